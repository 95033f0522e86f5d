"""Planar elastic rods."""

from equimorph.structures.rod.ends import End as End
from equimorph.structures.rod.rod import Rod as Rod
from equimorph.structures.rod.sections import (
    CrossSection as CrossSection,
    OwnSection as OwnSection,
    Round as Round,
    SectionProperties as SectionProperties,
    Strip as Strip,
    Tube as Tube,
)
from equimorph.structures.rod.space import LateralMode as LateralMode
from equimorph.structures.rod.terms import (
    Couple as Couple,
    Curvature as Curvature,
    LineLoad as LineLoad,
    PointForce as PointForce,
    Pressure as Pressure,
    Tendon as Tendon,
)
