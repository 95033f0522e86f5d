"""Descriptors of a planar rod as methods."""

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Int, Lanes, Parameters, Values
from equimorph.errors import InputError, MissingError
from equimorph.model import Constraint, Descriptor, remember_call
from equimorph.model.descriptor import Branches
from equimorph.model.families import Family
from equimorph.structures.contract import CompiledSteps, Readers, Written
from equimorph.structures.rod import space
from equimorph.structures.rod.any_rod import Peaks
from equimorph.structures.rod.ends import End
from equimorph.structures.rod.extrema import extreme_curvatures, peaks, stations
from equimorph.structures.rod.lateral import Holding, LateralStiffness, OutOfPlane
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.planar_fields import Measured, StressedRod
from equimorph.structures.rod.space import LateralMode
from equimorph.structures.rod.space_options import SpaceOptions
from equimorph.structures.states import State


def multiple(given: Descriptor, factor: float, names: tuple[str, str, str]) -> Descriptor:
    """Descriptor of a name, unit and symbol that is a positive multiple of another one."""

    def value(z: Lanes, p: Parameters) -> Values:
        return factor * given.function(z, p)

    branches: Branches | None = None
    if given.branches is not None:
        inner = given.branches

        def branches(z: Lanes, p: Parameters):  # type: ignore[no-untyped-def]  # as `inner`
            values, places = inner(z, p)
            return factor * values, places

    name, unit, symbol = names
    return Descriptor(name, unit, value, symbol, given.origin, given.place, branches)


FORCES = {"x": 0, "y": 1, "lambda": 0, "mu": 1}
"""Axes of the components of the support's force, by the axis and by the symbol of the theory."""


