"""Rods in space as structures: fields along the rod and descriptors, in the user's units."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values, Velocity
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.model.families import Family
from equimorph.structures.contract import Written
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.rod.any_rod import Peaks
from equimorph.structures.rod.arclengths import Arclengths, arclengths
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.rod.extrema import peaks, stations
from equimorph.structures.rod.fibres import Sizes, Strains
from equimorph.structures.rod.planar_fields import StressedRod
from equimorph.structures.spatial.fields import Fields, SpatialFields
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.natural import on_orbit
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.states import State

STRAINS = {"twist": "κ_t", "side_curvature": "κ_n", "curvature": "κ_b"}
"""Strains in the order in which fields have them, with their symbols."""
ANGLES = {"turn": "a", "tilt": "b", "roll": "τ"}
"""Angles of a cross-section with their symbols."""
LOCKED = 1e-3
"""Cosine of a clamp's tilt below which its two other angles turn it about the same axis."""
FORCES = {"lambda": 0, "mu": 1, "x": 0, "y": 1, "z": 2}
"""Components of the support's force; the first two as on a planar rod."""


class DescribedInSpace(StressedRod):
    """A rod in space with its fields and descriptors, in the user's units."""

    written: ClassVar[Written] = {
        "height(s)": "height",
        "x(s)": lambda rod, s: rod.coordinate(0, s),
        "z(s)": lambda rod, s: rod.coordinate(2, s),
        **{f"{name}(s)": lambda rod, s, name=name: rod._angle(name, s) for name in ANGLES},
        **{f"{name}(s)": lambda rod, s, name=name: rod._strain(name, s) for name in STRAINS},
        "bending(s)": "bending",
        **StressedRod.written,
        "end_couple(0,x)": "end_couple",
    }
    mechanics: SpatialMechanics

    @cached_property
    def recovery(self) -> SpatialFields:
        """Fields along the rod, non-dimensional."""
        return SpatialFields(self.mechanics)

    def fields(self, z: Lanes, p: Parameters, s: Arclengths) -> Fields:
        """Rotations, places and strains at arclengths, in the user's units."""
        found = self.recovery.at(z, p, s)
        length, bend = self.units.value("length"), self.units.value("curvature")
        return Fields(found.rotations, length * found.places, bend * found.strains)

    def places(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 3"]:
        """(x, y, z) at arclengths."""
        return self.fields(z, p, s).places

    def centreline(self, z: Lanes, p: Parameters, s: Arclengths) -> Centreline:
        """Places, tangents, and normals n and b at arclengths."""
        fields = self.fields(z, p, s)
        tangents, n, b = np.moveaxis(fields.frames, -1, 0)
        return Centreline(fields.places, tangents, np.stack([n, b], axis=2))

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """Largest bending curvature along the rod, and the arclength where it occurs."""
        value, place = self.recovery.largest_curvature(z, p)
        return np.asarray(value * self.units.value("curvature")), place

    def inertia_in_lengths(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of a rod of mass 1: masses at the nodes of the elements."""
        return self.material_in_lengths.inertia(z, p)

    def inertial_force_in_lengths(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of the same masses."""
        return self.material_in_lengths.inertial_force(z, p, velocity)

    @property
    def sprung_in_lengths(self) -> MaterialPoints | None:
        """Points of a rod of mass 1 on springs that the unknowns leave free."""
        springs = self.mechanics.model.springs_along
        return None if springs.follow else replace(self.material_in_lengths, springs=springs)

    @property
    def material_in_lengths(self) -> MaterialPoints:
        """Points of a rod of mass 1: the nodes of the elements."""

        def places(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points 3"]:
            return self.recovery.nodal(z, p).places.reshape(len(z), -1, 3)

        return MaterialPoints(self.mechanics, places, self.mesh.element_weights.ravel())

    def frames(
        self, z: Lanes, p: Parameters, s: Arclengths | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"]:
        """Axes of the cross-sections at arclengths `s`: the columns of each matrix are t, n, b."""
        return self.recovery.at(z, p, arclengths(s)).frames

    @property
    def flatness(self) -> float:
        """Width over thickness of a rectangle with the rod's mean ratio of bending stiffnesses."""
        model = self.mechanics.model
        _, aside, bend = model.stiffness.reshape(-1, 3).mean(axis=0)
        return float(np.sqrt(aside / bend))

    # --- descriptors ----------------------------------------------------------------------------

    @check_arguments
    def position(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """(x(s), y(s), z(s)), in units of L."""
        return self.coordinate(0, s), self.coordinate(1, s), self.coordinate(2, s)

    @check_arguments
    def angles(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """Angles turn, tilt, roll of R = exp(e₃ turn) exp(e₂ tilt) exp(e₁ roll) at s.

        The tangent is (cos turn cos tilt, sin turn cos tilt, −sin tilt). Turn and roll lie between
        −π and π; all three jump where the tangent is along ±z.
        """
        turn, tilt, roll = (self._angle(name, s) for name in ANGLES)
        return turn, tilt, roll

    @remember_call
    def _angle(self, name: str, s: float) -> Descriptor:
        def value(z: Lanes, p: Parameters, at: Arclengths) -> Float[np.ndarray, "lanes points"]:
            r = self.frames(z, p, at)
            if name == "turn":
                return np.asarray(np.arctan2(r[..., 1, 0], r[..., 0, 0]))
            if name == "tilt":
                return np.asarray(-np.arcsin(np.clip(r[..., 2, 0], -1.0, 1.0)))
            return np.asarray(np.arctan2(r[..., 2, 1], r[..., 2, 2]))

        return self.field_at(s, name, ANGLES[name], "angle", value)

    @check_arguments
    def strains(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """Twist, and curvatures about n and b, at s, in units of 1/L."""
        twist, aside, bend = (self._strain(name, s) for name in STRAINS)
        return twist, aside, bend

    @remember_call
    def _strain(self, name: str, s: float) -> Descriptor:
        axis = tuple(STRAINS).index(name)
        field: Family = lambda z, p, at: self.fields(z, p, at).strains[:, :, axis]  # noqa: E731
        return self.field_at(s, name, STRAINS[name], "curvature", field)

    @check_arguments
    @remember_call
    def bending(self, s: float) -> Descriptor:
        """Bending curvature √(κ_n² + κ_b²) at s, in units of 1/L."""

        def size(z: Lanes, p: Parameters, at: Arclengths) -> Float[np.ndarray, "lanes points"]:
            strains = self.fields(z, p, at).strains
            return np.asarray(np.hypot(strains[:, :, 1], strains[:, :, 2]))

        return self.field_at(s, "bending", "|κ|", "curvature", size)

    @cached_property
    @remember_call
    def max_curvature(self) -> Descriptor:
        """Largest bending curvature along the rod, in units of 1/L."""
        return self.max_curvature_descriptor()

    @cached_property
    @remember_call
    def max_strain(self) -> Descriptor:
        """Largest strain of bending in the surface of a rod with a `section`.

        Raises
        ------
        MissingError
            Without the size of the section, or for a rod that is curved or twisted when free of
            stress.
        """
        return self._largest("max_strain", "1", "max |ε|", self.fibres.strain)

    @cached_property
    @remember_call
    def max_stress(self) -> Descriptor:
        """Largest stress of von Mises, of bending about both axes and twist.

        Raises
        ------
        MissingError
            As of `max_strain`.
        """
        return self._largest("max_stress", self.stress_label, "max σ", self.fibres.stress)

    def _largest(
        self, name: str, unit: str, symbol: str, size: Callable[[Strains], Sizes]
    ) -> Descriptor:
        """Largest value along the rod of what strains give."""
        at = stations(self.mesh.breaks)

        def found(z: Lanes, p: Parameters) -> tuple[Peaks, Peaks]:
            return peaks(size(self.fields(z, p, at).strains), at)

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(found(z, p)[0].max(axis=1))

        def place(z: Lanes, p: Parameters) -> Values:
            values, places = found(z, p)
            return np.take_along_axis(places, values.argmax(axis=1)[:, None], axis=1)[:, 0]

        return Descriptor(name, unit, value, symbol, self.signature, place, found)

    @check_arguments
    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod along "x", "y" or "z"."""
        if component not in FORCES:
            raise InputError(f"`component` must be 'x', 'y' or 'z'; got {component!r}.")
        axis = FORCES[component]
        return self.support_force_along(axis, "xyz"[axis])

    @check_arguments
    @remember_call
    def end_couple(self, end: int, component: str) -> Descriptor:
        """Couple of the support at end 0 or 1 on the rod, about an axis "x", "y" or "z"."""
        if end not in (0, 1):
            raise InputError(f"`end` must be 0 or 1; got {end!r}.")
        if component not in ("x", "y", "z"):
            raise InputError(f"`component` must be 'x', 'y' or 'z'; got {component!r}.")
        axis, unit = "xyz".index(component), self.units.value("couple")

        def value(z: Lanes, p: Parameters) -> Values:
            return unit * self.mechanics.end_couples(z, p)[:, end, axis]

        name, label = f"end_couple({end}, {component})", self.units.label("couple")
        return Descriptor(name, label, value, f"M_{component}({end})", self.signature)

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """All components of the force at A and of the couples at both ends."""
        couples = [self.end_couple(end, axis) for end in (0, 1) for axis in "xyz"]
        return (*map(self.support_force, "xyz"), *couples)

    @check_arguments
    def warnings(self, state: State, thickness: float = 0.0) -> tuple[str, ...]:
        """Why what is computed of a state may not hold, one line each.

        Contact with itself, for a rod of some `thickness` in the user's unit of length; and orbits:
        equal bending stiffnesses between coaxial clamps let a state turn about their axis for
        nothing. Paths keep to one phase where this is the x axis; about another axis F_z is
        singular, and no event found there is a fold. And clamps tilted by a quarter turn.
        """
        found = list(self.warn_of_contact(state, thickness))
        pinned = isinstance(self.mechanics, PinnedMechanics)
        if not pinned and on_orbit(self.mechanics, state.z[None], state.p[None])[0]:
            found.append(
                "the state may be turned about the axis of the clamps for nothing: it is one of an "
                "orbit, of which searches and sets pick one with phase=True"
            )
        turned = (
            self.mechanics.model.turned @ self.mechanics.scalars(state.z[None], state.p[None])[0]
        )
        for side, (_, tilt, _) in zip("AB", turned, strict=True):
            if abs(np.cos(tilt)) < LOCKED:
                found.append(
                    f"tilt_{side} = {tilt:.6g} is at a quarter turn: theta_{side} and twist_{side} "
                    "turn the clamp about the same axis there, and one direction is missing"
                )
        return tuple(found)
