"""Elastic structures, their equilibrium states, and descriptors of these."""

from collections.abc import Callable, Mapping
from typing import Any

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.structures.contract import (
    Growth as Growth,
    Structure as Structure,
    Symmetry as Symmetry,
)
from equimorph.structures.energy import EnergyStructure as EnergyStructure, Unknown as Unknown
from equimorph.structures.equations import (
    Advance as Advance,
    Direction as Direction,
    Enclosed as Enclosed,
    Equations as Equations,
    LinearSystem as LinearSystem,
)
from equimorph.structures.frame import Frame as Frame, Member as Member
from equimorph.structures.margin import stability_margin as stability_margin
from equimorph.structures.quantities import (
    distance_to as distance_to,
    effort_of as effort_of,
    margin_of as margin_of,
    outside as outside,
    shape_coordinate as shape_coordinate,
    value_of as value_of,
)
from equimorph.structures.rod import (
    Couple as Couple,
    CrossSection as CrossSection,
    Curvature as Curvature,
    End as End,
    LateralMode as LateralMode,
    LineLoad as LineLoad,
    OwnSection as OwnSection,
    PointForce as PointForce,
    Pressure as Pressure,
    Rod as Rod,
    Round as Round,
    SectionProperties as SectionProperties,
    Strip as Strip,
    Tendon as Tendon,
    Tube as Tube,
)
from equimorph.structures.space_frame import (
    SpatialFrame as SpatialFrame,
    SpatialMember as SpatialMember,
)
from equimorph.structures.spatial import SpatialEnd as SpatialEnd, SpatialRod as SpatialRod
from equimorph.structures.spring import Spring as Spring
from equimorph.structures.states import (
    SpaceStability as SpaceStability,
    State as State,
    States as States,
    join_states as join_states,
    natural_state as natural_state,
)
from equimorph.structures.truss import Bar as Bar, Truss as Truss

KINDS: dict[str, Callable[..., Structure]] = {
    each.kind: each
    for each in (Rod, SpatialRod, Spring, EnergyStructure, Truss, Frame, SpatialFrame)
}
"""Classes of structures by their words in files."""


@check_arguments
def from_identity(identity: Mapping[str, Any]) -> Structure:
    """Build the structure that ``Structure.identity`` describes.

    Raises
    ------
    InputError
        If the kind is unknown, or does not take the data.
    """
    data = dict(identity)
    kind = data.pop("kind", None)
    if kind not in KINDS:
        raise InputError(f"`kind` must be one of {', '.join(KINDS)}; got {kind!r}.")
    return KINDS[kind](**data)
