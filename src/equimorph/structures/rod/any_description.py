"""Description of a rod by its user, in the plane or in space: supports, terms, parameters."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from equimorph.arrays import Flags, Float, Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Parameter, names_of
from equimorph.model.parameter import Role
from equimorph.structures.rod.discretisation import Mesh, mesh_with_kinks
from equimorph.structures.rod.ends import Axis, Support
from equimorph.structures.rod.lagrangian import RodLagrangian
from equimorph.structures.rod.profiles import LoadShape, profile
from equimorph.structures.rod.terms import Term, Terms, term
from equimorph.structures.rod.units import Units

Matrix = Float[np.ndarray, "scalars others"]
TURNING = {
    "Theta": {"theta_A": 1.0, "theta_B": -1.0},
    "Delta": {"theta_A": 1.0, "theta_B": 1.0},
}
"""Coordinates of the end angles, in the plane, of a rod that is held at both."""
CLOSEST = 1e-6
"""Shortest piece of a rod between kinks."""


Built = TypeVar("Built")
Model = TypeVar("Model", bound=RodLagrangian)


@dataclass(frozen=True, eq=False)
class RodDescription(ABC, Generic[Built, Model]):
    """A rod as its user describes it.

    *Raw* parameters are the prescribed angles of the ends, the amplitudes of the terms and the
    places of end B; those of the user are the raw ones, and coordinates that combine some of them.
    """

    ends: Sequence[Any]
    profiles: Mapping[str, Any]
    """Stiffnesses and intrinsic strains along the rod, by the names of the arguments."""
    loads: Terms
    actuators: Terms
    coordinates: Mapping[str, Mapping[str, float]] | None
    places: Mapping[str, float]
    """Default of the place of end B, by the names of its parameters."""
    kinks: Sequence[float]
    units: Units
    breaks: Sequence[float] = ()
    """Further arclengths at which elements must end."""

    defaults: ClassVar[Mapping[str, Any]]
    """Default of each profile."""
    reserved: ClassVar[tuple[str, ...]]
    """Names of parameters that terms must not have."""

    @property
    @abstractmethod
    def supports(self) -> tuple[Support, Support]:
        """Both ends, checked."""

    @property
    @abstractmethod
    def raw_names(self) -> tuple[str, ...]:
        """Raw parameters, in their order."""

    @abstractmethod
    def place_parameter(self, raw: str) -> Parameter:
        """Parameter of an angle of an end, or of the place of end B."""

    @property
    @abstractmethod
    def axes(self) -> Sequence[Axis]:
        """Axes along which supports hold the ends."""

    @property
    def held(self) -> set[str]:
        """Places of end B along axes that both supports hold, without springs."""
        return {axis.name for axis in self.axes if axis.rigid}

    @abstractmethod
    def build(self, elements: int, degree: int) -> Built:
        """The rod in non-dimensional form."""

    @abstractmethod
    def raw_model(self, elements: int, degree: int) -> Model:
        """The Lagrangian in the raw parameters."""

    def check_reach(self, given: Mapping[str, Any], length: Any) -> None:
        """Refuse places of end B that an inextensible rod cannot reach.

        `given` are span and rises as the user wrote them, by the names of the arguments, or None;
        `length` is that of the rod, as the user wrote it.
        """
        places = {name: float(self.places[name]) for name in self.places if name in self.held}
        far = np.linalg.norm(list(places.values()))
        if self.profiles["axial"] is not None or far < self.units.value("length"):
            return
        unit = "" if self.units.plain else f" {self.units.label('length')}"
        told = {"span" if name == "nu" else name: x for name, x in places.items() if x != 0.0}
        got = [f"{x:g}{unit}" if given[k] is None else repr(given[k]) for k, x in told.items()]
        limit = "be less than" if len(told) == 1 else "place end B nearer to A than"
        reach = length if isinstance(length, str) else f"{length or 1}{unit}"
        raise InputError(
            f"{', '.join(f'`{k}`' for k in told)} must {limit} the length of the rod, {reach}; got "
            f"{', '.join(got)}. A rod with `axial` stiffness may be stretched."
        )

    def farthest(self, raw: str) -> float:
        """Bound of a place of end B in the user's unit: the length, if the rod cannot stretch."""
        bounded = raw in self.held and self.profiles["axial"] is None
        return self.units.value(self.quantity(raw)) if bounded else np.inf

    def in_reach(self, model: RodLagrangian, p: Parameters) -> Flags:
        """Whether the ends are at most as far apart as the rod is long, or it stretches."""
        held = [k for k, name in enumerate(model.names) if name in self.held]
        far = np.linalg.norm(self.raw_parameters(model, p)[:, held], axis=1)
        strains = any(self.profiles.get(name) is not None for name in ("axial", "shear"))
        return np.asarray((far <= 1.0) | strains)

    # --- terms and profiles ---------------------------------------------------------------------

    @cached_property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Terms by the name of their amplitude, actuators first."""
        out: dict[str, tuple[Term, ...]] = {}
        for group, given in (("actuators", self.actuators), ("loads", self.loads)):
            for name, spec in given.items():
                key = f"{group}.{name}"
                if name in self.reserved or name in out or not name.isidentifier():
                    raise InputError(
                        f"`{key}` must have a different name, of letters, digits and _; "
                        f"got {name!r}."
                    )
                several = spec if isinstance(spec, list | tuple) else [spec]
                out[name] = tuple(term(one, key) for one in several)
                for one in out[name]:
                    self.check_term(key, one)
                measures = {one.measure for one in out[name]}
                if len(measures) != 1:
                    raise InputError(
                        f"`{key}` must hold terms of one kind, as they share one amplitude; got "
                        f"{', '.join(sorted(measures)) or 'none'}."
                    )
        return out

    def check_term(self, name: str, one: Term) -> None:
        """Refuse a term that the rod cannot have; none by default."""
        del name, one

    def profile(self, name: str, quantity: str | None = None) -> LoadShape:
        """Profile along the rod, divided by the unit of a quantity."""
        unit = 1.0 if quantity is None else self.units.value(quantity)
        return rescale(profile(self.profiles[name], name, self.kinks), unit)

    def mesh(self, shapes: Sequence[LoadShape], elements: int, degree: int) -> Mesh:
        """Elements whose ends meet the kinks of profiles and terms."""
        breaks = [s for terms in self.terms.values() for one in terms for s in one.breaks]
        breaks += [s for shape in shapes for s in shape.kinks]
        kinks = np.unique([*breaks, *self.breaks])
        if len(kinks) and np.diff(np.concatenate([[0.0], kinks, [1.0]])).min() < CLOSEST:
            raise InputError(
                f"`kinks`, of loads and profiles together, must lie {CLOSEST:g} apart at least; "
                f"got {kinks.tolist()}."
            )
        return mesh_with_kinks(kinks, elements, degree)

    # --- parameters -----------------------------------------------------------------------------

    def quantity(self, raw: str) -> str:
        """What a raw parameter measures."""
        if raw in self.terms:
            return self.terms[raw][0].measure
        return "angle" if raw.endswith(("_A", "_B")) else "length"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The user's parameters: coordinates, angles, actuators, loads, places."""
        raws = self.raw_names
        combined = {raw for weights in self.combined.values() for raw in weights}
        clash = set(self.combined) & (set(raws) - combined)
        if clash:
            raise InputError(f"`coordinates` must not name a parameter; got {sorted(clash)[0]!r}.")
        out = [self._coordinate(name, weights) for name, weights in self.combined.items()]
        return (*out, *(self._parameter(raw) for raw in raws if raw not in combined))

    @cached_property
    def combined(self) -> dict[str, dict[str, float]]:
        """Weights of the raw parameters in each coordinate."""
        if self.coordinates is None:
            held = all(each.holds_rotation for each in self.supports)
            return TURNING if held and {"theta_A", "theta_B"} <= set(self.raw_names) else {}
        for name, weights in self.coordinates.items():
            if not name.isidentifier():
                raise InputError(
                    f"`coordinates` must have names of letters, digits and _; got {name!r}."
                )
            if not weights:
                raise InputError(f"`coordinates.{name}` must combine parameters; got none.")
            for raw in weights:
                if raw not in self.raw_names:
                    raise InputError(
                        f"`coordinates.{name}` must combine {', '.join(self.raw_names)}; got "
                        f"{raw!r}.{suggestion(raw, self.raw_names)}"
                    )
        return {name: dict(weights) for name, weights in self.coordinates.items()}

    def _coordinate(self, name: str, weights: Mapping[str, float]) -> Parameter:
        quantities = {self.quantity(raw) for raw in weights}
        if len(quantities) > 1:
            raise InputError(
                f"`coordinates.{name}` must combine parameters of one unit; got "
                f"{', '.join(sorted(quantities))}."
            )
        (raw, weight), *others = weights.items()
        role: Role = "load" if raw in self.loads else "actuator"
        if not others and weight and sum(raw in each for each in self.combined.values()) == 1:
            return _rename(self._parameter(raw), name, role, weight)
        quantity, units = quantities.pop(), self.units
        # between held ends a straight rod needs a turn to know its upright side
        needed = self.coordinates is None and name == "Theta" and "nu" in self.raw_names
        default = None if needed else 0.0
        return Parameter(name, units.label(quantity), units.value(quantity), role, default)

    def _parameter(self, raw: str) -> Parameter:
        if raw not in self.terms:
            return self.place_parameter(raw)
        role: Role = "load" if raw in self.loads else "actuator"
        quantity, units = self.quantity(raw), self.units
        return Parameter(raw, units.label(quantity), units.value(quantity), role, 0.0)

    def matrix(self, model: RodLagrangian) -> Matrix:
        """Raw scalars as combinations of the user's."""
        m, names = model.multipliers, names_of(self.parameters)
        matrix = np.zeros((model.scalars, m + len(names) + 1))
        matrix[:m, :m] = np.eye(m)
        matrix[-1, -1] = 1.0
        for i, raw in enumerate(model.names):
            unit = self.units.value(self.quantity(raw))
            if self.quantity(raw) == "tension":  # the offset is in the user's unit, too
                unit *= self.units.value("length")
            matrix[m + i, m:-1] = self._weights(raw) / unit
        return matrix

    def in_own_parameters(self, raw: Model) -> Model:
        """The Lagrangian in the user's parameters, from that in the raw ones."""
        return raw.map_scalars(names_of(self.parameters), self.matrix(raw))

    def raw_parameters(self, model: RodLagrangian, p: Parameters) -> Float[np.ndarray, "lanes raw"]:
        """Raw parameters of a model from the user's."""
        m = model.multipliers
        given = np.concatenate([p, np.ones((len(p), 1))], axis=1)
        return np.asarray(given @ self.matrix(model)[m:-1, m:].T)

    def _weights(self, raw: str) -> Float[np.ndarray, " parameters"]:
        """Weight of each of the user's parameters in a raw one."""
        names = names_of(self.parameters)
        row = np.array([self.combined.get(name, {}).get(raw, 0.0) for name in names])
        if raw in names:
            row[names.index(raw)] = 1.0
        return row

    def amplitudes(self, p: Parameters) -> list[tuple[Term, Values]]:
        """Every term with its amplitude in the user's units."""
        return [(one, p @ self._weights(raw)) for raw in self.terms for one in self.terms[raw]]

    def data(self) -> dict[str, Any]:
        """Everything that differs from the default, as plain data."""
        terms = {
            group: {name: [one.data() for one in self.terms[name]] for name in given}
            for group, given in (("actuators", self.actuators), ("loads", self.loads))
        }
        data: dict[str, Any] = {"ends": [support.data() for support in self.supports], **terms}
        for name, default in self.defaults.items():
            value = self.profiles[name]
            if callable(value):
                raise InputError(
                    f"`{name}` must be a number or a table to be written to a file; got a "
                    "callable. Sample it into a table [[s, f], ...]."
                )
            if not (isinstance(value, int | float | None) and value == default):
                data[name] = value.tolist() if isinstance(value, np.ndarray) else value
        if self.coordinates is not None:
            data["coordinates"] = self.combined
        return data | self.units.data()


