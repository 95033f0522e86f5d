"""Lift grid edges: by one verified step, or by pseudo-arclength in ever finer steps.

A fold on a traced edge becomes a vertex of the set, exactly as the trace located it.

See docs/decisions.md, "An attempt to lift an edge counts once".
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Int, ItemFlags, Items, Lanes, Numbers, Some, Values
from equimorph.columns import Columns
from equimorph.equilibria import Guards, ParameterLine, TraceOptions, settle
from equimorph.equilibria.curves import squared_length
from equimorph.equilibria.settle import Held, lower_index
from equimorph.equilibria.trace import Traces, trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.geometry.exact_points import Aim, Pinned, correct_points
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.marching.kernels import FIRST_SHARE, LEAST_COSINE, MULTIPLIER_WEIGHT
from equimorph.model import Constraint

Excess = Float[np.ndarray, "lanes constraints"]
LONGEST = 0.5
"""Step in the metric above which the cheap way is not tried."""
LEFT = 1e-8
"""Length of a correction that is left to the tangents (see `Slopes`), which come with one."""
SAFE = Guards(
    iterations=7, longest=np.inf, converged=1e-8, contraction=0.5, multipliers=MULTIPLIER_WEIGHT
)
"""Corrections that shrink by half; applying the last one squares it."""


def correct_ends(
    line: ParameterLine,
    guess: Lanes,
    tangent: Lanes,
    length: Values,
    index: Numbers,
    constraints: tuple[Constraint, ...],
) -> tuple[Lanes, Flags, Excess]:
    """Points at the ends of steps of some length along tangents, which can be trusted, and excess.

    A point can be if the first correction is below a quarter of the step, later ones shrink at
    least by half, the index is that of the start, the tangents differ by less than acos 0.9, and no
    constraint is violated. Points are polished but for the last correction.
    """
    structure, weight, one = line.structure, line.weight, np.ones(len(guess))
    p = line.parameters(one)
    longest = np.maximum(FIRST_SHARE * length, SAFE.converged)
    guards = replace(SAFE, too_long=longest, index=index, following=LEFT)
    end = settle(structure, guess, p, line.velocity[:, None], (), guards, Held())
    end_tangent, n = np.ascontiguousarray(end.frames[:, 0, :-1]), structure.unknowns
    product = (tangent[:, :n] * end_tangent[:, :n]) @ structure.mass + weight**2
    end_length = np.sqrt(squared_length(structure, weight, end_tangent, one))
    good = np.asarray(end.found & (product >= LEAST_COSINE * length * end_length))
    own = np.flatnonzero(good)
    excess = np.full((len(good), len(constraints)), np.nan)
    for k, constraint in enumerate(constraints):
        excess[own, k] = constraint.excess(end.z.take(own, axis=0), p.take(own, axis=0))
        own = own[excess[own, k] <= 0.0]
    good[:] = False
    good[own] = True
    return end.z, good, excess


EFFORTS = 4
"""Attempts to trace a ray, each with smaller steps than the one before: of 86 927 rays 6130
needed the second, 1395 the third and 348 the fourth, with which 215 ended."""
SMALLEST = 1e-7
"""Smallest step of the first attempt, in the metric. Later ones turn by less in a step: over tiny
edges curves turn on their scale."""
NOISE = 1e-6
"""Distance in the metric below which two crossings are one, and by which folds may be misplaced."""
FLAT = 0.1
"""Part of their distance from a crossing by which folds beside it may be misplaced: where the side
branch is flat, as beside a pitchfork that is nearly degenerate, round-off may be more than
`NOISE`, and Newton's method does not come to its end."""


@dataclass(frozen=True)
class Inside(Columns):
    """Points inside the edges of lanes, in order along each lane."""

    lanes: Items
    z: Float[np.ndarray, "n size"]
    p: Float[np.ndarray, "n P"]
    index: Items
    kinds: Items


