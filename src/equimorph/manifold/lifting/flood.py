"""Sheet lifting, the flood: lift edges from all known points until nothing new appears.

From each known equilibrium over an edge's end, the edge is lifted: the curve ends over the other
end, or turns at folds and comes back as another equilibrium over the same end, or leaves through a
constraint. New ends are new equilibria.
"""

import numpy as np

from equimorph.errors import InputError
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.edges import lift_directly, trace_rays
from equimorph.manifold.lifting.hidden_zeros import take_back_hiding
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.model import Progress

STEPS = 4
"""Number of equal steps into which long edges are cut before they count as hard."""
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
            _lift(pairing, long, STEPS)
            continue
        hard = _one_of_each_pair(pairing, pairing.rays_with(RayMark.HARD))
        if len(hard.points) == 0:
            return
        for at in range(0, len(hard.points), CHUNK):
            trace_rays(pairing, hard.take(slice(at, at + CHUNK)))
        pairing.looked_at = len(pairing.curves.edge)  # steps of traces are judged as they are made


def flood_directly(pairing: Pairing, progress: Progress) -> None:
    """Lift edges from all known points as far as single steps lead."""
    pairing.fit()
    while not pairing.is_full and len((rays := pairing.rays_with(RayMark.UNTRACED)).points):
        _lift(pairing, rays, 1)
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


def _lift(pairing: Pairing, rays: Rays, steps: int) -> None:
    """Enter the curves of rays that `steps` steps lift; mark the rest for more effort."""
    pairing.mark(rays, RayMark.LONG if steps == 1 else RayMark.HARD)
    difficult = pairing.effort[rays.edges] > 0
    pairing.mark(rays.take(difficult), RayMark.HARD)
    rays = rays.take(~difficult)
    for at in range(0, len(rays.points), CHUNK):
        _lift_some(pairing, rays.take(slice(at, at + CHUNK)), steps)


def _lift_some(pairing: Pairing, rays: Rays, steps: int) -> None:
    store, setting, mesh = pairing.points, pairing.setting, pairing.mesh
    start = store.z[rays.points], store.index[rays.points]
    direct = lift_directly(pairing.line(rays), *start, setting.constraints, steps)
    done, z = rays.take(direct.good), direct.z[direct.good]
    vertices = mesh.edges[done.edges, 1 - done.sides]
    p = setting.parameters(mesh.vertices[vertices])
    # where it is lifted in one sweep, the index stays what it was
    ids, _ = store.over_vertices(vertices, z, p, store.index[done.points])
    pairing.fit()
    pairing.enter_many(done, ids)
