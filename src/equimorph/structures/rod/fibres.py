"""Strains and stresses in the surface of a cross-section that is bent and twisted.

Fibres at the distances y and z from the axes b and n have the strain ε = κ_b y + κ_n z + N/(EA),
where an axial force N counts, and the stress σ = E ε; twist adds the shear τ of Saint-Venant. What
counts is the stress of von Mises, √(σ² + 3 τ²). It is largest in the surface, since σ is linear and
τ² subharmonic.

Rods and frames whose sections are known share the descriptors of strain, stress and safety.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.contract import Readers, Structure, Written
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, UnitSystem

TERMS = 2.0 * np.arange(500) + 1.0
"""Odd numbers of the torsion series: what follows them in J is 1e-13 of the whole."""
FIBRES = np.sin(np.linspace(0.0, 0.5 * np.pi, 41))
"""Places of fibres on half a side of a rectangle, closest to each other at the corner."""
Along = Float[np.ndarray, " fibres"]
Strains = Float[np.ndarray, "lanes points 3"]
Sizes = Float[np.ndarray, "lanes points"]
SAFEST = 1e6
"""Largest safety factor: that of a straight rod has no bound."""


@dataclass(frozen=True, eq=False)
class Fibres:
    """Fibres in the surface of a quarter of a cross-section; others bear no more."""

    y: Along
    z: Along
    """Distances from the axes b and n."""
    shear: Along
    """Shear strain for a twist of 1."""
    round: bool
    """Whether all axes are alike: bends about n and b are then one bend, about b."""
    E: float
    nu: float
    """Young's modulus and Poisson's ratio."""
    EA: float
    """Axial stiffness."""

    def strain(self, strains: Strains, force: Sizes | None = None) -> Sizes:
        """Largest strain along the rod, for twists and curvatures about n and b, axial forces."""
        return np.asarray(self._normal(strains, force).max(axis=-1))

    def stress(self, strains: Strains, force: Sizes | None = None) -> Sizes:
        """Largest stress of von Mises, for twists and curvatures about n and b, axial forces."""
        sheared = np.abs(strains[..., :1]) * self.shear / (2.0 * (1.0 + self.nu))
        both = self._normal(strains, force) ** 2 + 3.0 * sheared**2
        return np.asarray(self.E * np.sqrt(both.max(axis=-1)))

    def _normal(
        self, strains: Strains, force: Sizes | None
    ) -> Float[np.ndarray, "lanes points fibres"]:
        """Strain along the rod where bending and the axial force add up."""
        axial = 0.0 if force is None else np.abs(force)[..., None] / self.EA
        aside, bend = np.abs(strains[..., 1:2]), np.abs(strains[..., 2:])
        if self.round:
            return np.asarray(axial + np.hypot(aside, bend) * self.y)
        return np.asarray(axial + bend * self.y + aside * self.z)


def circle(diameter: float, E: float, nu: float, EA: float) -> Fibres:
    """One fibre of a circle, with or without a hole."""
    at = np.array([0.5 * diameter])
    return Fibres(at, 0.0 * at, at, True, E, nu, EA)


def rectangle(width: float, thickness: float, E: float, nu: float) -> Fibres:
    """Fibres in half of two sides: bent about b over the thickness, about n over the width."""
    half_width, half = 0.5 * width, 0.5 * thickness
    sides = (
        (np.full(len(FIBRES), half), half_width * FIBRES),
        (half * FIBRES, np.full(len(FIBRES), half_width)),
    )
    y, z = np.concatenate(sides, axis=1)
    shear = [side_shear(half, half_width, FIBRES), side_shear(half_width, half, FIBRES)]
    return Fibres(y, z, np.concatenate(shear), False, E, nu, E * width * thickness)


def side_shear(distance: float, half: float, at: Along) -> Along:
    """Shear strain for a twist of 1 along a side of a rectangle.

    ``γ = 2a (1 − 8/π² Σ cosh(nπ y/(2a)) / (n² cosh(nπ b/(2a))))`` over odd n, where the side lies
    at the distance a from the axis and y = b `at` runs from its middle to its end. Relative error
    4e-4 at the very end, where γ = 0, and far less before.

    References
    ----------
    [TimoshenkoGoodier1970]_, section 109.

    Examples
    --------
    The largest shear in a square: 0.675 · 2a.

    >>> round(side_shear(0.5, 0.5, np.zeros(1)).item(), 3)
    0.675
    """
    rate = 0.5 * np.pi * half / distance * TERMS
    y = np.abs(at)[:, None]
    ratio = np.exp(rate * (y - 1.0)) * (1.0 + np.exp(-2.0 * rate * y)) / (1.0 + np.exp(-2.0 * rate))
    return np.asarray(2.0 * distance * (1.0 - 8.0 / np.pi**2 * (ratio / TERMS**2).sum(axis=1)))


def torsion_constant(width: float, thickness: float) -> float:
    """J of a rectangle, GJ being its torsional stiffness, to 1e-12.

    ``J = a b³/3 · (1 − 192 b/(π⁵ a) Σ tanh(nπ a/(2b))/n⁵)`` over odd n, with sides a ≥ b.

    References
    ----------
    [TimoshenkoGoodier1970]_, section 109.

    Examples
    --------
    >>> round(torsion_constant(1.0, 1.0), 6)
    0.140577
    """
    a, b = max(width, thickness), min(width, thickness)
    series = np.sum(np.tanh(TERMS * np.pi * a / (2.0 * b)) / TERMS**5)
    return float(a * b**3 / 3.0 * (1.0 - 192.0 * b / (np.pi**5 * a) * series))


class Stressed(Structure):
    """A structure with strains and stresses, which need the size of its sections."""

    written: ClassVar[Written] = {
        "max_strain": "max_strain",
        "max_stress": "max_stress",
        "safety_factor(strength)": "safety_factor",
    }
    readers: ClassVar[Readers] = {"strength": str}

    @property
    @abstractmethod
    def max_strain(self) -> Descriptor:
        """Largest strain in the surface."""

    @property
    @abstractmethod
    def max_stress(self) -> Descriptor:
        """Largest stress."""

    @property
    @abstractmethod
    def own_system(self) -> UnitSystem:
        """Units of its user, which may name none."""

    @check_arguments
    @remember_call
    def safety_factor(self, strength: Quantity) -> Descriptor:
        """A strength over the largest stress, at most 1e6: ``rod.safety_factor("900 MPa") >= 1.5``.

        Parameters
        ----------
        strength
            Stress that the material bears, a number in the structure's units or a text.

        Raises
        ------
        InputError
            If it is not positive or no stress, or as of `max_strain`.
        """
        number = float(self.stress_system.number(strength, "force/length²", "strength"))
        if not number > 0.0:
            raise InputError(f"`strength` must be positive; got {strength}.")
        stress = self.max_stress

        def value(z: Lanes, p: Parameters) -> Values:
            return number / np.maximum(stress.function(z, p), number / SAFEST)

        name = f"safety_factor({strength})"
        return Descriptor(name, "1", value, "safety factor", stress.origin, stress.place)

    @property
    def stress_label(self) -> str:
        """Unit of stresses."""
        return self.stress_system.label("force/length²")

    @property
    def stress_system(self) -> UnitSystem:
        """Units of stresses: SI where its user names none."""
        return SI if self.own_system.plain else self.own_system