@dataclass(frozen=True)
class Traced:
    """What became of rays that were followed.

    good: whether their curves are known; vertices: over which they end, −1 if they left through a
    constraint; z, index: there, of those good ones that end over vertices.
    """

    good: Bool[np.ndarray, " rays"]
    vertices: Int[np.ndarray, " rays"]
    z: Float[np.ndarray, "n size"]
    index: Items
    inside: Inside


def trace_rays(pairing: Pairing, rays: Rays) -> None:
    """Lift rays by pseudo-arclength; what fails is to be traced again with finer steps."""
    line = pairing.line(rays)
    efforts = pairing.effort[rays.edges]
    for effort in range(EFFORTS):
        lanes = np.flatnonzero(efforts == effort)
        if len(lanes):
            _trace(pairing, rays.take(lanes), line.take(lanes), effort)
    pairing.mark(rays.take(efforts >= EFFORTS), RayMark.ABANDONED)


def _trace(pairing: Pairing, rays: Rays, line: ParameterLine, effort: int) -> None:
    """Trace rays with a certain effort, and enter their curves."""
    finer = 0.35**effort
    options = TraceOptions(
        through_folds=True,
        through_branch_points=True,
        first_step=0.05 * finer,
        largest_step=0.5 * finer,
        # a constant one lost third attempts over edges of 1e-4 where the first had arrived
        smallest_step=SMALLEST * finer**2,
        turning=0.25 * finer,
        look_inside=effort > 0,
    )
    traced = _follow(pairing, rays, line, options)
    pairing.effort[rays.edges[~traced.good]] = effort + 1
    ends = _ends(pairing, traced)
    curves = _enter(pairing, rays, np.flatnonzero(traced.good), ends, effort)
    inside = traced.inside.take(curves[traced.inside.lanes] >= 0)
    numbers = _number(pairing, inside, rays.edges[inside.lanes]).tolist()
    lanes, starts = np.unique(inside.lanes, return_index=True)
    stops = np.append(starts, len(numbers))[1:]
    for curve, start, stop in zip(
        *(a.tolist() for a in (curves[lanes], starts, stops)), strict=True
    ):
        pairing.curves.put_inside(curve, numbers[start:stop])
    pairing.fit()


def _enter(pairing: Pairing, rays: Rays, good: Items, ends: Numbers, effort: int) -> Numbers:
    """Enter the curves of good rays; return the number of that of each ray, −1 if there is none."""
    curves = np.full(len(ends), -1)
    curves[good] = pairing.enter_at_once(rays.take(good), ends[good])
    for lane in good[curves[good] < 0].tolist():
        point, edge, end = int(rays.points[lane]), int(rays.edges[lane]), int(ends[lane])
        known = pairing.ray(point, edge)
        if known >= 0 and (end < 0 or pairing.other_end(known, point) == end):
            continue  # the same curve, traced from its other end in the same batch
        curves[lane] = pairing.enter(point, edge, end, tried=effort)
    return curves


def _number(pairing: Pairing, inside: Inside, edges: Items) -> Items:
    """Numbers of points inside edges; those where curves cross belong to both."""
    crossing = inside.kinds == VertexKind.CROSSING
    if not crossing.any():
        return pairing.points.add_many(inside.z, inside.p, inside.index, inside.kinds, edges)
    numbers = np.empty(len(edges), int)
    for k, edge in enumerate(edges.tolist()):
        place, index = (inside.z[k], inside.p[k]), int(inside.index[k])
        if crossing[k]:
            numbers[k] = pairing.crossing(*place, index, edge)
        else:
            numbers[k] = pairing.points.add(*place, index, int(inside.kinds[k]), edge)
    return numbers


