"""Description of a rod in space by its user, and how its model follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.errors import InputError
from equimorph.model import Parameter
from equimorph.structures.rod.any_description import RodDescription, check_profile_positive
from equimorph.structures.rod.ends import Axis
from equimorph.structures.rod.terms import Term
from equimorph.structures.spatial.ends import (
    PLACES,
    Ends,
    check_supports,
    spatial_end,
    support_axes,
)
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.model import (
    ANGLES,
    Build,
    SpatialModel,
    check_potential,
    raw_model,
    raw_names,
)
from equimorph.structures.spatial.orbits import OrbitMechanics
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.phase_condition import (
    BROKEN_BY,
    check_orbits,
    obstacle,
    with_phase_condition,
)

WORDS = {"nu": "span", "rise": "rise", "sideways": "sideways"}
"""Arguments that place end B, by its parameters."""
LARGEST_TWIST = 4.0 * np.pi
"""After a turn of a clamp by 4π a rod is the same again."""


@dataclass(frozen=True, eq=False)
class SpatialDescription(RodDescription[Build, SpatialModel]):
    """A rod in space as its user describes it; see `SpatialRod`."""

    phase: bool = False
    """Whether a phase condition pins states on their orbits."""

    defaults: ClassVar[Mapping[str, Any]] = {
        **{"stiffness": 1.0, "curvature": 0.0, "side_curvature": 0.0, "natural_twist": 0.0},
        **{"axial": None, "shear": None},
    }
    reserved: ClassVar[tuple[str, ...]] = (
        *(f"{angle}_{side}" for side in "AB" for angle in ANGLES),
        *PLACES,
    )

    @cached_property
    def supports(self) -> Ends:
        """Both ends, checked."""
        if isinstance(self.ends, str) or len(self.ends) != 2:
            raise InputError(f"`ends` must be two ends, A and B; got {self.ends!r}.")
        first, last = (spatial_end(spec, f"ends[{i}]") for i, spec in enumerate(self.ends))
        check_supports((first, last))
        return first, last

    @cached_property
    def raw_names(self) -> tuple[str, ...]:
        """Angles of the ends, amplitudes, places of end B, but for those that break orbits."""
        gone = BROKEN_BY if self.phase else ()
        names = raw_names(self.supports, self.terms)
        return tuple(name for name in names if name not in gone)

    def check_term(self, name: str, one: Term) -> None:
        """Refuse what has no potential in space."""
        check_potential(name, one)

    def build(self, elements: int, degree: int) -> Build:
        """The rod in non-dimensional form."""
        plane = self.profile("stiffness")
        ratios = (self.profile("torsion"), self.profile("lateral"))
        twisted, aside, bent = (
            self.profile(name, "curvature")
            for name in ("natural_twist", "side_curvature", "curvature")
        )
        positive = {"stiffness": plane, "torsion": ratios[0], "lateral": ratios[1]}
        axial = None if self.profiles["axial"] is None else self.profile("axial", "force")
        if axial is not None:
            positive["axial"] = axial
        shear = None
        if self.profiles["shear"] is not None:
            positive["shear"] = self.profile("shear", "force")
            shear = positive["shear"], positive["shear"]
        mesh = self.mesh([*positive.values(), twisted, aside, bent], elements, degree)
        for name, shape in positive.items():
            check_profile_positive(shape, name, mesh.nodes)
        spring, length = self.units.value("spring"), self.units.value("length")
        first, last = (support.scaled(spring) for support in self.supports)
        natural, ends = (twisted, aside, bent), (first, last)
        return Build(mesh, ends, plane, ratios, natural, axial, shear, self.terms, length)

    def raw_model(self, elements: int, degree: int) -> SpatialModel:
        """The Lagrangian in the raw parameters."""
        return raw_model(self.build(elements, degree))

    def mechanics(self, raw: SpatialModel) -> SpatialMechanics:
        """Mechanics in the user's parameters, from the Lagrangian in the raw ones."""
        own = self.in_own_parameters(raw)
        if self.phase:
            check_orbits(own)
            return PinnedMechanics(with_phase_condition(own))
        return SpatialMechanics(own) if obstacle(own) else OrbitMechanics(own)

    @property
    def axes(self) -> Sequence[Axis]:
        """Axes along which supports hold the ends."""
        return support_axes(self.supports)

    def check_places(self, given: Mapping[str, Any], length: Any) -> None:
        """Refuse places that an inextensible rod cannot reach, or that break orbits."""
        for name in ("rise", "sideways"):
            if self.phase and self.places[name] != 0.0:
                raise InputError(
                    "`phase` must be False unless every state may be turned about the x axis for "
                    f"nothing; got {name} = {self.places[name]:g}."
                )
        self.check_reach(given, length)

    def place_parameter(self, raw: str) -> Parameter:
        """Angle of an end, or place of end B."""
        quantity, units = self.quantity(raw), self.units
        label, scale = units.label(quantity), units.value(quantity)
        if raw in PLACES:
            far = self.farthest(raw)
            return Parameter(raw, label, scale, "fixed", float(self.places[raw]), -far, far)
        if raw.startswith("twist_"):
            near = np.nextafter(LARGEST_TWIST, np.inf)
            return Parameter(raw, label, scale, "actuator", 0.0, -near, near, self._turn)
        turn = self._turn if raw.startswith("theta_") else np.inf
        return Parameter(raw, label, scale, "actuator", 0.0, period=turn)

    @property
    def _turn(self) -> float:
        """Turn of a clamp after which the rod is the same again: 2π if it is the only one."""
        alone = any(support.turns for support in self.supports)
        return LARGEST_TWIST * (0.5 if alone else 1.0)

    def data(self) -> dict[str, Any]:
        """Everything that differs from the default, as plain data."""
        places = {WORDS[name]: self.places[name] for name in PLACES if name in self.raw_names}
        return RodDescription.data(self) | places | ({"phase": True} if self.phase else {})
