"""Grid edges that hide something between their ends, which these do not show.

An eigenvalue may vanish twice. A strip between two pitchforks that is narrower than the grid is
crossed by edges whose ends lie on both sides of it. The determinant of F_z shows it: the cubic
through its values at both ends, with the slopes from the next vertices on the same line, falls
between them. There it is computed. See docs/decisions.md, "Strips narrower than the grid are
recognised".

A constraint may be violated. Where an end is no farther from the bound than it is from what
neighbours have, points inside decide.
"""

import numpy as np

from equimorph.arrays import Flags, Int, Items, Some, Values
from equimorph.equilibria import ParameterLine
from equimorph.equilibria.curves import dual, squared_length
from equimorph.equilibria.determinants import hides_two_zeros
from equimorph.equilibria.legs import ON_BOUND
from equimorph.equilibria.short_violations import Part, Point, hidden_violations, may_exceed
from equimorph.equilibria.steps import Bracket, Front, least_inside, unit_tangents
from equimorph.manifold.lifting.pairing import Pairing, Rays
from equimorph.marching.judgement_kernels import EARLY_DIP
from equimorph.marching.kernels import row_sums
from equimorph.tolerances import METRIC_DIFFERENCE

STEEP = 1.0
"""Change of the determinant along an edge, relative to the smaller value, from which on a cubic may
fall to half of it on the edges around: with values 1 and slopes ∓r it falls to 1 − r/4."""
STRAIGHT = 0.98
"""Cosine of the angle between two edges from which on they lie on one line of the grid."""
NEAR, WIDE = 1.0, 4.0
"""Distance from a bound, over the difference from neighbours, from which on edges are not looked at
more closely; the latter if some neighbours are not known."""
UNSURE = 0.25
"""Error of a cubic, over its coefficient of degree three, as of first steps of a march."""
BothEnds = tuple[Rays, Rays]
"""Lifted edges, seen from their starts and from their ends."""


def hiding_edges(pairing: Pairing, rays: BothEnds) -> Some:
    """Which edges, lifted at once, hide two zeros of an eigenvalue or a violated constraint."""
    hiding = np.zeros(len(rays[0].points), bool)
    some = np.arange(len(hiding))
    for hint in (_are_steep, _dip, _vanish):
        if len(some):
            some = some[hint(pairing, _take(rays, some))]
    hiding[some] = True
    for constraint in range(len(pairing.setting.constraints)):
        some = np.flatnonzero(~hiding)
        for doubt in (_come_near, _may_exceed, _exceed):
            if len(some):
                some = some[doubt(pairing, constraint, _take(rays, some))]
        hiding[some] = True
    return np.flatnonzero(hiding)


def _take(rays: BothEnds, some: Some) -> BothEnds:
    return rays[0].take(some), rays[1].take(some)


def _determinants(pairing: Pairing, points: Items) -> Values:
    """Determinants of F_z at points, nan for the number −1."""
    pairing.slopes.fit(pairing.setting, pairing.points)
    return np.where(points < 0, np.nan, pairing.slopes.determinant[points])


def _are_steep(pairing: Pairing, rays: BothEnds) -> Flags:
    """Edges at an end of which the determinant changes much along some edge."""
    one, other = (_determinants(pairing, each.points) for each in rays)
    with np.errstate(invalid="ignore"):  # of values that overflow
        much = np.abs(other - one) > STEEP * np.fmin(np.abs(one), np.abs(other))
    steep = np.zeros(pairing.points.count, bool)
    for each in rays:
        steep[each.points[much]] = True
    return np.asarray(steep[rays[0].points] | steep[rays[1].points])


def _dip(pairing: Pairing, rays: BothEnds) -> Flags:
    """Where the cubic through determinants falls below half the smaller one at both ends."""
    ends = np.stack([_determinants(pairing, each.points) for each in rays])
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.copysign(np.abs(ends).min(axis=0), ends[0])
        start, end = ends / scale
        before, after = (_slope(pairing, *each) / scale for each in zip(rays, ends, strict=True))
        rise = 2.0 * (end - start)
        slopes = (
            np.where(np.isnan(before), rise + after, before),
            np.where(np.isnan(after), rise - before, -after),
        )
        least = least_inside((start, end), slopes, np.ones(len(rise)))[1]
    return np.asarray((least < EARLY_DIP) | (np.isnan(slopes[0]) & ~np.isnan(rise)))


def _slope(pairing: Pairing, rays: Rays, here: Values) -> Values:
    """Slope of the determinant, for an edge, from the next point behind its start.

    It lies on the same line of the grid and on the same sheet; nan where there is none.
    """
    mesh = pairing.mesh
    vertex = mesh.edges[rays.edges, rays.sides]
    around = pairing.incident[vertex]
    outward = np.where(mesh.edges[around, 0] == vertex[:, None], 1.0, -1.0)
    directions = outward[..., None] * mesh.spans(around)
    own = np.where(rays.sides == 0, 1.0, -1.0)[:, None] * mesh.spans(rays.edges)
    lengths, length = np.linalg.norm(directions, axis=2), np.linalg.norm(own, axis=1)
    cosine = -(directions @ own[:, :, None])[..., 0] / (lengths * length[:, None])
    cosine[(around < 0) | ~mesh.edges_in_use[around]] = -1.0
    slot, every = cosine.argmax(axis=1), np.arange(len(cosine))
    behind = np.full(len(cosine), -1)
    curves = pairing.rays[rays.points, slot]
    lanes = np.flatnonzero((cosine[every, slot] > STRAIGHT) & (curves >= 0))
    lanes = lanes[pairing.curves.plain[curves[lanes]]]
    start, end = pairing.curves.start[curves[lanes]], pairing.curves.end[curves[lanes]]
    behind[lanes] = np.where(start == rays.points[lanes], end, start)
    return np.asarray((here - _determinants(pairing, behind)) * length / lengths[every, slot])


