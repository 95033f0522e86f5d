"""Frames: planar networks of geometrically exact rods."""

from equimorph.structures.frame.frame import Frame
from equimorph.structures.frame.network import Member

__all__ = ["Frame", "Member"]
