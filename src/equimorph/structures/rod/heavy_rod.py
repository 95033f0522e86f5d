"""The mass of rods, and their unit of time."""

from abc import abstractmethod

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters, Velocity
from equimorph.model import Parameter
from equimorph.structures.contract import Structure
from equimorph.structures.rod.units import Units


class HeavyRod(Structure):
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
