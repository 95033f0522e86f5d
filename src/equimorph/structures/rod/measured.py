"""Rods as structures: mechanics inside, the user's units outside."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.linalg import Border, BorderedSolution
from equimorph.structures.approach import smooth_arcs
from equimorph.structures.contract import Structure, Symmetry
from equimorph.structures.equations import Advance, Direction, LinearSystem, Majorant
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.mechanics import Mechanics
from equimorph.structures.rod.units import Units

ARCS = 128
"""Number of cubic arcs along a rod: their error is below 1e-10 for κ = 10."""


class Measured(Structure):
    """Everything of a rod that its mechanics compute, in the user's units.

    Unknowns, multipliers, residuals and energies are non-dimensional; parameters, shapes and
    descriptors are in the user's units.
    """

    mechanics: Mechanics
    units: Units

    @property
    def mesh(self) -> Mesh:
        """Elements along the rod."""
        return self.mechanics.mesh

    def nodal_angles(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes"]:
        """Angles θ at all nodes, the prescribed ends included."""
        return self.mechanics.nodal_angles(z, p)

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        length = self.units.value("length")
        units = np.array([1.0, self.units.value("curvature"), length, length])
        return np.asarray(self.mechanics.fields(z, p, s) * units)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""
        value, place = self.mechanics.largest_curvature(z, p)
        return value * self.units.value("curvature"), place

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E."""
        return self.mechanics.energy(z, p)

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return self.mechanics.residual(z, p)

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return self.mechanics.parameter_derivative(z, p, dp)

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        return self.mechanics.second_derivative(z, p, v, w)

    def second_derivative_bound(self, z: Lanes, p: Parameters, reach: Direction) -> Majorant | None:
        """Bound of D²F over boxes, where the mechanics know one."""
        return self.mechanics.second_derivative_bound(z, p, reach)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: couples of actuators, displacements of loads."""
        return self.mechanics.effort(z, p)

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        return self.mechanics.solve(z, p, rhs, border, shift)

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
        """F, F_p along directions, and solves with F_z; computed together."""
        return self.mechanics.linear_system(z, p, directions)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """Fused Newton step, tangent and inertia."""
        return self.mechanics.advance(z, p, dp, row, corner, defect)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random guesses."""
        return self.mechanics.sample(p, generator)

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the highest Legendre coefficients of θ are small in every element."""
        return self.mechanics.resolved(z, p)

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images of equilibria that are equilibria."""
        return self.mechanics.symmetries()

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 2"]:
        """Positions (x, y) at arclengths `s` (default: 101 equidistant ones)."""
        at = np.linspace(0.0, 1.0, 101) if s is None else np.asarray(s, dtype=float)
        return self.fields(z, p, at)[:, :, 2:]

    def arcs(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes arcs 4 2"]:
        """Shape as cubic arcs with the rod's positions and angles at their ends."""
        fields = self.fields(z, p, np.linspace(0.0, 1.0, ARCS + 1))
        return smooth_arcs(fields[:, :, 2:], fields[:, :, 0], self.units.value("length") / ARCS)
