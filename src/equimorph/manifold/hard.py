"""Hard edges: traced by pseudo-arclength through folds, to constraints, in ever finer steps."""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.equilibria import ParameterLine, TraceOptions
from equimorph.equilibria.outcome import Outcome, follow
from equimorph.equilibria.tracing import ARRIVAL, BRANCH, CONSTRAINT, FOLD, RETURN
from equimorph.manifold.pairing import ABANDONED, Pairing, Rays
from equimorph.manifold.points import BETWEEN, CAP
from equimorph.manifold.points import FOLD as ON_FOLD

EFFORTS = 4

Inner = tuple[Float[np.ndarray, " size"], Float[np.ndarray, " P"], int, int]
"""Unknowns, parameters, index and kind of a point inside an edge."""


def trace(pairing: Pairing, rays: Rays) -> None:
    """Lift rays by pseudo-arclength; what fails is to be traced again with finer steps."""
    line = pairing.line(rays)
    efforts = pairing.effort[rays.edges]
    for effort in range(EFFORTS):
        lanes = np.flatnonzero(efforts == effort)
        if len(lanes):
            _trace(pairing, rays.take(lanes), line.take(lanes), effort)
    pairing.mark(rays.take(efforts >= EFFORTS), ABANDONED)


def _trace(pairing: Pairing, rays: Rays, line: ParameterLine, effort: int) -> None:
    """Trace rays with a certain effort, and enter their curves."""
    finer = 0.35**effort
    options = TraceOptions(
        through_folds=True,
        through_branch_points=True,
        first_step=0.05 * finer,
        largest_step=0.5 * finer,
        turning=0.25 * finer,
        look_inside=False,
    )
    outcome = follow(line, pairing.points.z[rays.points], pairing.setting.constraints, options)
    good = np.isin(outcome.code, (ARRIVAL, RETURN, CONSTRAINT))
    good[outcome.passed.lanes[outcome.passed.code == BRANCH]] = False
    np.add.at(pairing.effort, rays.edges[~good], 1)
    ends = _ends(pairing, rays, outcome, good)
    inner = _folds(outcome, line)
    for lane, cap in _caps(pairing, outcome, line, good).items():
        inner.setdefault(lane, []).append(cap)
    points, edges = rays.points.tolist(), rays.edges.tolist()
    for lane in np.flatnonzero(good).tolist():
        point, edge, end = points[lane], edges[lane], int(ends[lane])
        known = pairing.ray(point, edge)
        if known >= 0 and (end < 0 or pairing.other_end(known, point) == end):
            continue  # the same curve, traced from its other end in the same batch
        numbers = [pairing.points.add(*each, edge) for each in inner.get(lane, [])]
        pairing.enter(point, edge, end, numbers)
    pairing.fit()


def _ends(
    pairing: Pairing, rays: Rays, outcome: Outcome, good: Bool[np.ndarray, " lanes"]
) -> Int[np.ndarray, " lanes"]:
    """Points over the vertices at which lanes arrived or to which they returned; −1 for others."""
    mesh = pairing.mesh
    lanes = np.flatnonzero(good & (outcome.code != CONSTRAINT))
    side = np.where(outcome.code[lanes] == RETURN, rays.sides[lanes], 1 - rays.sides[lanes])
    vertices = mesh.edges[rays.edges[lanes], side]
    p = pairing.setting.parameters(mesh.vertices[vertices])
    ends = np.full(len(rays.points), -1)
    ends[lanes], _ = pairing.points.over_vertices(
        vertices, outcome.z[lanes], p, outcome.index[lanes]
    )
    pairing.fit()
    return ends


def _caps(
    pairing: Pairing, outcome: Outcome, line: ParameterLine, good: Bool[np.ndarray, " lanes"]
) -> dict[int, Inner]:
    """Points at which lanes left through a constraint."""
    lanes = np.flatnonzero(good & (outcome.code == CONSTRAINT))
    z, p = outcome.z[lanes], line.take(lanes).parameters(outcome.t[lanes])
    # counted anew: a fold may lie between the last step and the constraint
    index = pairing.setting.structure.index(z, p).tolist()
    return {int(lane): (z[k], p[k], index[k], CAP) for k, lane in enumerate(lanes)}


def _folds(outcome: Outcome, line: ParameterLine) -> dict[int, list[Inner]]:
    """Folds of each lane in order, with one regular point between neighbours."""
    passed = outcome.passed
    p = line.start[passed.lanes] + passed.t[:, None] * line.velocity[passed.lanes]
    rows: dict[int, list[Inner]] = {}
    places: dict[int, list[float]] = {}
    for i in np.flatnonzero(passed.code == FOLD):
        lane = int(passed.lanes[i])
        row = (passed.z[i], p[i], int(passed.index[i].min()), ON_FOLD)
        before = places.setdefault(lane, [])
        if before:
            rows[lane].append(_between(outcome, line, lane, (before[-1], passed.travelled[i])))
        rows.setdefault(lane, []).append(row)
        before.append(float(passed.travelled[i]))
    return rows


def _between(outcome: Outcome, line: ParameterLine, lane: int, span: tuple[float, float]) -> Inner:
    """Recorded point of a lane nearest to the middle of an interval of its length."""
    points = outcome.points
    own = slice(*np.searchsorted(points.lanes, [lane, lane + 1]))
    inside = (points.travelled[own] >= span[0]) & (points.travelled[own] <= span[1])
    assert inside.any(), "two folds in one step are refused by the tracer"
    off = np.abs(points.travelled[own] - 0.5 * (span[0] + span[1]))
    at = own.start + int(np.argmin(np.where(inside, off, np.inf)))
    p = line.start[lane] + points.t[at] * line.velocity[lane]
    return points.z[at], p, int(points.index[at]), BETWEEN
