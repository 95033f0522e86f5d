"""Tracing loci by pseudo-arclength: predict, correct, judge and update; and how curves end.

The general tracer of curves ``F = 0`` and k conditions in k + 1 parameters: a lift is the case
without conditions, for which lanes march in compiled kernels (`equimorph.equilibria.march`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Flags
from equimorph.equilibria.locus import Locus, Spots, advance
from equimorph.equilibria.locus_events import (
    Landmark,
    LostPartError,
    Walks,
    Watch,
    landmarks,
    predict,
    watch_tests,
)
from equimorph.equilibria.steps import least_inside
from equimorph.equilibria.trace_options import EventKind, TraceOptions
from equimorph.tolerances import SAME_STATE

CLOSE = 0.05
"""Least value inside a step, as a share of those at its ends, that asks for shorter steps."""
NARROW = 1e-3
"""Share of the first step below which hidden pairs of special points are not separated."""
BACK = 0.4
"""Factor of a step's length after a refusal."""
FOLLOWING = 1e-12
"""Estimate of a correction that is not taken any more."""


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


def trace_locus(
    locus: Locus, start: Spots, watches: Sequence[Watch], options: TraceOptions
) -> tuple[Side, Side]:
    """Follow a locus from one start backward and forward, side by side, until both sides end.

    Where they meet the curve is closed: it is the forward side, and the backward one its start.
    """
    starts = Spots.concatenate([start.turn(-np.ones(1)), start])
    here = begin(locus, starts, watches, options)
    lanes, sides = np.arange(2), [_side(here.take(np.array([lane])), watches) for lane in (0, 1)]
    while (on := np.array([sides[lane].end is None for lane in lanes], bool)).any():
        if not on.all():
            here, lanes = here.take(on), lanes[on]
        there, good = step(locus, here, watches, options)
        for i in np.flatnonzero(good).tolist():
            ends = here.take(slice(i, i + 1)), there.take(slice(i, i + 1))
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
    """Try one step of each lane; which are good. The rest need shorter ones."""
    guess = predict(locus, here, here.length)
    spots, found = advance(locus, here.spots, here.length, guess, following=FOLLOWING)
    if found.all():
        there = _look(locus, here, spots, watches, options)
        return there, _judge(here, there, options)
    at = np.flatnonzero(found)
    if len(at) == 0:
        return here, found
    there = _look(locus, here.take(at), spots.take(at), watches, options)
    good = found.copy()
    good[at] = _judge(here.take(at), there, options)
    return here.with_rows(at, there), good


def update(here: Walks, there: Walks, good: Flags) -> Walks:
    """Accept good steps, and shorten the rest."""
    if good.all():
        return there
    new = here.where(~good, there)
    return replace(new, length=np.where(good, new.length, BACK * new.length))


def begin(locus: Locus, starts: Spots, watches: Sequence[Watch], options: TraceOptions) -> Walks:
    """Stand at the starts."""
    lanes = len(starts.x)
    values, slopes = watch_tests(locus, starts, watches, np.zeros((lanes, len(watches))))
    first, none = np.full(lanes, options.first_step), np.zeros(lanes)
    return Walks(starts, values, slopes, first, none, starts.x, starts.tangent)


def _look(
    locus: Locus, here: Walks, spots: Spots, watches: Sequence[Watch], options: TraceOptions
) -> Walks:
    """What is watched at the ends of steps, and how long the next ones should be."""
    values, slopes = watch_tests(locus, spots, watches, here.values)
    cosine = np.einsum("li,li->l", spots.tangent * locus.weights, here.spots.tangent)
    turning = np.arccos(np.clip(cosine, -1.0, 1.0))
    growth = np.clip(options.turning / np.maximum(turning, 1e-3), 0.5, 2.0)
    longer = np.minimum(here.length * growth, options.largest_step)
    way, last = here.travelled + here.length, (here.spots.x, here.spots.tangent)
    return Walks(spots, values, slopes, longer, way, *last)


def _judge(here: Walks, there: Walks, options: TraceOptions) -> Flags:
    """Which steps hide nothing: no pair of special points, at most one change of the index.

    A watched test may touch zero inside a step, by the cubics through its ends.
    """
    sign, length = np.sign(here.values), (there.travelled - here.travelled)[:, None]
    ends = (sign * here.values, sign * there.values)
    rates = (sign * here.slopes, sign * there.slopes)
    close, third = CLOSE * np.minimum(*ends), length / 3.0
    # cubics lie above the least of their Bernstein coefficients
    below = np.minimum(ends[0] + third * rates[0], ends[1] - third * rates[1]) < close
    at = np.nonzero((ends[1] > 0.0) & below)
    hides = np.zeros(len(sign), bool)
    if len(at[0]):
        pair, slopes = (ends[0][at], ends[1][at]), (rates[0][at], rates[1][at])
        hides[at[0][least_inside(pair, slopes, length[at[0], 0])[1] < close[at]]] = True
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
    options: TraceOptions
) -> bool:  # fmt: skip
    """Note a good step of one lane, what lies inside, and how the curve ends there, if it does.

    False if a part of the step failed: a shorter one is to be tried.
    """
    before, after = ends
    try:
        found = landmarks(locus, before, after, watches)
    except LostPartError:
        return False
    end = next((mark for mark, last in found if last), _closing(locus, side, before, after))
    limit = np.inf if end is None else end.length
    side.landmarks += [mark for mark, last in found if not last and mark.length < limit]
    if end is not None:
        side.spots.append(end.spot)
        side.lengths.append(end.length)
        side.index.append(int(end.spot.index[0]))
    else:
        side.spots.append(after.spots)
        side.lengths.append(float(after.travelled[0]))
        side.index.append(int(after.index[0]))
        if len(side.spots) > options.steps:
            end = _lost(after, 0, f"no end in {options.steps} steps")
    side.end = end
    return True


def _closing(locus: Locus, side: Side, walk: Walks, after: Walks) -> Landmark | None:
    """Return to the start, if the step from `walk` passes it."""
    place = passes(locus, walk, float(after.travelled[0]), side.spots[0])
    return None if place is None else Landmark(EventKind.CLOSED, place[1], place[0])


def passes(locus: Locus, walk: Walks, stop: float, target: Spots) -> tuple[float, Spots] | None:
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
    if not found[0] or locus.lengths(spot.x - target.x)[0] > SAME_STATE:
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
            place = passes(locus, here.take(np.array([one])), stop, spot)
            if place is None or at == 0.0:
                continue
            lengths = {one: place[0] - 2e-9, other: at}
            backward, forward = (sides[k].up_to(lengths[k]) for k in (0, 1))
            whole = _join(backward, forward, place[0] + at)
            return [replace(backward, end=whole.end), whole]
    return sides


def _join(backward: Side, forward: Side, length: float) -> Side:
    """One closed side of a length: forward, and then against the backward one to its start."""
    spots = [each.turn(-np.ones(1)) for each in backward.spots[::-1]]
    marks = [replace(mark, length=length - mark.length) for mark in backward.landmarks[::-1]]
    return Side(
        forward.spots + spots,
        forward.lengths + [length - each for each in backward.lengths[::-1]],
        forward.index + backward.index[::-1],
        forward.landmarks + marks,
        Landmark(EventKind.CLOSED, spots[-1], length),
    )
