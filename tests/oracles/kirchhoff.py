"""Independent oracle of rods in space: multiple shooting for Kirchhoff's equations.

Shares nothing with the package but the physics. The state is y = (r, q, n, m): place, unit
quaternion (scalar part first), force and moment of what lies ahead on what lies behind, all but q
in the fixed frame. With R(q) = (tangent, normal, binormal), stiffnesses K (twist first), natural
strains u₀, compliances S (stretch first) and a dead load f per length, piece by piece constant,

    u = u₀ + K⁻¹ Rᵀm ,  r' = R (e₁ + S Rᵀn) ,  q' = ½ q u ,  n' = −f ,  m' = n × r'  [Antman2005]_.

Every piece is integrated by Gragg's midpoint rule, extrapolated to order 12, with its exact
variational equations. An end holds or frees each axis: places along the fixed axes (else the force
is given), turns about the axes of the cross-section (else there is no moment).

- `Rod.solved` is Newton's method for all pieces together; `determinant` vanishes at critical
  points, whichever way the rod got there.
- `index` counts points conjugate to s = 0 [ManningRogersMaddocks1998]_; it needs a clamp at s = 1.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.optimize import brentq

PLACE, TURN, FORCE, MOMENT = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
SIZE = 13
SUBSTEPS = (2, 4, 6, 8, 10, 12)
"""Midpoint steps that are extrapolated."""
LARGEST_STEP = 0.6
"""Change of a unit quaternion in one step of Newton's method, beyond which it is shortened."""


def _product(q, u):
    """q (0, u); the components come first."""
    a, x, y, z = q
    return np.stack([
        -x * u[0] - y * u[1] - z * u[2],
        a * u[0] + y * u[2] - z * u[1],
        a * u[1] + z * u[0] - x * u[2],
        a * u[2] + x * u[1] - y * u[0],
    ])  # fmt: skip


def _quadratic_forms() -> np.ndarray:
    """F with R(q)_ck = q·F_ck·q; R is a rotation where |q| = 1."""
    forms = np.zeros((3, 3, 4, 4))
    squares = np.array([[1, 1, -1, -1], [1, -1, 1, -1], [1, -1, -1, 1]])
    for c in range(3):
        forms[c, c] = np.diag(squares[c])
    for c, k, axis, sign in ((0, 1, 3, -1), (0, 2, 2, 1), (1, 2, 1, -1)):
        for row, column, turn in ((c, k, sign), (k, c, -sign)):
            forms[row, column, c + 1, k + 1] = forms[row, column, k + 1, c + 1] = 1.0
            forms[row, column, 0, axis] = forms[row, column, axis, 0] = turn
    return forms


FORMS = _quadratic_forms()
AXES = np.array([[_product(q, e) for e in np.eye(3)] for q in np.eye(4)]).swapaxes(1, 2)
"""q e_k is linear in q: by the entries of q, of the product, and by k."""


def _matrix(q) -> np.ndarray:
    """R(q)."""
    return np.einsum("ckab,a,b->ck", FORMS, q, q)


def _skew(v) -> np.ndarray:
    """Matrices of v ×, for several v."""
    found = np.zeros((len(v), 3, 3))
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        found[:, b, a], found[:, a, b] = v[:, c], -v[:, c]
    return found


