"""Independent oracle of the clamped rod over many lanes: equilibria by multiple shooting.

Shares nothing with the package but the physics, and with `shooting` the formulation: initial value
problems ``θ'' = −4π² (q ρ cos θ + λ sin θ − μ cos θ)`` with their exact variational equations,
here by the Runge–Kutta method of order 8 of Dormand and Prince with fixed steps.

- The rod is cut into pieces, at the kinks of the load and in between; unknowns are θ and κ where
  each piece begins (θ(0) is given) and the forces λ, μ. Equations: pieces meet, θ(1), x(1), y(1).
  Plain shooting (one piece) does not find rods in tension: their shots grow like exp(2π√|λ| s).
- The index is the number of points conjugate to s = 0: sign changes in (0, 1) of det J(s), where
  J(s) = ∂(θ, x, y)(s)/∂(κ(0), λ, μ) [ManningRogersMaddocks1998]_.
- `all_equilibria` solves from random starts: shooting in (κ(0), λ, μ) and all that lies between.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.integrate import DOP853
from scipy.interpolate import CubicHermiteSpline

SPAN = float(np.sin(1.0))
FORCE = 4.0 * np.pi**2
PIECES = 6
COARSE, FINE = 4, 50
"""Runge–Kutta steps per piece: while it is searched, and for results (error near 1e-13)."""
SAME = 1e-5

UNIFORM = ((0.0, 1.0), (1.0, 1.0))
LEFT_HALF = ((0.0, 2.0), (0.5, 2.0), (0.5, 0.0), (1.0, 0.0))

_TABLES = (DOP853.A.copy(), DOP853.B.copy(), DOP853.C.copy())


def cumulated(table, pieces: int = PIECES) -> np.ndarray:
    """Rows (s₀, s₁, ρ₀, Q₀, Q'): ρ = ρ₀ + Q₀ t + ½ Q' t² on [s₀, s₁], with t = s − s₀.

    Every interval of the table (s, Q) is cut into parts not longer than 1/pieces.
    """
    rows, rho = [], 0.0
    for (a, first), (b, last) in pairwise(table):
        if b == a:
            continue
        slope = (last - first) / (b - a)
        edges = np.linspace(a, b, 1 + int(np.ceil((b - a) * pieces - 1e-9)))
        for left, right in pairwise(edges):
            load, width = first + slope * (left - a), right - left
            rows.append([left, right, rho, load, slope])
            rho += width * (load + 0.5 * slope * width)
    return np.array(rows)


@njit(cache=True, error_model="numpy")
def _rates(y, pull, forces, out):
    """d/ds of (θ, κ, x, y) and of their derivatives by θ₀, κ₀, λ, μ, row after row."""
    sine, cosine = np.sin(y[0]), np.cos(y[0])
    lam = forces[1]
    slope = -FORCE * (lam * cosine - pull * sine)
    out[0], out[1], out[2], out[3] = y[1], -FORCE * (pull * cosine + lam * sine), cosine, sine
    for k in range(4, 20, 4):
        out[k], out[k + 1] = y[k + 1], slope * y[k]
        out[k + 2], out[k + 3] = -sine * y[k], cosine * y[k]
    out[13] -= FORCE * sine
    out[17] += FORCE * cosine


@njit(cache=True, error_model="numpy")
def _step(y, h, rho, forces, work):
    """One step of the Runge–Kutta method; ρ = rho[0] + t (rho[1] + ½ t rho[2]) on it."""
    (a_table, b_table, c_table), k, ahead = work
    for stage in range(c_table.shape[0]):
        ahead[:] = y
        for j in range(stage):
            factor = h * a_table[stage, j]
            if factor != 0.0:
                for i in range(20):
                    ahead[i] += factor * k[j, i]
        t = c_table[stage] * h
        pull = forces[0] * (rho[0] + t * (rho[1] + 0.5 * t * rho[2])) - forces[2]
        _rates(ahead, pull, forces, k[stage])
    for j in range(c_table.shape[0]):
        factor = h * b_table[j]
        if factor != 0.0:
            for i in range(20):
                y[i] += factor * k[j, i]


@njit(cache=True, error_model="numpy")
def _integrate(starts, forces, pieces, steps, tables, out):
    """Shoot every piece of every lane; out (lanes, pieces, points, 20): the way, or its ends."""
    work = (tables, np.zeros((12, 20)), np.zeros(20))
    y, rho = np.zeros(20), np.zeros(3)
    for lane in range(starts.shape[0]):
        for e in range(pieces.shape[0]):
            begin, end, before, load, slope = pieces[e]
            y[:] = 0.0
            y[0], y[1], y[4], y[9] = starts[lane, e, 0], starts[lane, e, 1], 1.0, 1.0
            out[lane, e, 0] = y
            h = (end - begin) / steps
            for i in range(steps):
                t = i * h
                rho[0], rho[1] = before + t * (load + 0.5 * t * slope), load + t * slope
                rho[2] = slope
                _step(y, h, rho, forces[lane], work)
                out[lane, e, min(i + 1, out.shape[2] - 1)] = y


@dataclass(frozen=True)
class Shots:
    """Rods cut into pieces, one per lane: setting, and the unknowns of the pieces.

    pieces: as `cumulated` gives them; last: θ(1); q, nu: of each lane; starts (lanes, pieces, 2):
    θ and κ where each piece begins; forces (lanes, 2): λ and μ.
    """

    pieces: np.ndarray
    last: np.ndarray
    q: np.ndarray
    nu: np.ndarray
    starts: np.ndarray
    forces: np.ndarray

    def __len__(self) -> int:
        return len(self.q)

    def take(self, lanes) -> "Shots":
        parts = {name: value[lanes] for name, value in vars(self).items() if name != "pieces"}
        return Shots(self.pieces, **parts)

    def shoot(self, steps: int, every: bool = False) -> np.ndarray:
        """(lanes, pieces, points, 5, 4): θ, κ, x, y, and their derivatives by θ₀, κ₀, λ, μ.

        x and y from where the piece begins; points: both ends, or `every` step.
        """
        forces = np.concatenate([self.q[:, None], self.forces], axis=1)
        out = np.empty((*self.starts.shape[:2], steps + 1 if every else 2, 20))
        _integrate(self.starts, forces, self.pieces, steps, _TABLES, out)
        return out.reshape(*out.shape[:3], 5, 4)

    def equations(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Residual and Jacobian by (κ₀, θ₁, κ₁, θ₂, κ₂, ..., λ, μ)."""
        y = self.shoot(steps)[:, :, -1]
        lanes, count = self.starts.shape[:2]
        size = 2 * count + 1
        r, jacobian = np.zeros((lanes, size)), np.zeros((lanes, size, size + 1))
        for e in range(count):
            wide = 2 if e + 1 < count else 1
            here, row = slice(2 * e, 2 * e + 2), slice(2 * e, 2 * e + wide)
            goal = self.starts[:, e + 1] if e + 1 < count else self.last[:, None]
            r[:, row] = y[:, e, 0, :wide] - goal
            jacobian[:, row, here] = y[:, e, 1:3, :wide].transpose(0, 2, 1)
            jacobian[:, row, -2:] = y[:, e, 3:5, :wide].transpose(0, 2, 1)
            if e + 1 < count:
                jacobian[:, 2 * e, 2 * e + 2] = jacobian[:, 2 * e + 1, 2 * e + 3] = -1.0
            jacobian[:, -2:, here] = y[:, e, 1:3, 2:].transpose(0, 2, 1)
        r[:, -2:] = y[:, :, 0, 2:].sum(axis=1) - np.stack([self.nu, np.zeros(lanes)], 1)
        jacobian[:, -2:, -2:] = y[:, :, 3:, 2:].sum(axis=1).transpose(0, 2, 1)
        return r, jacobian[:, :, 1:]

    def solved(
        self, steps: int = FINE, iterations: int = 40, longest: float = 1.0
    ) -> tuple["Shots", np.ndarray]:
        """Newton with angles changed by at most `longest` per step, and which lanes converged."""
        starts = self.starts.reshape(len(self), 2 * len(self.pieces))
        x = np.concatenate([starts, self.forces], axis=1)
        found, todo = np.zeros(len(self), bool), np.arange(len(self))
        weights = np.append(np.tile([1.0, 0.1], self.starts.shape[1])[1:], [0.1, 0.1])
        for _ in range(iterations):
            r, jacobian = self._with(x).take(todo).equations(steps)
            near = (np.abs(x[todo, 1:] * weights) < 15.0).all(axis=1)
            usable = np.isfinite(jacobian).all(axis=(1, 2)) & near
            todo, r, jacobian = todo[usable], r[usable], jacobian[usable]
            if len(todo) == 0:
                break
            step = -np.linalg.solve(jacobian, r[:, :, None])[:, :, 0]
            length = np.abs(step * weights).max(axis=1)
            x[todo, 1:] += step * np.minimum(1.0, longest / np.maximum(length, 1e-300))[:, None]
            found[todo[length < 1e-9]] = True
            todo = todo[~(length < 1e-9)]
        return self._with(x), found

    def _with(self, x: np.ndarray) -> "Shots":
        return replace(self, starts=x[:, :-2].reshape(self.starts.shape), forces=x[:, -2:])

    def max_curvature(self, steps: int = FINE) -> np.ndarray:
        """max |κ|, interior extrema by cubic interpolation of κ and κ' between the steps."""
        way = self.shoot(steps, every=True)[:, :, :, 0]
        best = np.zeros(len(self))
        for e, (begin, end, before, load, slope) in enumerate(self.pieces):
            t = np.linspace(0.0, end - begin, steps + 1)
            rho = before + t * (load + 0.5 * t * slope)
            lam, mu = self.forces.T[:, :, None]
            theta, kappa = way[:, e, :, 0], way[:, e, :, 1]
            pull = self.q[:, None] * rho - mu
            rate = -FORCE * (pull * np.cos(theta) + lam * np.sin(theta))
            for lane in range(len(self)):
                spline = CubicHermiteSpline(t, kappa[lane], rate[lane])
                inner = spline(spline.derivative().roots(extrapolate=False))
                extrema = np.concatenate([kappa[lane], inner[np.isfinite(inner)]])
                best[lane] = max(best[lane], np.abs(extrema).max())
        return best

    def heights(self, steps: int = FINE) -> np.ndarray:
        """(lanes, pieces): y where each piece ends."""
        return np.cumsum(self.shoot(steps)[:, :, -1, 0, 3], axis=1)

    def index(self, steps: int = FINE) -> np.ndarray:
        """Points conjugate to s = 0: sign changes of det J(s) at the steps behind s = 0.05.

        Before, det J falls to round-off like s⁹. Columns of J are made orthogonal from piece to
        piece (with positive factors), since in tension all of them grow along one direction.
        """
        way = self.shoot(steps, every=True)
        # columns κ(0), λ, μ; rows θ, κ, x, y, λ, μ
        columns = np.tile(np.eye(6)[[1, 4, 5]].T, (len(self), 1, 1))
        signs = []
        for e, (begin, end, *_) in enumerate(self.pieces):
            inside = begin + np.linspace(0.0, end - begin, steps + 1) > 0.05
            ahead = _transition(way[:, e]) @ columns[:, None]
            signs.append(np.sign(np.linalg.det(ahead[:, inside][:, :, [0, 2, 3]])))
            q, r = np.linalg.qr(ahead[:, -1])
            columns = q * np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None]
        sign = np.concatenate(signs, axis=1)
        return (sign[:, 1:] != sign[:, :-1]).sum(axis=1)


