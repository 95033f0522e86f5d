"""Planar rods as structures: fields along the rod in the user's units."""

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values, Velocity
from equimorph.structures.rod.any_rod import Arclengths
from equimorph.structures.rod.centreline import Centreline
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.stresses import StressedRod


class Measured(StressedRod):
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

    def inertia_in_lengths(
        self, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """Mass matrix of a rod of mass 1."""
        return self.mechanics.inertia(z, p)

    def inertial_force_in_lengths(self, z: Lanes, p: Parameters, velocity: Velocity) -> Velocity:
        """Γ of a rod of mass 1."""
        return self.mechanics.inertial_force(z, p, velocity)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""
        value, place = self.mechanics.largest_curvature(z, p)
        return value * self.units.value("curvature"), place
