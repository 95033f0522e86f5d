"""Tracing loci by pseudo-arclength, with the special points on the way and how they end.

The general tracer of curves ``F = 0`` and k conditions in k + 1 parameters: a lift is the case
without conditions, for which lanes march in compiled kernels (`equimorph.equilibria.march`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import brentq

from equimorph.arrays import Flags, Some, Values
from equimorph.equilibria.critical import Test
from equimorph.equilibria.locus import Locus, Points, Spots, advance, onto_set, test_slopes
from equimorph.equilibria.steps import least_inside
from equimorph.equilibria.trace_options import EventKind, TraceOptions

Watched = Float[np.ndarray, "lanes watches"]

ZERO = 1e-9
"""Size of a watched test that counts as zero: noise of tests that vanish identically."""
CLOSE = 0.05
"""Least value inside a step, as a share of those at its ends, that asks for shorter steps."""
BISECTIONS = 5
"""Halvings of a step in which the index changes."""
NARROW = 1e-3
"""Share of the first step below which hidden pairs of special points are not told apart."""
SMALL_EIGENVALUE = 1e-7
"""Size below which an eigenvalue is the one that vanishes along the locus."""
BACK = 0.4
"""Factor of a step's length after a refusal."""
FOLLOWING = 1e-12
"""Estimate of a correction that is not taken any more."""
CLOSED = 1e-6
"""Distance in the metric at which a curve has returned to its start, or its sides have met."""
STENCIL = 6
"""Points around a double point, from which it is interpolated."""


_SECOND = {
    True: (EventKind.DOUBLE, "a second eigenvalue vanishes"),
    False: (EventKind.CRITICAL, "an eigenvalue vanishes"),
}


class LostPartError(Exception):
    """A part of a step failed where the whole succeeded: shorter steps will tell."""


@dataclass(frozen=True)
class Watch:
    """A test whose changes of sign are located: special points, or ends of the curve."""

    kind: EventKind
    test: Test
    detail: str = ""
    ends: bool = False


@dataclass(frozen=True)
class Landmark:
    """Something located on a curve: kind, point, length from the start, detail."""

    kind: EventKind
    spot: Spots
    length: float
    detail: str = ""


@dataclass
class Side:
    """One side of a curve from its start: points with lengths and indices, landmarks, the end."""

    spots: list[Spots]
    lengths: list[float]
    index: list[int]
    landmarks: list[Landmark]
    end: Landmark | None = None

    @property
    def closed(self) -> bool:
        """Whether it returned to its start."""
        return self.end is not None and self.end.kind == EventKind.CLOSED

    def start(self) -> "Side":
        """Return the start alone, with the same end: the other side of a closed curve."""
        return Side(self.spots[:1], [0.0], self.index[:1], [], self.end)

    def up_to(self, length: float) -> "Side":
        """Return what lies within a length."""
        count = int(np.searchsorted(self.lengths, length + 1e-9))
        marks = [mark for mark in self.landmarks if mark.length <= length]
        return Side(self.spots[:count], self.lengths[:count], self.index[:count], marks)


@dataclass(frozen=True)
class Walks:
    """Where curves are, one a lane.

    Points, watched values with slopes, other negative eigenvalues, length of the next step, way so
    far, and the points before with their tangents.
    """

    spots: Spots
    values: Watched
    slopes: Watched
    index: Int[np.ndarray, " lanes"]
    length: Values
    travelled: Values
    last: Points
    last_tangent: Points

    def take(self, lanes: Some | Flags) -> "Walks":
        """Return some of the lanes."""
        columns = list(vars(self).values())
        return Walks(columns[0].take(lanes), *(column[lanes] for column in columns[1:]))

    def with_others(self, others: "Walks", at: Some) -> "Walks":
        """Return all lanes, those at some places replaced."""
        pick = np.arange(len(self.length))
        pick[at] = len(pick) + np.arange(len(at))

        def mixed(one: Any, other: Any) -> Any:
            columns = zip(vars(one).values(), vars(other).values(), strict=True)
            return [
                mixed(*pair) if isinstance(pair[0], Spots) else np.concatenate(pair)[pick]
                for pair in columns
            ]

        spots, *rest = mixed(self, others)
        return Walks(Spots(*spots), *rest)


