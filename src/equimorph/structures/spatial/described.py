"""Descriptors of a rod in space as methods."""

from functools import cached_property

from equimorph.argument_checks import check_arguments
from equimorph.model import Descriptor
from equimorph.structures.spatial import descriptors
from equimorph.structures.spatial.measured import MeasuredInSpace
from equimorph.structures.spatial.orbits import on_orbit
from equimorph.structures.states import State


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

    @check_arguments
    def warnings(self, state: State, thickness: float = 0.0) -> tuple[str, ...]:
        """Why what is computed of a state may not hold, one line each.

        Contact with itself, for a rod of some `thickness` in the user's unit of length; and orbits:
        equal bending stiffnesses between coaxial clamps let a state turn about their axis for
        nothing, so that F_z is singular and no event found there is a fold.
        """
        found = []
        distance = self.clearance()(state)
        if distance <= max(thickness, 1e-9 * self.units.value("length")):
            found.append(f"the rod touches itself: points come as near as {distance:.3g}")
        if on_orbit(self.mechanics, state.z[None], state.p[None])[0]:
            found.append(
                "the state may be turned about the axis of the clamps for nothing: give the rod a "
                "load across this axis, another clamp, or unequal bending stiffnesses"
            )
        return tuple(found)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``height(0.5)`` or ``max_curvature``."""
        return descriptors.descriptor_from_text(self, text)
