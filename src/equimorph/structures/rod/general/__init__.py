"""General planar rods: any ends, loads, stiffness and intrinsic curvature."""

from equimorph.structures.rod.general.ends import End
from equimorph.structures.rod.general.mechanics import GeneralMechanics
from equimorph.structures.rod.general.terms import (
    Couple,
    Curvature,
    LineLoad,
    PointForce,
    Pressure,
    Tendon,
)

__all__ = [
    "Couple",
    "Curvature",
    "End",
    "GeneralMechanics",
    "LineLoad",
    "PointForce",
    "Pressure",
    "Tendon",
]
