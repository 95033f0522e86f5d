"""Violations of constraints inside steps of lanes, which the ends of these do not show.

The excess over a bound along a step is the cubic through its values and slopes at points on the
path. Each further point shows the error of the cubic; points are added until the bound is out of
reach, or exceeded.

See docs/decisions.md, "Short violations of constraints".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Some
from equimorph.columns import Columns
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.legs import ON_BOUND
from equimorph.equilibria.steps import Bracket, Front, along_tangents, least_inside, step_along
from equimorph.model import Constraint
from equimorph.tolerances import METRIC_DIFFERENCE

Values = Float[np.ndarray, " points"]
INNER = 0.2
"""Least share of a part by which points inside are away from its ends: the error of the cubic at
such a point is at least that of the cubics through it."""
NARROW = 1e-5
"""Length of parts in which nothing is looked for."""
ROUNDS = 12
"""Most rounds of points inside a step: parts in which kinks come close to a bound are halved."""


@dataclass(frozen=True)
class Point(Columns):
    """Points on steps: lengths from their starts, the excess over the bound and its slope."""

    length: Values
    value: Values
    slope: Values


@dataclass(frozen=True)
class Part(Columns):
    """Parts of steps in which the bound may be exceeded; the error of their cubics."""

    step: Some
    low: Point
    high: Point
    doubt: Values

    @property
    def width(self) -> Values:
        """Length of the parts."""
        return np.asarray(self.high.length - self.low.length)

    @property
    def rises(self) -> tuple[Values, Values]:
        """Slopes at both ends, times the width."""
        return np.asarray(self.low.slope * self.width), np.asarray(self.high.slope * self.width)


def may_exceed(part: Part, floor: float) -> Flags:
    """Whether parts may rise above a bound; those that end above, whether more than once."""
    (a, b), (low, high) = part.rises, (part.low.value, part.high.value)
    top = -least_inside((-low, -high), (-a, -b), np.ones_like(low))[1]
    # control points with one change of sign allow one root, whatever such an error of degree four
    slack = 16.0 / 3.0 * part.doubt
    again = (low + a / 3.0 > -slack) & (high - b / 3.0 < slack)
    doubtful = np.where(high > floor, again, top + part.doubt > floor)
    return np.asarray(doubtful & (part.width > NARROW))


def hidden_violations(curve: Curve, constraint: Constraint, bracket: Bracket) -> Values:
    """Lengths at which steps exceed a bound that their ends show once at most; infinite for none.

    What is found need not be the first place. Where no point can be found inside, that length.
    """
    start, floor = bracket.before, ON_BOUND * constraint.size
    step, none = np.arange(len(bracket.step)), np.zeros(len(bracket.step))
    ends = (start, none), (bracket.after, bracket.step)
    low, high = (_point(curve, constraint, start, *end) for end in ends)
    found, part = none + np.inf, Part(step, low, high, none + np.inf)
    for _ in range(ROUNDS):
        part = part.take(may_exceed(part, floor) & np.isinf(found[part.step]))
        if len(part.step) == 0:
            break
        share = np.clip(_highest(part, floor), INNER, 1.0 - INNER)
        here, begun = curve.take(part.step), start.take(part.step)
        length = part.low.length + share * part.width
        front, good = step_along(here, begun, length)
        middle = _point(here, constraint, begun, front, length)
        beyond = ~good | (middle.value > floor)
        np.minimum.at(found, part.step[beyond], length[beyond])
        doubt = _surprise(part, middle, share)
        halves = (part.low, middle), (middle, part.high)
        part = Part.concatenate([Part(part.step, *half, doubt) for half in halves])
    return found


def _point(
    curve: Curve, constraint: Constraint, start: Front, front: Front, length: Values
) -> Point:
    """Excess and its slope, per length along the tangent at the start of the step."""
    h = METRIC_DIFFERENCE / along_tangents(curve, start, front)
    here, ahead, behind = (
        constraint.excess(*curve.states(z, t))
        for z, t in (
            (front.z + s * h[:, None] * front.tangent_z, front.t + s * h * front.tangent_t)
            for s in (0.0, 1.0, -1.0)
        )
    )
    return Point(length, here, np.asarray((ahead - behind) / (2.0 * METRIC_DIFFERENCE)))


def _highest(part: Part, floor: float) -> Values:
    """Share at which the cubic is highest; the middle of parts that end beyond the bound."""
    (a, b), (low, high) = part.rises, (part.low.value, part.high.value)
    share, _ = least_inside((-low, -high), (-a, -b), np.ones_like(low))
    return np.where(high > floor, 0.5, share)


def _surprise(part: Part, middle: Point, share: Values) -> Values:
    """Error of the cubic, by its value and slope at a point inside."""
    s, (a, b), low, rise = share, part.rises, part.low.value, part.high.value - part.low.value
    c2, c3 = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
    value, slope = low + s * (a + s * (c2 + s * c3)), a + s * (2.0 * c2 + 3.0 * s * c3)
    error = np.abs(middle.value - value) + np.abs(middle.slope * part.width - slope) / 8.0
    return np.asarray(error)
