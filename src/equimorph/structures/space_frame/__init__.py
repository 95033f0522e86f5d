"""Frames in space: networks of geometrically exact rods."""

from equimorph.structures.space_frame.frame import SpatialFrame
from equimorph.structures.space_frame.member import SpatialMember

__all__ = ["SpatialFrame", "SpatialMember"]