def _transition(way: np.ndarray) -> np.ndarray:
    """(lanes, points, 6, 6): how (θ, κ, x, y, λ, μ) where a piece begins changes what follows."""
    out = np.tile(np.eye(6), (*way.shape[:2], 1, 1))
    out[:, :, :4, [0, 1, 4, 5]] = way[:, :, 1:].transpose(0, 1, 3, 2)
    return out


def random_shots(table, setting, count: int, seed: int) -> Shots:
    """Starts all over for (Θ, Δ, q, ν): random waves of the angle on a parabola, random forces."""
    Theta, Delta, q, nu = setting
    pieces, generator = cumulated(table), np.random.default_rng(seed)
    s, modes = pieces[:, 0], np.arange(1, 7)
    sizes = (4.0 / modes) * generator.uniform(0, 1, (count, 1))
    amplitude = generator.normal(size=(count, 6)) * sizes
    waves = np.pi * modes[:, None]
    theta = Delta + Theta * (1.0 - 2.0 * s) + amplitude @ np.sin(waves * s)
    kappa = -2.0 * Theta + amplitude @ (waves * np.cos(waves * s))
    radius = 20.0 * generator.uniform(size=count) ** 2
    turn = generator.uniform(0, 2 * np.pi, count)
    forces = radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], 1) + [0.0, 0.5 * q]
    starts, same = np.stack([theta, kappa], 2), np.ones(count)
    return Shots(pieces, (Delta - Theta) * same, q * same, nu * same, starts, forces)


def all_equilibria(table, setting, count: int, seed: int) -> Shots:
    """What Newton finds from `count` random starts at (Θ, Δ, q, ν), each once."""
    shots, found = random_shots(table, setting, count, seed).solved(COARSE, 30)
    shots, found = shots.take(found).solved()
    shots = shots.take(found)
    kept: list[int] = []
    for i in range(len(shots)):
        gap = np.abs(shots.starts[kept] - shots.starts[i]).max(axis=(1, 2))
        if gap.min(initial=np.inf) > SAME:
            kept.append(i)
    return shots.take(kept)


def from_states(states, table) -> Shots:
    """Shots started from states of the package's rod, to be `solved` independently."""
    rod, pieces = states.structure, cumulated(table)
    fields = [[field(s)(states) for field in (rod.angle, rod.curvature)] for s in pieces[:, 0]]
    starts = np.array(fields).transpose(2, 0, 1)
    last = states["Delta"] - states["Theta"]
    return Shots(pieces, last, states["q"], states["nu"], starts, states.multipliers)
