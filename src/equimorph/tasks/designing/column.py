"""`strongest_column`: the area along a column of given volume that carries the largest load.

For similar cross-sections of area a the bending stiffness is B = a². With the slope v of the
deflection the buckling load is the least t at which ``K(a) − t M`` is singular, where
``vᵀKv = ∫ a² v'² ds`` and ``vᵀMv = ∫ v² ds`` on slopes that the supports allow. At the optimum two
loads may coincide, as between clamps [OlhoffRasmussen1977]_; there the load has no derivative, but
``t + μ log det(K(a) − t M)`` has, which is made as large as possible while μ → 0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh, null_space

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import count
from equimorph.arrays import Float
from equimorph.structures.rod.discretisation import reference_element

Supports = Literal["clamped-free", "clamped-clamped"]
Matrix = Float[np.ndarray, "n n"]
Vector = Float[np.ndarray, " n"]
Areas = Float[np.ndarray, " m"]

DEGREE = 4
"""Of the deflection's slope on each element."""
LEAST_AREA = {"clamped-free": 1e-4, "clamped-clamped": 1e-3}
"""Least area, relative to the mean: strongest columns have points that do not bend."""
SHARES = tuple((0.1 * 0.2 ** np.arange(13)).tolist())
"""Weights μ of the barriers, relative to the load of the uniform column."""
STEPS, HALVINGS = 30, 30
"""Steps of Newton's method for each μ, and halvings of a step."""
STILL = 1e-3
"""Decrement of Newton's method, relative to μ, at which the next μ is taken."""
ARMIJO = 1e-4
"""Share of the predicted descent that a step must make."""
SAME_LOAD = 1e-4
"""Relative difference of buckling loads that count as equal."""


@dataclass(frozen=True, eq=False)
class StrongestColumn:
    """Area and stiffness along the strongest column, and what it carries.

    Units: length 1, volume 1, stiffness of the uniform column 1; B = a².

    Parameters
    ----------
    supports
        "clamped-free" or "clamped-clamped".
    s, area
        Knots and the area there, linear in between.
    loads
        The lowest buckling loads in units of B/L², of the uniform column.
    uniform
        The lowest one of the uniform column.
    steps
        Newton steps.
    """

    supports: Supports
    s: Vector
    area: Vector
    loads: Float[np.ndarray, " modes"]
    uniform: float
    steps: int

    def __repr__(self) -> str:
        """Supports, load and multiplicity."""
        times = f", {self.multiplicity}-fold" if self.multiplicity > 1 else ""
        return (
            f"StrongestColumn({self.supports}: {self.load:.8g}{times}, "
            f"{self.load / self.uniform:.6g} of the uniform one)"
        )

    @property
    def load(self) -> float:
        """The buckling load."""
        return float(self.loads[0])

    @property
    def multiplicity(self) -> int:
        """Number of buckling loads that coincide."""
        return int((self.loads <= self.load * (1.0 + SAME_LOAD)).sum())

    def stiffness(self, s: Vector) -> Vector:
        """B(s) = a(s)²: the `stiffness` of a `Rod`, with the knots as its `kinks`."""
        return np.asarray(np.interp(s, self.s, self.area) ** 2)


@check_arguments
def strongest_column(
    supports: Supports, elements: Annotated[int, count(4, 256)] = 64
) -> StrongestColumn:
    """Find the area along a column of given volume that carries the largest load, for B = a².

    Of all loads t and areas a with ``K(a) − t M`` positive definite, the largest t is found by a
    primal interior-point method; buckling loads that coincide need no special treatment.

    Parameters
    ----------
    supports
        "clamped-free" or "clamped-clamped".
    elements
        Elements of the slope, and intervals of the area. They are denser where the bending moment
        vanishes.

    Returns
    -------
    The column, with its lowest loads.

    References
    ----------
    [Keller1960]_; [OlhoffRasmussen1977]_.

    Examples
    --------
    >>> import equimorph as em
    >>> column = em.strongest_column("clamped-free", 32)
    >>> round(column.load / column.uniform, 5)
    1.33333
    """
    column = _Elements(supports, _knots(supports, elements))
    area, steps = column.strongest()
    loads = column.loads(area, 3)
    uniform = column.loads(np.ones_like(area), 1)
    return StrongestColumn(supports, column.knots, area, loads, float(uniform[0]), steps)


def _knots(supports: Supports, elements: int) -> Vector:
    """Knots denser at the free end, or at ¼ and ¾, where the moment vanishes."""
    q = np.linspace(0.0, 1.0, elements + 1)
    if supports == "clamped-free":
        return np.asarray(1.0 - (1.0 - q) ** 2)
    return np.asarray(q + 0.7 * np.sin(4.0 * np.pi * q) / (4.0 * np.pi))


