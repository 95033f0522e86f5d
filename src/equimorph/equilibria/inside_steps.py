"""What the eigenvalue of F_z nearest to zero does between two points of a path.

It is the cubic through its values and slopes (``dσ/ds = vᵀ D²F[v, T]`` with the unit eigenvector
v). Points are added until it is known that it does not reach zero, or where.

See docs/decisions.md, "Hidden events".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.arrays import Lanes
from equimorph.columns import Columns
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.curves import Curve, squared_length
from equimorph.equilibria.events import Events, locate_all
from equimorph.equilibria.kernels import EARLY_DIP, EARLY_NEAR
from equimorph.equilibria.locate import hermite
from equimorph.equilibria.steps import Bracket, Front, least_inside, step_along
from equimorph.equilibria.trace_options import EventCode, TraceOptions

Values = Float[np.ndarray, " points"]

CLOSE = 0.1
"""Least value inside a step, as a share of those at its ends, that asks for more points."""
AT_EVENT = 1e-6
"""Value at one end of a step over that at the other below which the end is itself an event."""
NARROW = 1.5e-4
"""Length in the metric on which the cubic is exact to round-off."""
TOUCH = 1e-9
"""Least value over those at the ends of a step that counts as zero."""
SHARP = 1e-6
"""Distance between two zeros of an eigenvalue, in the metric, below which they count as one that
touches zero: round-off, relative to the largest eigenvalues, hides what lies between."""
TRIALS = 30
"""Largest number of points inside a step at which the eigenvalue nearest to zero is computed."""


@dataclass(frozen=True)
class Probe(Columns):
    """Points with tangents, the eigenvalue nearest to zero and its slope, lengths on the way."""

    front: Front
    value: Values
    slope: Values
    length: Values


def probe_at(curve: Curve, front: Front, length: Values) -> Probe:
    """Eigenvalue nearest to zero, and its slope along the curve, at one point of each lane.

    By the solution of ``F_z v = −g b``: the eigenvalue is −g, and v = b, where b is an eigenvector.
    Between eigenvalues ±σ, b is none of either, and g has a pole; ``g/|v|`` is ±σ there, too.
    """
    p = curve.parameters(front.t)
    b = null_border(curve.structure, front.z, p)
    at = Critical(curve.structure, front.z, p, b)
    slope = at.second(front.tangent_z, front.tangent_t[:, None] * curve.rate(front.t))
    size = np.linalg.norm(at.v, axis=1)
    return Probe(front, -at.g / size, slope / size**2, length)


def inside_step(
    curve: Curve, ends: tuple[Front, Front], lengths: tuple[float, ...], options: TraceOptions
) -> list[Events]:
    """Events between two points of one lane that neither the index nor the direction shows.

    `lengths` on the way of the ends, and of a point between them at which F_z is nearly singular,
    if one is known.
    """
    both = curve.take(np.zeros(2, int))
    probe = probe_at(both, Front.concatenate(ends), np.array(lengths[:2]))
    smaller, larger = np.sort(np.abs(probe.value))
    # a path may start or arrive right at an event: that is no hidden one
    if smaller <= AT_EVENT * larger:
        return []
    pair, first = (probe.take(np.array([0])), probe.take(np.array([1]))), (*lengths[2:], None)[0]
    return look_inside(curve, pair, first, options)


def inside_only_steps(curve: Curve, bracket: Bracket, options: TraceOptions) -> list[Events]:
    """Events inside steps that are the only one of their lane, without a point before them.

    The determinant at the middle of the step shows where to search.
    """
    ends = bracket.before.index == bracket.after.index
    ends &= (bracket.travelled == 0.0) & (bracket.what & options.stops != 0)
    if not (curve.folds_change_index and options.look_inside and ends.any()):
        return []
    step = bracket.take(np.flatnonzero(ends))
    here, old, new = curve.take(step.lanes), step.before, step.after
    middle = hermite(step, np.full(len(step.lanes), 0.5))
    places = ((old.z, old.t), middle, (new.z, new.t))
    found = list[Events]()
    for i in np.flatnonzero(_may_vanish(np.stack([_determinant(here, *at) for at in places]))):
        one, lengths = step.take(np.array([i])), (0.0, float(step.step[i]))
        lane = curve.take(one.lanes)
        inside = inside_step(lane, (one.before, one.after), lengths, options)
        found += [replace(each, lanes=np.full(len(each.t), one.lanes[0])) for each in inside]
    return found


def _determinant(curve: Curve, z: Lanes, t: Values) -> Values:
    """Determinant of F_z."""
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    return curve.advance(np.ascontiguousarray(z), t, still, one, none).determinant


def _may_vanish(values: Float[np.ndarray, "3 steps"]) -> Bool[np.ndarray, " steps"]:
    """Whether what has such values at start, middle and end may touch zero or cross it twice."""
    start, middle, end = np.sign(values[0]) * values
    bow, slope = start + end - 2.0 * middle, end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        least = middle - slope * (slope / (8.0 * bow))  # a determinant's square may overflow
    dips = (np.abs(slope) < 2.0 * bow) & (least < EARLY_DIP * np.minimum(start, end))
    low = np.minimum(start, end) < EARLY_NEAR * middle
    return np.asarray(dips | low | (middle < EARLY_NEAR * np.minimum(start, end)))


def look_inside(
    curve: Curve, ends: tuple[Probe, Probe], first: float | None, options: TraceOptions
) -> list[Events]:
    """What an eigenvalue does between two points where it seems to come close to zero.

    `first` is a length at which it is known to be small.
    """
    zero = _zero(ends)
    sign = float(np.sign(ends[0].value[0]))
    low, high = (_upright(end, sign, zero) for end in ends)
    doubt = 0.0
    for _ in range(TRIALS):
        width = high.length - low.length
        if width[0] < NARROW:
            return _at_the_least(curve, (low, high), ends, options)
        share, least, size = _least(curve, low, high)
        if first is None and least > max(CLOSE * size, zero, doubt):
            return []
        share = share if first is None else float((first - low.length[0]) / width[0])
        middle, first = _between(curve, ends[0], (low.length, width), share), None
        if middle is None:
            break
        known = np.abs(middle.value[0]) > zero
        if known and middle.front.index[0] != ends[0].front.index[0]:
            return _both(curve, (low, middle, high), ends[0].front.index, options)
        middle = _upright(middle, sign, zero)
        doubt = _surprise(curve, (low, high), middle)
        if middle.slope[0] < 0.0:
            low = middle
        else:
            high = middle
    return [_event(EventCode.BRANCH_POINT, low.front.z, low.front.t, low, found=False)]


def _zero(ends: tuple[Probe, Probe]) -> float:
    """Size of an eigenvalue that counts as zero between two points."""
    low, high = ends
    bow = np.abs(np.sign(high.value) * high.slope - np.sign(low.value) * low.slope)
    bow = 0.125 * bow * SHARP**2 / (high.length - low.length)
    return float(np.maximum(TOUCH * np.minimum(np.abs(low.value), np.abs(high.value)), bow)[0])


def _upright(probe: Probe, sign: float, zero: float) -> Probe:
    """The size of the eigenvalue; one that is zero within round-off has the sign of the ends."""
    turned = np.where(np.abs(probe.value) > zero, np.sign(probe.value), sign)
    return replace(probe, value=turned * probe.value, slope=turned * probe.slope)


def _surprise(curve: Curve, ends: tuple[Probe, Probe], middle: Probe) -> float:
    """Error of the cubic through two points at a point between them."""
    low, high = ends
    s, width = (middle.length - low.length) / (high.length - low.length), _chord(curve, low, high)
    cubic = (1 - s) ** 2 * ((1 + 2 * s) * low.value + s * width * low.slope)
    cubic = cubic + s**2 * ((3 - 2 * s) * high.value - (1 - s) * width * high.slope)
    return float(np.abs(middle.value - cubic)[0])


def _between(curve: Curve, start: Probe, span: tuple[Values, Values], share: float) -> Probe | None:
    """Point of a step at a share of a span, or elsewhere in it if the curve is singular there."""
    for place in (min(max(share, 0.1), 0.9), 0.37, 0.71):
        length = span[0] + place * span[1]
        front, good = step_along(curve, start.front, length - start.length)
        if good[0]:
            return probe_at(curve, front, length)
    return None


def _event(code: int, z: Float[np.ndarray, "1 size"], t: Values, low: Probe, found: bool) -> Events:
    """One event that leaves the index as it is."""
    index = np.stack([low.front.index, low.front.index], 1)
    kind, sure = np.array([code]), np.array([found])
    return Events(np.zeros(1, int), kind, z, t, low.length, index, sure)


def _chord(curve: Curve, low: Probe, high: Probe) -> Values:
    """Distance between two points: for narrow pieces their arclength."""
    a, b = low.front, high.front
    lengths = squared_length(curve.structure, curve.weight, b.z - a.z, b.t - a.t)
    return np.asarray(np.sqrt(lengths))


def _least(curve: Curve, low: Probe, high: Probe) -> tuple[float, float, float]:
    """Share and least value of the cubic between two points, and the smaller of their values."""
    values, slopes = (low.value, high.value), (low.slope, high.slope)
    share, least = least_inside(values, slopes, _chord(curve, low, high))
    return float(share[0]), float(least[0]), float(np.minimum(*values)[0])


def _at_the_least(
    curve: Curve, near: tuple[Probe, Probe], ends: tuple[Probe, Probe], options: TraceOptions
) -> list[Events]:
    """Decide on a narrow piece: nothing, one event that touches, or two."""
    low, high = near
    share, least, _ = _least(curve, low, high)
    zero = _zero(ends)
    if least > zero:
        return []
    piece = replace(step_between(near, 0), step=_chord(curve, low, high))
    z, t = hermite(piece, np.array([share]))
    length = low.length + share * (high.length - low.length)
    if least < -zero:
        front, good = step_along(curve, ends[0].front, length - ends[0].length)
        if good[0] and front.index[0] != ends[0].front.index[0]:
            return _both(
                curve,
                (low, Probe(front, length, length, length), high),
                ends[0].front.index,
                options,
            )
    code = EventCode.FOLD if _turns(curve, z, t) else EventCode.BRANCH_POINT
    return [_event(code, z, t, replace(low, length=length), found=True)]


def _turns(curve: Curve, z: Float[np.ndarray, "1 size"], t: Values) -> bool:
    """Whether vᵀF_t is not zero at a singular point: a fold in which the path does not turn."""
    p = curve.parameters(t)
    at = Critical(curve.structure, z, p, null_border(curve.structure, z, p))
    column = curve.structure.parameter_derivative(z, p, curve.rate(t))
    return bool(np.abs(at.along(curve.rate(t)))[0] > 1e-6 * np.linalg.norm(column) > 1e-12)


def _both(
    curve: Curve,
    points: tuple[Probe, Probe, Probe],
    index: Int[np.ndarray, " 1"],
    options: TraceOptions,
) -> list[Events]:
    """Locate the events on both sides of a point with another index than that around."""
    low, middle, high = points
    # at a point that is itself singular the index is one of round-off
    low, high = (replace(each, front=replace(each.front, index=index)) for each in (low, high))
    brackets = [step_between(pair, None) for pair in ((low, middle), (middle, high))]
    return [locate_all(curve, brackets, (), replace(options, locate_passed=True))]


def step_between(pair: tuple[Probe, Probe], what: int | None) -> Bracket:
    """Step between two points, with the data of its ends."""
    low, high = pair
    flipped = np.sign(low.front.tangent_t) != np.sign(high.front.tangent_t)
    code = (
        np.where(flipped, EventCode.FOLD, EventCode.BRANCH_POINT)
        if what is None
        else np.array([what])
    )
    step = high.length - low.length
    return Bracket(np.zeros(1, int), low.front, high.front, step, low.length, code)
