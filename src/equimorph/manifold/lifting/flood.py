"""Sheet lifting, the flood: lift edges from all known points until nothing new appears.

From each known equilibrium over an edge's end, the edge is lifted: the curve ends over the other
end, or turns at folds and comes back as another equilibrium over the same end, or leaves through a
constraint. New ends are new equilibria.

Where rays end is predicted by tangents, and the points that are known there are taken: see
docs/decisions.md, "Every point is corrected once, and rays are matched by tangents".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Lanes, Numbers, Values
from equimorph.columns import Columns
from equimorph.errors import EndlessError
from equimorph.linalg.lanes import over_lanes
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.edges import LONGEST, Excess, correct_ends, trace_rays
from equimorph.manifold.lifting.endless import (
    REPEATED,
    are_repeated,
    named_point,
    refuse_turns,
)
from equimorph.manifold.lifting.hiding_edges import BothEnds, hiding_edges
from equimorph.manifold.lifting.kernels import flag_first_of_alike, match_rays
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.marching.kernels import LEAST_COSINE, MULTIPLIER_WEIGHT
from equimorph.model import Progress

CHUNK = 4096
"""Rays that are traced together: this bounds the memory."""
ENDLESS = 250
"""Number of equilibria over one point beyond which the set is refused: it may be unbounded."""
REACH = 0.1
"""Distance of a known point from where it is predicted, over the step, up to which the ray ends
there; Newton's method may go 0.25 in its first correction, and from one end only."""
NEW, TOO_LONG = -1, -2
"""Partners of rays whose ends are not known, and of those that one step cannot lift."""


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
    """Raise EndlessError if a set grows without end, like one that winds around a circle."""
    store, setting = pairing.points, pairing.setting
    vertex = store.vertex[: store.count]
    sheets = np.bincount(vertex + 1, minlength=2)[1:]  # −1: over none
    if sheets.max() < REPEATED:
        return
    p = setting.parameters(pairing.mesh.vertices[sheets.argmax()][None])[0]
    if are_repeated(setting, store.z[np.flatnonzero(vertex == sheets.argmax())], p):
        refuse_turns(setting, p)
    if sheets.max() > ENDLESS:
        raise EndlessError(
            f"`within` must leave at most {ENDLESS} equilibria over a point; got more over "
            f"{named_point(setting, p)}. Bound a descriptor: one that grows with the turns of an "
            "endless set, or displacements if the structure has that many states."
        )


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
    z, good, excess = correct_ends(line, ends.guesses, tangent, ends.lengths, index, constraints)
    good = np.flatnonzero(good)
    _enter_lifted(pairing, rays.take(good), z.take(good, axis=0), excess.take(good, axis=0))


def _without_difficult(pairing: Pairing, rays: Rays) -> Rays:
    """Rays on edges that need no more effort; the others are marked as hard."""
    difficult = pairing.effort[rays.edges] > 0
    if not difficult.any():
        return rays
    pairing.mark(rays.take(difficult), RayMark.HARD)
    return rays.take(~difficult)


def _enter_lifted(pairing: Pairing, done: Rays, z: Lanes, excess: Excess) -> None:
    """Enter the curves of rays that were lifted to points over their other ends."""
    store, setting, mesh = pairing.points, pairing.setting, pairing.mesh
    vertices = mesh.edges[done.edges, 1 - done.sides]
    p = setting.parameters(mesh.vertices[vertices])
    # where it is lifted in one sweep, the index stays what it was
    ids, new = store.over_vertices(vertices, z, p, store.index[done.points])
    pairing.fit()
    # it was counted a correction before the last one; where eigenvalues nearly vanish it may differ
    pairing.slopes.fit(setting, store)
    new = np.flatnonzero(new)
    pairing.slopes.excess[ids[new]] = excess.take(new, axis=0)
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
    """Forget curves that hide zeros or violations, of new ones; their edges need more effort."""
    curves, rays = _new(pairing)
    some = hiding_edges(pairing, rays)
    pairing.effort[rays[0].edges[some]] = 1
    for curve in curves[some].tolist():
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
