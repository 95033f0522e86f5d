"""Sheet lifting, the flood: lift edges from all known points until nothing new appears.

From each known equilibrium over an edge's end, the edge is lifted: the curve ends over the other
end, or turns at folds and comes back as another equilibrium over the same end, or leaves through a
constraint. New ends are new equilibria.
"""

import numpy as np

from equimorph.errors import InputError
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.edges import Direct, correct_ends, lift_directly, trace_rays
from equimorph.manifold.lifting.hidden_zeros import take_back_hiding
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.manifold.lifting.predicted_ends import TOO_LONG, Ends, match_ends
from equimorph.model import Progress

CHUNK = 4096
"""Rays that are traced together: this bounds the memory."""
ENDLESS = 250
"""Number of equilibria over one point beyond which the set is refused: it may be unbounded."""


def flood(pairing: Pairing, progress: Progress) -> None:
    """Lift edges from all known points until every ray is traced or given up.

    All rays that one step can lift go first, then those that a few equal steps can; the rest wait
    and are traced many at a time.
    """
    while not pairing.is_full:
        flood_directly(pairing, progress)
        take_back_hiding(pairing)
        long = pairing.rays_with(RayMark.LONG)
        if len(long.points):
            _lift_long(pairing, long)
            continue
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
    if sheets.max() > ENDLESS:
        p = setting.parameters(pairing.mesh.vertices[sheets.argmax()][None])[0, setting.free]
        names = [setting.structure.parameters[place].name for place in setting.free]
        point = ", ".join(f"{name} = {value:g}" for name, value in zip(names, p, strict=True))
        raise InputError(
            f"`within` must leave at most {ENDLESS} equilibria over a point; got more over "
            f"{point}. Bound a descriptor: one that grows with the turns of an endless set, "
            "or displacements if the structure has that many states."
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
        ends = match_ends(pairing, some)
        known = np.flatnonzero(ends.partners >= 0)
        pairing.enter_many(some.take(known), ends.partners[known])
        new = ends.first_of_alike(pairing)
        pairing.mark(some.take(new | (ends.partners == TOO_LONG)), RayMark.LONG)
        _lift_to_new_ends(pairing, some.take(new), ends.take(new))


def _lift_to_new_ends(pairing: Pairing, rays: Rays, ends: Ends) -> None:
    """Correct predicted ends, and enter the curves of those that can be trusted."""
    store, line = pairing.points, pairing.line(rays)
    tangent, index = ends.guesses - store.z[rays.points], store.index[rays.points]
    constraints = pairing.setting.constraints
    direct = correct_ends(line, ends.guesses, tangent, ends.lengths, index, constraints)
    pairing.mark(rays.take(direct.hard), RayMark.HARD)
    _enter_lifted(pairing, rays, direct)


def _lift_long(pairing: Pairing, rays: Rays) -> None:
    """Enter the curves of rays that a few equal steps lift; the rest count as hard."""
    rays = _without_difficult(pairing, rays)
    pairing.mark(rays, RayMark.HARD)
    store = pairing.points
    for at in range(0, len(rays.points), CHUNK):
        some = rays.take(slice(at, at + CHUNK))
        start = store.z[some.points], store.index[some.points]
        direct = lift_directly(pairing.line(some), *start, pairing.setting.constraints)
        _enter_lifted(pairing, some, direct)


def _without_difficult(pairing: Pairing, rays: Rays) -> Rays:
    """Rays on edges that need no more effort; the others are marked as hard."""
    difficult = pairing.effort[rays.edges] > 0
    pairing.mark(rays.take(difficult), RayMark.HARD)
    return rays.take(~difficult)


def _enter_lifted(pairing: Pairing, rays: Rays, direct: Direct) -> None:
    """Enter the curves of rays that were lifted to points over their other ends."""
    store, setting, mesh = pairing.points, pairing.setting, pairing.mesh
    done, z = rays.take(direct.good), direct.z[direct.good]
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