def _rates(y, table):
    """d/ds of states and of their variations, the columns after the first; pieces first."""
    count = len(y)
    soft, natural, give, load = (table[:, i : i + 3] for i in (0, 3, 6, 9))
    q, n, m = y[:, 3:7, 0], y[:, 7:10, 0], y[:, 10:13, 0]
    half = np.tensordot(q, FORMS, (1, 2))  # (pieces, c, k, b)
    frame = (half @ q[:, None, :, None])[..., 0]
    back = frame.swapaxes(1, 2)
    u = natural + soft * (back @ m[..., None])[..., 0]
    v = give * (back @ n[..., None])[..., 0]
    v[:, 0] += 1.0
    # derivatives of R v, Rᵀ n and Rᵀ m by q
    by_ahead = 2.0 * np.einsum("pckb,pk->pcb", half, v)
    by_n, by_m = (2.0 * np.einsum("pckb,pc->pkb", half, each) for each in (n, m))
    matrix = np.zeros((count, SIZE, SIZE))
    give_back, soft_back = give[..., None] * back, soft[..., None] * back
    matrix[:, 0:3, 3:7] = by_ahead + frame @ (give[..., None] * by_n)
    matrix[:, 0:3, 7:10] = frame @ give_back
    left = 0.5 * np.tensordot(q, AXES, (1, 0))  # columns q e_k
    matrix[:, 3:7, 3:7] = _right(u) + left @ (soft[..., None] * by_m)
    matrix[:, 3:7, 10:13] = left @ soft_back
    ahead, pull = (frame @ v[..., None])[..., 0], _skew(n)
    matrix[:, 10:13, 3:10] = pull @ matrix[:, 0:3, 3:10]
    matrix[:, 10:13, 7:10] -= _skew(ahead)
    out = np.empty_like(y)
    out[:, :, 1:] = matrix @ y[:, :, 1:]
    out[:, 0:3, 0], out[:, 3:7, 0] = ahead, (left @ u[..., None])[..., 0]
    out[:, 7:10, 0], out[:, 10:13, 0] = -load, (pull @ ahead[..., None])[..., 0]
    return out


def _right(u) -> np.ndarray:
    """Matrices of q → ½ q u."""
    found = np.zeros((len(u), 4, 4))
    found[:, 0, 1:], found[:, 1:, 0] = -0.5 * u, 0.5 * u
    found[:, 1:, 1:] = -0.5 * _skew(u)
    return found


def _step(y, table, length):
    """One extrapolated step; variations are differentiated exactly, as columns of the same rule."""
    rows = []
    for count in SUBSTEPS:
        h = length / count
        before, here = y, y + h * _rates(y, table)
        for _ in range(count - 1):
            before, here = here, before + 2.0 * h * _rates(here, table)
        rows.append(0.5 * (before + here + h * _rates(here, table)))
    for k in range(1, len(rows)):
        for i in range(len(rows) - 1, k - 1, -1):
            ratio = (SUBSTEPS[i] / SUBSTEPS[i - k]) ** 2
            rows[i] = rows[i] + (rows[i] - rows[i - 1]) / (ratio - 1.0)
    return rows[-1]


def _passage(y, table, length, steps):
    """States and variations at the beginning and after each of some steps through all pieces."""
    found = [y]
    for _ in range(steps):
        found.append(_step(found[-1], table, length / steps))
    return np.array(found)


@dataclass(frozen=True)
class End:
    """What holds an end.

    place: where, one number an axis, or None where the force is given instead; force: that
    force on the rod, where the place is free; turn: the unit quaternion of the clamp; held: turns
    about tangent, normal, binormal of the clamp that are held, all for a clamp; moment: in the
    fixed frame, on an end of which no turn is held.
    """

    place: tuple[float | None, float | None, float | None] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    held: tuple[bool, bool, bool] = (True, True, True)
    force: tuple[float, float, float] = (0.0, 0.0, 0.0)
    moment: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @cached_property
    def fixed(self) -> np.ndarray:
        """Which of the six variations (moves along fixed axes, turns of the section) are held."""
        return np.array([each is not None for each in self.place] + list(self.held))

    def conditions(self, y, sign):
        """Six numbers that vanish, and their derivatives by y; sign: +1 at s = 1, −1 at s = 0."""
        values, slopes = np.zeros(6), np.zeros((6, SIZE))
        for k, place in enumerate(self.place):
            if place is None:
                values[k], slopes[k, 7 + k] = y[7 + k] - sign * self.force[k], 1.0
            else:
                values[k], slopes[k, k] = y[k] - place, 1.0
        q, clamp = y[TURN], np.array(self.turn)
        for k in range(3):
            unit = np.eye(3)[k]
            if self.held[k]:
                side = _product(clamp, unit)
                values[3 + k], slopes[3 + k, TURN] = 2.0 * side @ q, 2.0 * side
            elif not any(self.held):
                values[3 + k], slopes[3 + k, 10 + k] = y[10 + k] - sign * self.moment[k], 1.0
            else:
                axis = _matrix(q) @ unit
                values[3 + k], slopes[3 + k, MOMENT] = axis @ y[MOMENT], axis
                slopes[3 + k, TURN] = 2.0 * np.einsum("cab,c,a->b", FORMS[:, k], y[MOMENT], q)
        return values, slopes

    def variations(self, y):
        """Six variations of the state at s = 0 that keep the conditions, as columns."""
        columns, q = np.zeros((SIZE, 6)), y[TURN]
        slopes, frame = self.conditions(y, -1.0)[1], _matrix(q)
        for k in range(3):
            if self.place[k] is None:
                columns[k, k] = 1.0
            else:
                columns[7 + k, k] = 1.0
            if self.held[k]:
                columns[MOMENT, 3 + k] = frame[:, k]
            else:
                columns[TURN, 3 + k] = 0.5 * _product(q, np.eye(3)[k])
        # moments follow turns so that those that are free keep their values
        for k in range(6):
            rest = slopes @ columns[:, k]
            for j in range(3):
                if not self.held[j]:
                    columns[MOMENT, k] -= frame[:, j] * rest[3 + j]
        return columns


