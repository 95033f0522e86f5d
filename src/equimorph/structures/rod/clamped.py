"""PlanarMechanics of the clamped rod: energy, residual, derivatives and solves in batches."""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Nodal, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution, CondensedLayout, multiply, no_border
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import Symmetry
from equimorph.structures.equations import (
    Advance,
    AnyBorder,
    Direction,
    LinearSystem,
    Majorant,
    Shift,
)
from equimorph.structures.rod.clamped_derivative_kernels import (
    linearise_lanes,
    matrix_lanes,
    parameter_lanes,
    residual_lanes,
    second_lanes,
)
from equimorph.structures.rod.clamped_kernels import advance_lanes
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.fields import ClampedFields
from equimorph.structures.rod.inertia import inextensible_inertia
from equimorph.structures.rod.mechanics import PlanarMechanics
from equimorph.structures.rod.profiles import LoadShape
from equimorph.structures.rod.units import FOUR_PI_SQUARED

PARAMETERS = 4
"""Number of parameters: Θ, Δ, q, ν."""
MORE = 1.0 + 1e-12
"""Covers the round-off of the bounds of second derivatives."""


class ClampedMechanics(PlanarMechanics):
    """PlanarMechanics of the uniform rod between two clamps under one vertical line load.

    L = Σ ½ θᵀKθ + Σᵢ (μ mᵢ − q Rᵢ) sin θᵢ + λ mᵢ cos θᵢ − λν with quadrature weights m, load
    weights R = m ρ and K the stiffness over 4π². Parameters (Θ, Δ, q, ν), multipliers (λ, μ).
    """

    constraints = 2
    parameters = PARAMETERS
    held = (True, True)

    def __init__(self, mesh: Mesh, load: LoadShape) -> None:
        self.mesh, self.load = mesh, load
        self.rho = load.cumulate(mesh)
        self.loads = mesh.assemble(self.rho)
        scaled = mesh.stiffness / FOUR_PI_SQUARED
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

    @property
    def unknown_nodes(self) -> slice:
        """All but the ends."""
        return slice(1, -1)

    # --- fields -----------------------------------------------------------------------------

    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""
        z, p = self.check_widths((z, p))
        theta = np.empty((len(z), self.unknowns + 2))
        theta[:, 1:-1] = z[:, : self.unknowns]
        theta[:, 0], theta[:, -1] = p[:, 1] + p[:, 0], p[:, 1] - p[:, 0]
        return theta

    @cached_property
    def recovery(self) -> ClampedFields:
        """Fields inside elements with the accuracy of the vertices."""
        return ClampedFields(self.mesh, self.load, self.layout.stiffness, self.rho)

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths, recovered from the vertices."""
        z, p = self.check_widths((z, p))
        return self.recovery.fields(z, p, s)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)|, ends and interior extrema included, and the first arclength where it is."""
        z, p = self.check_widths((z, p))
        return self.recovery.largest_curvature(z, p)

    def kkt(
        self, z: Lanes, p: Parameters, shift: Shift = None
    ) -> tuple[Nodal, Float[np.ndarray, "lanes 2 nodes"]]:
        """F_z − shift·mass as `layout` takes it: diagonal to add to the stiffness, constraints."""
        z, p = self.check_widths((z, p))
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
        z, p = self.check_widths((z, p))
        out, ends = np.empty_like(z), np.empty((len(z), 3))
        over_lanes(residual_lanes, self._matrices, [z, p], [out, ends])
        return out, ends

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        z, p, _, dp = self.check_widths((z, p), (z, dp))
        out = np.empty_like(z)
        over_lanes(parameter_lanes, self._matrices, [z, p, dp], [out])
        return out

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        arrays = self.check_widths((z, p), v, w)
        out = np.empty_like(arrays[0])
        over_lanes(second_lanes, self._matrices[1:], arrays, [out])
        return out

    def second_derivative_bound(self, z: Lanes, p: Parameters, reach: Direction) -> Majorant:
        """Bound of |D²F| over boxes; see `ClampedBound`."""
        weights, theta = self.mesh.weights, self.nodal_angles(z, p)
        across = z[:, -1:] * weights - p[:, 2:3] * self.loads
        along = z[:, -2:-1] * weights
        return clamped_bound(theta, across, along, reach, weights, self.loads)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂(Θ, Δ, q, ν): actuator couples, ∫Qy, −λ."""
        first, last, lift = self._residual(z, p)[1].T
        return np.stack([first - last, first + last, lift, -z[:, -2]], axis=1)

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """JᵀWJ of the inner nodes' angles."""
        return inextensible_inertia(self.mesh, self.nodal_angles(z, p))[:, 1:-1, 1:-1]

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        return self._solve(*self.kkt(z, p, shift), rhs, border)

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
        """One kernel for F, F_p along directions and the matrix."""
        z, p = self.check_widths((z, p))
        (lanes, k, _), nodes = directions.shape, self.unknowns + 2
        given = [z, p, np.ascontiguousarray(directions)]
        residual, columns = np.empty_like(z), np.empty((lanes, k, self.size))
        diagonal, gradients = np.empty((lanes, nodes)), np.empty((lanes, 2, nodes))
        out = [residual, columns, diagonal, gradients]
        over_lanes(linearise_lanes, self._matrices, given, out)
        return LinearSystem(residual, columns, partial(self._solve, diagonal, gradients))

    def _solve(
        self,
        diagonal: Nodal,
        gradients: Float[np.ndarray, "lanes 2 nodes"],
        rhs: Sides,
        border: AnyBorder,
    ) -> BorderedSolution:
        """Solve with F_z, given by its parts, bordered."""
        around = no_border(len(rhs), self.size) if border is None else border
        return self.layout.solve(diagonal, gradients, *around, rhs)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One fused kernel."""
        given = (z, p, dp, row, corner, defect)
        return self.fused_advance(advance_lanes, self._step_data, *given)

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


# --- bounds of the second derivatives over boxes of states --------------------------------------


@dataclass(frozen=True)
class ClampedBound:
    """``|D²F[v, w]|`` for F = Kθ + a cos θ − b sin θ, ∫cos θ − ν, ∫sin θ; a = μm − qR, b = λm.

    ``D²F = −(a cos θ − b sin θ) η_v η_w − (α_v sin θ + β_v cos θ) η_w − …`` with η, α, β the
    changes of θ, a, b; the constraints' are ``−Σ m cos θ η_v η_w`` and ``−Σ m sin θ η_v η_w``.

    Parameters
    ----------
    weights, loads
        m and |R| at all nodes.
    curving, sine, cosine
        Bounds of |a cos θ − b sin θ|, |sin θ| and |cos θ| over each box, at all nodes.
    """

    weights: Float[np.ndarray, " nodes"]
    loads: Float[np.ndarray, " nodes"]
    curving: Nodal
    sine: Nodal
    cosine: Nodal

    def __call__(self, v: Direction, w: Direction) -> Lanes:
        """Bound along directions with entries ≥ 0."""
        (turn_v, up_v, along_v), (turn_w, up_w, along_w) = self._changes(v), self._changes(w)
        both = turn_v * turn_w
        rows = self.curving * both
        rows += (up_v * self.sine + along_v * self.cosine) * turn_w
        rows += (up_w * self.sine + along_w * self.cosine) * turn_v
        closing = [(self.weights * each * both).sum(axis=1) for each in (self.cosine, self.sine)]
        return np.concatenate([rows[:, 1:-1], np.stack(closing, axis=1)], axis=1) * MORE

    def _changes(self, v: Direction) -> tuple[Nodal, Nodal, Nodal]:
        """|η|, |α| and |β| at all nodes."""
        dz, dp = v
        turn = spread_to_ends(dz, dp)
        up = dz[:, -1:] * self.weights + dp[:, 2:3] * self.loads
        return turn, up, dz[:, -2:-1] * self.weights


def spread_to_ends(reach: Lanes, ends: Parameters) -> Nodal:
    """Changes of the angles at all nodes; those of the ends are |Θ| + |Δ|."""
    outer = ends[:, :1] + ends[:, 1:2]
    return np.concatenate([outer, reach[:, :-2], outer], axis=1)


def clamped_bound(
    theta: Nodal,
    across: Nodal,
    along: Nodal,
    reach: Direction,
    weights: Float[np.ndarray, " nodes"],
    loads: Float[np.ndarray, " nodes"],
) -> ClampedBound:
    """`ClampedBound` over boxes around angles θ and forces a (across) and b (along).

    `reach` is half the width of each box.
    """
    a, b = across, along
    turn = spread_to_ends(*reach)
    more_a = reach[0][:, -1:] * weights + reach[1][:, 2:3] * np.abs(loads)
    more_b = reach[0][:, -2:-1] * weights
    sine, cosine = np.sin(theta), np.cos(theta)
    largest = np.hypot(np.abs(a) + more_a, np.abs(b) + more_b)
    curving = np.abs(a * cosine - b * sine) + more_a + more_b + turn * largest
    return ClampedBound(
        weights,
        np.abs(loads),
        np.minimum(curving, largest),
        np.minimum(np.abs(sine) + turn, 1.0),
        np.minimum(np.abs(cosine) + turn, 1.0),
    )