def trace_locus(
    locus: Locus, start: Spots, watches: Sequence[Watch], options: TraceOptions
) -> tuple[Side, Side]:
    """Follow a locus from one start backward and forward, side by side, until both sides end.

    Where they meet the curve is closed: it is the forward side, and the backward one its start.
    """
    ways = (vars(start.turned(sign)).values() for sign in (-np.ones(1), np.ones(1)))
    starts = Spots(*(np.concatenate(column) for column in zip(*ways, strict=True)))
    here = begin(locus, starts, watches, options)
    lanes, sides = np.arange(2), [_side(here.take(np.array([lane])), watches) for lane in (0, 1)]
    while (on := np.array([sides[lane].end is None for lane in lanes], bool)).any():
        if not on.all():
            here, lanes = here.take(on), lanes[on]
        there, good = step(locus, here, watches, options)
        for i in np.flatnonzero(good).tolist():
            ends = here.take(np.array([i])), there.take(np.array([i]))
            good[i] = _record(locus, sides[lanes[i]], ends, watches, options)
        if sides[0].end is None and sides[1].end is None:
            sides = _close(locus, sides, (here, there), good)
        here = update(here, there, good)
        for i, lane in enumerate(lanes):
            if sides[lane].end is None and here.length[i] < options.smallest_step:
                sides[lane].end = _lost(here, i, "the step became too small")
    backward, forward = sides
    if forward.closed:
        return forward.start(), forward
    return backward, backward.start() if backward.closed else forward


def step(
    locus: Locus, here: Walks, watches: Sequence[Watch], options: TraceOptions
) -> tuple[Walks, Flags]:
    """Try one step of each lane; which are good. The others are to be tried with shorter ones."""
    guess = predict(locus, here, here.length)
    spots, found = advance(locus, here.spots, here.length, guess, following=FOLLOWING)
    at = np.flatnonzero(found)
    if len(at) == 0:
        return here, found
    there = _look(locus, here.take(at), spots.take(at), watches, options)
    good = found.copy()
    good[at] = _judge(here.take(at), there, options)
    return there if found.all() else here.with_others(there, at), good


def predict(locus: Locus, here: Walks, lengths: Values) -> Points:
    """Points at lengths along the tangents: by cubics through the points before, if there are any.

    In the coordinate along a tangent a curve is a graph, whose derivative is the unit tangent over
    the cosine of the angle between.
    """
    row = here.spots.tangent * locus.weights
    back = np.einsum("li,li->l", row, here.last - here.spots.x)
    rate = np.einsum("li,li->l", row, here.last_tangent)
    known = back < 0.0
    share = np.where(known, lengths / np.where(known, back, 1.0), 0.0)
    factors = (
        (3.0 - 2.0 * share) * share**2,
        lengths * (1.0 - share) ** 2,
        (lengths - back) * share**2 / rate,
    )
    moves = (here.last - here.spots.x, here.spots.tangent, here.last_tangent)
    steps = (factor[:, None] * move for factor, move in zip(factors, moves, strict=True))
    return np.asarray(here.spots.x + sum(steps))


def update(here: Walks, there: Walks, good: Flags) -> Walks:
    """Take over good steps, and shorten the others."""
    if good.all():
        return there
    new = here.with_others(there.take(good), np.flatnonzero(good))
    return replace(new, length=np.where(good, new.length, BACK * new.length))


def begin(locus: Locus, starts: Spots, watches: Sequence[Watch], options: TraceOptions) -> Walks:
    """Stand at the starts."""
    lanes = len(starts.x)
    values, slopes = watched(locus, starts, watches, np.zeros((lanes, len(watches))))
    index = negative_others(locus, starts)
    first, none = np.full(lanes, options.first_step), np.zeros(lanes)
    return Walks(starts, values, slopes, index, first, none, starts.x, starts.tangent)


