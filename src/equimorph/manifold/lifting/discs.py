"""Sheet lifting, the discs: polygons become triangulated discs that fit together."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise, starmap

import numpy as np

from equimorph.arrays import Bool, Int, Items, Pairs, Triples
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.topology import flags_of, keys_of, rows_of
from equimorph.manifold.lifting.constraint_sides import close_along_constraints
from equimorph.manifold.lifting.crossing_branches import lonely
from equimorph.manifold.lifting.crossing_discs import (
    Group,
    join_crossings,
    put_hubs,
    split_crossings,
)
from equimorph.manifold.lifting.fold_walks import fold_exits, nearest_at
from equimorph.manifold.lifting.fold_ways import followed_ways, ways_to_join
from equimorph.manifold.lifting.loops import Loops
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.patterns import cut_by_pattern
from equimorph.manifold.lifting.pins import groups_of, pin_groups
from equimorph.manifold.lifting.polygon_cuts import (
    MEETING,
    MOST_FOLDS,
    SINGULAR,
    TURN,
    Chord,
    Piece,
    Plan,
    between,
    chord_of,
    chords_to_split,
    cut,
    triangulate,
)
from equimorph.manifold.lifting.polygons import Polygon
from equimorph.model import are_feasible


@dataclass(frozen=True)
class Discs:
    """Triangulated discs over the grid triangles.

    corners (n, 3): points; index: of each triangle; owner: the grid triangle below it; folds,
    caps, crossings: their sides on folds, on constraints, and where sheets cross; doubtful: grid
    triangles whose polygons could not be closed and cut without doubt. met: which sides ab,
    bc, ca of each triangle lie on crossings; sheet: number, over its grid triangle, of the smooth
    sheet that it belongs to. astray: doubtful grid triangles with the fold and both ends of an open
    polygon that finds no corner there, or, three times, a fold or an end of a constraint that may
    lead to no known point.
    """

    corners: Triples
    index: Items
    owner: Items
    met: Bool[np.ndarray, "n 3"]
    sheet: Items
    folds: Int[np.ndarray, "f 2"]
    caps: Int[np.ndarray, "c 2"]
    crossings: Int[np.ndarray, "x 2"]
    doubtful: Int[np.ndarray, " k"]
    astray: Int[np.ndarray, "a 4"]


@dataclass
class _Found:
    """What is known of the discs that are not plain triangles."""

    corners: list[tuple[int, int, int]] = field(default_factory=list)
    index: list[int] = field(default_factory=list)
    owner: list[int] = field(default_factory=list)
    sheet: list[int] = field(default_factory=list)
    folds: set[Chord] = field(default_factory=set)
    caps: set[Chord] = field(default_factory=set)
    crossings: set[Chord] = field(default_factory=set)
    undecided: set[int] = field(default_factory=set)
    astray: list[tuple[int, int, int, int]] = field(default_factory=list)


def assemble(pairing: Pairing, loops: Loops) -> Discs:
    """Triangulate all polygons; plain ones are triangles already, others are cut by pattern."""
    found = _Found()
    found.undecided.update(loops.ambiguous, loops.broken)
    found.astray.extend(loops.astray)
    found.undecided.update(_alone(pairing))
    whole, left = cut_by_pattern(pairing, loops.polygons)
    found.undecided.update(whole.undecided.tolist())
    polygons = [*loops.polygons.each(left), *loops.special]
    plans = [_plan(pairing, polygon) for polygon in polygons]
    _close(pairing, plans, found)
    plans = _join_folds(pairing, plans, found)
    _split_chords(pairing, plans, found)
    _fill(pairing, plans, found)
    plain = len(loops.plain) + len(whole.corners)
    corners = np.array(found.corners, int).reshape(-1, 3)
    corners = np.concatenate([loops.plain, whole.corners, corners])
    index, base = pairing.points.index[loops.plain[:, 0]], pairing.points.count
    crossings = np.array(sorted(found.crossings), int).reshape(-1, 2)
    return Discs(
        corners,
        np.concatenate([index, whole.index, np.array(found.index, int)]),
        np.concatenate([loops.plain_triangle, whole.owner, np.array(found.owner, int)]),
        sides_among(corners, crossings),
        np.concatenate([np.zeros(plain, int), np.array(found.sheet, int)]),
        _distinct(whole.folds, found.folds, base),
        _distinct(whole.caps, found.caps, base),
        crossings,
        np.array(sorted(found.undecided), int),
        np.array(found.astray, int).reshape(-1, 4),
    )


def _distinct(pairs: Pairs, chords: set[Chord], base: int) -> Int[np.ndarray, "m 2"]:
    """Pairs of points and chords, each once, in order."""
    more = np.array(list(chords), int).reshape(-1, 2)
    keys = keys_of(np.concatenate([pairs, more]), base)
    return rows_of(np.unique(keys), base, 2)


def sides_of(corners: Triples) -> Int[np.ndarray, "sides 2"]:
    """Sides ab, bc, ca of triangles, one triangle after the other."""
    return corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def sides_among(corners: Triples, chosen: Int[np.ndarray, "k 2"]) -> Bool[np.ndarray, "n 3"]:
    """Which sides ab, bc, ca of triangles are among the chosen ones."""
    if len(chosen) == 0:
        return np.zeros(corners.shape, bool)
    return flags_of(sides_of(corners), chosen).reshape(corners.shape)


def _alone(pairing: Pairing) -> list[int]:
    """Grid triangles with a crossing through which the number of curves is not two."""
    edges = pairing.points.edge[lonely(pairing)]
    return np.flatnonzero(np.isin(pairing.mesh.sides, edges).any(axis=1)).tolist()


def _plan(pairing: Pairing, polygon: Polygon) -> Plan:
    mesh, store = pairing.mesh, pairing.points
    at_edge = {edge: 1 << k for k, edge in enumerate(mesh.sides[polygon.triangle].tolist())}
    at_corner = {
        vertex: (1 << k) | (1 << (k + 2) % 3)
        for k, vertex in enumerate(mesh.triangles[polygon.triangle].tolist())
    }
    points = np.array(polygon.points)
    vertices, edges = store.vertex[points].tolist(), store.edge[points].tolist()
    sides = {
        point: at_corner[vertex] if vertex >= 0 else at_edge[edge]
        for point, vertex, edge in zip(polygon.points, vertices, edges, strict=True)
    }
    kinds = {point: int(store.kind[point]) for point in polygon.points}
    return Plan(polygon, list(polygon.points), sides, kinds)


def _close(pairing: Pairing, plans: list[Plan], found: _Found) -> None:
    """Close open polygons along the constraint."""
    closed = close_along_constraints(pairing, plans)
    found.caps |= closed.caps
    found.undecided |= closed.undecided
    found.astray.extend(closed.astray)


def _join_folds(pairing: Pairing, plans: list[Plan], found: _Found) -> list[Plan]:
    """Decide which folds of each polygon belong together; return plans where that is certain."""
    ways = [ways_to_join(pairing, plan) for plan in plans]
    several = [
        k for k, each in enumerate(ways) if len(each) > 1 or len(plans[k].those(TURN)) > MOST_FOLDS
    ]
    followed = followed_ways(pairing, [plans[k] for k in several], [ways[k] for k in several])
    for k, each in zip(several, followed, strict=True):
        ways[k] = each
    ways = join_crossings(plans, ways)
    decided = []
    for plan, each in zip(plans, ways, strict=True):
        if len(each) == 1:
            plan.chords = each[0]
            decided.append(plan)
        else:
            found.undecided.add(plan.polygon.triangle)
            found.astray.extend(_leaving(plan, plan.those(TURN)))
    # what is said of a crossing must be said of both sheets
    crossed = [bool(plan.those(MEETING)) for plan in decided]
    decided = [
        plan
        for plan, own in zip(decided, crossed, strict=True)
        if not (own and plan.polygon.triangle in found.undecided)
    ]
    lost = put_hubs(pairing, decided)
    found.undecided.update(lost)
    return [plan for plan in decided if plan.polygon.triangle not in lost]


def _leaving(plan: Plan, folds: Iterable[int]) -> list[tuple[int, int, int, int]]:
    """What may lead out of the triangle of an undecided polygon; see `Discs`.

    No fold beside a crossing: it may end there, at a hilltop.
    """
    if plan.those(MEETING):
        return []
    triangle = plan.polygon.triangle
    return [(triangle, each, each, each) for each in folds if plan.kinds[each] == VertexKind.FOLD]


def _split_chords(pairing: Pairing, plans: list[Plan], found: _Found) -> None:
    """Put an exact point on chords that would lie on a grid edge, or block triangulation.

    And on those of folds that turn sharply, where it is known.
    """
    for plan in plans:
        plan.middle.update(
            {each: pairing.tips[each] for each in plan.chords if each in pairing.tips}
        )
    blocked = [
        (plan, chord)
        for plan in plans
        for chord in _chords_to_split(plan)
        if chord not in pairing.tips
    ]
    folds = [(plan, chord) for plan, chord in blocked if plan.singular(chord[0]) == TURN]
    groups = groups_of([plan for plan, _ in folds], [chord for _, chord in folds])
    extra = pin_groups(pairing, groups, [VertexKind.FOLD] * len(folds))
    _follow_lost(pairing, groups, extra)
    for (plan, chord), point in zip(folds, extra, strict=True):
        if point is None:
            found.undecided.add(plan.polygon.triangle)
            found.astray.extend(_leaving(plan, chord))
        else:
            plan.middle[chord] = point
    met = {
        Group(plan.polygon.triangle, chord)
        for plan, chord in blocked
        if plan.singular(chord[0]) == MEETING
    }
    # near a constraint the crossing might leave between the ends of its chord
    met |= {
        Group(plan.polygon.triangle, chord)
        for plan in plans
        for chord in plan.chords
        if plan.polygon.open and plan.singular(chord[0]) == MEETING and chord not in plan.middle
        if set(chord) <= set(plan.polygon.points)
    }
    found.undecided.update(split_crossings(pairing, plans, met))


def _follow_lost(pairing: Pairing, groups: list[Group], points: list[int | None]) -> None:
    """Points of folds that were not found between their ends: those that these pass as curves."""
    store, constraints = pairing.points, pairing.setting.constraints
    lost = [k for k, point in enumerate(points) if point is None]
    pairs = [(groups[k].triangle, groups[k].points[0]) for k in lost]
    for k, exit_ in zip(lost, fold_exits(pairing, pairs), strict=True):
        ends = np.array(groups[k].points)
        if exit_ is None or exit_.inside is None or nearest_at(pairing, [exit_], ends[1:])[0] < 0:
            continue
        z, p = exit_.inside
        if are_feasible(constraints, z[None], p[None])[0]:
            points[k] = store.add(z, p, int(store.index[ends].min()), VertexKind.FOLD)


def _chords_to_split(plan: Plan) -> list[Chord]:
    """Chords that need a further point; see `chords_to_split`."""
    place = {point: at for at, point in enumerate(plan.points)}
    chords = {chord_of(place[a], place[b]): (a, b) for a, b in plan.chords if {a, b} <= set(place)}
    chosen = chords_to_split(tuple(plan.on(plan.points)), tuple(chords))
    return [chords[chord] for chord in chosen]


@dataclass(frozen=True)
class _PlanPiece:
    """A piece of a polygon that is cut, by its corners, with the index of its sheet."""

    plan: Plan
    corners: Piece
    index: int


def _fill(pairing: Pairing, plans: list[Plan], found: _Found) -> None:
    """Cut polygons and triangulate their pieces, all pieces with equally many corners together."""
    by_size: dict[int, list[_PlanPiece]] = {}
    for number, plan in enumerate(plans):
        plan.sheet = number
        for chord in plan.chords:
            marked = found.crossings if plan.singular(chord[0]) == MEETING else found.folds
            way = (chord[0], *between(chord, plan.middle), chord[1])
            marked.update(starmap(chord_of, pairwise(way)))
        for piece in cut(plan.points, plan.chords, plan.middle):
            index = _index(pairing, piece)
            if index is None or len(piece) < 3:
                found.undecided.add(plan.polygon.triangle)
            else:
                by_size.setdefault(len(piece), []).append(_PlanPiece(plan, piece, index))
    for _, pieces in sorted(by_size.items()):  # so every triangle has its discs in one order
        _triangulate(pairing, pieces, found)


def _index(pairing: Pairing, piece: Piece) -> int | None:
    """Index of the points of a piece that are not on folds; None if they differ."""
    kind, own = pairing.points.kind, pairing.points.index
    index = {int(own[point]) for point in piece if int(kind[point]) not in SINGULAR}
    return index.pop() if len(index) == 1 else None


def _triangulate(pairing: Pairing, pieces: list[_PlanPiece], found: _Found) -> None:
    """Enter the triangles of pieces with equally many corners."""
    store = pairing.points
    corners = np.array([each.corners for each in pieces])
    places = embed(pairing.setting, store.z[corners.ravel()], store.p[corners.ravel()])
    sides = np.array([each.plan.on(each.corners) for each in pieces])
    below = pairing.mesh.triangles[[each.plan.polygon.triangle for each in pieces]]
    shares = shares_in(
        np.repeat(pairing.mesh.vertices[below], corners.shape[1], axis=0),
        store.p[corners.ravel()][:, pairing.setting.free],
    )
    flat = shares[:, 1:].reshape(*corners.shape, 2)
    triangles, possible = triangulate(places.reshape(*corners.shape, -1), sides, flat)
    rows = np.arange(len(corners))[:, None, None]
    for piece, own, good in zip(
        pieces, corners[rows, triangles].tolist(), possible.tolist(), strict=True
    ):
        if not good:
            found.undecided.add(piece.plan.polygon.triangle)
            continue
        found.corners.extend(own)
        found.index.extend([piece.index] * len(own))
        found.owner.extend([piece.plan.polygon.triangle] * len(own))
        found.sheet.extend([piece.plan.sheet] * len(own))
