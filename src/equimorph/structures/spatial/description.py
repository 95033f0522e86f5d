"""Description of a rod in space by its user, and how its model and parameters follow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Parameters, Values
from equimorph.errors import InputError, suggestion
from equimorph.model import Parameter
from equimorph.model.parameter import Role
from equimorph.structures.rod.description import CLOSEST, check_profile_positive, rescale
from equimorph.structures.rod.discretisation import Mesh, mesh_with_kinks
from equimorph.structures.rod.profiles import LoadShape, profile
from equimorph.structures.rod.terms import Term, term
from equimorph.structures.rod.units import Units
from equimorph.structures.spatial.effects import check_potential
from equimorph.structures.spatial.ends import (
    PLACES,
    Ends,
    check_supports,
    spatial_end,
    support_axes,
)
from equimorph.structures.spatial.model import (
    ANGLES,
    Build,
    SpatialModel,
    raw_model,
    raw_names,
)

Terms = Mapping[str, Any]
Matrix = Float[np.ndarray, "scalars others"]
TURNING = {
    "Theta": {"theta_A": 1.0, "theta_B": -1.0},
    "Delta": {"theta_A": 1.0, "theta_B": 1.0},
}
"""Coordinates of the turns in the plane of a rod whose both rotations are held."""
RESERVED = (*(f"{angle}_{side}" for side in "AB" for angle in ANGLES), *PLACES)
LARGEST_TWIST = 4.0 * np.pi
"""After a turn of a clamp by 4π a rod is the same again."""


@dataclass(frozen=True, eq=False)
class SpatialDescription:
    """A rod in space as its user describes it; see `SpatialRod`."""

    ends: Sequence[Any]
    profiles: Mapping[str, Any]
    """Stiffnesses, intrinsic strains, by the names of the arguments."""
    loads: Terms
    actuators: Terms
    coordinates: Mapping[str, Mapping[str, float]] | None
    places: Mapping[str, float]
    """Default of the place of end B: nu, rise, sideways."""
    kinks: Sequence[float]
    units: Units

    @cached_property
    def supports(self) -> Ends:
        """Both ends, checked."""
        if isinstance(self.ends, str) or len(self.ends) != 2:
            raise InputError(f"`ends` must be two ends, A and B; got {self.ends!r}.")
        first, last = (spatial_end(spec, f"ends[{i}]") for i, spec in enumerate(self.ends))
        check_supports((first, last))
        return first, last

    @cached_property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Terms by the name of their amplitude, actuators first."""
        out: dict[str, tuple[Term, ...]] = {}
        for group, given in (("actuators", self.actuators), ("loads", self.loads)):
            if not isinstance(given, Mapping):
                raise InputError(f"`{group}` must map names to terms; got {given!r}.")
            for name, spec in given.items():
                key = f"{group}.{name}"
                if name in RESERVED or name in out or not name.isidentifier():
                    raise InputError(
                        f"`{key}` must have a different name, of letters, digits and _; "
                        f"got {name!r}."
                    )
                several = spec if isinstance(spec, list | tuple) else [spec]
                out[name] = tuple(term(one, key) for one in several)
                for one in out[name]:
                    check_potential(key, one)
                measures = {one.measure for one in out[name]}
                if len(measures) != 1:
                    raise InputError(
                        f"`{key}` must hold terms of one kind, as they share one amplitude; got "
                        f"{', '.join(sorted(measures)) or 'none'}."
                    )
        return out

    def _profile(self, name: str, unit: float = 1.0) -> LoadShape:
        return rescale(profile(self.profiles[name], name, self.kinks), unit)

    def build(self, elements: int, degree: int) -> Build:
        """The rod in non-dimensional form."""
        bent = self.units.value("curvature")
        plane = self._profile("stiffness")
        ratios = self._profile("torsion"), self._profile("lateral")
        twisted, aside = self._profile("natural_twist", bent), self._profile("side_curvature", bent)
        natural = twisted, aside, self._profile("curvature", bent)
        force = self.units.value("force")
        axial = None if self.profiles["axial"] is None else self._profile("axial", force)
        shear = None
        if self.profiles["shear"] is not None:
            shear = self._profile("shear", force), self._profile("shear", force)
        positive = {"stiffness": plane, "torsion": ratios[0], "lateral": ratios[1]}
        if axial is not None:
            positive["axial"] = axial
        if shear is not None:
            positive["shear"] = shear[0]
        mesh = self._mesh([*positive.values(), *natural], elements, degree)
        for name, shape in positive.items():
            check_profile_positive(shape, name, mesh.nodes)
        spring = self.units.value("spring")
        first, last = (support.scaled(spring) for support in self.supports)
        length = self.units.value("length")
        ends = first, last
        return Build(mesh, ends, plane, ratios, natural, axial, shear, self.terms, length)

    def _mesh(self, shapes: Sequence[LoadShape], elements: int, degree: int) -> Mesh:
        """Elements whose ends meet all kinks."""
        breaks = [s for terms in self.terms.values() for one in terms for s in one.breaks]
        breaks += [s for shape in shapes for s in shape.kinks]
        kinks = np.unique(breaks)
        if len(kinks) and np.diff(np.concatenate([[0.0], kinks, [1.0]])).min() < CLOSEST:
            raise InputError(
                f"`kinks`, of loads and profiles together, must lie {CLOSEST:g} apart at least; "
                f"got {kinks.tolist()}."
            )
        return mesh_with_kinks(kinks, elements, degree)

    def check_places(self) -> None:
        """Refuse places of end B that an inextensible rod cannot reach."""
        held = {axis.name for axis in support_axes(self.supports) if axis.opposed}
        if self.profiles["axial"] is not None:
            return
        length, unit = self.units.value("length"), self.units.label("length")
        place = np.array([self.places[name] if name in held else 0.0 for name in PLACES])
        if not np.linalg.norm(place) < length:
            written = ", ".join(f"{value:g}" for value in place)
            raise InputError(
                f"`span`, `rise`, `sideways` must place end B nearer to A than the length of the "
                f"rod, {length:g} {unit}; got ({written}). A rod with `axial` stiffness may be "
                "stretched."
            )

    def model(self, elements: int, degree: int) -> SpatialModel:
        """The Lagrangian in the user's parameters."""
        raw = raw_model(self.build(elements, degree))
        return raw.map_scalars([each.name for each in self.parameters], self.matrix(raw))

    # --- parameters -----------------------------------------------------------------------------

    @cached_property
    def _raw(self) -> tuple[str, ...]:
        return raw_names(self.supports, self.terms)

    @cached_property
    def _coordinates(self) -> dict[str, dict[str, float]]:
        given = self.coordinates
        if given is None:
            both = not any(support.turns for support in self.supports)
            return TURNING if both else {}
        for name, weights in given.items():
            if not isinstance(weights, Mapping) or not weights:
                raise InputError(
                    f"`coordinates.{name}` must map parameters to weights; got {weights!r}."
                )
            for raw, weight in weights.items():
                if raw not in self._raw:
                    raise InputError(
                        f"`coordinates.{name}` must combine {', '.join(self._raw)}; got {raw!r}."
                        f"{suggestion(raw, self._raw)}"
                    )
                if not (isinstance(weight, int | float) and np.isfinite(weight)):
                    raise InputError(
                        f"`coordinates.{name}.{raw}` must be a finite number; got {weight!r}."
                    )
        return {name: dict(weights) for name, weights in given.items()}

    def quantity(self, raw: str) -> str:
        """What a raw parameter measures."""
        if raw in self.terms:
            return self.terms[raw][0].measure
        return "length" if raw in PLACES else "angle"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The user's parameters: coordinates, angles, actuators, loads, places."""
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
        role: Role = "load" if next(iter(weights)) in self.loads else "actuator"
        quantity, units = quantities.pop(), self.units
        # between held ends a straight rod needs a turn to know its upright side
        needed = self.coordinates is None and name == "Theta" and "nu" in self._raw
        default = None if needed else 0.0
        return Parameter(name, units.label(quantity), units.value(quantity), role, default)

    def _parameter(self, raw: str) -> Parameter:
        quantity, units = self.quantity(raw), self.units
        label, scale = units.label(quantity), units.value(quantity)
        if raw in PLACES:
            far = scale if self.profiles["axial"] is None else np.inf
            default = float(self.places[raw])
            return Parameter(raw, label, scale, "fixed", default, -far, far)
        if raw.startswith("twist_") and raw in RESERVED:
            near = np.nextafter(LARGEST_TWIST, np.inf)
            return Parameter(raw, label, scale, "actuator", 0.0, -near, near)
        role: Role = "load" if raw in self.loads else "actuator"
        return Parameter(raw, label, scale, role, 0.0)

    def matrix(self, model: SpatialModel) -> Matrix:
        """Raw scalars as combinations of the user's."""
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

    def amplitudes(self, p: Parameters) -> list[tuple[Term, Values]]:
        """Every term with its amplitude in the user's units."""
        names = [parameter.name for parameter in self.parameters]
        out: list[tuple[Term, Values]] = []
        for raw, terms in self.terms.items():
            row = np.zeros(len(names))
            if raw in names:
                row[names.index(raw)] = 1.0
            for name, weights in self._coordinates.items():
                row[names.index(name)] = weights.get(raw, 0.0)
            out += [(one, p @ row) for one in terms]
        return out

    def data(self) -> dict[str, Any]:
        """Loads, supports and coordinates as plain data."""
        terms = {
            group: {name: [one.data() for one in self.terms[name]] for name in given}
            for group, given in (("actuators", self.actuators), ("loads", self.loads))
        }
        out: dict[str, Any] = {"ends": [support.data() for support in self.supports], **terms}
        if self.coordinates is not None:
            out["coordinates"] = self._coordinates
        words = {"nu": "span", "rise": "rise", "sideways": "sideways"}
        out |= {words[name]: self.places[name] for name in PLACES if name in self._raw}
        return out
