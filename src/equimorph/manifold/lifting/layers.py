"""Layers of a set beside a fold that pass between grid vertices: arcs over edges lead through them.

Where a constraint leaves only a thin layer beside a fold, an edge that crosses it begins and ends
beyond: over it lies an arc, from the constraint through the fold to the constraint, of which no
vertex knows. But in a triangle that sees the layer on another side, the fold leads there.

See docs/decisions.md, "Strips between a fold and a constraint are led along".
"""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Int, Place
from equimorph.equilibria.critical import null_border
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.cap_walks import cap_at, cap_exits
from equimorph.manifold.lifting.cells import CellFinder, Cells, Close
from equimorph.manifold.lifting.crossing_branches import (
    HALVES,
    LedOut,
    edge_lines,
    first_steps,
    flood_crossings,
    lead_out,
)
from equimorph.manifold.lifting.edges import Inside
from equimorph.manifold.lifting.fold_walks import NOISE, fold_at, fold_exits
from equimorph.manifold.lifting.grid import NEAR_AN_END
from equimorph.manifold.lifting.pairing import CapExit, FoldExit, Pairing
from equimorph.model import Progress
from equimorph.structures.metric import metric_length


def find_through_layers(
    finder: CellFinder, pairing: Pairing, close: Close | None, progress: Progress
) -> Cells:
    """Cells of a set, through layers that are led along; `close` is for the first time."""
    cells = finder.find(pairing, close)
    while not pairing.is_full and _enter_layers(pairing, cells.astray):
        flood_crossings(pairing, progress)
        cells = finder.find(pairing)
    return cells


def _enter_layers(pairing: Pairing, astray: Int[np.ndarray, "a 4"]) -> bool:
    """Enter the arcs to which folds and constraints lead out of triangles; whether any are new.

    `astray`: see `Discs`. What was tried in vain is not tried again.
    """
    on_fold = pairing.points.kind[astray[:, 1]] != VertexKind.CAP
    pairs, caps = (
        [(triangle, point) for triangle, point in np.unique(own[:, :2], axis=0).tolist()]
        for own in (astray[on_fold], astray[~on_fold])
    )
    # both in any case
    return any([_enter_at_folds(pairing, pairs), _enter_at_constraints(pairing, caps)])