def _rename(raw: Parameter, name: str, role: Role, weight: float) -> Parameter:
    """The parameter of another name that `weight` times a raw one moves alone."""
    default = None if raw.default is None else raw.default / weight
    low, high = sorted((raw.lower / weight, raw.upper / weight))
    period = raw.period / abs(weight)
    return Parameter(name, raw.unit, raw.scale, role, default, low, high, period)


def rescale(shape: LoadShape, unit: float) -> LoadShape:
    """The profile divided by a unit."""
    if unit == 1.0:
        return shape

    def density(points: Float[np.ndarray, " points"]) -> Float[np.ndarray, " points"]:
        return shape.density(points) / unit

    return LoadShape(None, density, shape.kinks)


def check_profile_positive(shape: LoadShape, name: str, s: Float[np.ndarray, " nodes"]) -> None:
    """Refuse a profile that is not positive everywhere."""
    points = np.unique(np.concatenate([s, np.linspace(0.0, 1.0, 201)]))
    values = shape.density(points)
    worst = int(np.argmin(values))
    if not values[worst] > 0.0:
        raise InputError(
            f"`{name}` must be positive everywhere; got {values[worst]:g} at s = {points[worst]:g}."
        )


RESOLUTION = (2, 3)
"""Elements and degree of a mesh that is used for its breaks alone."""


@dataclass(frozen=True, eq=False)
class Construction(Generic[Built]):
    """Profiles, terms and ends of a rod, and its raw parameters by those of its user.

    build: non-dimensional; table: of the raw parameters, times the user's parameters and 1.
    """

    build: Built
    names: tuple[str, ...]
    table: Float[np.ndarray, "raw settings"]

    def row(self, name: str) -> Float[np.ndarray, " settings"]:
        """Table of one raw parameter: an end angle, an amplitude, a place of end B."""
        return np.asarray(self.table[self.names.index(name)])


def construction(description: RodDescription[Built, Any], parameters: int) -> Construction[Built]:
    """Take the description of a rod apart whose user has some parameters; further ones are zero."""
    model = description.raw_model(*RESOLUTION)
    first = model.multipliers
    rows = description.matrix(model)[first:-1, first:]
    table = np.concatenate([rows[:, :parameters], rows[:, -1:]], axis=1)
    return Construction(description.build(*RESOLUTION), description.raw_names, table)
