"""Mechanics of the clamped rod: energy, residual, derivatives and solves in batches."""

from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Bool, Float

from equimorph.linalg import BorderedSolution, CondensedLayout, multiply
from equimorph.linalg.condensed import PIVOT_GUARD
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import Advance, Direction, Structure, Symmetry
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.kernels import advance_lanes
from equimorph.structures.rod.loads import LoadShape
from equimorph.structures.rod.recovery import Recovery

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]
Nodal = Float[np.ndarray, "lanes nodes"]


def _contiguous(*arrays: np.ndarray) -> list[np.ndarray]:
    return [np.ascontiguousarray(array) for array in arrays]


class RodMechanics(Structure):
    """Everything about the rod that needs no continuation and no names: see `Rod`.

    L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load
    weights R = m ρ and K the stiffness over 4π². Parameters (Θ, Δ, q, ν), multipliers (λ, μ).
    """

    kind: ClassVar[str] = "rod"
    constraints = 2

    def __init__(self, mesh: Mesh, load: LoadShape) -> None:
        self.mesh, self.load = mesh, load
        self.rho = load.cumulated(mesh)
        self.loads = mesh.assemble(self.rho)
        scaled = mesh.stiffness / (4.0 * np.pi**2)
        self.layout = CondensedLayout(scaled, np.array([1, mesh.elements - 1]))
        self.unknowns = len(mesh.nodes) - 2
        self.mass = mesh.weights[1:-1].copy()

    # --- fields -----------------------------------------------------------------------------

    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""
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
        return self.recovery.fields(np.ascontiguousarray(z), np.ascontiguousarray(p), s)

    def largest_curvature(
        self, z: Lanes, p: Parameters
    ) -> tuple[Float[np.ndarray, " lanes"], Float[np.ndarray, " lanes"]]:
        """max_s |κ(s)|, ends and interior extrema included, and the arclength where it occurs."""
        z, p = np.ascontiguousarray(z), np.ascontiguousarray(p)
        return self.recovery.largest_curvature(z, p)

    def _coefficients(self, z: Lanes, p: Parameters) -> tuple[Nodal, Nodal]:
        """Factors a of sin θᵢ and b of cos θᵢ in L."""
        lam, mu = z[:, -2:-1], z[:, -1:]
        return mu * self.mesh.weights - p[:, 2:3] * self.loads, lam * self.mesh.weights

    def _gradient(self, z: Lanes, p: Parameters) -> Nodal:
        """∂L/∂θ at all nodes, the prescribed ends included."""
        theta = self.nodal_angles(z, p)
        a, b = self._coefficients(z, p)
        bending = multiply(theta, self.layout.assembled)
        return np.asarray(bending + a * np.cos(theta) - b * np.sin(theta))

    def _border(self, theta: Nodal) -> Float[np.ndarray, "lanes 2 nodes"]:
        weights = self.mesh.weights
        return np.stack([-weights * np.sin(theta), weights * np.cos(theta)], axis=1)

    # --- contract ---------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Float[np.ndarray, " lanes"]:
        """∫ θ'²/(8π²) − q ∫ ρ sin θ."""
        theta = self.nodal_angles(z, p)
        bending = 0.5 * np.einsum("li,li->l", multiply(theta, self.layout.assembled), theta)
        return np.asarray(bending - p[:, 2] * multiply(np.sin(theta), self.loads))

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """(∂L/∂θ at the inner nodes, ∫cos θ − ν, ∫ sin θ)."""
        theta, weights = self.nodal_angles(z, p), self.mesh.weights
        closing = [multiply(np.cos(theta), weights) - p[:, 3], multiply(np.sin(theta), weights)]
        return np.concatenate([self._gradient(z, p)[:, 1:-1], np.stack(closing, 1)], axis=1)

    def _spread(self, direction: Direction) -> tuple[Nodal, Nodal, Nodal]:
        """Nodal angles of a direction, and the changes of the factors of sin θ and cos θ."""
        dz, dp = direction
        weights = self.mesh.weights
        change = dz[:, -1:] * weights - dp[:, 2:3] * self.loads
        return self.nodal_angles(dz, dp), change, dz[:, -2:-1] * weights

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        theta = self.nodal_angles(z, p)
        moved, change, _ = self._spread((np.zeros_like(z), dp))
        a, b = self._coefficients(z, p)
        gradient = multiply(moved, self.layout.assembled) + change * np.cos(theta)
        gradient -= (a * np.sin(theta) + b * np.cos(theta)) * moved
        closing = np.einsum("lmi,li->lm", self._border(theta), moved)
        closing[:, 0] -= dp[:, 3]
        return np.concatenate([gradient[:, 1:-1], closing], axis=1)

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        theta, weights = self.nodal_angles(z, p), self.mesh.weights
        sine, cosine = np.sin(theta), np.cos(theta)
        a, b = self._coefficients(z, p)
        (v_t, v_a, v_b), (w_t, w_a, w_b) = self._spread(v), self._spread(w)
        gradient = (b * sine - a * cosine) * v_t * w_t
        gradient -= sine * (v_a * w_t + w_a * v_t) + cosine * (v_b * w_t + w_b * v_t)
        product = v_t * w_t
        closing = [-multiply(cosine * product, weights), -multiply(sine * product, weights)]
        return np.concatenate([gradient[:, 1:-1], np.stack(closing, 1)], axis=1)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂(Θ, Δ, q, ν): actuator couples, ∫Qy, −λ."""
        gradient, theta = self._gradient(z, p), self.nodal_angles(z, p)
        first, last = gradient[:, 0], gradient[:, -1]
        lift = -multiply(np.sin(theta), self.loads)
        return np.stack([first - last, first + last, lift, -z[:, -2]], axis=1)

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: tuple[Any, Any, Any] | None = None,
        shift: Float[np.ndarray, " lanes"] | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        theta = self.nodal_angles(z, p)
        a, b = self._coefficients(z, p)
        diagonal = -a * np.sin(theta) - b * np.cos(theta)
        if shift is not None:
            diagonal -= shift[:, None] * self.mesh.weights
        lanes = len(z)
        if border is None:
            nothing = np.zeros((lanes, 0, self.size))
            border = (nothing, nothing, np.zeros((lanes, 0, 0)))
        columns, rows, corner = border
        return self.layout.solve(diagonal, self._border(theta), columns, rows, corner, rhs)

    def advance(
        self,
        z: Lanes,
        p: Parameters,
        dp: Parameters,
        row: Lanes,
        corner: Float[np.ndarray, " lanes"],
        defect: Float[np.ndarray, " lanes"],
    ) -> Advance:
        """Fused kernel; lanes with an unsafe pivot take the general solve."""
        lanes = len(z)
        inputs = _contiguous(z, p, dp, row, corner, defect)
        out = Advance(
            np.empty_like(inputs[0]),
            np.empty(lanes),
            np.empty_like(inputs[0]),
            np.empty(lanes),
            np.empty(lanes),
            np.empty(lanes, dtype=np.int64),
        )
        ratio = np.empty(lanes)
        shared = (self.layout.stiffness, self.layout.ends, self.mesh.weights, self.loads)
        outputs = (out.dz, out.dt, out.tangent_z, out.tangent_t, out.residual, out.index, ratio)
        over_lanes(advance_lanes, shared, inputs, outputs)
        unsafe = ~(ratio >= PIVOT_GUARD)
        if unsafe.any():
            again = super().advance(*(x[unsafe] for x in inputs))
            for name in ("dz", "dt", "tangent_z", "tangent_t", "residual", "index"):
                getattr(out, name)[unsafe] = getattr(again, name)
        return out

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Linear angles plus random sine waves, with random support forces."""
        lanes, s = len(p), self.mesh.nodes[1:-1]
        modes = np.arange(1, 6)
        waves = np.sin(np.pi * np.outer(modes, s))
        amplitude = generator.normal(size=(lanes, len(modes))) * (3.0 / modes)
        base = (p[:, 1] + p[:, 0])[:, None] * (1 - s) + (p[:, 1] - p[:, 0])[:, None] * s
        forces = generator.normal(size=(lanes, 2)) * 4.0
        return np.concatenate([base + amplitude @ waves, forces], axis=1)

    def resolved(self, z: Lanes, p: Parameters) -> Bool[np.ndarray, " lanes"]:
        """Whether the highest Legendre coefficient of θ is small in every element."""
        theta = self.nodal_angles(z, p)[:, self.mesh.element_nodes]
        tail = np.abs(theta @ self.mesh.reference.to_legendre[-2:].T)
        return np.asarray(tail.max(axis=(1, 2)) < 1e-3)

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 2"]:
        """Positions (x, y) at arclengths `s` (default: 101 equidistant ones), in units of L."""
        at = np.linspace(0.0, 1.0, 101) if s is None else np.asarray(s, dtype=float)
        return self.fields(z, p, at)[:, :, 2:]

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
