"""Independent oracle of the clamped rod: shooting with a Runge–Kutta method of order 8.

Shares nothing with the package but the physics: initial value problems for
``θ'' = −4π² (q ρ cos θ + λ sin θ − μ cos θ)`` with tolerance 1e-13, integrated from kink to kink of
the load, with their exact variational equations. Unknowns are w = (κ(0), λ, μ).

- The shooting residual is (θ(1) − Δ + Θ, x(1) − ν, y(1)); its Jacobian J(1) comes from the
  variational equations.
- The index is the number of points conjugate to s = 0: zeros in (0, 1) of det J(s), where
  J(s) = ∂(θ, x, y)(s)/∂w [ManningRogersMaddocks1998]_. Critical points are the roots of det J(1).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

SPAN = float(np.sin(1.0))
FORCE = 4.0 * np.pi**2
TOLERANCE = 1e-13


@dataclass(frozen=True)
class Load:
    """Cumulated load ρ(s), smooth on each of the `pieces`."""

    rho: Callable[[float], float]
    pieces: tuple[float, ...] = (0.0, 1.0)


UNIFORM = Load(lambda s: s)
LEFT_HALF = Load(lambda s: min(2.0 * s, 1.0), (0.0, 0.5, 1.0))


@njit(cache=True)
def _rates(state, rho, q, lam, mu):
    """d/ds of θ, κ, x, y, E and of ∂(θ, κ, x, y)/∂(κ₀, λ, μ, q), quantity by quantity."""
    theta, kappa = state[0], state[1]
    sine, cosine, pull = np.sin(theta), np.cos(theta), q * rho - mu
    slope = -FORCE * (lam * cosine - pull * sine)
    rates = np.empty(21)
    rates[0], rates[1] = kappa, -FORCE * (pull * cosine + lam * sine)
    rates[2], rates[3] = cosine, sine
    rates[4] = kappa**2 / (2.0 * FORCE) - q * rho * sine
    for k in range(4):
        dtheta = state[5 + k]
        rates[5 + k], rates[9 + k] = state[9 + k], slope * dtheta
        rates[13 + k], rates[17 + k] = -sine * dtheta, cosine * dtheta
    rates[10] -= FORCE * sine  # by λ
    rates[11] += FORCE * cosine  # by μ
    rates[12] -= FORCE * rho * cosine  # by q
    return rates


@dataclass(frozen=True)
class Rod:
    """One initial value problem: parameters and shooting unknowns."""

    Theta: float
    Delta: float
    q: float = 0.0
    nu: float = SPAN
    load: Load = UNIFORM
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def _rates(self, s: float, state: np.ndarray) -> np.ndarray:
        return _rates(state, self.load.rho(s), self.q, self.w[1], self.w[2])

    def integrate(self, stop: float = 1.0, dense: bool = False) -> list:
        """Solutions from kink to kink: θ, κ, x, y, E and ∂(θ, κ, x, y)/∂(κ₀, λ, μ, q)."""
        state = np.zeros(21)
        state[:2] = self.Delta + self.Theta, self.w[0]
        state[9] = 1.0
        out = []
        edges = [*(e for e in self.load.pieces if e < stop), stop]
        for a, b in pairwise(edges):
            piece = solve_ivp(
                self._rates, (a, b), state, "DOP853",
                rtol=TOLERANCE, atol=1e-15, dense_output=dense,
            )  # fmt: skip
            state = piece.y[:, -1]
            out.append(piece)
        return out

    @cached_property
    def dense(self) -> list:
        """Solutions with continuous output."""
        return self.integrate(dense=True)

    @cached_property
    def last(self) -> np.ndarray:
        """Everything at s = 1."""
        return self.integrate()[-1].y[:, -1]

    def at(self, s: float) -> np.ndarray:
        """Everything at s, by integrating to it (dense output is less accurate)."""
        return self.integrate(s)[-1].y[:, -1] if s > 0 else self.dense[0].y[:, 0]

    @property
    def residual(self) -> np.ndarray:
        theta, _, x, y = self.last[:4]
        return np.array([theta - self.Delta + self.Theta, x - self.nu, y])

    @property
    def jacobian(self) -> np.ndarray:
        """∂(residual)/∂(κ₀, λ, μ, q)."""
        return _sensitivity(self.last)

    @property
    def determinant(self) -> float:
        return float(np.linalg.det(self.jacobian[:, :3]))

    def solved(self) -> "Rod":
        """The equilibrium near w at these parameters, by Newton.

        Where |κ| is large, round-off grows along the rod: there Newton ends where it gains no more.
        """
        rod, before = self, np.inf
        for _ in range(30):
            step = np.linalg.solve(rod.jacobian[:, :3], -rod.residual)
            step *= min(1.0, 2.0 / np.abs(step).max())
            rod = replace(rod, w=rod.w + step)
            size = np.abs(step).max()
            if size < 1e-11 or (size < 1e-7 and size > 0.5 * before):
                return rod
            before = size
        raise RuntimeError("shooting did not converge")

    def height(self, s: float) -> float:
        return float(self.at(s)[3])

    @property
    def energy(self) -> float:
        return float(self.last[4])

    def max_curvature(self) -> float:
        """max |κ|: ends, steps and the exact roots of κ' between them."""
        best = 0.0
        for piece in self.dense:
            best = max(best, np.abs(piece.y[1]).max())
            slope = [self._rates(s, y)[1] for s, y in zip(piece.t, piece.y.T, strict=True)]
            for i in np.flatnonzero(np.sign(slope[:-1]) != np.sign(slope[1:])):
                root = brentq(lambda s, p=piece: self._rates(s, p.sol(s))[1], *piece.t[i : i + 2])
                best = max(best, abs(self.at(root)[1]))
        return float(best)

    def index(self) -> int:
        """Conjugate points in (0, 1): sign changes of det J(s), sampled 400 times."""
        s = np.linspace(0.05, 1.0, 400)
        values = []
        for point in s:
            piece = next(p for p in self.dense if point <= p.t[-1] + 1e-15)
            values.append(np.linalg.det(_sensitivity(piece.sol(point))[:, :3]))
        sign = np.sign(values)
        return int((sign[1:] != sign[:-1]).sum())


