"""Events that neither index nor direction betray: eigenvalues that touch zero, or cross it twice.

Between neighbouring points of a path the eigenvalue of F_z nearest to zero is the cubic through its
values and slopes (``dσ/ds = vᵀ D²F[v, T]`` with the unit eigenvector v). Where the cubic comes
close to zero, points are added until it is known that it does not reach it, or where.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.cubics import least_inside
from equimorph.equilibria.curves import ParameterLine, dual, squared_length
from equimorph.equilibria.fronts import Bracket, Front, step_along
from equimorph.equilibria.happenings import Happenings, locate_all
from equimorph.equilibria.location import hermite
from equimorph.equilibria.outcome import Outcome
from equimorph.equilibria.tracing import (
    ARRIVAL,
    BRANCH,
    CONSTRAINT,
    FOLD,
    RETURN,
    Points,
    TraceOptions,
)

Values = Float[np.ndarray, " points"]

CLOSE = 0.1
"""Least value inside a step, as a share of those at its ends, that asks for more points."""
NARROW = 1.5e-4
"""Length in the metric on which the cubic is exact to round-off."""
TOUCH = 1e-9
"""Least value over those at the ends of a step that counts as zero."""
AT_EVENT = 1e-6
"""Value at one end of a step over that at the other below which the end is itself an event."""
TRIALS = 30


@dataclass(frozen=True)
class _Probe:
    """Points with tangents, the eigenvalue nearest to zero and its slope, lengths on the way."""

    front: Front
    value: Values
    slope: Values
    length: Values

    def at(self, some: Int[np.ndarray, " some"]) -> "_Probe":
        """Return some of the points."""
        columns = (self.value[some], self.slope[some], self.length[some])
        return _Probe(self.front.take(some), *columns)


def with_hidden_events(
    curve: ParameterLine, z: Float[np.ndarray, "1 size"], outcome: Outcome, options: TraceOptions
) -> Outcome:
    """Outcome of one recorded lane, started at z, completed by what its steps did not show.

    The first hidden event that ends a lane ends this one.
    """
    hidden = hidden_events(curve, _points(curve, z, outcome), options)
    if len(hidden.code) == 0:
        return outcome
    passed = Happenings.joined([outcome.passed, hidden], z.shape[1])
    stops = np.flatnonzero((hidden.code & options.stops != 0) | ~hidden.found)
    if len(stops) == 0:
        return replace(outcome, passed=passed)
    end = hidden.take(stops[:1])
    located = bool(end.found[0])
    touching = end.index[0, 0] == end.index[0, 1] and end.code[0] == FOLD
    why = "the path touches a fold and goes on" if touching else ""
    return replace(
        outcome,
        code=end.code if located else np.zeros(1, int),
        z=end.z,
        t=end.t,
        index=end.index[:, 0],
        travelled=end.travelled,
        why={0: why if located else "a hidden pair of events could not be located"},
        passed=passed.take(passed.travelled < end.travelled[0]),
    )


def _points(curve: ParameterLine, z: Float[np.ndarray, "1 size"], outcome: Outcome) -> Points:
    """Start, recorded points, and the end if it is a regular one."""
    index = curve.structure.index(z, curve.parameters(np.zeros(1)))
    start = Points(np.zeros(1, int), np.zeros(1), z, np.zeros(1), index)
    parts = [start, outcome.points]
    if outcome.code[0] in {ARRIVAL, RETURN, CONSTRAINT}:
        end = (outcome.travelled, outcome.z, outcome.t, outcome.index)
        parts.append(Points(np.zeros(1, int), *end))
    return Points.joined(parts, z.shape[1])


def hidden_events(curve: ParameterLine, points: Points, options: TraceOptions) -> Happenings:
    """Folds and branch points between the points of a traced path that its steps do not show.

    An eigenvalue that touches zero is one event that leaves the index as it is; one that crosses
    zero twice between two points gives two events.

    Parameters
    ----------
    curve
        The curve of one lane.
    points
        Its points, from the start on.
    """
    size, found = curve.structure.size, list[Happenings]()
    if len(points.t) < 2:
        return Happenings.joined(found, size)
    probe = _probed(curve, _fronts(curve, points), points.travelled)
    kept, skipped = _without_lowest(np.abs(probe.value), points.index)
    few = probe.at(kept)
    sign = np.sign(few.value)
    values, slopes = sign * few.value, sign * few.slope
    ends = values[:-1], values[1:]
    least = least_inside(ends, (slopes[:-1], slopes[1:]), np.diff(few.length))[1]
    smaller, larger = np.minimum(*ends), np.maximum(*ends)
    # a path may start or arrive right at an event: that is no hidden one
    doubtful = (least < CLOSE * smaller) & (smaller > AT_EVENT * larger)
    same = np.diff(few.front.index) == 0
    for i in np.flatnonzero((doubtful | (skipped >= 0)) & same):
        pair = (few.at(np.array([i])), few.at(np.array([i + 1])))
        first = float(probe.length[skipped[i]]) if skipped[i] >= 0 else None
        found += _closer(curve, pair, first, options)
    return Happenings.joined(found, size)


def _without_lowest(
    value: Values, index: Int[np.ndarray, " points"]
) -> tuple[Int[np.ndarray, " kept"], Int[np.ndarray, " gaps"]]:
    """Leave out points that happen to lie near a least value, lest it hide between two gaps.

    Returns the numbers of the points kept, and for each gap the number of the one left out, or −1.
    """
    inner = value[1:-1] < CLOSE * np.minimum(value[:-2], value[2:])
    inner &= (index[1:-1] == index[:-2]) & (index[1:-1] == index[2:])
    lowest = np.concatenate([[False], inner, [False]])
    kept = np.flatnonzero(~lowest)
    between = np.diff(kept) > 1
    return kept, np.where(between, kept[:-1] + 1, -1)


def _fronts(curve: ParameterLine, points: Points) -> Front:
    """Unit tangents at the points of a path, along it."""
    many = curve.take(np.zeros(len(points.t), int))
    # the chord to the next point tells the direction, and closes the system
    dz, dt = np.diff(points.z, axis=0), np.diff(points.t)
    dz, dt = np.concatenate([dz, dz[-1:]]), np.append(dt, dt[-1])
    row, corner = dual(curve.structure, many.weight, dz, dt)
    move = many.advance(points.z, points.t, row, corner, np.zeros(len(points.t)))
    along, alongside = dual(curve.structure, many.weight, move.tangent_z, move.tangent_t)
    norm = np.sqrt((along * move.tangent_z).sum(axis=1) + alongside * move.tangent_t)
    tangent = move.tangent_z / norm[:, None], move.tangent_t / norm
    return Front(points.z, points.t, *tangent, points.index)


def _probed(curve: ParameterLine, front: Front, length: Values) -> _Probe:
    """Eigenvalue nearest to zero, and its slope along the curve."""
    many = curve.take(np.zeros(len(front.t), int))
    p = many.parameters(front.t)
    b = null_border(curve.structure, front.z, p)
    at = Critical(curve.structure, front.z, p, b)
    slope = at.second(front.tangent_z, front.tangent_t[:, None] * many.velocity)
    return _Probe(front, -at.g, slope, length)


def _closer(
    curve: ParameterLine,
    ends: tuple[_Probe, _Probe],
    first: float | None,
    options: TraceOptions,
) -> list[Happenings]:
    """What an eigenvalue does between two points where it seems to come close to zero.

    `first` is a length at which it is known to be small.
    """
    low, high = ends
    for _ in range(TRIALS):
        if float(high.length[0] - low.length[0]) < NARROW:
            return _at_the_least(curve, (low, high), ends, options)
        share, least, size = _least(curve, low, high)
        if least > CLOSE * size and first is None:
            return []
        width = high.length - low.length
        share = share if first is None else float((first - low.length[0]) / width[0])
        middle, first = _between(curve, ends[0], (low.length, width), share), None
        if middle is None:
            break
        known = np.abs(middle.value[0]) > TOUCH * size
        if known and middle.front.index[0] != low.front.index[0]:
            return _both(curve, ends, middle.front, middle.length, options)
        if np.sign(middle.value[0]) * middle.slope[0] < 0.0:
            low = middle
        else:
            high = middle
    return [_event(BRANCH, low.front.z, low.front.t, low, found=False)]


def _between(
    curve: ParameterLine, start: _Probe, span: tuple[Values, Values], share: float
) -> _Probe | None:
    """Point of a step at a share of a span, or elsewhere in it if the curve is singular there."""
    for place in (min(max(share, 0.1), 0.9), 0.37, 0.71):
        length = span[0] + place * span[1]
        front, good = step_along(curve, start.front, length - start.length)
        if good[0]:
            return _probed(curve, front, length)
    return None


def _event(
    code: int, z: Float[np.ndarray, "1 size"], t: Values, low: _Probe, found: bool
) -> Happenings:
    """One event that leaves the index as it is."""
    index = np.stack([low.front.index, low.front.index], 1)
    kind, sure = np.array([code]), np.array([found])
    return Happenings(np.zeros(1, int), kind, z, t, low.length, index, sure)


def _chord(curve: ParameterLine, low: _Probe, high: _Probe) -> Values:
    """Distance between two points: for narrow pieces their arclength."""
    a, b = low.front, high.front
    lengths = squared_length(curve.structure, curve.weight, b.z - a.z, b.t - a.t)
    return np.asarray(np.sqrt(lengths))


def _least(curve: ParameterLine, low: _Probe, high: _Probe) -> tuple[float, float, float]:
    """Share and least value of the cubic between two points, and the smaller of their values."""
    one, two = np.sign(low.value), np.sign(high.value)
    values, slopes = (one * low.value, two * high.value), (one * low.slope, two * high.slope)
    share, least = least_inside(values, slopes, _chord(curve, low, high))
    return float(share[0]), float(least[0]), float(min(values[0][0], values[1][0]))


def _at_the_least(
    curve: ParameterLine,
    near: tuple[_Probe, _Probe],
    ends: tuple[_Probe, _Probe],
    options: TraceOptions,
) -> list[Happenings]:
    """Decide on a narrow piece: nothing, one event that touches, or two."""
    low, high = near
    share, least, _ = _least(curve, low, high)
    zero = TOUCH * float(min(np.abs(ends[0].value[0]), np.abs(ends[1].value[0])))
    if least > zero:
        return []
    piece = replace(_bracket(near, 0), step=_chord(curve, low, high))
    z, t = hermite(piece, np.array([share]))
    length = low.length + share * (high.length - low.length)
    if least < -zero:
        front, good = step_along(curve, ends[0].front, length - ends[0].length)
        if good[0] and front.index[0] != low.front.index[0]:
            return _both(curve, ends, front, length, options)
    code = FOLD if _turns(curve, z, t) else BRANCH
    return [_event(code, z, t, replace(low, length=length), found=True)]


def _turns(curve: ParameterLine, z: Float[np.ndarray, "1 size"], t: Values) -> bool:
    """Whether vᵀF_t is not zero at a singular point: a fold in which the path does not turn."""
    p = curve.parameters(t)
    at = Critical(curve.structure, z, p, null_border(curve.structure, z, p))
    column = curve.structure.parameter_derivative(z, p, curve.velocity)
    return bool(np.abs(at.along(curve.velocity))[0] > 1e-6 * np.linalg.norm(column) > 1e-12)


def _both(
    curve: ParameterLine,
    ends: tuple[_Probe, _Probe],
    middle: Front,
    length: Values,
    options: TraceOptions,
) -> list[Happenings]:
    """Locate the events on both sides of a point with another index."""
    between = _Probe(middle, length, length, length)
    brackets = [_bracket(pair, None) for pair in ((ends[0], between), (between, ends[1]))]
    return [locate_all(curve, brackets, (), replace(options, locate_passed=True))]


def _bracket(pair: tuple[_Probe, _Probe], what: int | None) -> Bracket:
    """Step between two points, with what its ends tell."""
    low, high = pair
    flipped = np.sign(low.front.tangent_t) != np.sign(high.front.tangent_t)
    code = np.where(flipped, FOLD, BRANCH) if what is None else np.array([what])
    step = high.length - low.length
    return Bracket(np.zeros(1, int), low.front, high.front, step, low.length, code)