def clamp(place=(0.0, 0.0, 0.0), turn=(1.0, 0.0, 0.0, 0.0)) -> End:
    """An end that is held."""
    return End(tuple(place), tuple(turn))


def free(force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0)) -> End:
    """An end under a dead force and a moment about a fixed axis."""
    nothing = (None, None, None)
    return End(nothing, held=(False, False, False), force=tuple(force), moment=tuple(moment))


FREE = End((None, None, None), held=(False, False, False))
"""An end on which nothing acts."""


def about(axis, angle):
    """Unit quaternion of a turn about a fixed axis."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.concatenate([[np.cos(0.5 * angle)], np.sin(0.5 * angle) * axis])


def composed(*turns):
    """Product of quaternions, the last applied first."""
    found = np.array([1.0, 0.0, 0.0, 0.0])
    for turn in turns:
        found = turn[0] * found + _product(found, np.asarray(turn, float)[1:])
    return found


@dataclass(frozen=True, eq=False)
class Rod:
    """A boundary value problem and a guess of its states at the beginnings of the pieces.

    stiffness: of twist, bending about the normal, bending about the binormal; natural: strains
    without moment; give: compliances of stretch and shear; load: dead, per length; kicks: dead
    forces where pieces begin. Each is one row, or one a piece.
    """

    y: np.ndarray
    start: End
    end: End
    stiffness: np.ndarray
    natural: np.ndarray = field(default_factory=lambda: np.zeros(3))
    give: np.ndarray = field(default_factory=lambda: np.zeros(3))
    load: np.ndarray = field(default_factory=lambda: np.zeros(3))
    kicks: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length: float = 1.0
    steps: int = 3

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.y)

    @cached_property
    def _table(self) -> np.ndarray:
        rows = (1.0 / np.asarray(self.stiffness, float), self.natural, self.give, self.load)
        return np.concatenate(
            [np.broadcast_to(np.asarray(row, float), (self.pieces, 3)) for row in rows], axis=1
        )

    @property
    def _part(self) -> float:
        return self.length / self.pieces

    def _passages(self, steps: int) -> np.ndarray:
        """States and their derivatives by the first of their piece: steps + 1, pieces, 13, 14."""
        unit = np.broadcast_to(np.eye(SIZE), (self.pieces, SIZE, SIZE))
        start = np.concatenate([self.y[..., None], unit], axis=2)
        return _passage(start, self._table, self._part, steps)

    @cached_property
    def _ends(self) -> np.ndarray:
        return self._passages(self.steps)[-1]

    @cached_property
    def _linear(self) -> tuple[np.ndarray, np.ndarray]:
        """Residual and Jacobian of all pieces together."""
        count, unit, ends = self.pieces, np.eye(SIZE), self._ends
        residual, matrix = np.zeros(SIZE * count), np.zeros((SIZE * count, SIZE * count))
        for i in range(count - 1):
            rows = slice(SIZE * i, SIZE * (i + 1))
            residual[rows] = ends[i][:, 0] - self.y[i + 1]
            residual[rows][FORCE] -= np.broadcast_to(self.kicks, (count, 3))[i + 1]
            matrix[rows, rows] = ends[i][:, 1:]
            matrix[rows, SIZE * (i + 1) : SIZE * (i + 2)] = -unit
        row = SIZE * (count - 1)
        q = self.y[0, TURN]
        residual[row], matrix[row, TURN] = 0.5 * (q @ q - 1.0), q
        value, slope = self.start.conditions(self.y[0], -1.0)
        residual[row + 1 : row + 7], matrix[row + 1 : row + 7, :SIZE] = value, slope
        value, slope = self.end.conditions(ends[-1][:, 0], 1.0)
        residual[row + 7 :] = value
        matrix[row + 7 :, row:] = slope @ ends[-1][:, 1:]
        return residual, matrix

    @property
    def residual(self) -> float:
        """Largest defect."""
        return float(np.abs(self._linear[0]).max())

    def moved(self, step) -> "Rod":
        """The same problem from another guess."""
        step = step.reshape(self.y.shape)
        return replace(self, y=self.y + step)

    def solved(self, iterations: int = 40, accuracy: float = 1e-11) -> "Rod":
        """Newton's method; RuntimeError if it does not converge."""
        rod = self
        for _ in range(iterations):
            residual, matrix = rod._linear
            step = np.linalg.solve(matrix, -residual)
            turn = np.abs(step.reshape(rod.y.shape)[:, TURN]).max()
            rod = rod.moved(step * min(1.0, LARGEST_STEP / max(turn, 1e-300)))
            if turn < 1e-7 and rod.residual < accuracy * (1.0 + np.abs(rod.y).max()):
                return rod
        raise RuntimeError(f"no convergence: {rod.residual:.1e}")

    # --- what a solution tells -----------------------------------------------------------------

    def along(self, steps: int | None = None) -> np.ndarray:
        """States at equidistant s, `steps` in each piece, both ends included."""
        found = _passage(self.y[..., None], self._table, self._part, steps or self.steps)[..., 0]
        return np.concatenate([found[:-1].swapaxes(0, 1).reshape(-1, SIZE), found[-1, -1:]])

    def place(self, share: float) -> np.ndarray:
        """Place at a share of the length."""
        i = min(int(share * self.pieces), self.pieces - 1)
        part, one = (share * self.pieces - i) * self._part, slice(i, i + 1)
        return _passage(self.y[one, :, None], self._table[one], part, self.steps)[-1, 0, PLACE, 0]

    def strains(self, steps: int | None = None) -> np.ndarray:
        """Twist and both curvatures at the places of `along`."""
        found, rows = self.along(steps), np.repeat(np.arange(self.pieces), steps or self.steps)
        table = self._table[np.append(rows, self.pieces - 1)]
        moments = np.array([_matrix(y[TURN]).T @ y[MOMENT] for y in found])
        return table[:, 3:6] + table[:, 0:3] * moments

    @property
    def energy(self) -> float:
        """½ u·K u of all strains beyond the natural ones, by Simpson's rule; no load."""
        steps = 2 * self.steps
        u, h = self.strains(steps), self.length / self.pieces / steps
        total = 0.0
        for i in range(self.pieces):
            part = u[i * steps : (i + 1) * steps + 1] - self._table[i, 3:6]
            density = 0.5 * (part**2 / self._table[i, 0:3]).sum(axis=1)
            weights = np.tile([2.0, 4.0], steps // 2 + 1)[: steps + 1]
            weights[[0, -1]] = 1.0
            total += h / 3.0 * weights @ density
        return float(total)

    def _flow(self, steps: int) -> np.ndarray:
        """Moves and turns of the section, six rows, by the six variations at s = 0, along s."""
        columns, found, passed = self.start.variations(self.y[0]), [], self._passages(steps)
        for i in range(self.pieces):
            states = passed[: None if i == self.pieces - 1 else -1, i]
            found += [_moves(state[:, 0], state[:, 1:] @ columns) for state in states]
            columns = passed[-1, i, :, 1:] @ columns
        return np.array(found)

    @cached_property
    def _shooting(self) -> np.ndarray:
        """Conditions at s = 1 by the variations at s = 0."""
        columns = self.start.variations(self.y[0])
        for each in self._ends:
            columns = each[:, 1:] @ columns
        return self.end.conditions(self._ends[-1, :, 0], 1.0)[1] @ columns

    @property
    def determinant(self) -> float:
        """Of the Jacobian of the boundary conditions by shooting; zero at critical points."""
        return float(np.linalg.det(self._shooting))

    @property
    def stretches(self) -> np.ndarray:
        """Singular values of that Jacobian, largest first; as many are zero as there are modes."""
        return np.linalg.svd(self._shooting, compute_uv=False)

    def index(self, steps: int = 24) -> int:
        """Points conjugate to s = 0 inside the rod, for an end that is clamped."""
        assert self.end.fixed.all(), "the index needs a clamp at s = 1"
        flow = self._flow(steps)
        signs = np.sign([np.linalg.det(each / np.linalg.norm(each)) for each in flow[1:]])
        return int((signs[1:] != signs[:-1]).sum())


def _moves(y, columns) -> np.ndarray:
    """Moves and turns of the section of variations of a state."""
    sides = np.stack([_product(y[TURN], e) for e in np.eye(3)])
    return np.concatenate([columns[PLACE], 2.0 * sides @ columns[TURN]])


def straight(pieces, start, end, stiffness, force=(0.0, 0.0, 0.0), twist=0.0, **more) -> Rod:
    """Guess: a straight rod along x, stretched between its ends, with an even twist."""
    length = more.get("length", 1.0)
    y, s = np.zeros((pieces, SIZE)), length * np.arange(pieces) / pieces
    y[:, 0], y[:, FORCE] = s, force
    y[:, 3], y[:, 4] = np.cos(0.5 * twist * s), np.sin(0.5 * twist * s)
    y[:, 10] = np.asarray(stiffness, float).reshape(-1, 3)[0, 0] * twist
    return Rod(y, start, end, stiffness, **more)


def double_zero(test: Callable[[float], float], low: float, high: float) -> float:
    """Where a singular value vanishes, by straight lines from both sides: it is |linear| there.

    Determinants do not change their sign where two modes of a symmetric problem are critical.
    """
    for _ in range(4):
        a, b = test(low), test(high)
        here = low + (high - low) * a / (a + b)
        width = max(0.02 * (high - low), 1e-7 * abs(here))
        low, high = here - width, here + width
    return here


def clamped_buckling_moment(tension: float) -> float:
    """Least M of w'''' − i M w''' − T w'' = 0, w = y + i z, with w = w' = 0 at both ends.

    Solutions are 1, s and e^{iks} with k² − M k + T = 0. The determinant of the four conditions,
    divided by e^{iM/2}, is real or imaginary.
    """

    def conditions(moment):
        omega = np.sqrt(moment**2 / 4.0 - tension)
        k = moment / 2.0 + np.array([omega, -omega])
        ends = np.exp(1j * k)
        if tension == 0.0:  # 1, s, s², e^{iMs}
            end = np.exp(1j * moment)
            rows = [
                [1, 0, 0, 1],
                [0, 1, 0, 1j * moment],
                [1, 1, 1, end],
                [0, 1, 2, 1j * moment * end],
            ]
        else:
            rows = [[1, 0, 1, 1], [0, 1, *(1j * k)], [1, 1, *ends], [0, 1, *(1j * k * ends)]]
        value = np.linalg.det(np.array(rows)) * np.exp(-0.5j * moment)
        return value.real if abs(value.real) > abs(value.imag) else value.imag

    trials = 2.0 * np.sqrt(tension) + np.linspace(1.0, 12.0, 120)
    values = np.array([conditions(each) for each in trials])
    first = int(np.flatnonzero(values[1:] * values[:-1] < 0.0)[0])
    return brentq(conditions, trials[first], trials[first + 1], xtol=1e-13)
