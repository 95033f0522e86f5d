"""Frames: planar networks of geometrically exact rods."""

from equimorph.structures.frame.frame import Frame as Frame
from equimorph.structures.frame.network import Member as Member
