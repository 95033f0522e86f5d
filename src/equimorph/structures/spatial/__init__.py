"""Elastic rods in space."""

from equimorph.structures.spatial.ends import SpatialEnd
from equimorph.structures.spatial.fields import Fields
from equimorph.structures.spatial.rod import SpatialRod

__all__ = ["Fields", "SpatialEnd", "SpatialRod"]