def _vanish(pairing: Pairing, rays: BothEnds) -> Flags:
    """Whether the determinant vanishes inside edges, by its values there."""
    return hides_two_zeros(*_steps(pairing, rays))


def _come_near(pairing: Pairing, constraint: int, rays: BothEnds) -> Flags:
    """Edges with an end no farther from a bound than from what its neighbours have."""
    points, ends = pairing.points, (rays[0].points, rays[1].points)
    used = _flagged(points.count, *ends)
    known, incident = pairing.rays[used], pairing.incident[points.vertex[used]]
    lacking = (known < 0) & (incident >= 0) & pairing.mesh.edges_in_use[incident]
    lifted = np.maximum(known, 0)
    start, end = pairing.curves.start[lifted], pairing.curves.end[lifted]
    around = np.where(start == used[:, None], end, start)
    around = np.where((known < 0) | (around < 0), used[:, None], around)
    excess = np.zeros(points.count)
    every = _flagged(points.count, around)
    excess[every] = pairing.excess(every, constraint)
    rise = np.abs(excess[around] - excess[used, None]).max(axis=1)
    near = np.zeros(points.count, bool)
    near[used] = excess[used] + np.where(lacking.any(axis=1), WIDE, NEAR) * rise > 0.0
    return np.asarray(near[ends[0]] | near[ends[1]])


def _flagged(count: int, *numbers: Int[np.ndarray, "..."]) -> Int[np.ndarray, " flagged"]:
    """Numbers that occur, each once."""
    flags = np.zeros(count, bool)
    for each in numbers:
        flags[each] = True
    return np.flatnonzero(flags)


def _may_exceed(pairing: Pairing, number: int, rays: BothEnds) -> Flags:
    """Edges whose cubics, by values and slopes at both ends, reach a bound, or nearly."""
    points, free = pairing.points, pairing.setting.free
    constraint = pairing.setting.constraints[number]
    used = _flagged(points.count, rays[0].points, rays[1].points)
    place = np.empty(points.count, int)
    place[used] = np.arange(len(used))
    z, p, scales = points.z[used], points.p[used], pairing.setting.scales
    excess, gradient = constraint.excess(z, p), np.empty((len(used), len(free)))
    for k, tangent in enumerate(np.swapaxes(pairing.slopes.tangents[used], 0, 1)):
        weight, one = np.full(len(used), 1.0 / scales[k]), np.ones(len(used))
        length = squared_length(points.structure, weight, tangent, one)
        h, dp = METRIC_DIFFERENCE / np.sqrt(length), np.zeros_like(p)
        dp[:, free[k]] = h
        dz = h[:, None] * tangent
        ahead, behind = constraint.excess(z + dz, p + dp), constraint.excess(z - dz, p - dp)
        gradient[:, k] = (ahead - behind) / (2.0 * h)
    spans = pairing.line(rays[0]).velocity[:, free]
    lengths = np.zeros(len(spans)), np.ones(len(spans))
    low, high = (
        Point(length, excess[own], (gradient[own] * spans).sum(axis=1))
        for length, own in zip(lengths, (place[each.points] for each in rays), strict=True)
    )
    doubt = UNSURE * np.abs(low.slope + high.slope - 2.0 * (high.value - low.value))
    part = Part(np.arange(len(spans)), low, high, doubt)
    return may_exceed(part, ON_BOUND * constraint.size)


def _exceed(pairing: Pairing, constraint: int, rays: BothEnds) -> Flags:
    """Whether a bound is exceeded inside edges, or they are no single steps."""
    line, steps = _steps(pairing, rays)
    return np.asarray(
        np.isfinite(hidden_violations(line, pairing.setting.constraints[constraint], steps))
    )


def _steps(pairing: Pairing, rays: BothEnds) -> tuple[ParameterLine, Bracket]:
    """Edges as steps along lines in the parameters."""
    pairing.slopes.fit(pairing.setting, pairing.points)
    line, one = pairing.line(rays[0]), np.ones(len(rays[0].points))
    spans = line.velocity[:, None, pairing.setting.free]
    fronts = []
    for t, side in zip((0.0 * one, one), rays, strict=True):
        tangent = (spans @ pairing.slopes.tangents[side.points])[:, 0]
        index = pairing.points.index[side.points]
        fronts.append(Front(pairing.points.z[side.points], t, tangent, one, index))
    start, end = (unit_tangents(line, front) for front in fronts)
    row, corner = dual(line.metric, line.weight, start.tangent_z, start.tangent_t)
    length = row_sums(row, end.z - start.z) + corner
    lanes = np.arange(len(one))
    return line, Bracket(lanes, start, end, length, 0.0 * one, lanes)
