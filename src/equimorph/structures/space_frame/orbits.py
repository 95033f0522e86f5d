"""Frames in space on one line whose states may be turned about it for nothing.

Members along a line, as stiff in all directions across it, with supports and loads that do not
tell these apart: the turn R about the line takes a state with turns w of its nodes and forces f to
one with R w R⁻¹ and R f, of the same energy. Off the line equilibria lie in orbits then, and F_z is
singular along their velocity ξ. Solves leave it out: their results are orthogonal to ξ in the
metric, and inertia and determinant are those across the orbit. So are margins, because ξ is an
eigenvector of F_z. Paths begin in the state that a phase picks, and each step corrects the phase:
predictors would amplify one that nothing corrects.
See docs/decisions.md, "Orbits of frames are left out of solves".
"""

from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from equimorph.arrays import Entries, Flags, Float, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution
from equimorph.linalg.dense import no_border
from equimorph.structures.equations import Advance, AnyBorder, Shift, Solver
from equimorph.structures.metric import metric_length
from equimorph.structures.space_frame.line_turns import NEAR_LINE, LineTurns
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.spatial.quaternions import product

OFF_LINE = 1e-8
"""Length of ξ in the metric above which a state lies off the line."""
NEAR_PHASE = 0.1
"""Phase below which steps correct it: a path that began elsewhere on its orbit stays there."""
NO_PHASE = 1e-6
"""Share of the root mean square deflection below which the mean has no direction."""
LOWER = np.tril_indices(3)


