"""Planar elastic rods."""

from equimorph.structures.rod.ends import End
from equimorph.structures.rod.rod import Rod
from equimorph.structures.rod.sections import (
    CrossSection,
    OwnSection,
    Round,
    SectionProperties,
    Strip,
    Tube,
)
from equimorph.structures.rod.space import LateralMode
from equimorph.structures.rod.terms import (
    Couple,
    Curvature,
    LineLoad,
    PointForce,
    Pressure,
    Tendon,
)

__all__ = [
    "Couple",
    "CrossSection",
    "Curvature",
    "End",
    "LateralMode",
    "LineLoad",
    "OwnSection",
    "PointForce",
    "Pressure",
    "Rod",
    "Round",
    "SectionProperties",
    "Strip",
    "Tendon",
    "Tube",
]
