"""Events that steps do not show: eigenvalues that touch zero, cross it twice, or vanish together.

Between neighbouring points of a path the eigenvalue of F_z nearest to zero is the cubic through its
values and slopes. Where that comes close to zero, the step is searched. For many lanes, a test
function that costs one solve per point first selects the steps in which the eigenvalue is worth its
price.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.arrays import Lanes, Parameters, Some, Values
from equimorph.equilibria.curves import Curve, dual
from equimorph.equilibria.events import Events, locate_all
from equimorph.equilibria.inside_steps import AT_EVENT, CLOSE, look_inside, probe_at, step_between
from equimorph.equilibria.steps import Front, Points, least_inside
from equimorph.equilibria.trace import Traces
from equimorph.equilibria.trace_options import EventCode, TraceOptions
from equimorph.structures import Structure

DOUBTFUL = 0.4
"""Least value of the test function between two points, as a share of those at its ends, from which
on the eigenvalue is computed."""
COLUMNS = 3
"""Right-hand sides of the solve for the test function: the smallest eigenvalues that it sees."""
AT_ONCE = 1024
"""Points, or lanes, that are evaluated together: they stay in the cache."""
Counts = Int[np.ndarray, " lanes"]

REGULAR_ENDS = (EventCode.ARRIVED, EventCode.RETURNED, EventCode.CONSTRAINT)


def with_hidden_events(
    curve: Curve,
    z: Lanes,
    outcome: Traces,
    options: TraceOptions,
    *,
    thorough: bool = True,
) -> Traces:
    """Traces of recorded lanes, started at z, completed by what their steps did not show.

    The first hidden event that stops a lane becomes its end. See `hidden_events`.
    """
    points = recorded_points(curve, z, outcome)
    inside = hidden_events(curve, points, options, thorough=thorough)
    last_ones = _before_ends(curve, points, outcome)
    hidden = Events.join([inside, last_ones], z.shape[1])
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
        return "a hidden pair of events could not be located"
    touching = end.index[i, 0] == end.index[i, 1] and end.code[i] == EventCode.FOLD
    return "the path touches a fold and goes on" if touching else ""


def _before_ends(curve: Curve, points: Points, outcome: Traces) -> Events:
    """Events between the last point of a lane and its end, inside a longer step with two of them.

    They show where the index at the end differs from that which the steps imply.
    """
    size, found = curve.structure.size, list[Events]()
    last = np.flatnonzero(np.append(np.diff(points.lanes) != 0, True))
    last = last[np.isin(outcome.code[points.lanes[last]], REGULAR_ENDS)]
    lanes = points.lanes[last]
    p = curve.take(lanes).parameters(points.t[last])
    index = curve.structure.index(np.ascontiguousarray(points.z[last]), p)
    for i in np.flatnonzero(index != points.index[last]):
        ends, one = np.array([last[i] - 1, last[i]]), curve.take(lanes[i : i + 1])
        both = curve.take(np.repeat(lanes[i], 2))
        probe = probe_at(both, fronts(both, points, ends), points.travelled[ends])
        if np.abs(probe.value[1]) <= AT_EVENT * np.abs(probe.value[0]):
            continue
        front = replace(probe.front, index=np.array([points.index[last[i]], index[i]]))
        probe = replace(probe, front=front)
        pair = probe.take(np.array([0])), probe.take(np.array([1]))
        events = locate_all(one, [step_between(pair, None)], (), TraceOptions())
        found.append(replace(events, lanes=lanes[i : i + 1]))
    return Events.join(found, size)


def recorded_points(curve: Curve, z: Lanes, outcome: Traces) -> Points:
    """Starts, recorded points, and the ends that are regular ones."""
    lanes, none = np.arange(len(z)), np.zeros(len(z))
    index = curve.structure.index(z, curve.parameters(none))
    start = Points(lanes, none, z, none, index)
    end = Points(lanes, outcome.travelled, outcome.z, outcome.t, outcome.index)
    regular = end.take(np.isin(outcome.code, REGULAR_ENDS))
    return Points.join([start, outcome.points, regular], z.shape[1])


def hidden_events(
    curve: Curve, points: Points, options: TraceOptions, *, thorough: bool = True
) -> Events:
    """Folds and branch points between the points of traced paths that their steps do not show.

    An eigenvalue that touches zero is one event that leaves the index as it is; one that crosses
    zero twice between two points gives two events.

    Parameters
    ----------
    curve
        The curves of all lanes.
    points
        Their points, from the start on, sorted by lane and length.
    thorough
        Look at the eigenvalue nearest to zero at every point, by six solves each. Else only where
        `gaps`, by one solve each, leaves a doubt: enough for rods, whose lowest modes are smooth,
        but an eigenvalue that is small in a mode unlike its columns may touch zero unseen.
    """
    found = list[Events]()
    near = np.arange(len(points.t)) if thorough else _doubtful_points(points, gaps(curve, points))
    if len(near) < 2:
        return Events.join(found, curve.structure.size)
    lanes, index = points.lanes[near], points.index[near]
    many = curve.take(lanes)
    probe = probe_at(many, fronts(many, points, near), points.travelled[near])
    low = _lowest(np.abs(probe.value), _neighbours(points, near), CLOSE)
    kept = np.flatnonzero(~low)
    few, sign = probe.take(kept), np.sign(probe.value[kept])
    values, slopes = sign * few.value, sign * few.slope
    ends = values[:-1], values[1:]
    least = least_inside(ends, (slopes[:-1], slopes[1:]), np.diff(few.length))[1]
    smaller, larger = np.minimum(*ends), np.maximum(*ends)
    # a path may start or arrive right at an event: that is no hidden one
    close = (least < CLOSE * smaller) & (smaller > AT_EVENT * larger)
    skips = np.diff(kept) > 1
    same = (np.diff(near[kept]) == 1 + skips) & (np.diff(lanes[kept]) == 0)
    for i in np.flatnonzero((close | skips) & same & (np.diff(index[kept]) == 0)):
        pair = (few.take(np.array([i])), few.take(np.array([i + 1])))
        first = float(probe.length[kept[i] + 1]) if skips[i] else None
        lane = lanes[kept[i] : kept[i] + 1]
        inside = look_inside(curve.take(lane), pair, first, options)
        found += [replace(each, lanes=np.full(len(each.code), lane[0])) for each in inside]
    return Events.join(found, curve.structure.size)


def gaps(curve: Curve, points: Points) -> Values:
    """Test function ``1 / det(BᵀF_z⁻¹B)``: zero where F_z is singular.

    By the formula of Cauchy and Binet it is close to a multiple of the product of the smallest
    eigenvalues, as many as B has columns, which are smooth and do not act on the multipliers. As
    long as the index is zero it has no poles.
    """
    structure, out = curve.structure, np.empty(len(points.t))
    n, count = structure.unknowns, min(COLUMNS, structure.unknowns)
    place, wave = (np.arange(n) + 0.5) / n, np.arange(count)[:, None]
    b = np.zeros((count, structure.size))
    b[:, :n] = structure.mass * np.cos(np.pi * (wave + 0.37) * place + 0.6 * wave)
    rhs = np.tile(b, (min(AT_ONCE, len(out)), 1, 1))
    for start in range(0, len(out), AT_ONCE):
        some = slice(start, start + AT_ONCE)
        lanes = points.lanes[some]
        p = curve.take(lanes).parameters(points.t[some])
        y = structure.solve(np.ascontiguousarray(points.z[some]), p, rhs[: len(lanes)]).x
        with np.errstate(all="ignore"):
            small = y.reshape(-1, structure.size) @ b.T
            out[some] = 1.0 / np.linalg.det(small.reshape(-1, count, count))
    return out


def _doubtful_points(points: Points, gap: Values) -> Some:
    """Ends of all steps inside which the test function may come close to zero, and neighbours."""
    lanes, length = points.lanes, points.travelled
    steps = (lanes[1:] == lanes[:-1]) & (points.index[1:] == points.index[:-1])
    sign = np.sign(gap)
    slopes = _slopes(lanes, length, gap)
    ends = sign[:-1] * gap[:-1], sign[1:] * gap[1:]
    rates = sign[:-1] * slopes[:-1], sign[1:] * slopes[1:]
    least = least_inside(ends, rates, np.diff(length))[1]
    # not <: NaN is suspicious, too; an odd number of poles or zeros changes the sign
    doubtful = ~(least >= DOUBTFUL * np.minimum(*ends)) | (sign[:-1] != sign[1:])
    near = np.zeros(len(gap), bool)
    for shift in (0, 1):
        near[shift : len(gap) - 1 + shift] |= doubtful & steps
    low = _lowest(np.abs(gap), _neighbours(points, np.arange(len(gap))), DOUBTFUL)
    for shift in (-1, 0, 1):
        near |= np.roll(low, shift)
    return np.flatnonzero(near)


def _slopes(lanes: Int[np.ndarray, " points"], length: Values, value: Values) -> Values:
    """Slopes of parabolas through three neighbours on a lane; nan on lanes of fewer points."""
    out, along = np.full(len(value), np.nan), lanes[1:] == lanes[:-1]
    step = np.diff(length)
    rise = np.diff(value) / np.where(along, np.maximum(step, 1e-300), 1.0)
    inner = 1 + np.flatnonzero(along[1:] & along[:-1])
    before, after = step[inner - 1], step[inner]
    out[inner] = (after * rise[inner - 1] + before * rise[inner]) / (before + after)
    starts = along & np.append(True, ~along[:-1])
    first = np.flatnonzero(starts & np.append(along[1:], False))
    out[first] = 2.0 * rise[first] - out[first + 1]
    last = 1 + np.flatnonzero(along & np.append(~along[1:], True))
    last = last[np.isin(last - 1, inner)]
    out[last] = 2.0 * rise[last - 1] - out[last - 1]
    return out


def _neighbours(points: Points, near: Some) -> Bool[np.ndarray, " some"]:
    """Which of the points have both neighbours among them, on one lane and with one index."""
    out = np.zeros(len(near), bool)
    lanes, index = points.lanes[near], points.index[near]
    whole = near[2:] - near[:-2] == 2
    for column in (lanes, index):
        whole &= (column[2:] == column[1:-1]) & (column[:-2] == column[1:-1])
    out[1:-1] = whole
    return out


def _lowest(
    value: Float[np.ndarray, " some"], inner: Bool[np.ndarray, " some"], share: float
) -> Bool[np.ndarray, " some"]:
    """Points near a least value, which could otherwise hide between two steps."""
    out = np.zeros(len(value), bool)
    out[1:-1] = inner[1:-1] & ~(value[1:-1] >= share * np.minimum(value[:-2], value[2:]))
    return out


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


VANISHED, LOCATED = 1e-4, 1e-8
"""Eigenvalue, relative to the small ones at the start of the path, that counts as zero; that of a
simple fold where it is located."""


def with_multiple_points(
    curve: Curve, start: Float[np.ndarray, "lanes extended"], outcome: Traces
) -> Traces:
    """The outcome with lanes that ended at points of multiplicity two or more named so.

    One border row removes one null vector: where two eigenvalues vanish together, as symmetry or
    equal parts make them do, steps shrink until the lane is lost, within round-off of the point,
    or it ends as at a fold if their number is odd. The inertia of F_z ∓ εM counts the eigenvalues
    within ±ε. A fold with another small eigenvalue is located to round-off: one vanishes alone.

    Parameters
    ----------
    curve, start
        Curves and unknowns at their beginning, one per lane.
    outcome
        How the lanes ended.
    """
    ended = np.flatnonzero(np.isin(outcome.code, (EventCode.LOST, EventCode.FOLD)))
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


def _several(
    curve: Curve, start: Lanes, outcome: Traces, ended: Int[np.ndarray, " some"]
) -> list[int]:
    """How many eigenvalues vanish where some lanes ended."""
    here, structure = curve.take(ended), curve.structure
    begun = here.states(start[ended], np.zeros(len(ended)))
    z, p = here.states(outcome.z[ended], outcome.t[ended])
    small = _small_eigenvalue(structure, *begun)
    count = multiplicity(structure, z, p, VANISHED * small)
    folds = np.flatnonzero((count > 1) & (outcome.code[ended] == EventCode.FOLD))
    alone = multiplicity(structure, z[folds], p[folds], LOCATED * small[folds]) == 1
    count[folds[alone]] = 1
    return [int(n) for n in count]


def multiplicity(structure: Structure, z: Lanes, p: Parameters, near: Values) -> Counts:
    """Number of eigenvalues of the constrained Hessian, in the metric, within ±near of zero."""
    nothing = np.zeros((len(z), 0, structure.size))
    above, below = (structure.solve(z, p, nothing, shift=sign * near) for sign in (1.0, -1.0))
    return np.asarray(above.negative - below.negative)


def _small_eigenvalue(structure: Structure, z: Lanes, p: Parameters) -> Values:
    """Harmonic mean of the eigenvalues, of the size of the smallest one: by a single solution."""
    n, mass = structure.unknowns, structure.mass
    vector = np.cos(1.7 * np.arange(n)) + 1.3
    rhs = np.zeros((len(z), 1, structure.size))
    rhs[:, 0, :n] = mass * vector
    yielding = structure.solve(z, p, rhs).x[:, 0, :n] @ (mass * vector)
    return np.asarray(np.abs(mass @ vector**2 / np.where(yielding == 0.0, np.inf, yielding)))
