"""Events that steps do not show: eigenvalues that touch zero, cross it twice, or vanish together.

Between neighbouring points of a path the eigenvalue of F_z nearest to zero is the cubic through its
values and slopes. Where that comes close to zero, the step is searched.
"""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Numbers, Parameters, Some, Values
from equimorph.equilibria.curves import Curve, dual
from equimorph.equilibria.events import Events, locate_all
from equimorph.equilibria.inside_steps import (
    AT_EVENT,
    CLOSE,
    look_inside,
    probe_at,
    step_between,
    within_ends,
)
from equimorph.equilibria.steps import Front, Points, least_inside
from equimorph.equilibria.trace import Traces
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.structures import Structure
from equimorph.structures.margin import count_below, generic_vectors, inverse_step
from equimorph.structures.metric import metric_length

AT_ONCE = 1024
"""Points, or lanes, that are evaluated together: they stay in the cache."""
Counts = Numbers

NOT_LOCATED = "a hidden pair of events could not be located"
REGULAR_ENDS = EventCode.ARRIVED | EventCode.RETURNED | EventCode.CONSTRAINT
"""Bits of the events at whose points curves are regular."""


def with_hidden_events(
    curve: Curve, z: Lanes, outcome: Traces, options: TraceOptions, index: Some | None = None
) -> Traces:
    """Traces of recorded lanes, started at z, completed by what their steps did not show.

    The first hidden event that stops a lane becomes its end. See `hidden_events`. `index`: that of
    the starts, if it is known.
    """
    points = recorded_points(curve, z, outcome, index)
    inside = hidden_events(curve, points, options)
    last_ones = _before_ends(curve, points, outcome)
    hidden = within_ends(Events.join([inside, last_ones], z.shape[1]))
    if len(hidden.code) == 0:
        return outcome
    stops = np.flatnonzero((hidden.code & options.stops != 0) | ~hidden.found)
    stops = stops[np.unique(hidden.lanes[stops], return_index=True)[1]]
    end = hidden.take(stops)
    lanes, located = end.lanes, end.found
    code, index = outcome.code.copy(), outcome.index.copy()
    places, t = outcome.z.copy(), outcome.t.copy()
    travelled, last = outcome.travelled.copy(), np.full(len(code), np.inf)
    index[last_ones.lanes] = last_ones.index[:, 1]
    code[lanes], index[lanes] = np.where(located, end.code, EventCode.LOST), end.index[:, 0]
    places[lanes], t[lanes] = end.z, end.t
    travelled[lanes] = last[lanes] = end.travelled
    passed = Events.join([outcome.passed, hidden], z.shape[1])
    why = outcome.why | {int(end.lanes[i]): _why(end, i) for i in range(len(lanes))}
    return replace(
        outcome,
        code=code,
        z=places,
        t=t,
        index=index,
        travelled=travelled,
        why={lane: reason for lane, reason in why.items() if reason},
        passed=passed.take(passed.travelled < last[passed.lanes]),
    )


def _why(end: Events, i: int) -> str:
    if not end.found[i]:
        return NOT_LOCATED
    touching = end.index[i, 0] == end.index[i, 1] and end.code[i] == EventCode.FOLD
    return "the path touches a fold and goes on" if touching else ""


def _before_ends(curve: Curve, points: Points, outcome: Traces) -> Events:
    """Events between the last point of a lane and its end, inside a longer step with two of them.

    They show where the index at the end differs from that which the steps imply.
    """
    last = np.append(points.lanes[1:] != points.lanes[:-1], True).nonzero()[0]
    last = last[_regular(outcome.code[points.lanes[last]])]
    if len(last) == 0:
        return Events.join([], curve.structure.size)
    p = curve.take(points.lanes[last]).parameters(points.t[last])
    index = curve.structure.index(np.ascontiguousarray(points.z[last]), p)
    off = index != points.index[last]
    if not off.any():
        return Events.join([], curve.structure.size)
    last, index = last[off], index[off]
    lanes = points.lanes[last]
    here = curve.take(lanes)
    low, high = (
        probe_at(here, fronts(here, points, at), points.travelled[at]) for at in (last - 1, last)
    )
    low = replace(low, front=replace(low.front, index=points.index[last]))
    high = replace(high, front=replace(high.front, index=index))
    regular = ~(np.abs(high.value) <= AT_EVENT * np.abs(low.value))
    step = step_between(lanes, (low, high)).take(regular)
    return locate_all(curve, [step], (), TraceOptions())