class OrbitFrameMechanics(SpatialFrameMechanics):
    """Mechanics of a frame that has orbits at some parameters."""

    @cached_property
    def line_turns(self) -> LineTurns:
        """Turns of states about the line."""
        return LineTurns(self.model)

    # --- orbits ---------------------------------------------------------------------------------

    def have_orbits(self, p: Parameters, *, moving: bool = False) -> Flags:
        """Whether states at parameters, or along directions (moving), may be turned about the line.

        Turns of supports that several parameters cause one after the other are taken together.
        """
        turns, model = self.line_turns, self.model
        if not turns.possible:
            return np.zeros(len(p), bool)
        given = np.concatenate([p, np.full((len(p), 1), 0.0 if moving else 1.0)], axis=1)
        across = np.abs(given @ turns.breaking.T).max(axis=1, initial=0.0)
        if moving:
            about = np.einsum("lk,kha->lha", p, model.patterns.turns[:, model.held])
        else:
            y = np.concatenate([np.zeros((len(p), model.multipliers)), given], axis=1)
            about = self.held_turns(y[None])[0, ..., 1:]
        tilted = np.abs(about @ turns.cross.T).max(axis=(1, 2), initial=0.0)
        return np.asarray(np.maximum(across, tilted) <= NEAR_LINE)

    def on_orbits(self, z: Lanes, p: Parameters) -> Flags:
        """Whether states may be turned about the line for nothing, and would move."""
        on = self.have_orbits(p)
        if on.any():
            on[on] = metric_length(self, self.turning(z[on], p[on])) > OFF_LINE
        return on

    def turning(self, z: Lanes, p: Parameters) -> Lanes:
        """ξ: velocity of states by a turn about the line."""
        way = np.zeros_like(z)
        turned = way[:, : self._rows].reshape(len(z), -1, 4)
        turned[..., 1:] = self.quaternions(z)[..., 1:] @ self.line_turns.cross.T
        way[:, self.unknowns :] = self.scalars(z, p) @ self.line_turns.rates.T
        return way

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """ξ of states off the line that may be turned about it for nothing, or 0."""
        on = self.on_orbits(z, p)
        return np.where(on[:, None], self.turning(z, p), 0.0) if on.any() else np.zeros_like(z)

    def turn(self, z: Lanes, p: Parameters, angle: Values) -> Lanes:
        """States turned about the line by angles: ``exp(α J) = 1 + sin α J + (1 − cos α) J²``."""
        first, rest = self.turning(z, p), np.zeros_like(p)
        twice = self.turning(first, rest)
        twice[:, self.unknowns :] -= self.line_turns.rates[:, -1]
        return np.asarray(z + np.sin(angle)[:, None] * first + (1 - np.cos(angle))[:, None] * twice)

    def phase(self, z: Lanes) -> tuple[Values, Lanes]:
        """Angle about the line from the nearest phase, 0 or π, and its gradient by z.

        It is that of the mean deflection, where a node's is that of the line, turned with it. Both
        are 0 where the mean has no direction.
        """
        turns, q = self.line_turns, self.quaternions(z)
        length = np.linalg.norm(q, axis=2)
        unit = q / length[..., None]
        slopes = np.einsum("eab,lnb->lena", turns.forms, unit)
        away = np.einsum("lena,lna->len", slopes, unit)
        mean, square = away @ turns.node_weights, (away**2) @ turns.node_weights
        size = (mean**2).sum(axis=1)
        known = size > NO_PHASE**2 * square.sum(axis=1) * turns.node_weights.sum()
        angle = np.where(known, np.arctan2(mean[:, 1], mean[:, 0]), 0.0)
        angle -= np.pi * np.round(angle / np.pi)
        other = np.stack([-mean[:, 1], mean[:, 0]], axis=1) / np.where(known, size, np.inf)[:, None]
        ways = 2.0 * (slopes - away[..., None] * unit[:, None]) / length[:, None, :, None]
        gradient = np.zeros_like(z)
        by_node = np.einsum("le,lena,n->lna", other, ways, turns.node_weights)
        gradient[:, : self._rows] = by_node.reshape(len(z), self._rows)
        return angle, gradient

    def pick_on_orbits(self, z: Lanes, p: Parameters, towards: Parameters) -> Lanes:
        """States of phase 0 or π, where orbits lead on to other parameters."""
        there = self.on_orbits(z, p) & self.have_orbits(towards)
        if not there.any():
            return z
        out = z.copy()
        out[there] = self.turn(z[there], p[there], -self.phase(z[there])[0])
        return out

    # --- steps and solves -----------------------------------------------------------------------

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve; where orbits stay along it, in the phase 0 or π.

        Solves give a step d across the orbit; on it the step is ``d − (phase + phase'·d) ξ``.
        """
        there = np.zeros(len(z), bool)
        if self.line_turns.possible:
            there = self.have_orbits(dp, moving=True) & dp.any(axis=1)
            there[there] = self.on_orbits(z[there], p[there])
        if not there.any():
            return super().advance(z, p, dp, row, corner, defect)
        row, defect, way = row.copy(), defect.copy(), self.turning(z[there], p[there])
        phase, gradient = self.phase(z[there])
        phase[np.abs(phase) > NEAR_PHASE] = 0.0
        lean = (row[there] * way).sum(axis=1)
        row[there] -= lean[:, None] * gradient
        defect[there] -= lean * phase
        step = super().advance(z, p, dp, row, corner, defect)
        moves = step.dz.copy(), step.tangent_z.copy()
        for move, off in zip(moves, (phase, 0.0), strict=True):
            move[there] -= (off + (gradient * move[there]).sum(axis=1))[:, None] * way
        return replace(step, dz=moves[0], tangent_z=moves[1])

    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Shift = None
    ) -> Solver:
        """Solves with the matrix whose parts are given, on orbits across them."""
        on = self.on_orbits(z, p)
        if not on.any():
            return super().solver(parts, z, p, shift)
        entries, *at = parts
        return partial(self._solve_across, (z, *at), entries, self.along_orbits(z, p))

    def solve_whole(
        self, z: Lanes, p: Parameters, rhs: Sides, shift: Values
    ) -> Float[np.ndarray, "lanes k size"]:
        """Solve with F_z − shift·mass, orbits included."""
        parts = self.linearised(z, p, np.zeros_like(p), shift)[2:]
        return super().solver(parts, z, p)(rhs, None).x

    def _solve_across(
        self,
        at: tuple[np.ndarray, ...],
        entries: Entries,
        way: Lanes,
        rhs: Sides,
        border: AnyBorder,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass across velocities ξ of orbits, 0 where there is none.

        A spring w wᵀ against the turn of one node makes F_z regular. Two borders more take it out
        again, and hold the metric's component along ξ: it is that of rods, see `spatial.phase`.
        With ``wᵀξ ≠ 0`` the inertia of F_z + w wᵀ is that of F_z across ξ, its determinant that
        across ξ times (wᵀξ/|ξ|)². Where the spectrum is shifted, the Schur complement of both
        borders tells how many of the negative eigenvalues are those of the borders.
        """
        z, _, shift = at
        on, size = way.any(axis=1), self.size
        held = np.zeros_like(z)
        held[:, : self.unknowns] = way[:, : self.unknowns] * self.mass
        length = np.sqrt((way * held).sum(axis=1))
        held[on] /= length[on, None]
        entries, spring = self._with_spring(z, entries, way)
        inner = np.stack([held, spring], axis=1)
        own = np.zeros((len(z), 2, 2))
        own[:, 1, 1], own[:, 0, 0] = 1.0, ~on
        columns, rows, corner = no_border(len(z), size) if border is None else border
        k = columns.shape[1]
        wide = np.zeros((len(z), k + 2, k + 2))
        wide[:, :2, :2], wide[:, 2:, 2:] = own, corner
        columns, rows = (np.concatenate([inner, each], axis=1) for each in (columns, rows))
        more = np.insert(rhs, [size, size], 0.0, axis=2)
        found = self._solve_reduced(at, entries, more, (columns, rows, wide))
        negative, determinant = found.negative.copy(), found.determinant.copy()
        part = (spring * way).sum(axis=1)[on] ** 2 / (way[on] ** 2).sum(axis=1)
        determinant[on, 0] /= part
        lowered = np.flatnonzero(on & (shift[:, 0] != 0.0))
        if len(lowered):
            some = inner[lowered]
            given = tuple(each[lowered] for each in at)
            answer = self._solve_reduced(given, entries[lowered], some, None).x
            schur = own[lowered] - some @ answer.transpose(0, 2, 1)
            negative[lowered] += (np.linalg.eigvalsh(schur) < 0.0).sum(axis=1) - 1
        x = np.delete(found.x, [size, size + 1], axis=2)
        return replace(found, x=x, negative=negative, determinant=determinant)

    def _with_spring(self, z: Lanes, entries: Entries, way: Lanes) -> tuple[Entries, Lanes]:
        """Matrices with w wᵀ at the node that ξ moves most, as stiff as it is already, and w."""
        lanes, free = np.arange(len(z)), len(self.model.free)
        moved = way[:, : self._rows].reshape(len(z), free, 4)
        node = np.argmax((moved**2).sum(axis=2), axis=1)
        there, q = moved[lanes, node], self.quaternions(z)[lanes, node]
        slots = self.tables.node_slots[node]
        stiff = np.abs(entries[lanes[:, None], slots[:, [0, 2, 5]]]).mean(axis=1)
        length = np.linalg.norm(there, axis=1)
        root = np.divide(np.sqrt(stiff), length, out=np.zeros(len(z)), where=length > 0.0)
        spring = np.zeros((len(z), free, 4))
        spring[lanes, node] = root[:, None] * there
        # by rotations, as in `reduction_kernels`: dq = ½ q e_k
        ways = np.stack([product(q, np.broadcast_to(unit, q.shape)) for unit in np.eye(4)[1:]], 1)
        small = 0.5 * np.einsum("lka,la->lk", ways, spring[lanes, node])
        entries = entries.copy()
        entries[lanes[:, None], slots] += (small[:, :, None] * small[:, None])[:, *LOWER]
        wide = np.zeros_like(z)
        wide[:, : self._rows] = spring.reshape(len(z), self._rows)
        return entries, wide
