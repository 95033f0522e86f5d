"""Rods between coaxial clamps whose states are pinned on their orbits by a phase condition.

Where the bending stiffnesses are equal and nothing acts across the axis of the clamps, a state off
the axis may be turned about it with all forces, its cross-sections turned back,
``q → exp(e₁ α/2) q exp(−e₁ α/2)``: its orbit under SO(2). F_z is singular along ξ, the velocity of
this turn. The condition ``c = ∫ g t_z ds = 0`` with a multiplier μ pins the orbit. L is constant
along it, so that ``μ (ξ·∇c) = 0``: with ``ξ·∇c = ∫ g t_y ds ≠ 0`` no force remains, equilibria are
those of the rod, and the direction ξ is among the constraints: neither negative nor zero.

On the axis ξ = 0, there is nothing to pin, and the condition is void: μ = 0 stands in its place.
Eigenvalues of F_z with modes across the axis are double there: a mode and the same a quarter turn
on. Where a pair vanishes, a circle of orbits branches off, of which the condition picks two states,
as at a pitchfork. So bordered solves hold the mode of the pair nearest to zero that the condition
holds: one null vector is left, that of the branch. Steps tell the product of the pairs' eigenvalues
as determinant, each once: it changes its sign where the index changes by two.
See docs/decisions.md, "Orbits" and "Pairs of eigenvalues on the axis".
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution
from equimorph.linalg.dense import no_border
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import Symmetry
from equimorph.structures.equations import Advance, AnyBorder, Direction, Equations, Shift
from equimorph.structures.metric import metric_length
from equimorph.structures.spatial.lagrangian import HALF_TURN
from equimorph.structures.spatial.mechanics import SpatialMechanics, condition_tables
from equimorph.structures.spatial.phase_condition import phase_of, phase_weight
from equimorph.structures.spatial.phase_kernels import condition_lanes
from equimorph.structures.spatial.quaternions import Jet
from equimorph.structures.spatial.step_kernels import advance_lanes

ON_AXIS = 1e-10
"""Length of ξ in the metric below which a state lies on the axis."""
NEAR_PAIR, INVERSE, RAYLEIGH = 1e-7, 3, 2
"""Distance from an eigenvalue at which inverse iteration looks for it: nearer, round-off parts the
pair and turns its mode; steps of it near zero, and then near the quotient, which cube the error."""
NO_FORCE = 1e-8
"""Multiplier of the phase condition that is none, in units of 4π²B/L²."""


class PinnedMechanics(SpatialMechanics):
    """Mechanics of a rod on whose orbits the phase condition picks one state, and that opposite."""

    def on_axis(self, z: Lanes) -> Flags:
        """Whether states are those that the turn leaves as they are: ξ = (0, 0, −q₃, q₂)."""
        q, n = z[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4), self.unknowns
        square = np.einsum("lna,lna,n->l", q[..., 2:], q[..., 2:], self.mass[2:n:4])
        return np.asarray(square < ON_AXIS**2)

    def equations(self, z: Lanes, p: Parameters, *directions: Direction, mixed: bool = True) -> Jet:
        """F with its derivatives along none, one or two directions, and the mixed one if asked."""
        void = self.on_axis(z)
        if not void.any():
            return super().equations(z, p, *directions, mixed=mixed)
        given, moves = z.copy(), [(dz.copy(), dp) for dz, dp in directions]
        given[void, -1] = 0.0
        for dz, _ in moves:
            dz[void, -1] = 0.0
        out = super().equations(given, p, *moves, mixed=mixed)
        out[:, void, -1] = 0.0
        for part, values in zip(out, (z, *(dz for dz, _ in directions)), strict=False):
            part[void, -1] = -values[void, -1]
        return out

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered: that of the rod itself, with two borders more.

        That of the condition, ∂F/∂μ; and that which takes out a spring against the turn of one
        cross-section about the axis, with which F_z of the rod itself is regular. On the axis a
        border, as is given to nearly singular matrices, lets the condition hold one of a pair.
        """
        on_axis, below = self.on_axis(z), np.zeros(len(z), bool)
        own = self._condition(z, p, on_axis)[0]
        void = np.flatnonzero(on_axis) if border is not None else np.zeros(0, int)
        if len(void):
            shifts = None if shift is None else shift[void]
            own[void], below[void] = self._hold_pairs(z[void], p[void], shifts)
        around = no_border(len(z), self.size) if border is None else border
        springs, turn = self._springs(z, on_axis)
        columns, rows = (
            np.concatenate([own[:, None, :-1], turn[:, None], each[..., :-1]], axis=1)
            for each in around[:2]
        )
        k = columns.shape[1]
        corner = np.zeros((len(z), k, k))
        corner[:, 0, 0], corner[:, 1, 1], corner[:, 2:, 2:] = own[:, -1], 1.0, around[2]
        corner[:, 0, 2:], corner[:, 2:, 0] = around[0][..., -1], around[1][..., -1]
        mu = np.where(on_axis, 0.0, z[:, -1])
        found = self.bare.eliminate(
            z[:, :-1],
            np.concatenate([mu[:, None], p], axis=1),
            np.insert(rhs, self.size, 0.0, axis=-1),
            (columns, rows, corner),
            shift,
            springs,
        )
        found = replace(found, x=np.delete(found.x, self.size, axis=-1))
        found = self.pivot(found, z, p, rhs, around, shift, own)
        found.negative[below] += 1
        return found

    @np.errstate(divide="ignore", invalid="ignore")
    def _hold_pairs(self, z: Lanes, p: Parameters, shift: Shift) -> tuple[Lanes, Flags]:
        """Conditions on the axis that hold one of the pair nearest to zero; if that is negative.

        By inverse iteration on the gradient of the condition: the mode of the pair that has it, the
        only one of the two on which the condition depends. Lanes whose forces grow beyond all
        bounds on the way have none, and their corrections are not finite.
        """
        n, lanes = self.unknowns, len(z)
        bare = np.concatenate([z[:, :-1], np.zeros((lanes, 1))], axis=1)
        side = self._condition(bare, p, np.zeros(lanes, bool))[0]
        given = np.zeros(lanes) if shift is None else shift
        mode, value = side[:, :n] / self.mass, np.zeros(lanes)
        for number in range(INVERSE + RAYLEIGH):
            mode /= metric_length(self, mode)[:, None]
            side[:, :n], side[:, n:] = self.mass * mode, 0.0
            near = value - NEAR_PAIR
            yielding = self.solve(z, p, side[:, None], None, given + near).x[:, 0, :n]
            if number >= INVERSE - 1:
                value = near + 1.0 / (side[:, :n] * yielding).sum(axis=1)
            mode = yielding
        mode /= metric_length(self, mode)[:, None]
        side[:, :n] = self.mass * mode
        return side, np.asarray(value < 0.0)

    def _condition(self, z: Lanes, p: Parameters, void: Flags) -> tuple[Lanes, Values]:
        """∂F/∂μ, which is the gradient of the condition, and the condition's row of F."""
        gradients, values = np.empty(z.shape), np.empty(len(z))
        inputs, outputs = [np.ascontiguousarray(z), np.ascontiguousarray(p)], [gradients, values]
        over_lanes(condition_lanes, self._condition_tables, inputs, outputs)
        gradients[void], values[void] = 0.0, -z[void, -1]
        gradients[void, -1] = -1.0
        return gradients, values

    def _drift(self, z: Lanes, p: Parameters, dp: Parameters, void: Flags, value: Values) -> Values:
        """∂c/∂p·dp at states where c is `value`: loads stretch a rod that is soft, and with it c.

        The condition is affine in loads, and no turn of a clamp about the axis changes it.
        """
        if not (self.model.soft and dp.any()):
            return np.zeros(len(z))
        return np.where(void, 0.0, self._condition(z, p + dp, void)[1] - value)

    @cached_property
    def _condition_tables(self) -> tuple[np.ndarray, ...]:
        return condition_tables(self.model)

    @cached_property
    def bare(self) -> SpatialMechanics:
        """The rod without the condition, with μ as the first of its parameters."""
        names, m = ("μ", *self.model.names), self.constraints - 1
        return SpatialMechanics(replace(self.model, multipliers=m, names=names))

    def _springs(
        self, z: Lanes, void: Flags
    ) -> tuple[Float[np.ndarray, "lanes 4"], Float[np.ndarray, "lanes bare"]]:
        """Springs of `solve_bordered_lanes`, and w·φ_v by the unknowns without μ.

        At the vertex that ξ moves most, along ξ = (0, 0, −q₃, q₂); none on the axis.
        """
        springs, row = np.zeros((len(z), 4)), np.zeros((len(z), self.size - 1))
        start, degree = self.model.unknown_nodes.start, self.mesh.degree
        nodes = np.arange(self.unknowns // 4)[-start % degree :: degree]
        lanes = np.arange(len(z))
        q = z[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4)
        node = nodes[np.argmax((q[:, nodes, 2:] ** 2).sum(axis=-1), axis=1)]
        a, b, c, d = q[lanes, node].T
        size, across = np.sqrt(a * a + b * b + c * c + d * d), np.sqrt(c * c + d * d)
        root = np.sqrt(self.model.stiffness.max() * self.mesh.elements)
        root = np.where(void, 0.0, root)
        by = root / (size * np.maximum(across, ON_AXIS**2))
        springs[:, 0] = (node + start) // degree
        springs[:, 1], springs[:, 2] = -by * across**2, by * (b * c - a * d)
        springs[:, 3] = by * (b * d + a * c)
        row[lanes, 4 * node + 2] = -2.0 * by * d
        row[lanes, 4 * node + 3] = 2.0 * by * c
        return springs, row

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`.

        The fused one of the rod itself, with the spring of `_springs` and μ = 0. ``F·ξ = 0`` at
        all states: the step is that of the rod but for its part along ξ, which the condition
        corrects afterwards. F_z ξ and with it the difference to a step with the whole matrix are
        of first order in F, so that steps converge as quickly.
        """
        z, p, row, dp = self.check_widths((z, p), (row, dp))
        void, bare, none = self.on_axis(z), z.copy(), np.zeros((len(z), 1))
        bare[:, -1] = 0.0
        own, gap = self._condition(bare, p, void)
        springs, around = self._springs(z, void)[0], self.velocity(z)
        rate, drift = _dot(own, around), self._drift(bare, p, dp, void, gap)
        by = np.divide(1.0, rate, out=np.zeros(len(z)), where=rate != 0.0)
        lean = by * _dot(row, around)
        given = (
            z, np.concatenate([none, p], axis=1), np.concatenate([none, dp], axis=1),
            row - lean[:, None] * own, corner - lean * drift,
            defect - lean * gap - row[:, -1] * z[:, -1], springs, none[:, :0], none[:, :0],
        )  # fmt: skip
        step, ratio = self.bare.fused_step(advance_lanes, self.bare.step_tables, *given)
        ways = (step.dz, gap + drift * step.dt), (step.tangent_z, drift * step.tangent_t)
        for way, off in ways:
            way[:, -1] = 0.0
            np.subtract(way, (by * (_dot(own, way) + off))[:, None] * around, out=way)
        step.dz[:, -1] -= z[:, -1]
        force = np.abs(z[:, -1]) * np.abs(own).max(axis=1)
        np.maximum(step.residual, np.maximum(np.abs(gap), force), out=step.residual)
        scale = np.divide(rate, 2.0 * springs[:, 1], out=np.ones(len(z)), where=rate != 0.0)
        step.determinant[:, 0] *= -(scale**2)
        step = self.pivot_steps(step, ratio, z, p, dp, row, corner, defect)
        pairs = 1.0 - 2.0 * (step.index[void] // 2 % 2)
        step.determinant[void, 0] = pairs * np.sqrt(np.abs(step.determinant[void, 0]))
        step.determinant[void, 1] /= 2.0
        return step

    advance_under = Equations.advance_under
    """The general one: the fused step of the rod knows nothing of the condition."""

    def velocity(self, z: Lanes) -> Lanes:
        """ξ: quaternions change by (0, 0, −q₃, q₂), forces of the supports by (0, −f_z, f_y)."""
        around, n = np.zeros_like(z), self.unknowns
        around[:, 2:n:4], around[:, 3:n:4] = -z[:, 3:n:4], z[:, 2:n:4]
        held = self.model.reaction[1:, : self.constraints]
        around[:, n:] = z[:, n:] @ (np.outer(held[0], held[1]) - np.outer(held[1], held[0]))
        return around

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """ξ; 0 on the axis."""
        return np.where(self.on_axis(z)[:, None], 0.0, self.velocity(z))

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the rotations are smooth, and the phase condition exerts no force."""
        return np.asarray(super().resolved(z, p) & (np.abs(z[:, -1]) < NO_FORCE))

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether rotations jump nowhere, and the phase condition exerts no force."""
        return np.asarray(super().may_resolve(z, p) & (np.abs(z[:, -1]) < NO_FORCE))

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Those of the rod; the half turn about the axis leads along orbits."""
        every = super().symmetries()
        return tuple(replace(each, along_orbits=each.name == HALF_TURN) for each in every)

    def turn(self, z: Lanes, angle: Values) -> Lanes:
        """States turned about the axis by angles, with the forces of the supports."""
        cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
        held = self.model.reaction[1:, : self.constraints]
        q = z[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4).copy()
        c, d = q[..., 2].copy(), q[..., 3].copy()
        q[..., 2], q[..., 3] = cosine * c - sine * d, sine * c + cosine * d
        ends = z[:, self.unknowns :]
        f, g = np.einsum("la,ka->kl", ends, held)[..., None]
        moved = np.concatenate([cosine * f - sine * g - f, sine * f + cosine * g - g], axis=1)
        ends = ends + np.einsum("lk,ka->la", moved, held)
        return np.concatenate([q.reshape(len(z), self.unknowns), ends], axis=1)

    def phase(self, z: Lanes) -> Values:
        """Angle by which a state is turned from one that the condition picks, −π/2 to π/2."""
        weights, free = self.mesh.weights, self.model.unknown_nodes
        q = z[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4)
        return phase_of(q, (phase_weight(self.mesh.nodes) * weights)[free])

    def aligned(self, z: Lanes) -> Lanes:
        """The nearest states on their orbits that meet the phase condition."""
        return self.turn(z, -self.phase(z))


def _dot(a: Lanes, b: Lanes) -> Values:
    return np.asarray(np.einsum("ln,ln->l", a, b))