def recorded_points(curve: Curve, z: Lanes, outcome: Traces, index: Some | None = None) -> Points:
    """Starts, recorded points, and the ends that are regular ones."""
    lanes, none = np.arange(len(z)), np.zeros(len(z))
    index = curve.structure.index(z, curve.parameters(none)) if index is None else index
    start = Points(lanes, none, z, none, index)
    end = Points(lanes, outcome.travelled, outcome.z, outcome.t, outcome.index)
    regular = end.take(_regular(outcome.code))
    return Points.join([start, outcome.points, regular], z.shape[1])


def _regular(code: Some) -> Flags:
    """Whether lanes ended at regular points."""
    return np.asarray((code > 0) & (code & REGULAR_ENDS != 0))


def hidden_events(curve: Curve, points: Points, options: TraceOptions) -> Events:
    """Folds and branch points between the points of traced paths that their steps do not show.

    An eigenvalue that touches zero is one event that leaves the index as it is; one that crosses
    zero twice between two points gives two events.

    `curve`: the curves of all lanes. `points`: their points, from the start on, sorted by lane and
    length.
    """
    if len(points.t) < 2:
        return Events.join([], curve.structure.size)
    lanes, index, many = points.lanes, points.index, curve.take(points.lanes)
    probe = probe_at(many, fronts(many, points, np.arange(len(lanes))), points.travelled)
    kept = (~_lowest(np.abs(probe.value), lanes, index)).nonzero()[0]
    few, sign = probe.take(kept), np.sign(probe.value[kept])
    values, slopes = sign * few.value, sign * few.slope
    ends = values[:-1], values[1:]
    length, step = few.length[1:] - few.length[:-1], kept[1:] - kept[:-1]
    least = least_inside(ends, (slopes[:-1], slopes[1:]), length)[1]
    smaller, larger = np.minimum(*ends), np.maximum(*ends)
    # a path may start or arrive right at an event: that is no hidden one
    close = (least < CLOSE * smaller) & (smaller > AT_EVENT * larger)
    skips, own, alike = step > 1, lanes[kept], index[kept]
    same = (step == 1 + skips) & (own[1:] == own[:-1]) & (alike[1:] == alike[:-1])
    at = ((close | skips) & same).nonzero()[0]
    if len(at) == 0:
        return Events.join([], curve.structure.size)
    pairs = few.take(at), few.take(at + 1)
    first = np.where(skips[at], probe.length[kept[at] + 1], np.nan)
    return look_inside(curve, lanes[kept[at]], pairs, first, options)


def _lowest(value: Values, lanes: Some, index: Some) -> Flags:
    """Points near a least value, which could otherwise hide between two steps.

    Both neighbours belong to the same lane and have the same index.
    """
    alike = (lanes[1:] == lanes[:-1]) & (index[1:] == index[:-1])
    low = np.zeros(len(value), bool)
    low[1:-1] = ~(value[1:-1] >= CLOSE * np.minimum(value[:-2], value[2:]))
    low[1:-1] &= alike[1:] & alike[:-1]
    return low