@dataclass(frozen=True, eq=False)
class _Elements:
    """K(a) = Σ a² b bᵀ over the points of Gauss, on slopes that obey the supports; and M."""

    supports: Supports
    knots: Vector

    @cached_property
    def _tables(
        self,
    ) -> tuple[Float[np.ndarray, "points n"], Matrix, Float[np.ndarray, "points m"]]:
        """Rows b with weights, M, and shares of the areas at the knots at each point."""
        rule = reference_element(DEGREE)
        points, weights = legendre.leggauss(DEGREE + 3)
        t, weights = 0.5 * (points + 1.0), 0.5 * weights
        shapes = legendre.legvander(points, DEGREE) @ rule.to_legendre
        slopes = shapes @ rule.derivative
        lengths, count = np.diff(self.knots), len(self.knots) - 1
        size, rows, shares = count * DEGREE + 1, [], []
        mass, mean = np.zeros((size, size)), np.zeros(size)
        for e, h in enumerate(lengths.tolist()):
            own = slice(e * DEGREE, e * DEGREE + DEGREE + 1)
            mass[own, own] += (shapes * (weights * h)[:, None]).T @ shapes
            mean[own] += (weights * h) @ shapes
            block, share = np.zeros((len(t), size)), np.zeros((len(t), count + 1))
            block[:, own] = slopes * np.sqrt(weights / h)[:, None]
            share[:, e], share[:, e + 1] = 1.0 - t, t
            rows.append(block)
            shares.append(share)
        basis = self._allowed_slopes(mean)
        return np.concatenate(rows) @ basis, basis.T @ mass @ basis, np.concatenate(shares)

    def _allowed_slopes(self, mean: Float[np.ndarray, " size"]) -> Float[np.ndarray, "size n"]:
        """Slopes that vanish at clamps and, between two of them, in the mean."""
        unit = np.eye(len(mean))
        if self.supports == "clamped-free":
            return unit[:, 1:]
        return np.asarray(null_space(np.stack([unit[0], unit[-1], mean])))

    @cached_property
    def volume(self) -> Vector:
        """Weights of the areas at the knots in the volume."""
        h = np.diff(self.knots)
        return np.asarray(0.5 * (np.append(h, 0.0) + np.append(0.0, h)))

    def stiffness(self, area: Areas) -> Matrix:
        """K(a)."""
        rows, _, shares = self._tables
        scaled = rows * (shares @ area)[:, None]
        return np.asarray(scaled.T @ scaled)

    def loads(self, area: Areas, number: int) -> Vector:
        """Lowest buckling loads."""
        chosen = (0, number - 1)
        found = eigh(
            self.stiffness(area), self._tables[1], subset_by_index=chosen, eigvals_only=True
        )
        return np.asarray(found)

    def strongest(self) -> tuple[Vector, int]:
        """Areas with the largest load, and the number of Newton steps."""
        area = np.ones(len(self.knots))
        unit = float(self.loads(area, 1)[0])
        state, steps = np.append(area, 0.5 * unit), 0
        for share in SHARES:
            for _ in range(STEPS):
                step, decrement = self._newton(state, share, unit)
                steps += 1
                state = self._shorten(state, step, share, unit, decrement)
                if decrement < STILL * share:
                    break
        return state[:-1], steps

    def _barrier(self, state: Vector, share: float, unit: float) -> float:
        """−t/t₀ − μ (log det(K − tM) + Σ log(a − a_min)); ∞ outside."""
        area, t = state[:-1], float(state[-1])
        room = area - LEAST_AREA[self.supports]
        if room.min() <= 0.0:
            return np.inf
        try:
            factor = np.linalg.cholesky(self.stiffness(area) - t * self._tables[1])
        except np.linalg.LinAlgError:
            return np.inf
        barrier = 2.0 * np.log(np.diag(factor)).sum() + np.log(room).sum()
        return float(-t / unit - share * barrier)

    def _newton(self, state: Vector, share: float, unit: float) -> tuple[Vector, float]:
        """Step at constant volume, and its decrement; convexified where that is no descent."""
        (rows, mass, shares), area, t = self._tables, state[:-1], float(state[-1])
        room, at_points = area - LEAST_AREA[self.supports], shares @ area
        inverse = np.linalg.inv(self.stiffness(area) - t * mass)
        by_mass, gram = inverse @ mass, rows @ inverse @ rows.T
        both, change = rows @ by_mass, 2.0 * at_points[:, None] * shares
        cross = np.einsum("qi,ij,qj->q", both, inverse, rows)
        m, diagonal = len(area), np.diag(gram)
        slope = np.append(
            -share * (change.T @ diagonal + 1.0 / room), share * np.trace(by_mass) - 1.0 / unit
        )
        convex = np.zeros((m + 1, m + 1))
        convex[:m, :m] = share * (change.T @ (gram**2) @ change + np.diag(1.0 / room**2))
        convex[m, m] = share * np.sum(by_mass * by_mass.T)
        convex[:m, m] = convex[m, :m] = -share * (change.T @ cross)
        exact = convex.copy()
        exact[:m, :m] -= 2.0 * share * (shares.T * diagonal) @ shares
        for hessian in (exact, convex):
            system = np.zeros((m + 2, m + 2))
            system[: m + 1, : m + 1] = hessian
            system[:m, -1] = system[-1, :m] = self.volume
            step = np.linalg.solve(system, np.append(-slope, 0.0))[:-1]
            decrement = float(-slope @ step)
            if decrement > 0.0:
                break
        return step, decrement

    def _shorten(
        self, state: Vector, step: Vector, share: float, unit: float, decrement: float
    ) -> Vector:
        """State after the step, halved until the barrier function falls."""
        here, size = self._barrier(state, share, unit), 1.0
        for _ in range(HALVINGS):
            there = state + size * step
            if self._barrier(there, share, unit) <= here - ARMIJO * size * decrement:
                return there
            size *= 0.5
        return state
