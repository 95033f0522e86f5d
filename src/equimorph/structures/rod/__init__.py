"""Elastic rods."""

from equimorph.structures.rod.general import Couple, Curvature, End, LineLoad, PointForce, Tendon
from equimorph.structures.rod.rod import Rod

__all__ = ["Couple", "Curvature", "End", "LineLoad", "PointForce", "Rod", "Tendon"]