def fronts(curve: Curve, points: Points, near: Some) -> Front:
    """Unit tangents at points of paths, along them."""
    lanes = points.lanes
    # the chord to the next point, or from the one before, gives the direction and closes the system
    ahead = np.append(lanes[1:] == lanes[:-1], False)[near]
    one, two = np.where(ahead, near, near - 1), np.where(ahead, near + 1, near)
    dz, dt = points.z[two] - points.z[one], points.t[two] - points.t[one]
    row, corner = dual(curve.structure, curve.weight, dz, dt)
    z, t = np.ascontiguousarray(points.z[near]), points.t[near]
    move = curve.advance(z, t, row, corner, np.zeros(len(t)))
    along, alongside = dual(curve.structure, curve.weight, move.tangent_z, move.tangent_t)
    norm = np.sqrt((along * move.tangent_z).sum(axis=1) + alongside * move.tangent_t)
    tangent = move.tangent_z / norm[:, None], move.tangent_t / norm
    return Front(z, t, *tangent, points.index[near])


VANISHED, PARTED = 1e-4, 1e-6
"""Eigenvalue, relative to the small ones at the start of the path, that counts as zero; the least
second one at a simple fold: round-off parts eigenvalues that vanish together by its root, 1e-7."""


def with_multiple_points(
    curve: Curve, start: Float[np.ndarray, "lanes extended"], outcome: Traces
) -> Traces:
    """The outcome with lanes that ended at points of multiplicity two or more named so.

    One border row removes one null vector: where two eigenvalues vanish together, as symmetry or
    equal parts make them do, steps shrink until the lane is lost, within round-off of the point,
    or it ends as at a fold if their number is odd. The inertia of F_z ∓ εM counts the eigenvalues
    within ±ε. A fold with another small eigenvalue is located so well that one vanishes alone.

    `curve`, `start`: curves and unknowns at their beginning, one per lane. `outcome`: how the lanes
    ended.
    """
    ended = ((outcome.code == EventCode.LOST) | (outcome.code == EventCode.FOLD)).nonzero()[0]
    if len(ended) == 0 or not curve.folds_change_index:
        return outcome
    code, why = outcome.code.copy(), dict(outcome.why)
    for first in range(0, len(ended), AT_ONCE):
        some = ended[first : first + AT_ONCE]
        for lane, several in zip(some.tolist(), _several(curve, start, outcome, some), strict=True):
            if several > 1:
                code[lane] = EventCode.MULTIPLE_POINT
                why[lane] = (
                    f"{several} eigenvalues vanish at once, and no direction leads on: an "
                    "imperfection that parts them, however small, does"
                )
    return replace(outcome, code=code, why=why)


def _several(curve: Curve, start: Lanes, outcome: Traces, ended: Some) -> list[int]:
    """How many eigenvalues vanish where some lanes ended."""
    here, structure = curve.take(ended), curve.structure
    begun = here.states(start[ended], np.zeros(len(ended)))
    z, p = here.states(outcome.z[ended], outcome.t[ended])
    small = _small_eigenvalue(structure, *begun)
    count = multiplicity(structure, z, p, VANISHED * small)
    folds = np.flatnonzero((count > 1) & (outcome.code[ended] == EventCode.FOLD))
    alone = multiplicity(structure, z[folds], p[folds], PARTED * small[folds]) == 1
    count[folds[alone]] = 1
    return [int(n) for n in count]


def multiplicity(structure: Structure, z: Lanes, p: Parameters, near: Values) -> Counts:
    """Number of eigenvalues of the constrained Hessian, in the metric, within ±near of zero."""
    if len(z) == 0:
        return np.zeros(0, int)
    twice = np.concatenate([z, z]), np.concatenate([p, p])
    above, below = count_below(structure, *twice, np.concatenate([near, -near])).reshape(2, -1)
    return np.asarray(above - below)


def _small_eigenvalue(structure: Structure, z: Lanes, p: Parameters) -> Values:
    """Harmonic mean of the eigenvalues, of the size of the smallest one: by a single solution."""
    vector, mass = generic_vectors(structure, len(z)), structure.mass
    answer = inverse_step(structure, z, p, vector)[:, : structure.unknowns]
    yielding = (answer * vector) @ mass
    stiff = np.where(yielding == 0.0, np.inf, np.abs(yielding))
    return np.asarray(metric_length(structure, vector) ** 2 / stiff)