def negative_others(locus: Locus, spots: Spots) -> Int[np.ndarray, " lanes"]:
    """Negative eigenvalues of the constrained Hessian, those within 1e-7 of zero not counted."""
    z, p = locus.split(spots.x)
    nothing = np.zeros((len(z), 0, locus.structure.size))
    shift = np.full(len(z), -SMALL_EIGENVALUE)
    solved = locus.structure.solve(z, p, nothing, shift=shift)
    return np.asarray(solved.negative - locus.structure.constraints)


def watched(
    locus: Locus, spots: Spots, watches: Sequence[Watch], before: Watched
) -> tuple[Watched, Watched]:
    """Watched tests with slopes; zeros keep the sign that they had `before`."""
    tests = tuple(watch.test for watch in watches)
    values, slopes = test_slopes(locus, spots.x, spots.basis[:, :1], tests, spots.b)
    slopes = slopes[:, :, 0]
    return np.where(np.abs(values) < ZERO, 1e-200 * np.sign(before), values), slopes


def _look(
    locus: Locus, here: Walks, spots: Spots, watches: Sequence[Watch], options: TraceOptions
) -> Walks:
    """What is watched at the ends of steps, and how long the next ones should be."""
    values, slopes = watched(locus, spots, watches, here.values)
    index = negative_others(locus, spots)
    cosine = np.einsum("li,li->l", spots.tangent * locus.weights, here.spots.tangent)
    turning = np.arccos(np.clip(cosine, -1.0, 1.0))
    growth = np.clip(options.turning / np.maximum(turning, 1e-3), 0.5, 2.0)
    longer = np.minimum(here.length * growth, options.largest_step)
    way, last = here.travelled + here.length, (here.spots.x, here.spots.tangent)
    return Walks(spots, values, slopes, index, longer, way, *last)


def _judge(here: Walks, there: Walks, options: TraceOptions) -> Flags:
    """Which steps hide nothing: no pair of special points, at most one change of the index.

    A watched test may touch zero inside a step, by the cubics through its ends.
    """
    sign, length = np.sign(here.values), (there.travelled - here.travelled)[:, None]
    ends = (sign * here.values, sign * there.values)
    rates = (sign * here.slopes, sign * there.slopes)
    flat = [each.ravel() for each in (*ends, *rates, np.broadcast_to(length, sign.shape))]
    least = least_inside((flat[0], flat[1]), (flat[2], flat[3]), flat[4])[1].reshape(sign.shape)
    hides = ((ends[1] > 0.0) & (least < CLOSE * np.minimum(*ends))).any(axis=1)
    hides |= np.abs(there.index - here.index) > 1
    return np.asarray(~hides | (length[:, 0] <= NARROW * options.first_step))


def _side(here: Walks, watches: Sequence[Watch]) -> Side:
    """One side at its start; it may end there, at its limit, if it leads beyond."""
    side = Side([here.spots], [0.0], [int(here.index[0])], [])
    for watch, value, slope in zip(watches, here.values[0], here.slopes[0], strict=True):
        if watch.ends and value >= 0.0 and slope > 0.0:
            side.end = Landmark(watch.kind, here.spots, 0.0, watch.detail)
            break
    return side


def _lost(here: Walks, lane: int, why: str) -> Landmark:
    spot = here.spots.take(np.array([lane]))
    return Landmark(EventKind.LOST, spot, float(here.travelled[lane]), why)


def _record(
    locus: Locus, side: Side, ends: tuple[Walks, Walks], watches: Sequence[Watch],
    options: TraceOptions,
) -> bool:  # fmt: skip
    """Note a good step of one lane, what lies inside, and how the curve ends there, if it does.

    False if a part of the step failed: a shorter one is to be tried.
    """
    before, after = ends
    try:
        found = _landmarks(locus, before, after, watches)
    except LostPartError:
        return False
    end = next((mark for mark, last in found if last), _closing(locus, side, before, after))
    limit = np.inf if end is None else end.length
    side.landmarks += [mark for mark, last in found if not last and mark.length < limit]
    if end is not None:
        side.spots.append(end.spot)
        side.lengths.append(end.length)
        side.index.append(int(negative_others(locus, end.spot)[0]))
    else:
        side.spots.append(after.spots)
        side.lengths.append(float(after.travelled[0]))
        side.index.append(int(after.index[0]))
        if len(side.spots) > options.steps:
            end = _lost(after, 0, f"no end in {options.steps} steps")
    side.end = end
    return True


