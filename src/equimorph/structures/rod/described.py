"""Descriptors of a rod as methods."""

from abc import abstractmethod
from functools import cached_property
from typing import Any

from equimorph.door import door
from equimorph.model import Descriptor
from equimorph.structures.rod import descriptors, validity
from equimorph.structures.rod.ends import End
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.measured import Measured
from equimorph.structures.states import State


class Described(Measured):
    """A rod with its descriptors, in the user's units."""

    @property
    @abstractmethod
    def ends(self) -> tuple[End, End]:
        """How ends A and B are supported."""

    @property
    @abstractmethod
    def general_mechanics(self) -> GeneralMechanics:
        """The rod as a general one: in its parameters, and further ones that are zero."""

    @door
    def height(self, s: float) -> Descriptor:
        """y(s), in units of L."""
        return descriptors.coordinate(self, s, 1)

    @door
    def position(self, s: float) -> tuple[Descriptor, Descriptor]:
        """(x(s), y(s)), in units of L."""
        return descriptors.coordinate(self, s, 0), descriptors.coordinate(self, s, 1)

    @door
    def angle(self, s: float) -> Descriptor:
        """θ(s) in radians."""
        return descriptors.angle(self, s)

    @door
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

    @door
    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod: "lambda" (horizontal) or "mu" (vertical)."""
        return descriptors.support_force(self, component)

    @door
    def end_moment(self, end: int) -> Descriptor:
        """Couple of the actuator at end 0 or 1: ∂L/∂θ(end), in units of 4π²B/L."""
        return descriptors.end_moment(self, end)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    @door
    def clearance(self, apart: float = 0.1) -> Descriptor:
        """Smallest distance between points whose arclengths differ by `apart` at least.

        Contact is not modelled: a rod of thickness h is the planar model's while this exceeds h.
        """
        return validity.clearance(self, apart)

    @door
    def lateral_margin(self, torsion: Any, lateral: Any) -> Descriptor:
        """Smallest eigenvalue of the second variation for movements out of the plane.

        `torsion` and `lateral` are GJ and EI about the axis in the plane, relative to the bending
        stiffness in the plane. Where it is negative the rod buckles out of its plane.
        """
        stiffness = validity.LateralStiffness(torsion, lateral)
        return validity.lateral(self, self.general_mechanics, self.ends, stiffness)

    @door
    def warnings(
        self, state: State, thickness: float = 0.0, torsion: Any = None, lateral: Any = None
    ) -> tuple[str, ...]:
        """Why the planar model may not hold in a state, one line each.

        Contact with itself, for a rod of some `thickness` in the user's unit of length; buckling
        out of the plane, where the stiffnesses of `lateral_margin` are given.
        """
        found = []
        distance = self.clearance()(state)
        if distance <= max(thickness, 1e-9 * self.units.value("length")):
            found.append(f"the rod touches itself: points come as near as {distance:.3g}")
        if torsion is not None and lateral is not None:
            margin = self.lateral_margin(torsion, lateral)(state)
            if margin < 0.0:
                found.append(f"the rod buckles out of its plane: eigenvalue {margin:.3g}")
        return tuple(found)

    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``height(0.5)`` or ``max_curvature``."""
        return descriptors.descriptor_from_text(self, text)
