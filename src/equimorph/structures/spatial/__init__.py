"""Elastic rods in space."""

from equimorph.structures.spatial.ends import SpatialEnd as SpatialEnd
from equimorph.structures.spatial.fields import Fields as Fields
from equimorph.structures.spatial.rod import SpatialRod as SpatialRod
