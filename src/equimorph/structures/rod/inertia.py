"""Physical mass matrices of planar rods: JᵀWJ with the places of all nodes as functions of z.

A point of the rod lies at ``x = ∫₀ˢ (1 + ε) cos θ``, ``y = ∫₀ˢ (1 + ε) sin θ`` from end A, or by
the same integral from end B. The mass lies at the nodes with the weights of the quadrature.
Cross-sections have no rotary inertia, as is right for slender rods.
"""

from abc import abstractmethod
from dataclasses import replace
from functools import lru_cache

import numpy as np

from equimorph.arrays import Float, Lanes, Nodal, Parameters, Velocity
from equimorph.linalg.dense import multiply
from equimorph.model import Parameter
from equimorph.structures.collapse import Shortening
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.units import Units


@lru_cache(maxsize=32)
def _moments(mesh: Mesh) -> Float[np.ndarray, "nodes nodes"]:
    """IᵀWI of the matrix I that integrates nodal values from end A to each node."""
    integral = mesh.integration(mesh.nodes)
    return np.asarray(integral.T @ (mesh.weights[:, None] * integral))


def inextensible_places(mesh: Mesh, theta: Nodal) -> Float[np.ndarray, "lanes nodes 2"]:
    """Places of all nodes of an inextensible rod whose end A rests."""
    integral = mesh.integration(mesh.nodes).T
    return np.stack([multiply(each, integral) for each in (np.cos(theta), np.sin(theta))], axis=2)


def inextensible_inertia(mesh: Mesh, theta: Nodal) -> Float[np.ndarray, "lanes nodes nodes"]:
    """Mass matrix of all nodal angles of an inextensible rod whose end A rests, total mass 1.

    ``M_jk = (IᵀWI)_jk cos(θ_j − θ_k)``.
    """
    return np.asarray(_moments(mesh) * np.cos(theta[:, :, None] - theta[:, None, :]))


def inextensible_force(mesh: Mesh, theta: Nodal, rates: Nodal) -> Nodal:
    """Γ of all nodal angles of the same rod: ``Γ_j = Σ (IᵀWI)_jk sin(θ_j − θ_k) θ̇_k²``."""
    turned = _moments(mesh) * np.sin(theta[:, :, None] - theta[:, None, :])
    return np.asarray(np.einsum("ljk,lk->lj", turned, rates**2))


class HeavyRod(Shortening):
    """A rod whose mass is spread evenly along its centre line."""

    units: Units

    @abstractmethod
    def inertia_in_lengths(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Physical mass matrix of a rod of mass 1, in units of its mass and length."""

    @abstractmethod
    def inertial_force_in_lengths(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of a rod of mass 1, see `Structure.inertial_force`, in units of its mass and length."""

    @property
    @abstractmethod
    def sprung_in_lengths(self) -> MaterialPoints | None:
        """Points of a rod of mass 1 on springs that the unknowns leave free; None without these."""

    @property
    @abstractmethod
    def material_in_lengths(self) -> MaterialPoints:
        """Points of a rod of mass 1."""

    @property
    def material(self) -> MaterialPoints | None:
        """Its points, which supports may move; None without a mass."""
        unit, points = self.units.time(), self.material_in_lengths
        return None if unit is None else replace(points, masses=unit**2 * points.masses)

    @property
    def sprung(self) -> MaterialPoints | None:
        """Its points on springs at both ends, or at one where the other end is free."""
        unit, points = self.units.time(), self.sprung_in_lengths
        if unit is None or points is None:
            return None
        return replace(points, masses=unit**2 * points.masses)

    @property
    def time_unit(self) -> str:
        """T, or s of a rod with EI and length."""
        return self.units.time_label

    def effort_unit(self, parameter: Parameter) -> str:
        """Unit of the effort of a parameter: of a couple for an angle, a force for a length."""
        known = self.units.conjugate(parameter.unit)
        return super().effort_unit(parameter) if known is None else known

    @property
    def massless(self) -> str:
        """How a rod with EI and length is given its mass."""
        return 'Give it one, like Rod(..., mass="0.2 kg"), or a section with a density.'

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Physical mass matrix of the rod, which is as heavy everywhere, in units of energy·time².

        Without EI and length the unit of time is T = √(m L/λ_cr) with the mass m of the rod and
        λ_cr = 4π²B/L². Where the load is its own weight, m g = q λ_cr and T = √(q L/g).
        """
        unit = self.units.time()
        if unit is None:
            return super().inertia(z, p)
        return unit**2 * self.inertia_in_lengths(z, p)

    def inertial_force(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Forces of inertia at constant rates of the unknowns."""
        unit = self.units.time()
        if unit is None:
            return super().inertial_force(z, p, velocity)
        return unit**2 * self.inertial_force_in_lengths(z, p, velocity)
