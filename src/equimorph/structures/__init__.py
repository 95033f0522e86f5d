"""Elastic structures, their equilibrium states, and descriptors of these."""

from collections.abc import Callable, Mapping
from typing import Any

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.structures.contract import Growth, Structure, Symmetry
from equimorph.structures.energy import EnergyStructure, Unknown
from equimorph.structures.equations import Advance, Direction, Enclosed, Equations, LinearSystem
from equimorph.structures.frame import Frame, Member
from equimorph.structures.margin import stability_margin
from equimorph.structures.quantities import (
    distance_to,
    effort_of,
    margin_of,
    outside,
    shape_coordinate,
    value_of,
)
from equimorph.structures.rod import (
    Couple,
    CrossSection,
    Curvature,
    End,
    LateralMode,
    LineLoad,
    OwnSection,
    PointForce,
    Pressure,
    Rod,
    Round,
    SectionProperties,
    Strip,
    Tendon,
    Tube,
)
from equimorph.structures.space_frame import SpatialFrame, SpatialMember
from equimorph.structures.spatial import SpatialEnd, SpatialRod
from equimorph.structures.spring import Spring
from equimorph.structures.states import SpaceStability, State, States, join_states, natural_state
from equimorph.structures.truss import Bar, Truss

KINDS: dict[str, Callable[..., Structure]] = {
    each.kind: each
    for each in (Rod, SpatialRod, Spring, EnergyStructure, Truss, Frame, SpatialFrame)
}
"""Classes of structures by their words in files."""

__all__ = [
    "KINDS",
    "Advance",
    "Bar",
    "Couple",
    "CrossSection",
    "Curvature",
    "Direction",
    "Enclosed",
    "End",
    "EnergyStructure",
    "Equations",
    "Frame",
    "Growth",
    "LateralMode",
    "LineLoad",
    "LinearSystem",
    "Member",
    "OwnSection",
    "PointForce",
    "Pressure",
    "Rod",
    "Round",
    "SectionProperties",
    "SpaceStability",
    "SpatialEnd",
    "SpatialFrame",
    "SpatialMember",
    "SpatialRod",
    "Spring",
    "State",
    "States",
    "Strip",
    "Structure",
    "Symmetry",
    "Tendon",
    "Truss",
    "Tube",
    "Unknown",
    "distance_to",
    "effort_of",
    "from_identity",
    "join_states",
    "margin_of",
    "natural_state",
    "outside",
    "shape_coordinate",
    "stability_margin",
    "value_of",
]


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