def _parts(locus: Locus, walk: Walks, lengths: Values) -> Spots:
    """Points of one step at lengths."""
    many = walk.take(np.zeros(len(lengths), int))
    spots, found = advance(locus, many.spots, lengths, predict(locus, many, lengths))
    if not found.all():
        raise LostPartError
    return spots


def _part(locus: Locus, walk: Walks, length: float) -> Spots:
    """Point of a step at a length."""
    return _parts(locus, walk, np.array([length])) if length > 0.0 else walk.spots


def _closing(locus: Locus, side: Side, walk: Walks, after: Walks) -> Landmark | None:
    """Return to the start, if the step from `walk` passes it."""
    place = _passes(locus, walk, float(after.travelled[0]), side.spots[0])
    return None if place is None else Landmark(EventKind.CLOSED, place[1], place[0])


def _passes(locus: Locus, walk: Walks, stop: float, target: Spots) -> tuple[float, Spots] | None:
    """Length and point at which the step from `walk` to the length `stop` passes a point."""
    travelled = float(walk.travelled[0])
    if travelled == 0.0:
        return None
    gap, size = target.x - walk.spots.x, stop - travelled
    ahead = float(walk.spots.tangent[0] * locus.weights @ gap[0])
    if not 0.0 < ahead <= size or locus.lengths(gap)[0] > 2.0 * size:
        return None
    length = np.array([ahead])
    spot, found = advance(locus, walk.spots, length, predict(locus, walk, length))
    if not found[0] or locus.lengths(spot.x - target.x)[0] > CLOSED:
        return None
    return travelled + ahead, spot


def _close(locus: Locus, sides: list[Side], walks: tuple[Walks, Walks], good: Flags) -> list[Side]:
    """Both sides, joined to one that is closed if a step of one passes a point of the other."""
    here, there = walks
    for one, other in ((1, 0), (0, 1)):
        targets = [there] * int(good[other]) + [here]
        for target in targets if good[one] else ():
            spot, at = target.spots.take(np.array([other])), float(target.travelled[other])
            stop = float(there.travelled[one])
            place = _passes(locus, here.take(np.array([one])), stop, spot)
            if place is None or at == 0.0:
                continue
            lengths = {one: place[0] - 2e-9, other: at}
            backward, forward = (sides[k].up_to(lengths[k]) for k in (0, 1))
            whole = _joined(backward, forward, place[0] + at)
            return [replace(backward, end=whole.end), whole]
    return sides


def _joined(backward: Side, forward: Side, length: float) -> Side:
    """One closed side of a length: forward, and then against the backward one to its start."""
    spots = [each.turned(-np.ones(1)) for each in backward.spots[::-1]]
    marks = [replace(mark, length=length - mark.length) for mark in backward.landmarks[::-1]]
    return Side(
        forward.spots + spots,
        forward.lengths + [length - each for each in backward.lengths[::-1]],
        forward.index + backward.index[::-1],
        forward.landmarks + marks,
        Landmark(EventKind.CLOSED, spots[-1], length),
    )


def _landmarks(
    locus: Locus, walk: Walks, after: Walks, watches: Sequence[Watch]
) -> list[tuple[Landmark, bool]]:
    """Special points and ends within a step, in order."""
    start, found = float(walk.travelled[0]), []
    size, turned = float(after.travelled[0]) - start, after.index[0] != walk.index[0]
    for watch, low, high in zip(watches, walk.values[0], after.values[0], strict=True):
        if high > 0.0 if watch.ends else low * high < 0.0:
            length = _by_newton(locus, walk, size, watch.test, (low, high))
            if length is None and turned and not watch.ends:
                continue  # tests have poles where a second eigenvalue vanishes
            if length is None:
                length = _by_bracketing(locus, walk, size, watch.test, (low, high))
            spot = _part(locus, walk, length)
            found.append((Landmark(watch.kind, spot, start + length, watch.detail), watch.ends))
    if turned:
        length, spot = _double(locus, walk, size)
        kind, detail = _SECOND[locus.singular]
        found.append((Landmark(kind, spot, start + length, detail), False))
    return sorted(found, key=lambda entry: entry[0].length)


