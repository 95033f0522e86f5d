"""Elastic rods."""

from equimorph.structures.rod.general import (
    Couple,
    Curvature,
    End,
    LineLoad,
    PointForce,
    Pressure,
    Tendon,
)
from equimorph.structures.rod.rod import Rod

__all__ = ["Couple", "Curvature", "End", "LineLoad", "PointForce", "Pressure", "Rod", "Tendon"]
