"""Planar rods as structures: fields along the rod in the user's units."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.any_rod import AnyRod, Arclengths
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.rod.mechanics import PlanarMechanics


class Measured(AnyRod):
    """A planar rod with its angles, curvature and places."""

    mechanics: PlanarMechanics

    def nodal_angles(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes"]:
        """Angles θ at all nodes, the prescribed ends included."""
        return self.mechanics.nodal_angles(z, p)

    def fields(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        length = self.units.value("length")
        units = np.array([1.0, self.units.value("curvature"), length, length])
        return np.asarray(self.mechanics.fields(z, p, s) * units)

    def places(self, z: Lanes, p: Parameters, s: Arclengths) -> Float[np.ndarray, "lanes points 2"]:
        """(x, y) at arclengths."""
        return self.fields(z, p, s)[:, :, 2:]

    def centreline(self, z: Lanes, p: Parameters, s: Arclengths) -> Centreline:
        """Places, tangents, normals to the left and curvature at arclengths."""
        fields, length = self.fields(z, p, s), self.units.value("length")
        angles, bending = fields[:, :, 0], length * fields[:, :, 1, None]
        tangents = np.stack([np.cos(angles), np.sin(angles)], axis=2)
        left = np.stack([-tangents[:, :, 1], tangents[:, :, 0]], axis=2)
        return Centreline(fields[:, :, 2:], tangents, left[:, :, None], bending * left, length)

    @property
    def time_unit(self) -> str:
        """T, or s of a rod with EI and length."""
        return self.units.time_label

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
        return unit**2 * self.mechanics.inertia(z, p)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""
        value, place = self.mechanics.largest_curvature(z, p)
        return value * self.units.value("curvature"), place