def _by_newton(
    locus: Locus, walk: Walks, size: float, test: Test, ends: tuple[float, float]
) -> float | None:
    """Length at which a test vanishes within a step, by Newton; None if it fails."""
    share = np.array([size * ends[0] / (ends[0] - ends[1])])
    spot, found = advance(locus, walk.spots, share, predict(locus, walk, share), test)
    if not found[0]:
        return None
    length = float((spot.x - walk.spots.x)[0] * locus.weights @ walk.spots.tangent[0])
    return length if 0.0 <= length <= size else None


def _by_bracketing(
    locus: Locus, walk: Walks, size: float, test: Test, ends: tuple[float, float]
) -> float:
    """Length at which a test changes its sign within a step."""
    known = {0.0: float(ends[0]), size: float(ends[1])}

    def value(length: float) -> float:
        if length in known:
            return known[length]
        spot = _part(locus, walk, length)
        return float(test(locus.critical(spot.x, walk.spots.b))[0])

    return float(brentq(value, 0.0, size, xtol=1e-13))


def _double(locus: Locus, walk: Walks, size: float) -> tuple[float, Spots]:
    """Where the index changes within a step: from points around it, since tests fail at it.

    Bisection on the index, then the root of the interpolated gap of a second border.
    """
    low, high = 0.0, size
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = negative_others(locus, _part(locus, walk, middle))[0] == walk.index[0]
        low, high = (middle, high) if same else (low, middle)
    width = high - low
    first = min(max(low - 2.0 * width, 0.0), size - (STENCIL - 1) * width)
    lengths = first + width * np.arange(STENCIL)
    spots = _parts(locus, walk, np.maximum(lengths, 1e-300))
    nearest = spots.take(np.array([int(np.argmin(np.abs(lengths - middle)))]))
    c = _second_border(locus, nearest)
    # c·(solution) has a pole where the second eigenvalue vanishes: its inverse is smooth
    gaps = -1.0 / (_solve_beside(locus, spots, np.tile(c, (STENCIL, 1))) @ c)
    place = _zero(gaps)
    x = (_lagrange(place) @ spots.x)[None]
    return float(first + width * place), replace(nearest, x=onto_set(locus, x, nearest))


def _lagrange(place: float) -> Float[np.ndarray, " 6"]:
    """Weights that interpolate values at 0, 1, ..., 5."""
    others = place - np.arange(6.0)
    apart = np.subtract.outer(np.arange(6.0), np.arange(6.0)) + np.eye(6)
    whole = [np.prod(np.delete(others, j)) for j in range(6)]
    return np.asarray(np.array(whole) / apart.prod(axis=1))


def _zero(values: Float[np.ndarray, " 6"]) -> float:
    """Root of the polynomial through values at 0, 1, ..., 5, where their sign changes."""
    change = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    if len(change) != 1:
        raise LostPartError
    at = float(change[0])
    return float(brentq(lambda place: _lagrange(place) @ values, at, at + 1.0, xtol=1e-13))


def _second_border(locus: Locus, spot: Spots) -> Float[np.ndarray, " bordered"]:
    """Null vector of the bordered matrix at a double point, by inverse iteration."""
    c = np.cos(1.1 * np.arange(locus.structure.size + int(locus.singular))) + 1.3
    for _ in range(3):
        solved = _solve_beside(locus, spot, c[None])[0]
        if not np.isfinite(solved).all():
            break
        c = solved / np.linalg.norm(solved)
    return np.asarray(c)


def _solve_beside(
    locus: Locus, spots: Spots, rhs: Float[np.ndarray, "lanes bordered"]
) -> Float[np.ndarray, "lanes bordered"]:
    """Solve with F_z, bordered where it is singular along the whole locus."""
    at = locus.critical(spots.x, spots.b)
    if locus.singular:
        return np.asarray(at.solve(rhs[:, None])[:, 0])
    return np.asarray(locus.structure.solve(at.z, at.p, rhs[:, None]).x[:, 0])
