"""Mechanics of the clamped rod: energy, residual, derivatives and solves in batches."""

from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Nodal, Parameters, Values
from equimorph.errors import InputError
from equimorph.linalg import BorderedSolution, CondensedLayout, multiply
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import Advance, Direction, Majorant, Symmetry
from equimorph.structures.rod.bounds import clamped_bound
from equimorph.structures.rod.derivatives.kernels import (
    matrix_lanes,
    parameter_lanes,
    residual_lanes,
    second_lanes,
)
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.interface import Mechanics
from equimorph.structures.rod.kernels import advance_lanes
from equimorph.structures.rod.loads import LoadShape
from equimorph.structures.rod.recovery import Recovery

PARAMETERS = 4


class ClampedMechanics(Mechanics):
    """Mechanics of the uniform rod between two clamps under one vertical line load.

    L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load
    weights R = m ρ and K the stiffness over 4π². Parameters (Θ, Δ, q, ν), multipliers (λ, μ).
    """

    constraints = 2
    held = (True, True)

    def __init__(self, mesh: Mesh, load: LoadShape) -> None:
        self.mesh, self.load = mesh, load
        self.rho = load.cumulated(mesh)
        self.loads = mesh.assemble(self.rho)
        scaled = mesh.stiffness / (4.0 * np.pi**2)
        self.layout = CondensedLayout(scaled, np.array([1, mesh.elements - 1]))
        self.unknowns = len(mesh.nodes) - 2
        self.mass = mesh.weights[1:-1].copy()

    @cached_property
    def _matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stiffness, quadrature weights and load weights, as the kernels take them."""
        return self.layout.stiffness, self.mesh.weights, self.loads

    @cached_property
    def _step_data(self) -> tuple[np.ndarray, ...]:
        """What the fused step shares among lanes."""
        return self.layout.stiffness, self.layout.ends, self.mesh.weights, self.loads

    def _checked(self, *pairs: Direction) -> list[np.ndarray]:
        """States and directions (z, p) as contiguous arrays of the right widths, for the kernels.

        Kernels do not check what they read.
        """
        lanes = len(pairs[0][0])
        shapes = (lanes, self.size), (lanes, PARAMETERS)
        for pair in pairs:
            if (pair[0].shape, pair[1].shape) != shapes:
                wrong = int(pair[0].shape == shapes[0])
                raise InputError(
                    f"`{'zp'[wrong]}` must have shape {shapes[wrong]}; got {pair[wrong].shape}. "
                    "States belong to the rod, and the resolution, that made them."
                )
        return [np.ascontiguousarray(array) for pair in pairs for array in pair]

    @property
    def unknown_nodes(self) -> slice:
        """All but the ends."""
        return slice(1, -1)

    # --- fields -----------------------------------------------------------------------------

    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""
        z, p = self._checked((z, p))
        theta = np.empty((len(z), self.unknowns + 2))
        theta[:, 1:-1] = z[:, : self.unknowns]
        theta[:, 0], theta[:, -1] = p[:, 1] + p[:, 0], p[:, 1] - p[:, 0]
        return theta

    @cached_property
    def recovery(self) -> Recovery:
        """Fields inside elements with the accuracy of the vertices."""
        return Recovery(self.mesh, self.load, self.layout.stiffness, self.rho)

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        z, p = self._checked((z, p))
        return self.recovery.fields(z, p, s)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the first arclength where it is."""
        z, p = self._checked((z, p))
        return self.recovery.largest_curvature(z, p)

    def kkt(
        self, z: Lanes, p: Parameters, shift: Values | None = None
    ) -> tuple[Nodal, Float[np.ndarray, "lanes 2 nodes"]]:
        """F_z − shift·mass as `layout` takes it: diagonal beside the stiffness, constraints."""
        z, p = self._checked((z, p))
        lanes, nodes = len(z), self.unknowns + 2
        diagonal, gradients = np.empty((lanes, nodes)), np.empty((lanes, 2, nodes))
        moved = np.zeros(lanes) if shift is None else np.ascontiguousarray(shift)
        over_lanes(matrix_lanes, self._matrices[1:], [z, p, moved], [diagonal, gradients])
        return diagonal, gradients

    # --- contract ---------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """∫ θ'²/(8π²) − q ∫ ρ sin θ."""
        theta = self.nodal_angles(z, p)
        bending = 0.5 * np.einsum("li,li->l", multiply(theta, self.layout.assembled), theta)
        return np.asarray(bending - p[:, 2] * multiply(np.sin(theta), self.loads))

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """(∂L/∂θ at the inner nodes, ∫cos θ − ν, ∫ sin θ)."""
        return self._residual(z, p)[0]

    def _residual(self, z: Lanes, p: Parameters) -> tuple[Lanes, Float[np.ndarray, "lanes 3"]]:
        """F, and ∂L/∂(θ(0), θ(1), q)."""
        z, p = self._checked((z, p))
        out, ends = np.empty_like(z), np.empty((len(z), 3))
        over_lanes(residual_lanes, self._matrices, [z, p], [out, ends])
        return out, ends

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        z, p, _, dp = self._checked((z, p), (z, dp))
        out = np.empty_like(z)
        over_lanes(parameter_lanes, self._matrices, [z, p, dp], [out])
        return out

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        arrays = self._checked((z, p), v, w)
        out = np.empty_like(arrays[0])
        over_lanes(second_lanes, self._matrices[1:], arrays, [out])
        return out

    def second_derivative_bound(self, z: Lanes, p: Parameters, reach: Direction) -> Majorant:
        """Bound of |D²F| over boxes; see `ClampedBound`."""
        weights, theta = self.mesh.weights, self.nodal_angles(z, p)
        forces = z[:, -1:] * weights - p[:, 2:3] * self.loads, z[:, -2:-1] * weights
        return clamped_bound(theta, forces, reach, weights, self.loads)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂(Θ, Δ, q, ν): actuator couples, ∫Qy, −λ."""
        first, last, lift = self._residual(z, p)[1].T
        return np.stack([first - last, first + last, lift, -z[:, -2]], axis=1)

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: tuple[Any, Any, Any] | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        diagonal, gradients = self.kkt(z, p, shift)
        if border is None:
            nothing = np.zeros((len(z), 0, self.size))
            border = (nothing, nothing, np.zeros((len(z), 0, 0)))
        columns, rows, corner = border
        return self.layout.solve(diagonal, gradients, columns, rows, corner, rhs)

    def advance(
        self,
        z: Lanes,
        p: Parameters,
        dp: Parameters,
        row: Lanes,
        corner: Values,
        defect: Values,
    ) -> Advance:
        """Fused kernel; lanes with an unsafe pivot take the general solve."""
        lanes = len(z)
        z, p, row, dp = self._checked((z, p), (row, dp))
        inputs = [z, p, dp, row, np.ascontiguousarray(corner), np.ascontiguousarray(defect)]
        # one block each: what is freed at once stays with the process and is not mapped anew
        dz, tangent_z = np.empty((2, lanes, self.size))
        dt, tangent_t, residual, determinant, ratio = np.empty((5, lanes))
        index = np.empty(lanes, dtype=np.int64)
        outputs = (dz, dt, tangent_z, tangent_t, residual, index, determinant, ratio)
        over_lanes(advance_lanes, self._step_data, inputs, outputs)
        out = Advance(*outputs[:-1])
        if not ratio.min(initial=1.0) >= PIVOT_GUARD:
            unsafe = ~(ratio >= PIVOT_GUARD)
            again = self.plain_advance(*(x[unsafe] for x in inputs))
            for name, column in vars(again).items():
                getattr(out, name)[unsafe] = column
        return out

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Linear angles plus random sine waves, with random support forces.

        Eight waves and forces up to about 16 reach the compressed shapes with max |κ| near 20.
        """
        lanes, s = len(p), self.mesh.nodes[1:-1]
        modes = np.arange(1, 9)
        waves = np.sin(np.pi * np.outer(modes, s))
        amplitude = generator.normal(size=(lanes, len(modes))) * (3.0 / modes)
        amplitude *= generator.uniform(size=(lanes, 1))
        base = (p[:, 1] + p[:, 0])[:, None] * (1 - s) + (p[:, 1] - p[:, 0])[:, None] * s
        forces = generator.normal(size=(lanes, 2)) * 8.0
        return np.concatenate([base + amplitude @ waves, forces], axis=1)

    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """λ and μ."""
        return z[:, -2:].copy()

    def end_moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """∂L/∂θ(0) and ∂L/∂θ(1)."""
        return self._residual(z, p)[1][:, :2].copy()

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror x → ν − x for symmetric loads: θ(s) → −θ(1 − s), Δ → −Δ."""
        nodes, points = self.mesh.nodes, np.linspace(0.013, 0.487, 40)
        density = self.load.density
        if not np.allclose(density(points), density(1.0 - points), atol=1e-12):
            return ()
        if not np.allclose(nodes, 1.0 - nodes[::-1], atol=1e-12):
            return ()
        return (Symmetry("mirror", self._mirror, np.array([1.0, -1.0, 1.0, 1.0])),)

    def _mirror(self, z: Lanes, p: Parameters) -> tuple[Lanes, Parameters]:
        """θ(s) → −θ(1 − s), μ → q∫Q − μ, Δ → −Δ."""
        n, total = self.unknowns, self.rho[-1, -1]
        image = z.copy()
        image[:, :n] = -z[:, :n][:, ::-1]
        image[:, -1] = p[:, 2] * total - z[:, -1]
        return image, p * np.array([1.0, -1.0, 1.0, 1.0])
