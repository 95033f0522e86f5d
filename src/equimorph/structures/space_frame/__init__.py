"""Frames in space: networks of geometrically exact rods."""

from equimorph.structures.space_frame.frame import SpatialFrame as SpatialFrame
from equimorph.structures.space_frame.member import SpatialMember as SpatialMember
