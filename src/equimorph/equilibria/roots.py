"""Roots of a scalar inside steps: every trial point is corrected onto its curve.

[Chandrupatla1997]_: inverse quadratic interpolation where the last three points allow it, else
bisection. The curve between the ends of the bracket is predicted by the cubic through them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria.curves import Curve, dual
from equimorph.equilibria.fronts import Bracket, Front, onto_curve
from equimorph.equilibria.kernels import row_sums

Values = Float[np.ndarray, " lanes"]
Flags = Bool[np.ndarray, " lanes"]
Some = Int[np.ndarray, " some"]
Scalar = Callable[[Some, Front], Float[np.ndarray, " some"]]

TRIALS = 60
PLACE, VALUE = 1e-14, 1e-13
"""Width of a bracket, and value of the scalar over that at its ends, that end the iteration."""


@dataclass
class _End:
    """One end of each bracket: length from the start of the step, value there, point."""

    x: Values
    f: Values
    front: Front

    def take(self, some: Some) -> "_End":
        """Return some of the lanes."""
        return _End(self.x[some], self.f[some], self.front.take(some))

    def put(self, some: Some, other: "_End") -> None:
        """Replace some of the lanes."""
        self.x[some], self.f[some] = other.x, other.f
        for mine, new in zip(vars(self.front).values(), vars(other.front).values(), strict=True):
            mine[some] = new


@dataclass(frozen=True)
class Root:
    """Points where the scalar vanishes, their lengths from the start of the step, and success."""

    front: Front
    at: Values
    found: Flags


def root_inside(
    curve: Curve, bracket: Bracket, scalar: Scalar, ends: tuple[Values, Values], guess: Values
) -> Root:
    """Zero of a scalar with values of opposite signs at the ends of a step.

    Parameters
    ----------
    scalar
        Values at points on some of the lanes, whose numbers come first.
    ends
        Values at both ends of the step; a zero at the start is the root.
    guess
        Share of the step that is tried first.
    """
    lanes = len(guess)
    start = bracket.before.take(np.arange(lanes))
    one = _End(bracket.step.copy(), ends[1].copy(), bracket.after.take(np.arange(lanes)))
    two = _End(np.zeros(lanes), ends[0].copy(), start)
    three_x, three_f = two.x.copy(), two.f.copy()
    small = VALUE * (np.abs(ends[0]) + np.abs(ends[1]))
    share, found = 1.0 - guess, np.ones(lanes, bool)
    one.put(np.flatnonzero(two.f == 0.0), two.take(np.flatnonzero(two.f == 0.0)))
    todo = np.flatnonzero(np.abs(one.f) > small)
    for _ in range(TRIALS):
        if len(todo) == 0:
            break
        a, b = one.take(todo), two.take(todo)
        x = a.x + share[todo] * (b.x - a.x)
        new, good = _point(curve.take(todo), bracket.take(todo), (a, b), x)
        found[todo[~good]] = False
        trial = _End(x, scalar(todo, new), new)
        same = np.sign(trial.f) == np.sign(a.f)
        three_x[todo], three_f[todo] = np.where(same, a.x, b.x), np.where(same, a.f, b.f)
        two.put(todo[~same], a.take(np.flatnonzero(~same)))
        one.put(todo, trial)
        share[todo] = _next_share(one.take(todo), two.take(todo), three_x[todo], three_f[todo])
        wide = np.abs(one.x[todo] - two.x[todo]) > PLACE
        todo = todo[good & wide & (np.abs(trial.f) > small[todo])]
    found[todo] = False
    return Root(one.front, one.x, found)


def _point(
    curve: Curve, bracket: Bracket, ends: tuple[_End, _End], x: Values
) -> tuple[Front, Flags]:
    """Points of the curves at lengths x, predicted by the cubic through two points."""
    a, b = ends
    row, corner = dual(
        curve.structure, curve.weight, bracket.before.tangent_z, bracket.before.tangent_t
    )
    width = b.x - a.x
    s = (x - a.x) / width
    weights = (1 - s) ** 2 * (1 + 2 * s), s**2 * (3 - 2 * s), s * (1 - s) ** 2, -(s**2) * (1 - s)
    # derivatives by the length, which is measured along the tangent at the start of the step
    slopes = [
        width / (row_sums(row, end.front.tangent_z) + corner * end.front.tangent_t) for end in ends
    ]
    factors = (weights[0], weights[1], weights[2] * slopes[0], weights[3] * slopes[1])
    columns = (a.front.z, b.front.z, a.front.tangent_z, b.front.tangent_z)
    scalars = (a.front.t, b.front.t, a.front.tangent_t, b.front.tangent_t)
    z = sum(f[:, None] * column for f, column in zip(factors, columns, strict=True))
    t = sum(f * scalar for f, scalar in zip(factors, scalars, strict=True))
    return onto_curve(curve, bracket.before, (np.asarray(z), np.asarray(t)), x)


def _next_share(one: _End, two: _End, x3: Values, f3: Values) -> Values:
    """Where to look next, as a share of the way from the newest point to the other end."""
    x1, f1, x2, f2 = one.x, one.f, two.x, two.f
    with np.errstate(all="ignore"):
        xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
        inverse = (1 - np.sqrt(1 - xi) < phi) & (phi < np.sqrt(xi))
        share = f1 / (f2 - f1) * f3 / (f2 - f3)
        share += (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
    safe = np.clip(share, 1e-6, 1.0 - 1e-6)
    return np.where(inverse & np.isfinite(share), safe, 0.5)
