"""Descriptors of a rod in space as methods."""

from functools import cached_property

from equimorph.argument_checks import check_arguments
from equimorph.model import Descriptor
from equimorph.structures.spatial import descriptors
from equimorph.structures.spatial.measured import MeasuredInSpace


class DescribedInSpace(MeasuredInSpace):
    """A rod in space with its descriptors, in the user's units."""

    @check_arguments
    def height(self, s: float) -> Descriptor:
        """y(s), in units of L."""
        return descriptors.coordinate(self, "height", s)

    @check_arguments
    def position(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """(x(s), y(s), z(s)), in units of L."""
        x, y, z = (descriptors.coordinate(self, name, s) for name in ("x", "height", "z"))
        return x, y, z

    @check_arguments
    def angles(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """Angles turn, tilt, roll of R = exp(e₃ turn) exp(e₂ tilt) exp(e₁ roll) at s.

        Turn and roll lie between −π and π; all three jump where the tangent is along ±z.
        """
        turn, tilt, roll = (descriptors.angle(self, name, s) for name in descriptors.ANGLES)
        return turn, tilt, roll

    @check_arguments
    def strains(self, s: float) -> tuple[Descriptor, Descriptor, Descriptor]:
        """Twist, and curvatures about n and b, at s, in units of 1/L."""
        twist, aside, bend = (descriptors.strain(self, name, s) for name in descriptors.STRAINS)
        return twist, aside, bend

    @check_arguments
    def bending(self, s: float) -> Descriptor:
        """Bending curvature √(κ_n² + κ_b²) at s, in units of 1/L."""
        return descriptors.bending(self, s)

    @cached_property
    def max_curvature(self) -> Descriptor:
        """Largest bending curvature along the rod, in units of 1/L."""
        return descriptors.max_curvature(self)

    @cached_property
    def total_energy(self) -> Descriptor:
        """Potential energy E, in units of 4π²B/L."""
        return descriptors.total_energy(self)

    @check_arguments
    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod along "x", "y" or "z"."""
        return descriptors.support_force(self, component)

    @check_arguments
    def end_couple(self, end: int, component: str) -> Descriptor:
        """Couple of the support at end 0 or 1 on the rod, about an axis "x", "y" or "z"."""
        return descriptors.end_couple(self, end, component)

    @check_arguments
    def clearance(self, apart: float = 0.1) -> Descriptor:
        """Smallest distance between points whose arclengths differ by `apart` at least.

        Contact is not modelled: a rod of thickness h touches itself where this is below h.
        """
        return descriptors.clearance(self, apart)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``height(0.5)`` or ``max_curvature``."""
        return descriptors.descriptor_from_text(self, text)
