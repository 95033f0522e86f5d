"""Sheet lifting, the flood: lift edges from all known points until nothing new appears.

From each known equilibrium over an edge's end, the edge is lifted: the curve ends over the other
end, or turns at folds and comes back as another equilibrium over the same end, or leaves through a
constraint. New ends are new equilibria.

Where rays end is predicted by tangents, and the points that are known there are taken: see
docs/decisions.md, "Every point is corrected once, and rays are matched by tangents".

On an edge an eigenvalue may vanish twice although its ends do not show it. A strip between two
pitchforks that is narrower than the grid is crossed by edges whose ends lie on both sides of it.
The determinant of F_z shows it: the cubic through its values at both ends, with the slopes from the
next vertices on the same line, falls between them. There it is computed. See docs/decisions.md,
"Strips narrower than the grid are recognised".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Items, Lanes, Numbers, Values
from equimorph.columns import Columns
from equimorph.equilibria.determinants import hides_two_zeros
from equimorph.equilibria.steps import Bracket, Front, least_inside
from equimorph.errors import InputError
from equimorph.linalg.lanes import over_lanes
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.edges import LONGEST, correct_ends, trace_rays
from equimorph.manifold.lifting.kernels import flag_first_of_alike, match_rays
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.marching.judgement_kernels import EARLY_DIP
from equimorph.marching.kernels import LEAST_COSINE, MULTIPLIER_WEIGHT
from equimorph.model import Progress, are_feasible
from equimorph.tolerances import SAME_STATE

CHUNK = 4096
"""Rays that are traced together: this bounds the memory."""
ENDLESS = 250
"""Number of equilibria over one point beyond which the set is refused: it may be unbounded."""
REPEATED, FURTHER = 6, 100
"""Times that whole turns repeat a state over one point from which on the set is refused, if it may
turn so many times further."""
TURN = 2.0 * np.pi
REACH = 0.1
"""Distance of a known point from where it is predicted, over the step, up to which the ray ends
there; Newton's method may go 0.25 in its first correction, and from one end only."""
NEW, TOO_LONG = -1, -2
"""Partners of rays whose ends are not known, and of those that one step cannot lift."""
STEEP = 1.0
"""Change of the determinant along an edge, relative to the smaller value, from which on a cubic may
fall to half of it on the edges around: with values 1 and slopes ∓r it falls to 1 − r/4."""
STRAIGHT = 0.98
"""Cosine of the angle between two edges from which on they lie on one line of the grid."""
BothEnds = tuple[Rays, Rays]
"""Lifted edges, seen from their starts and from their ends."""


@dataclass(frozen=True)
class Ends(Columns):
    """Predicted ends of rays, lengths of the steps there, and known points or `NEW`, `TOO_LONG`."""

    vertices: Numbers
    index: Numbers
    guesses: Lanes
    lengths: Values
    partners: Numbers

    def first_of_alike(self, pairing: Pairing) -> Flags:
        """Which ends are new, and not where earlier ones are."""
        new = np.flatnonzero(self.partners == NEW)
        order = new[np.argsort(self.vertices[new], kind="stable")]
        first = np.zeros(len(self.partners), bool)
        flag_first_of_alike(
            pairing.setting.structure.mass, order, self.vertices, self.index, self.guesses,
            self.lengths, REACH, first,
        )  # fmt: skip
        return first


def flood(pairing: Pairing, progress: Progress) -> None:
    """Lift edges from all known points until every ray is traced or given up.

    All rays that one step can lift go first; the rest wait and are traced many at a time.
    """
    while not pairing.is_full:
        flood_directly(pairing, progress)
        take_back_hiding(pairing)
        hard = _one_of_each_pair(pairing, pairing.rays_with(RayMark.HARD))
        if len(hard.points) == 0:
            return
        for at in range(0, len(hard.points), CHUNK):
            trace_rays(pairing, hard.take(slice(at, at + CHUNK)))
        pairing.looked_at = pairing.curves.count  # steps of traces are judged as they are made


def flood_directly(pairing: Pairing, progress: Progress) -> None:
    """Lift edges from all known points as far as single steps lead."""
    pairing.fit()
    while not pairing.is_full and len((rays := pairing.rays_with(RayMark.UNTRACED)).points):
        _step_over(pairing, rays)
        _refuse_endless(pairing)
        live = np.count_nonzero(pairing.points.kind[: pairing.points.count] == VertexKind.GRID)
        progress.report("lifting edges", int(live), None)