def _sensitivity(state: np.ndarray) -> np.ndarray:
    return np.stack([state[5:9], state[13:17], state[17:21]])


def fold(near: Rod) -> Rod:
    """Fold of the path in q: residual = 0 and det J = 0 in (κ₀, λ, μ, q).

    Newton; ∂det J by central differences of exact determinants, so that it converges linearly with
    a factor near 1e-8.
    """
    rod = near
    for _ in range(30):
        matrix = np.empty((4, 4))
        matrix[:3] = rod.jacobian
        for i in range(4):
            h = 1e-4 * max(1.0, abs(rod.w[i] if i < 3 else rod.q))
            ahead, behind = _moved(rod, i, h), _moved(rod, i, -h)
            matrix[3, i] = (ahead.determinant - behind.determinant) / (2.0 * h)
        step = np.linalg.solve(matrix, -np.append(rod.residual, rod.determinant))
        rod = replace(rod, w=rod.w + step[:3], q=rod.q + step[3])
        if np.abs(step).max() < 1e-11:
            return rod
    raise RuntimeError("the fold was not found")


def _moved(rod: Rod, i: int, h: float) -> Rod:
    if i == 3:
        return replace(rod, q=rod.q + h)
    w = rod.w.copy()
    w[i] += h
    return replace(rod, w=w)


def critical(solution: Callable[[float], Rod], low: float, high: float) -> Rod:
    """Where det J changes sign along a one-parameter family of equilibria: for branch points."""
    root = brentq(lambda t: solution(t).determinant, low, high, xtol=1e-14, rtol=1e-15)
    return solution(root)


def from_package(state, load: Load = UNIFORM) -> Rod:
    """Shooting problem started from a state of the package, then solved independently."""
    values = state.parameters
    kappa = state.structure.curvature(0.0)(state)
    lam, mu = state.multipliers
    w = np.array([kappa, lam, mu])
    return Rod(values["Theta"], values["Delta"], values["q"], values["nu"], load, w)