def _enter_at_constraints(pairing: Pairing, pairs: Sequence[tuple[int, int]]) -> bool:
    """Enter what lies over edges behind unknown points on constraints, from these on."""
    exits = [each for each in cap_exits(pairing, pairs) if each is not None]
    new = [each for each in exits if cap_at(pairing, each) < 0]
    if not new:
        return False
    led = _led_from_constraints(pairing, new)
    store, met = pairing.points, led.met
    count = store.count
    reached, _ = store.over_vertices(*led.seeds)
    pairing.fit()
    for half in np.unique(met.lanes[met.kinds == VertexKind.CAP]).tolist():
        own, each = met.take(met.lanes == half), new[half // HALVES]
        if cap_at(pairing, each) < 0 and VertexKind.CROSSING not in own.kinds:
            start = _add(pairing, each)
            rest = store.add_many(own.z, own.p, own.index, own.kinds, each.edge)
            pairing.arcs.setdefault(each.edge, []).append((start, *rest.tolist()))
    direct = led.straight >= 0
    for half, point in zip(led.straight[direct].tolist(), reached[direct].tolist(), strict=True):
        each = new[half // HALVES]
        if cap_at(pairing, each) < 0:
            _end_at_constraint(pairing, point, each.edge, _add(pairing, each))
    pairing.fit()
    tried = {id(each) for each in new if cap_at(pairing, each) < 0}
    for key, one in pairing.cap_exits.items():
        if id(one) in tried:
            pairing.cap_exits[key] = None
    return store.count > count


def _led_from_constraints(pairing: Pairing, exits: Sequence[CapExit]) -> LedOut:
    """Follow the curves over edges both ways from points on constraints."""
    edge, z, p = (np.array([getattr(each, name) for each in exits]) for name in ("edge", "z", "p"))
    owner, sense = np.divmod(np.arange(HALVES * len(z)), HALVES)
    line = edge_lines(pairing, edge)
    t = np.array([_share(pairing, *each) for each in zip(edge.tolist(), p, strict=True)])
    one = np.ones(len(z))
    along = line.advance(z, t, np.zeros_like(z), one, 0.0 * one).tangent_z
    norm = np.hypot(metric_length(pairing.setting.structure, along), line.weight)
    sign = np.where(sense, -1.0, 1.0)
    tangents = (sign / norm[owner])[:, None] * along[owner], sign / norm[owner]
    lines = line.take(owner)
    index = pairing.setting.structure.index(z, p)[owner]
    halves, front = first_steps(pairing, lines, z[owner], p[owner], tangents, index)
    return lead_out(pairing, halves, edge[owner[halves]], lines.take(halves), front)


def _add(pairing: Pairing, exit_: CapExit) -> int:
    """Number of a new point on a constraint."""
    index = pairing.setting.structure.index(exit_.z[None], exit_.p[None])
    return pairing.points.add(exit_.z, exit_.p, int(index[0]), VertexKind.CAP, exit_.edge)


def _end_at_constraint(pairing: Pairing, point: int, edge: int, cap: int) -> None:
    """Let the curve from a point over a vertex end at a constraint, instead of one that passed it.

    Behind it a violation is hidden, which neither end of the edge shows.
    """
    pairing.fit()
    known = pairing.ray(point, edge)
    if known >= 0:
        pairing.forget(known)
    pairing.enter(point, edge, -1, [cap])


def _enter_at_folds(pairing: Pairing, pairs: Sequence[tuple[int, int]]) -> bool:
    """Enter what lies over edges beside unknown folds, from these on."""
    exits = [each for each in fold_exits(pairing, pairs) if each is not None]
    new = [each for each in exits if each.edge >= 0 and fold_at(pairing, each) < 0]
    kept: list[FoldExit] = []
    for one in new:
        if not any(_same(one, each) for each in kept):
            kept.append(one)
    if not kept:
        return False
    entered = _enter(pairing, kept)
    tried = {id(each) for each in new if fold_at(pairing, each) < 0}
    for key, each in pairing.exits.items():
        if id(each) in tried:
            pairing.exits[key] = None
    return entered


def _same(one: FoldExit, other: FoldExit) -> bool:
    """Whether two folds over edges are the same."""
    return one.edge == other.edge and bool(
        max(np.abs(one.z - other.z).max(), np.abs(one.p - other.p).max()) < NOISE
    )


def _enter(pairing: Pairing, exits: Sequence[FoldExit]) -> bool:
    """Follow both halves of the curves through folds over edges, and enter what they lead to."""
    edge, z, p = (np.array([getattr(each, name) for each in exits]) for name in ("edge", "z", "p"))
    setting, store = pairing.setting, pairing.points
    structure = setting.structure
    phi = null_border(structure, z, p)
    phi /= metric_length(structure, phi)[:, None]
    owner, sense = np.divmod(np.arange(HALVES * len(z)), HALVES)
    line = edge_lines(pairing, edge).take(owner)
    tangents = np.where(sense, -1.0, 1.0)[:, None] * phi[owner], np.zeros(len(owner))
    halves, front = first_steps(pairing, line, z[owner], p[owner], tangents)
    lines = line.take(halves)
    led = lead_out(pairing, halves, edge[owner[halves]], lines, front)
    met = led.met
    for half, t in led.rings.items():  # a vertex between both folds sees the ring
        k = int(owner[half])
        middle = _share(pairing, int(edge[k]), 0.5 * (p[k] + t))
        pairing.rings[int(edge[k])] = min(max(middle, NEAR_AN_END), 1.0 - NEAR_AN_END)
    count = store.count
    store.over_vertices(*led.seeds)
    left = np.unique(met.lanes[met.kinds == VertexKind.CAP])
    left = np.setdiff1d(left, met.lanes[met.kinds == VertexKind.CROSSING])
    entered = np.unique(left[np.isin(left ^ 1, left)] // HALVES).tolist()
    for k in entered:
        if fold_at(pairing, exits[k]) >= 0:  # on an arc through several folds
            continue
        ends = [met.take(met.lanes == HALVES * k + half) for half in range(HALVES)]
        _enter_arc(pairing, int(edge[k]), z[k], p[k], ends)
    pairing.fit()
    return bool(entered) or store.count > count


def _share(pairing: Pairing, edge: int, p: Place) -> float:
    """Part of the way along an edge at which parameters lie."""
    free, mesh = pairing.setting.free, pairing.mesh
    start, end = mesh.vertices[mesh.edges[edge]] / pairing.setting.scales
    way = end - start
    return float((p[free] / pairing.setting.scales - start) @ way / (way @ way))


def _enter_arc(pairing: Pairing, edge: int, z: Place, p: Place, ends: list[Inside]) -> None:
    """Enter one arc through a fold."""
    store = pairing.points
    first, second = (
        store.add_many(own.z, own.p, own.index, own.kinds, edge).tolist() for own in ends
    )
    low = min(int(store.index[own[0]]) for own in (first, second))
    fold = store.add(z, p, low, VertexKind.FOLD, edge)
    pairing.arcs.setdefault(edge, []).append((*first[::-1], fold, *second))