def _refuse_endless(pairing: Pairing) -> None:
    """Raise InputError if a set grows without end, like one that winds around a circle."""
    store, setting = pairing.points, pairing.setting
    vertex = store.vertex[: store.count]
    sheets = np.bincount(vertex[vertex >= 0], minlength=1)
    if sheets.max() < REPEATED:
        return
    p = setting.parameters(pairing.mesh.vertices[sheets.argmax()][None])[0, setting.free]
    names = [setting.structure.parameters[place].name for place in setting.free]
    point = ", ".join(f"{name} = {value:g}" for name, value in zip(names, p, strict=True))
    if _repeats(pairing, np.flatnonzero(vertex == sheets.argmax())):
        raise InputError(
            f"`within` must bound whole turns: over {point} they repeat a state {REPEATED} times, "
            "and without end. Bound a descriptor that grows with them: an angle, or the rotation "
            "of a member that is hinged at both ends."
        )
    if sheets.max() > ENDLESS:
        raise InputError(
            f"`within` must leave at most {ENDLESS} equilibria over a point; got more over "
            f"{point}. Bound a descriptor: one that grows with the turns of an endless set, "
            "or displacements if the structure has that many states."
        )


def _repeats(pairing: Pairing, points: Items) -> bool:
    """Whether points over one vertex are one state but for whole turns, and more turns are allowed.

    It differs from its copies by multiples of 2π in some unknowns. See docs/decisions.md, "Whole
    turns that no constraint bounds are refused early".
    """
    structure, constraints = pairing.setting.structure, pairing.setting.constraints
    z, p = pairing.points.z[points], pairing.points.p[points]
    for own in range(len(z)):
        apart = z - z[own]
        turned = np.rint(apart / TURN)
        turned[:, structure.unknowns :] = 0.0
        copies = np.abs(apart - TURN * turned).max(axis=1) < SAME_STATE
        if copies.sum() < REPEATED:
            continue
        axis = np.abs(turned[copies]).max(axis=0).argmax()
        if len(np.unique(turned[copies, axis])) >= REPEATED:
            furthest = np.flatnonzero(copies)[np.abs(turned[copies, axis]).argmax()]
            beyond = z[own] + TURN * FURTHER * turned[[furthest]]
            return bool(are_feasible(constraints, beyond, p[[own]])[0])
    return False


def _one_of_each_pair(pairing: Pairing, rays: Rays) -> Rays:
    """Rays of even index on edges that have such: one that turns at a fold comes back odd."""
    even = pairing.points.index[rays.points] % 2 == 0
    has_even = np.zeros(len(pairing.mesh.edges), bool)
    has_even[rays.edges[even]] = True
    return rays.take(even | ~has_even[rays.edges])


def _step_over(pairing: Pairing, rays: Rays) -> None:
    """Enter the curves of rays that one step lifts; mark those that need more effort.

    Rays that end near one another wait until the first of them is lifted: often they meet its end.
    """
    rays = _without_difficult(pairing, rays)
    for at in range(0, len(rays.points), CHUNK):
        some = rays.take(slice(at, at + CHUNK))
        ends = _match_ends(pairing, some)
        known = np.flatnonzero(ends.partners >= 0)
        pairing.enter_many(some.take(known), ends.partners[known])
        new = ends.first_of_alike(pairing)
        pairing.mark(some.take(new | (ends.partners == TOO_LONG)), RayMark.HARD)
        _lift_to_new_ends(pairing, some.take(new), ends.take(new))


def _lift_to_new_ends(pairing: Pairing, rays: Rays, ends: Ends) -> None:
    """Correct predicted ends, and enter the curves of those that can be trusted."""
    store, line = pairing.points, pairing.line(rays)
    tangent, index = ends.guesses - store.z[rays.points], store.index[rays.points]
    constraints = pairing.setting.constraints
    z, good = correct_ends(line, ends.guesses, tangent, ends.lengths, index, constraints)
    _enter_lifted(pairing, rays.take(good), z[good])