class Described(Measured):
    """A planar rod with its descriptors, in the user's units."""

    written: ClassVar[Written] = {
        "height(s)": "height",
        "x(s)": lambda rod, s: rod.coordinate(0, s),
        "angle(s)": "angle",
        "curvature(s)": "curvature",
        **StressedRod.written,
        "lateral_margin": "lateral_margin",
        "lateral_margin(torsion,lateral)": "lateral_margin",
        "lateral_index": "lateral_index",
        "lateral_index(torsion,lateral)": "lateral_index",
        "end_moment(0)": "end_moment",
    }
    readers: ClassVar[Readers] = {
        **StressedRod.readers,
        **dict.fromkeys(("torsion", "lateral"), space.number_or_text),
    }

    @property
    @abstractmethod
    def ends(self) -> tuple[End, End]:
        """How ends A and B are supported."""

    lateral_stiffness: LateralStiffness | None
    """Stiffnesses out of the plane; None: not judged."""

    @property
    @abstractmethod
    def lagrangian(self) -> RodModel:
        """That of the rod, in its parameters or in these and further ones that are zero."""

    @check_arguments
    def position(self, s: float) -> tuple[Descriptor, Descriptor]:
        """(x(s), y(s)), in units of L."""
        return self.coordinate(0, s), self.coordinate(1, s)

    @check_arguments
    @remember_call
    def angle(self, s: float) -> Descriptor:
        """θ(s) in radians."""
        return self.field_at(s, "angle", "θ", "angle", self._field(0))

    @check_arguments
    @remember_call
    def curvature(self, s: float) -> Descriptor:
        """κ(s) in units of 1/L."""
        return self.field_at(s, "curvature", "κ", "curvature", self._field(1))

    def _field(self, which: int) -> Family:
        """θ or κ (0, 1)."""
        return lambda z, p, at: self.fields(z, p, at)[:, :, which]

    @cached_property
    @remember_call
    def max_curvature(self) -> Descriptor:
        """max_s |κ(s)| in units of 1/L, ends and interior extrema included."""
        return self.max_curvature_descriptor(self._peaks)

    def compiled_steps(self, within: Sequence[Constraint]) -> CompiledSteps | None:
        """Loops of the mechanics, if they have some, under bounds on the largest curvature."""
        if any(each.descriptor != self.max_curvature for each in within):
            return None
        unit = self.units.value("curvature")
        bounds = [(1.0 if c.sense == "<=" else -1.0, unit, c.bound, c.ease) for c in within]
        return self.mechanics.compiled_steps(np.array(bounds).reshape(-1, 4))

    @cached_property
    @remember_call
    def max_strain(self) -> Descriptor:
        """Largest strain of bending, max_s |κ(s)| t/2, of a rod with a `section` of thickness t.

        Raises
        ------
        MissingError
            Without the size of the section, or for a rod that is curved when free of stress.
        """
        return multiple(
            self.max_curvature, float(self.fibres.y.max()), ("max_strain", "1", "max |ε|")
        )

    @cached_property
    @remember_call
    def max_stress(self) -> Descriptor:
        """Largest stress of bending, E times `max_strain`: ``rod.max_stress <= "400 MPa"``.

        Raises
        ------
        MissingError
            As of `max_strain`.
        """
        names = "max_stress", self.stress_label, "max |σ|"
        return multiple(self.max_strain, self.fibres.E, names)

    def _peaks(self, z: Lanes, p: Parameters) -> tuple[Peaks, Peaks]:
        """Local maxima of |κ|, and the arclengths where they are."""
        at = stations(self.mesh.breaks)
        found, places = peaks(np.abs(self.mechanics.fields(z, p, at)[:, :, 1]), at)
        exact = extreme_curvatures(self.mechanics, z, p, places)
        unit = self.units.value("curvature")
        return unit * np.where(np.isfinite(found), exact, found), places

    @check_arguments
    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod along "x" or "y" ("lambda", "mu" in the theory)."""
        if component not in FORCES:
            raise InputError(f"`component` must be 'x', 'y', 'lambda' or 'mu'; got {component!r}.")
        return self.support_force_along(FORCES[component], component)

    @check_arguments
    @remember_call
    def end_moment(self, end: int) -> Descriptor:
        """Couple of the actuator at end 0 or 1: ∂L/∂θ(end), in units of 4π²B/L."""
        if end not in (0, 1):
            raise InputError(f"`end` must be 0 or 1; got {end!r}.")
        unit = self.units.value("couple")

        def value(z: Lanes, p: Parameters) -> Values:
            return unit * self.mechanics.end_moments(z, p)[:, end]

        label = self.units.label("couple")
        return Descriptor(f"end_moment({end})", label, value, f"M({end})", self.signature)

    @property
    def support_reactions(self) -> tuple[Descriptor, ...]:
        """Both components of the force at A, and the couples at both ends."""
        return (*map(self.support_force, "xy"), *map(self.end_moment, (0, 1)))

    # --- out of the plane -------------------------------------------------------------------

    @property
    def has_lateral_stiffness(self) -> bool:
        """Whether the rod has stiffnesses out of its plane."""
        return self.lateral_stiffness is not None

    @property
    def watched(self) -> tuple[Descriptor, ...]:
        """The lateral margin, if the rod is judged in space."""
        return (self.lateral_margin(),) if self.has_lateral_stiffness else ()

    def index_out_of_plane(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"] | None:
        """Independent movements out of the plane that lower the energy; None: not judged."""
        return self.out_of_plane().index(z, p) if self.has_lateral_stiffness else None

    def out_of_plane(self, torsion: Any = None, lateral: Any = None) -> OutOfPlane:
        """The second variation out of the plane, with the rod's stiffnesses or others.

        Raises
        ------
        InputError
            Without stiffnesses, or under loads without a potential in space.
        """
        if torsion is None and lateral is None:
            return self._own_block
        space.check_terms(self.terms)
        stiffness = SpaceOptions(torsion, lateral, None).check(None, None)
        return self._block(stiffness.stiffness(self.units, ()))

    @cached_property
    def _own_block(self) -> OutOfPlane:
        return self._block(self.lateral_stiffness)

    def _block(self, stiffness: LateralStiffness | None) -> OutOfPlane:
        if stiffness is None:
            raise MissingError(
                "`torsion`, `lateral` must be given to judge whether a rod leaves its plane; got "
                "neither. Give the rod these, like torsion=0.77, lateral=1.0 for a round one, or a "
                "section."
            )
        return OutOfPlane(self.mechanics, self.lagrangian, Holding.of(self.ends), stiffness)

    @check_arguments
    @remember_call
    def lateral_index(self, torsion: Any = None, lateral: Any = None) -> Descriptor:
        """Number of independent movements out of the plane that lower the energy.

        0 where the rod stays in its plane. Arguments as of `lateral_margin`.
        """
        block, written = self.out_of_plane(torsion, lateral), self._arguments(torsion, lateral)
        return space.lateral_index(self, block, written)

    @check_arguments
    @remember_call
    def lateral_margin(self, torsion: Any = None, lateral: Any = None) -> Descriptor:
        """Smallest eigenvalue of the second variation for movements out of the plane.

        Where it is negative the rod leaves its plane. Relative to ∫ φ² + ψ² ds of the rotations, in
        the unit of couples.

        Parameters
        ----------
        torsion, lateral
            GJ and EI about the axis in the plane: relative to the bending stiffness in the plane,
            or texts with units. None: those of the rod.

        Raises
        ------
        InputError
            Where neither the rod nor the arguments have them, or under loads without a potential in
            space.
        """
        block, written = self.out_of_plane(torsion, lateral), self._arguments(torsion, lateral)
        return space.lateral_margin(self, block, written, self.terms)

    def _arguments(self, torsion: Any, lateral: Any) -> str:
        """Arguments of a descriptor's name; none for the rod's own stiffnesses."""
        return "" if torsion is None and lateral is None else f"({torsion}, {lateral})"

    @cached_property
    def stable_in_space(self) -> Constraint:
        """Constraint that planar states do not leave their plane: ``lateral_margin >= 0``.

        A path that violates it ends at a lateral branch point.
        """
        return self.lateral_margin() >= 0.0

    @check_arguments
    def lateral_mode(self, state: State, points: int = 101) -> LateralMode:
        """The movement out of the plane that a state resists least, at equidistant points."""
        s = np.linspace(0.0, 1.0, points)
        return space.lateral_mode(self, self.out_of_plane(), state.z[None], state.p[None], s)

    @check_arguments
    def warnings(
        self, state: State, thickness: float = 0.0, torsion: Any = None, lateral: Any = None
    ) -> tuple[str, ...]:
        """Why the planar model may not hold in a state, one line each.

        Contact with itself, for a rod of some `thickness` in the user's unit of length; buckling
        out of the plane, where the stiffnesses of `lateral_margin` are given here or to the rod.
        """
        found = list(self.warn_of_contact(state, thickness))
        if self.has_lateral_stiffness or (torsion is not None and lateral is not None):
            margin = self.lateral_margin(torsion, lateral)(state)
            if margin < 0.0:
                found.append(f"the rod buckles out of its plane: eigenvalue {margin:.3g}")
        return tuple(found)