def _follow(pairing: Pairing, rays: Rays, line: ParameterLine, options: TraceOptions) -> Traced:
    """Follow rays to their ends."""
    mesh, setting = pairing.mesh, pairing.setting
    outcome = trace(line, pairing.points.z[rays.points], setting.constraints, options)
    good = np.isin(outcome.code, (EventCode.ARRIVED, EventCode.RETURNED, EventCode.CONSTRAINT))
    inside = points_inside(pairing, rays.edges, outcome, line, good)
    side = np.where(outcome.code == EventCode.RETURNED, rays.sides, 1 - rays.sides)
    vertices = mesh.edges[rays.edges, side]
    vertices[outcome.code == EventCode.CONSTRAINT] = -1
    there = np.flatnonzero(good & (vertices >= 0))
    return Traced(good, vertices, outcome.z[there], outcome.index[there], inside)


def _ends(pairing: Pairing, traced: Traced) -> Numbers:
    """Points over the vertices at which lanes arrived or to which they returned; −1 elsewhere."""
    lanes = np.flatnonzero(traced.good & (traced.vertices >= 0))
    vertices = traced.vertices[lanes]
    p = pairing.setting.parameters(pairing.mesh.vertices[vertices])
    ends = np.full(len(traced.good), -1)
    ends[lanes], _ = pairing.points.over_vertices(vertices, traced.z, p, traced.index)
    pairing.fit()
    return ends


def _caps(pairing: Pairing, outcome: Traces, line: ParameterLine, good: Flags) -> Inside:
    """Points at which lanes left through a constraint."""
    lanes = np.flatnonzero(good & (outcome.code == EventCode.CONSTRAINT))
    z, p = outcome.z[lanes], line.take(lanes).parameters(outcome.t[lanes])
    # counted anew: a fold may lie between the last step and the constraint
    index = pairing.setting.structure.index(z, p)
    return Inside(lanes, z, p, index, np.full(len(lanes), VertexKind.CAP))


def points_inside(
    pairing: Pairing, edges: Items, outcome: Traces, line: ParameterLine, good: Flags
) -> Inside:
    """Folds and crossings of each lane, one regular point between neighbours, and where it left.

    Folds stay where the trace located them (`equilibria.locate`); crossings are corrected again.
    Folds beside them are kept unless Newton's method leads from them to the crossing. They are
    round-off then: a side branch of a pitchfork turns back there, and an eigenvalue touches zero.
    Lanes on which a crossing cannot be polished are not `good` any more.
    """
    passed = outcome.passed
    at = np.flatnonzero(np.isin(passed.code, (EventCode.FOLD, EventCode.BRANCH_POINT)))
    at = at[np.argsort(passed.lanes[at], kind="stable")]
    z, index = passed.z[at].copy(), passed.index[at].min(axis=1)
    p = line.start[passed.lanes[at]] + passed.t[at][:, None] * line.velocity[passed.lanes[at]]
    kind = np.where(passed.code[at] == EventCode.FOLD, VertexKind.FOLD, VertexKind.CROSSING)
    keep = np.ones(len(at), bool)
    own = np.flatnonzero(kind == VertexKind.CROSSING)
    if len(own):
        those = edges[passed.lanes[at[own]]]
        pinned = _pin(pairing, those, z[own], p[own], VertexKind.CROSSING)
        z[own], p[own] = pinned.z, pinned.p
        index[own] = lower_index(pairing.setting.structure, pinned.z, pinned.p)
        good[passed.lanes[at[own[~pinned.found]]]] = False
        crossed = passed.lanes[at[own]]
        keep[own] = _first_ones(pairing, crossed, pinned)
        doubtful = np.flatnonzero((kind == VertexKind.FOLD) & np.isin(passed.lanes[at], crossed))
        lanes = passed.lanes[at[doubtful]]
        again = _pin(pairing, edges[lanes], z[doubtful], p[doubtful], VertexKind.FOLD)
        moved = embed(pairing.setting, z[doubtful], p[doubtful])
        moved = np.linalg.norm(embed(pairing.setting, again.z, again.p) - moved, axis=1)
        off = _off_crossings(pairing, lanes, again, crossed, pinned)
        keep[doubtful] = again.found & (moved < NOISE) | (moved < FLAT * off)
    events = Inside(passed.lanes[at], z, p, index, kind).take(keep)
    at = at[keep]
    first = np.flatnonzero(events.lanes[1:] == events.lanes[:-1])
    between = _between(outcome, line, at, events, first)
    caps = _caps(pairing, outcome, line, good)
    place = np.concatenate(
        [2 * np.arange(len(at)), 2 * first + 1, np.full(len(caps.lanes), 2 * len(at))]
    )
    inside = Inside.concatenate([events, between, caps])
    return inside.take(np.lexsort((place, inside.lanes)))