def _without_difficult(pairing: Pairing, rays: Rays) -> Rays:
    """Rays on edges that need no more effort; the others are marked as hard."""
    difficult = pairing.effort[rays.edges] > 0
    pairing.mark(rays.take(difficult), RayMark.HARD)
    return rays.take(~difficult)


def _enter_lifted(pairing: Pairing, done: Rays, z: Lanes) -> None:
    """Enter the curves of rays that were lifted to points over their other ends."""
    store, setting, mesh = pairing.points, pairing.setting, pairing.mesh
    vertices = mesh.edges[done.edges, 1 - done.sides]
    p = setting.parameters(mesh.vertices[vertices])
    # where it is lifted in one sweep, the index stays what it was
    ids, new = store.over_vertices(vertices, z, p, store.index[done.points])
    pairing.fit()
    # it was counted a correction before the last one; where eigenvalues nearly vanish it may differ
    pairing.slopes.fit(setting, store)
    counted = pairing.slopes.index[ids]
    same = np.flatnonzero(counted == store.index[done.points])
    store.index[ids[new]] = counted[new]
    pairing.enter_many(done.take(same), ids[same])


def _match_ends(pairing: Pairing, rays: Rays) -> Ends:
    """Predict the ends of rays, and match them with known points."""
    setting, points, mesh, slopes = pairing.setting, pairing.points, pairing.mesh, pairing.slopes
    slopes.fit(setting, points)
    structure, count = setting.structure, len(rays.points)
    start, vertices = mesh.edges[rays.edges, rays.sides], mesh.edges[rays.edges, 1 - rays.sides]
    weights = np.full(structure.size, MULTIPLIER_WEIGHT)
    weights[: structure.unknowns] = structure.mass
    ends = Ends(
        vertices,
        points.index[rays.points],
        np.empty((count, structure.size)),
        np.empty(count),
        np.empty(count, int),
    )
    known = points.head, points.following, points.z, points.index, slopes.tangents, slopes.index
    over_lanes(
        match_rays,
        (structure.unknowns, weights, setting.scales, *known, LONGEST, REACH, LEAST_COSINE),
        (rays.points, vertices, mesh.vertices[vertices] - mesh.vertices[start]),
        (ends.guesses, ends.lengths, ends.partners),
    )
    return ends


def take_back_hiding(pairing: Pairing) -> None:
    """Forget curves that hide two zeros, of those that are new; their edges need more effort."""
    curves, rays = _new(pairing)
    for hint in (_are_steep, _dip, _hide):
        if len(curves) == 0:
            return
        some = np.flatnonzero(hint(pairing, rays))
        curves, rays = curves[some], (rays[0].take(some), rays[1].take(some))
    pairing.effort[rays[0].edges] = 1
    for curve in curves.tolist():
        pairing.forget(curve, RayMark.HARD)


def _new(pairing: Pairing) -> tuple[Numbers, BothEnds]:
    """Curves that were lifted at once and have not been looked at, as rays from both ends."""
    known, pairing.looked_at = pairing.looked_at, pairing.curves.count
    curves = np.arange(known, pairing.looked_at)
    start, end, edges, plain = (
        each[known:]
        for each in (
            pairing.curves.start,
            pairing.curves.end,
            pairing.curves.edge,
            pairing.curves.plain,
        )
    )
    sides = (pairing.mesh.edges[edges, 1] == pairing.points.vertex[start]).astype(int)
    alive = pairing.rays[start, pairing.slots[edges, sides]] == curves
    own = np.flatnonzero(alive & plain & (end >= 0) & (pairing.effort[edges] == 0))
    rays = Rays(start, edges, sides), Rays(end, edges, 1 - sides)
    return curves[own], (rays[0].take(own), rays[1].take(own))


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


def _hide(pairing: Pairing, rays: BothEnds) -> Flags:
    """Whether the determinant vanishes inside edges, by its values there."""
    line, one, fronts = pairing.line(rays[0]), np.ones(len(rays[0].points)), []
    for t, side in zip((0.0 * one, one), rays, strict=True):
        z = pairing.points.z[side.points]
        tangent = line.advance(z, t, np.zeros_like(z), one, 0.0 * one).tangent_z
        fronts.append(Front(z, t, tangent, one, pairing.points.index[side.points]))
    lanes = np.arange(len(one))
    return hides_two_zeros(line, Bracket(lanes, fronts[0], fronts[1], one, 0.0 * one, lanes))
