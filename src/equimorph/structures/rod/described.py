"""Descriptors of a rod as methods."""

from abc import abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Int

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Lanes, Parameters
from equimorph.errors import MissingError
from equimorph.model import Constraint, Descriptor
from equimorph.structures.rod import descriptors, space, validity
from equimorph.structures.rod.ends import End
from equimorph.structures.rod.lateral import Holding, LateralStiffness, OutOfPlane
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.space import LateralMode
from equimorph.structures.rod.space_options import SpaceOptions
from equimorph.structures.rod.terms import Term
from equimorph.structures.states import State


class Described(Measured):
    """A rod with its descriptors, in the user's units."""

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
    def height(self, s: float) -> Descriptor:
        """y(s), in units of L."""
        return descriptors.coordinate(self, s, 1)

    @check_arguments
    def position(self, s: float) -> tuple[Descriptor, Descriptor]:
        """(x(s), y(s)), in units of L."""
        return descriptors.coordinate(self, s, 0), descriptors.coordinate(self, s, 1)

    @check_arguments
    def angle(self, s: float) -> Descriptor:
        """θ(s) in radians."""
        return descriptors.angle(self, s)

    @check_arguments
    def curvature(self, s: float) -> Descriptor:
        """κ(s) in units of 1/L."""
        return descriptors.curvature(self, s)

    @cached_property
    def max_curvature(self) -> Descriptor:
        """max_s |κ(s)| in units of 1/L, ends and interior extrema included."""
        return descriptors.max_curvature(self)

    @cached_property
    def total_energy(self) -> Descriptor:
        """Potential energy E, in units of 4π²B/L."""
        return descriptors.total_energy(self)

    @check_arguments
    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod: "lambda" (horizontal) or "mu" (vertical)."""
        return descriptors.support_force(self, component)

    @check_arguments
    def end_moment(self, end: int) -> Descriptor:
        """Couple of the actuator at end 0 or 1: ∂L/∂θ(end), in units of 4π²B/L."""
        return descriptors.end_moment(self, end)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    @check_arguments
    def clearance(self, apart: float = 0.1) -> Descriptor:
        """Smallest distance between points whose arclengths differ by `apart` at least.

        Contact is not modelled: a rod of thickness h is the planar model's while this exceeds h.
        """
        return validity.clearance(self, apart)

    # --- out of the plane -------------------------------------------------------------------

    @property
    @abstractmethod
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Loads and actuators that act on the rod, by the name of their amplitude."""

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
    def lateral_index(self, torsion: Any = None, lateral: Any = None) -> Descriptor:
        """Number of independent movements out of the plane that lower the energy.

        0 where the rod stays in its plane. Arguments as of `lateral_margin`.
        """
        block, written = self.out_of_plane(torsion, lateral), self._written(torsion, lateral)
        return space.lateral_index(self, block, written)

    @check_arguments
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
        block, written = self.out_of_plane(torsion, lateral), self._written(torsion, lateral)
        return space.lateral_margin(self, block, written, self.terms)

    def _written(self, torsion: Any, lateral: Any) -> str:
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
        found = []
        distance = self.clearance()(state)
        if distance <= max(thickness, 1e-9 * self.units.value("length")):
            found.append(f"the rod touches itself: points come as near as {distance:.3g}")
        if self.has_lateral_stiffness or (torsion is not None and lateral is not None):
            margin = self.lateral_margin(torsion, lateral)(state)
            if margin < 0.0:
                found.append(f"the rod buckles out of its plane: eigenvalue {margin:.3g}")
        return tuple(found)

    @check_arguments
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``height(0.5)`` or ``max_curvature``."""
        found = space.LATERAL.fullmatch(text)
        if found:
            make = self.lateral_index if found[1] == "index" else self.lateral_margin
            return make(*space.stiffness_arguments(found[2]))
        return descriptors.descriptor_from_text(self, text)
