"""Description of a planar rod by its user, and how its model follows."""

from collections.abc import Mapping
from functools import cached_property
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np

from equimorph.errors import InputError
from equimorph.model import Parameter
from equimorph.structures.rod.any_description import RodDescription, check_profile_positive
from equimorph.structures.rod.ends import HELD, Axis, End, check_supports, end, support_axes
from equimorph.structures.rod.model import Build, RodModel, raw_model, raw_names
from equimorph.structures.rod.terms import Pressure

SIDES = (attrgetter("first"), attrgetter("last"))
"""How ends A and B are held along an axis."""


class PlanarDescription(RodDescription[Build, RodModel]):
    """A general planar rod as its user describes it; see `Rod`."""

    defaults: ClassVar[Mapping[str, Any]] = {"stiffness": 1.0, "curvature": 0.0, "axial": None}
    reserved: ClassVar[tuple[str, ...]] = ("theta_A", "theta_B", "nu", "rise", "offset")

    @cached_property
    def supports(self) -> tuple[End, End]:
        """Both ends, checked."""
        if len(self.ends) != 2:
            raise InputError(f"`ends` must be two ends, A and B; got {self.ends!r}.")
        first, last = (end(spec) for spec in self.ends)
        check_supports((first, last))
        return first, last

    @cached_property
    def raw_names(self) -> tuple[str, ...]:
        """Angles of the ends, amplitudes, places of end B."""
        return raw_names(self.supports, self.terms)

    def build(self, elements: int, degree: int) -> Build:
        """The rod in non-dimensional form."""
        rigid, curved = self.profile("stiffness"), self.profile("curvature", "curvature")
        axial = None if self.profiles["axial"] is None else self.profile("axial", "force")
        positive = {"stiffness": rigid} | ({} if axial is None else {"axial": axial})
        mesh = self.mesh([*positive.values(), curved], elements, degree)
        self._check_pressure()
        for name, shape in positive.items():
            check_profile_positive(shape, name, mesh.nodes)
        couple, spring = self.units.value("couple"), self.units.value("spring")
        first, last = (support.scaled(couple, spring) for support in self.supports)
        length = self.units.value("length")
        return Build(mesh, (first, last), rigid, curved, axial, self.terms, length)

    def raw_model(self, elements: int, degree: int) -> RodModel:
        """The Lagrangian in the raw parameters."""
        return raw_model(self.build(elements, degree))

    def _check_pressure(self) -> None:
        """Refuse pressure without a potential, or with a stretching axis."""
        for name, terms in self.terms.items():
            if not any(isinstance(one, Pressure) for one in terms):
                continue
            moves = [
                {at for at, axis in enumerate(self.axes) if each(axis) != HELD} for each in SIDES
            ]
            if max(map(len, moves)) > 1:
                raise InputError(
                    f"`ends` must leave each end of a rod under the pressure `{name}` one "
                    "direction at most in which it moves; got one that moves in x and y, at which "
                    "pressure is a follower load without a potential. Hold x or y, or use a dead "
                    "line load."
                )
            if moves[0] & moves[1]:
                raise InputError(
                    f"`ends` must not both move along {'xy'[min(moves[0])]} on a rod under the "
                    f"pressure `{name}`; got two that do. Hold one of them."
                )
            if self.profiles["axial"] is not None:
                raise InputError(
                    f"`axial` must be left out for rods under the pressure `{name}`; got axial = "
                    f"{self.profiles['axial']!r}: pressure on a stretching axis is not modelled."
                )

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """Axes along which supports hold the ends."""
        return support_axes(self.supports)

    def place_parameter(self, raw: str) -> Parameter:
        """Angle of an end, span, rise, or the distance of an inclined line."""
        quantity, units = self.quantity(raw), self.units
        label, scale = units.label(quantity), units.value(quantity)
        span, rise = (float(self.places[name]) for name in ("nu", "rise"))
        if raw == "nu":
            far = self.farthest(raw)
            blank = Parameter(raw, label, scale, "fixed", None, -far, far)
            return Parameter(raw, label, scale, "fixed", blank.check(span), -far, far)
        if raw == "offset":
            unit = self.axes[1].unit
            return Parameter(raw, label, scale, "fixed", float(np.dot(unit, (span, rise))))
        if raw == "rise":
            far = self.farthest(raw)
            return Parameter(raw, label, scale, "fixed", rise, -far, far)
        return Parameter(raw, label, scale, "actuator", 0.0)

    def data(self) -> dict[str, Any]:
        """Everything that differs from the default, as plain data."""
        data = RodDescription.data(self)
        if "nu" in self.raw_names or "offset" in self.raw_names:
            data["span"] = float(self.places["nu"])
        if self.places["rise"] != 0.0:
            data["rise"] = float(self.places["rise"])
        return data
