"""Planar elastic rods."""

from equimorph.structures.rod.ends import End
from equimorph.structures.rod.rod import Rod
from equimorph.structures.rod.terms import (
    Couple,
    Curvature,
    LineLoad,
    PointForce,
    Pressure,
    Tendon,
)

__all__ = ["Couple", "Curvature", "End", "LineLoad", "PointForce", "Pressure", "Rod", "Tendon"]
