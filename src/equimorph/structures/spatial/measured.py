"""Rods in space as structures: mechanics inside, the user's units outside."""

from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.linalg import Border, BorderedSolution
from equimorph.structures.contract import Structure, Symmetry
from equimorph.structures.equations import Advance, Direction, LinearSystem
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.units import Units
from equimorph.structures.spatial.fields import Fields, SpatialFields
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.symmetry import symmetries

ARCS = 128
"""Number of cubic arcs along a rod: their error is below 1e-10 for κ = 10."""


class MeasuredInSpace(Structure):
    """Everything of a rod in space that its mechanics compute, in the user's units.

    Unknowns, multipliers, residuals and energies are non-dimensional; parameters, shapes and
    descriptors are in the user's units.
    """

    mechanics: SpatialMechanics
    units: Units

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E, in units of 4π²B/L."""
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

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: couples and forces of actuators, displacements of loads."""
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
        """One Newton step, with tangent and inertia."""
        return self.mechanics.advance(z, p, dp, row, corner, defect)

    def index(self, z: Lanes, p: Parameters) -> Int[np.ndarray, " lanes"]:
        """Negative eigenvalues of the constrained Hessian."""
        return self.mechanics.index(z, p)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random guesses."""
        return self.mechanics.sample(p, generator)

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the highest Legendre coefficients of the rotations are small in every element."""
        return self.mechanics.resolved(z, p)

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns of equilibria that are equilibria."""
        return self._symmetries

    @cached_property
    def _symmetries(self) -> tuple[Symmetry, ...]:
        return symmetries(self.mechanics.model, self.unknowns)

    # --- shapes ---------------------------------------------------------------------------------

    @property
    def mesh(self) -> Mesh:
        """Elements along the rod."""
        return self.mechanics.mesh

    @cached_property
    def recovery(self) -> SpatialFields:
        """Fields along the rod, non-dimensional."""
        return SpatialFields(self.mechanics)

    def fields(self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]) -> Fields:
        """Rotations, places and strains at arclengths, in the user's units."""
        found = self.recovery.at(z, p, s)
        length, bend = self.units.value("length"), self.units.value("curvature")
        return Fields(found.rotations, length * found.places, bend * found.strains)

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3"]:
        """Positions (x, y, z) at arclengths `s` (default: 101 equidistant ones)."""
        return self.fields(z, p, _arclengths(s)).places

    def frames(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 3 3"]:
        """Axes of the cross-sections at arclengths `s`: the columns of each matrix are t, n, b."""
        return self.recovery.at(z, p, _arclengths(s)).frames

    @property
    def flatness(self) -> float:
        """Width over thickness of a rectangle with the rod's mean ratio of bending stiffnesses."""
        model = self.mechanics.model
        _, aside, bend = model.stiffness.reshape(-1, 3).mean(axis=0)
        return float(np.sqrt(aside / bend))

    def arcs(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes arcs 4 3"]:
        """Shape as cubic arcs with the rod's positions and tangents at their ends."""
        fields = self.fields(z, p, np.linspace(0.0, 1.0, ARCS + 1))
        rate = fields.frames[..., 0] * (self.units.value("length") / ARCS)
        places = fields.places
        return np.stack([places[:, :-1], places[:, 1:], rate[:, :-1], rate[:, 1:]], axis=2)


def _arclengths(s: Float[np.ndarray, " points"] | None) -> Float[np.ndarray, " points"]:
    return np.linspace(0.0, 1.0, 101) if s is None else np.asarray(s, dtype=float)