def _between(
    outcome: Traces, line: ParameterLine, at: Items, events: Inside, first: Some
) -> Inside:
    """A regular point between each of some events and the next one, on the same lane.

    Recorded ones are near it if there are any; the index is its own: near crossings the tracer met
    round-off.
    """
    if len(first) == 0:
        return events.take(first)
    passed, lanes = outcome.passed, events.lanes[first]
    near = 0.5 * (events.z[first] + events.z[first + 1])
    t = 0.5 * (passed.t[at[first]] + passed.t[at[first + 1]])
    for k, lane in enumerate(lanes.tolist()):
        row = _recorded(outcome, lane, passed.travelled[at[first[k] : first[k] + 2]])
        if row is not None:
            near[k], t[k] = outcome.points.z[row], outcome.points.t[row]
    lines = line.take(lanes)
    p = lines.parameters(t)
    found = settle(line.structure, near, p, lines.velocity[:, None], (), SAFE, Held()).z
    index = line.structure.index(found, p)
    return Inside(lanes, found, p, index, np.full(len(lanes), VertexKind.BETWEEN))


def _first_ones(pairing: Pairing, lanes: Items, pinned: Pinned) -> ItemFlags:
    """Which crossings are not those that their lanes met just before."""
    place = embed(pairing.setting, pinned.z, pinned.p)
    gap = np.linalg.norm(np.diff(place, axis=0), axis=1)
    again = (np.diff(lanes) == 0) & (gap < NOISE)
    return np.concatenate([[True], ~again])


def _off_crossings(
    pairing: Pairing, lanes: Items, folds: Pinned, crossed: Some, crossings: Pinned
) -> Values:
    """Distances of folds from the nearest crossings on their lanes, which are in order."""
    own, others = (embed(pairing.setting, each.z, each.p) for each in (folds, crossings))
    first, last = (np.searchsorted(crossed, lanes, side) for side in ("left", "right"))
    gap = np.full(len(lanes), np.inf)
    for k in range(int((last - first).max(initial=0))):
        some = np.flatnonzero(first + k < last)
        off = np.linalg.norm(own[some] - others[first[some] + k], axis=1)
        gap[some] = np.minimum(gap[some], off)
    return gap


def _pin(
    pairing: Pairing,
    edges: Items,
    z: Float[np.ndarray, "n size"],
    p: Float[np.ndarray, "n P"],
    kind: VertexKind,
) -> Pinned:
    """Crossings or folds on edges, polished."""
    setting, mesh = pairing.setting, pairing.mesh
    ends = mesh.vertices[mesh.edges[edges]] / setting.scales
    span = ends[:, 1] - ends[:, 0]
    span /= np.linalg.norm(span, axis=1, keepdims=True)
    place, fold = embed(setting, z, p), kind == VertexKind.FOLD
    rows = place[:, None][:, :0]
    aim = Aim(setting, fold, False, span[:, None], place, rows, crossing=not fold)
    return correct_points(aim, z, p, np.zeros(len(place)))


def _recorded(outcome: Traces, lane: int, span: Float[np.ndarray, " 2"]) -> int | None:
    """Recorded point of a lane nearest to the middle of an interval of its length, if any."""
    points = outcome.points
    own = slice(*np.searchsorted(points.lanes, [lane, lane + 1]))
    inside = (points.travelled[own] >= span[0]) & (points.travelled[own] <= span[1])
    if not inside.any():
        return None
    off = np.abs(points.travelled[own] - span.mean())
    return int(own.start) + int(np.argmin(np.where(inside, off, np.inf)))
