"""Description of a rod by its user, and how its model and parameters follow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Parameter
from equimorph.model.parameter import Role
from equimorph.structures.rod.discretisation import mesh_with_kinks
from equimorph.structures.rod.ends import HELD, End, EndSpec, check_supports, end, support_axes
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.model import Build, RodModel, raw_model
from equimorph.structures.rod.profiles import LoadShape, ProfileSpec, profile
from equimorph.structures.rod.terms import Pressure, Term, Terms, term
from equimorph.structures.rod.units import Units

Matrix = Float[np.ndarray, "scalars others"]
TURNING = {
    "Theta": {"theta_A": 1.0, "theta_B": -1.0},
    "Delta": {"theta_A": 1.0, "theta_B": 1.0},
}
"""Coordinates of the end angles of a rod that is held at both."""
RESERVED = ("theta_A", "theta_B", "nu", "rise", "offset")
SIDES = (attrgetter("first"), attrgetter("last"))
"""How ends A and B are held along an axis."""
CLOSEST = 1e-6
"""Shortest piece of a rod between kinks."""


@dataclass(frozen=True, eq=False)
class Description:
    """A general rod as its user describes it; see `Rod`."""

    ends: Sequence[EndSpec]
    stiffness: ProfileSpec
    curvature: ProfileSpec
    axial: ProfileSpec | None
    loads: Terms
    actuators: Terms
    coordinates: Mapping[str, Mapping[str, float]] | None
    span: float
    rise: float
    kinks: Sequence[float]
    units: Units
    breaks: Sequence[float] = ()
    """Arclengths where stiffnesses out of the plane are not smooth."""

    @cached_property
    def supports(self) -> tuple[End, End]:
        """Both ends, checked."""
        if len(self.ends) != 2:
            raise InputError(f"`ends` must be two ends, A and B; got {self.ends!r}.")
        first, last = (end(spec) for spec in self.ends)
        check_supports((first, last))
        return first, last

    @cached_property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Terms by the name of their amplitude, actuators first."""
        out: dict[str, tuple[Term, ...]] = {}
        for group, given in (("actuators", self.actuators), ("loads", self.loads)):
            for name, spec in given.items():
                key = f"{group}.{name}"
                if name in RESERVED or name in out or not name.isidentifier():
                    raise InputError(
                        f"`{key}` must have a different name, of letters, digits and _; "
                        f"got {name!r}."
                    )
                several = spec if isinstance(spec, list | tuple) else [spec]
                out[name] = tuple(term(one, key) for one in several)
                measures = {one.measure for one in out[name]}
                if len(measures) != 1:
                    raise InputError(
                        f"`{key}` must hold terms of one kind, as they share one amplitude; got "
                        f"{', '.join(sorted(measures)) or 'none'}."
                    )
        return out

    def _profile(self, name: str, unit: float = 1.0) -> LoadShape:
        return rescale(profile(getattr(self, name), name, self.kinks), unit)

    def build(self, elements: int, degree: int) -> Build:
        """The rod in non-dimensional form."""
        rigid = self._profile("stiffness")
        curved = self._profile("curvature", self.units.value("curvature"))
        axial = None
        if self.axial is not None:
            axial = self._profile("axial", self.units.value("force"))
        shapes = [rigid, curved, *([] if axial is None else [axial])]
        breaks = [s for terms in self.terms.values() for one in terms for s in one.breaks]
        breaks += [s for shape in shapes for s in shape.kinks]
        kinks = np.unique([*breaks, *self.breaks])
        if len(kinks) and np.diff(np.concatenate([[0.0], kinks, [1.0]])).min() < CLOSEST:
            raise InputError(
                f"`kinks`, of loads and profiles together, must lie {CLOSEST:g} apart at least; "
                f"got {kinks.tolist()}."
            )
        self._check_pressure()
        mesh = mesh_with_kinks(kinks, elements, degree)
        check_profile_positive(rigid, "stiffness", mesh.nodes)
        check_profile_positive(axial, "axial", mesh.nodes)
        couple, spring = self.units.value("couple"), self.units.value("spring")
        first, last = (support.scaled(couple, spring) for support in self.supports)
        length = self.units.value("length")
        return Build(mesh, (first, last), rigid, curved, axial, self.terms, length)

    def _check_pressure(self) -> None:
        """Refuse pressure without a potential, or with a stretching axis."""
        for name, terms in self.terms.items():
            if not any(isinstance(one, Pressure) for one in terms):
                continue
            axes = support_axes(self.supports)
            moves = [{at for at, axis in enumerate(axes) if each(axis) != HELD} for each in SIDES]
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
            if self.axial is not None:
                raise InputError(
                    f"`axial` must be left out for rods under the pressure `{name}`; got "
                    f"axial = {self.axial!r}: pressure on a stretching axis is not modelled."
                )

    def check_span(self, span: Any, length: Any) -> None:
        """Refuse a span that an inextensible rod cannot reach, as its user wrote it."""
        reach = self.units.value("length")
        held = any(axis.name == "nu" and axis.opposed for axis in support_axes(self.supports))
        if span is None or not held or self.axial is not None or -reach < self.span < reach:
            return
        unit = (
            "" if isinstance(length, str) or self.units.plain else f" {self.units.label('length')}"
        )
        raise InputError(
            f"`span` must be less than the length of the rod, {length or 1}{unit}; got {span!r}. "
            "A rod with `axial` stiffness may be stretched."
        )

    def mechanics(self, elements: int, degree: int) -> tuple[GeneralMechanics, Matrix]:
        """Mechanics in raw parameters, and raw scalars as combinations of the user's."""
        model = raw_model(self.build(elements, degree))
        return GeneralMechanics(model), self._matrix(model)

    # --- parameters -----------------------------------------------------------------------------

    @cached_property
    def _raw(self) -> tuple[str, ...]:
        names = [
            name
            for name, support in zip(RESERVED, self.supports, strict=False)
            if support.angle != "free"
        ]
        names += self.terms
        return (*names, *(axis.name for axis in support_axes(self.supports) if axis.opposed))

    @cached_property
    def _coordinates(self) -> dict[str, dict[str, float]]:
        both = all(support.angle == "held" for support in self.supports)
        given = self.coordinates
        if given is None:
            return TURNING if both else {}
        for name, weights in given.items():
            if not name.isidentifier():
                raise InputError(
                    f"`coordinates` must have names of letters, digits and _; got {name!r}."
                )
            if not weights:
                raise InputError(f"`coordinates.{name}` must combine parameters; got none.")
            for raw in weights:
                if raw not in self._raw:
                    raise InputError(
                        f"`coordinates.{name}` must combine {', '.join(self._raw)}; got {raw!r}."
                        f"{suggestion(raw, self._raw)}"
                    )
        return {name: dict(weights) for name, weights in given.items()}

    def quantity(self, raw: str) -> str:
        """What a raw parameter measures."""
        if raw in self.terms:
            return self.terms[raw][0].measure
        return "angle" if raw.startswith("theta") else "length"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The user's parameters: coordinates, angles, actuators, loads, span and rise."""
        combined = {raw for weights in self._coordinates.values() for raw in weights}
        clash = set(self._coordinates) & (set(self._raw) - combined)
        if clash:
            raise InputError(f"`coordinates` must not name a parameter; got {sorted(clash)[0]!r}.")
        out = [self._coordinate(name, weights) for name, weights in self._coordinates.items()]
        return (*out, *(self._parameter(raw) for raw in self._raw if raw not in combined))

    def _coordinate(self, name: str, weights: Mapping[str, float]) -> Parameter:
        quantities = {self.quantity(raw) for raw in weights}
        if len(quantities) > 1:
            raise InputError(
                f"`coordinates.{name}` must combine parameters of one unit; got "
                f"{', '.join(sorted(quantities))}."
            )
        first = next(iter(weights))
        role: Role = "load" if first in self.loads else "actuator"
        quantity = quantities.pop()
        # between held ends a straight rod needs a turn to know its upright side
        needed = self.coordinates is None and name == "Theta" and "nu" in self._raw
        default = None if needed else 0.0
        units = self.units
        return Parameter(name, units.label(quantity), units.value(quantity), role, default)

    def _parameter(self, raw: str) -> Parameter:
        quantity, units = self.quantity(raw), self.units
        label, scale = units.label(quantity), units.value(quantity)
        if raw == "nu":
            far = scale if self.axial is None else np.inf
            blank = Parameter(raw, label, scale, "fixed", None, -far, far)
            span = self.span * scale if units.plain else self.span
            return Parameter(raw, label, scale, "fixed", blank.check(span), -far, far)
        if raw == "offset":
            unit = support_axes(self.supports)[1].unit
            span = self.span * scale if units.plain else self.span
            return Parameter(raw, label, scale, "fixed", float(np.dot(unit, (span, self.rise))))
        if raw == "rise":
            return Parameter(raw, label, scale, "fixed", float(self.rise))
        role: Role = "load" if raw in self.loads else "actuator"
        return Parameter(raw, label, scale, role, 0.0)

    def _matrix(self, model: RodModel) -> Matrix:
        names = [parameter.name for parameter in self.parameters]
        m = model.multipliers
        matrix = np.zeros((model.scalars, m + len(names) + 1))
        matrix[:m, :m] = np.eye(m)
        matrix[-1, -1] = 1.0
        for i, raw in enumerate(model.names):
            unit = self.units.value(self.quantity(raw))
            if self.quantity(raw) == "tension":  # the offset is in the user's unit, too
                unit *= self.units.value("length")
            if raw in names:
                matrix[m + i, m + names.index(raw)] = 1.0 / unit
            for name, weights in self._coordinates.items():
                matrix[m + i, m + names.index(name)] = weights.get(raw, 0.0) / unit
        return matrix

    def amplitudes(self, p: Parameters, matrix: Matrix) -> list[tuple[Term, Values]]:
        """Every term with its amplitude in the user's units; matrix: what `mechanics` returns."""
        columns = matrix[:, -len(self.parameters) - 1 : -1]
        out: list[tuple[Term, Values]] = []
        for name, terms in self.terms.items():
            row = columns[self._raw.index(name)] * self.units.value(self.quantity(name))
            amplitude = np.einsum("j,lj->l", row, p)
            out += [(one, amplitude) for one in terms]
        return out

    def identity(self) -> dict[str, Any]:
        """Everything that differs from the default, as plain data."""
        terms = {
            group: {name: [one.data() for one in self.terms[name]] for name in given}
            for group, given in (("actuators", self.actuators), ("loads", self.loads))
        }
        data: dict[str, Any] = {"ends": [support.data() for support in self.supports], **terms}
        for name, default in (("stiffness", 1.0), ("curvature", 0.0), ("axial", None)):
            value = getattr(self, name)
            if callable(value):
                raise InputError(
                    f"`{name}` must be a number or a table to be written to a file; got a "
                    "callable. Sample it into a table [[s, f], ...]."
                )
            if not (isinstance(value, int | float | None) and value == default):
                data[name] = value.tolist() if isinstance(value, np.ndarray) else value
        if self.coordinates is not None:
            data["coordinates"] = self._coordinates
        if "nu" in self._raw or "offset" in self._raw:
            data["span"] = float(self.span)
        if self.rise != 0.0:
            data["rise"] = float(self.rise)
        return data | self.units.data()


def rescale(shape: LoadShape, unit: float) -> LoadShape:
    """The profile divided by a unit."""
    if unit == 1.0:
        return shape

    def density(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        return shape.density(points) / unit

    return LoadShape(None, density, shape.kinks)


def check_profile_positive(
    shape: LoadShape | None, name: str, s: Float[np.ndarray, " nodes"]
) -> None:
    """Refuse a profile that is not positive everywhere."""
    if shape is None:
        return
    points = np.unique(np.concatenate([s, np.linspace(0.0, 1.0, 201)]))
    values = shape.density(points)
    worst = int(np.argmin(values))
    if not values[worst] > 0.0:
        raise InputError(
            f"`{name}` must be positive everywhere; got {values[worst]:g} at s = {points[worst]:g}."
        )
