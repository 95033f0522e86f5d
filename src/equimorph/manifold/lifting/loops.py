"""Sheet lifting, the loops: around each triangle the lifted edges close into polygons.

Every point over a corner of a triangle belongs to one curve on each of the two edges that meet
there, so that the curves form closed loops, and open chains that end on a constraint at both ends.
Each loop, and a chain closed along the constraint, bounds a disc of the equilibrium set.
"""

from dataclasses import dataclass
from functools import partial
from itertools import groupby
from operator import attrgetter

import numpy as np

from equimorph.arrays import Bool, Float, Int, ItemFlags, Items, Some, Triples
from equimorph.linalg.lanes import results_of
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import cap_normals, frames_in_embedding, tangent_frames
from equimorph.manifold.lifting.cap_walks import link
from equimorph.manifold.lifting.courses import Courses
from equimorph.manifold.lifting.kernels import close_loops, find_plain_loops
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygons import Polygon, Polygons

ALONG, ASIDE = 0.1, 0.3
"""Sines of angles between sheets and chords: along them at most, aside at least."""
STRAIGHT = 0.9
"""Cosine of the angles between a constraint at both ends of a chain and the chord between them from
which on it leads from one to the other."""
AT_ONCE = 8192
"""Triangles around which loops are found together, while other threads do other ones."""
NEARER = 0.5
"""Most that the gap in a chain may be, relative to the distance from another chain."""
Pairwise = Bool[np.ndarray, "n n"]


@dataclass(frozen=True)
class Loops:
    """Plain triangles as an array, other polygons, and triangles that need subdivision."""

    plain: Int[np.ndarray, "P 3"]
    plain_triangle: Int[np.ndarray, " P"]
    polygons: Polygons
    special: list[Polygon]
    """Polygons in triangles with arcs or several open chains."""
    ambiguous: list[int]
    """Triangles with several open chains: which ends belong together is not decided there."""
    broken: list[int]
    """Triangles whose curves do not close, or close only after going around twice."""
    astray: list[tuple[int, int, int, int]]
    """Ambiguous triangles with a fold or constraint that leads to nothing known, see `Discs`."""


def find_loops(pairing: Pairing, wanted: Bool[np.ndarray, " T"] | None = None) -> Loops:
    """Close the curves around every triangle, or around the flagged ones."""
    triangles = np.arange(len(pairing.mesh.triangles))
    triangles = triangles if wanted is None else triangles[wanted]
    plain, owner, left = _plain(pairing, triangles)
    polygons, broken = _close(pairing, left, plain, owner)
    chains = np.bincount(polygons.triangle[polygons.open], minlength=len(pairing.mesh.triangles))
    several = chains > 1
    several[_with_arc(pairing)] = True
    single = np.flatnonzero(polygons.open & ~several[polygons.triangle])
    several[polygons.triangle[single[_are_bent(pairing, polygons, single)]]] = True
    rows = np.flatnonzero(several[polygons.triangle])
    layers = _over_layers(pairing, triangles[several[triangles]])
    found = sorted([*polygons.each(rows), *layers], key=attrgetter("triangle"))
    special, ambiguous, unjoined, astray = _decide(pairing, found)
    alone = _alone(polygons, ~several[polygons.triangle])
    return Loops(plain, owner, alone, special, ambiguous, [*broken.tolist(), *unjoined], astray)


def _are_bent(pairing: Pairing, polygons: Polygons, chains: Some) -> Bool[np.ndarray, " n"]:
    """Whether constraints do not lead straight from one end of open chains to the other.

    They may take turns there, or lead out of the triangle and back into it. Where ends differ in
    their index a fold leads out, where sheets cross, these do.
    """
    store, setting = pairing.points, pairing.setting
    ends = polygons.points[np.stack([polygons.starts[chains], polygons.starts[chains + 1] - 1], 1)]
    bent = np.zeros(len(ends), bool)
    plain = np.flatnonzero(
        (store.index[ends[:, 0]] == store.index[ends[:, 1]])
        & (store.kind[ends] == VertexKind.CAP).all(axis=1)
    )
    if len(plain) == 0 or len(setting.free) == 1:
        return bent
    own = ends[plain]
    normals = cap_normals(setting, store.z[own.ravel()], store.p[own.ravel()])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    triangle = polygons.triangle[chains[plain]]
    courses = Courses.of(pairing, own, triangle, normals.reshape(*own.shape, -1))
    bent[plain] = ~(courses.cosines > STRAIGHT).all(axis=1)
    return bent


def _over_layers(pairing: Pairing, triangles: Items) -> list[Polygon]:
    """Arcs without a crossing over the sides of triangles, as open chains."""
    kinds = pairing.points.kind
    return [
        Polygon(triangle, arc, True)
        for triangle in triangles.tolist()
        for edge in pairing.mesh.sides[triangle].tolist()
        for arc in pairing.arcs.get(edge, ())
        if VertexKind.CROSSING not in kinds[list(arc)]
    ]


def _close(
    pairing: Pairing, triangles: Some, plain: Triples, owner: Items
) -> tuple[Polygons, Int[np.ndarray, " broken"]]:
    """Polygons over triangles that are not plain, and triangles over which they do not close."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    inner = np.zeros(curves.count + 1, int)
    for curve, own in curves.inner.items():
        inner[curve + 1] = len(own)
    in_order = [point for curve in sorted(curves.inner) for point in curves.inner[curve]]
    known = points.vertex, points.head, points.following, pairing.rays, pairing.slots
    rows = np.stack([np.searchsorted(owner, triangles + k) for k in range(2)], axis=1)
    flat, starts, triangle, is_open, broken = close_loops(
        triangles, mesh.triangles, mesh.sides, mesh.edges, *known, curves.start, curves.end,
        np.cumsum(inner), np.array(in_order, int), plain, rows,
    )  # fmt: skip
    return Polygons(flat, starts, triangle, is_open > 0), triangles[broken]


def _alone(polygons: Polygons, kept: ItemFlags) -> Polygons:
    """Those of some polygons that are flagged."""
    lengths = np.diff(polygons.starts)
    return Polygons(
        polygons.points[np.repeat(kept, lengths)],
        np.concatenate([[0], np.cumsum(lengths[kept])]),
        polygons.triangle[kept],
        polygons.open[kept],
    )


def _with_arc(pairing: Pairing) -> Some:
    """Triangles with arcs over their sides."""
    has = np.zeros(len(pairing.mesh.edges), bool)
    has[[edge for edge, arcs in pairing.arcs.items() if arcs]] = True
    return np.flatnonzero(has[pairing.mesh.sides].any(axis=1))


Astray = tuple[int, int, int, int]


def _decide(
    pairing: Pairing, polygons: list[Polygon]
) -> tuple[list[Polygon], list[int], list[int], list[Astray]]:
    """Polygons in triangles with arcs or several chains; triangles without a decision; broken.

    And folds that lead out of triangles where no curve is known.
    """
    decided: list[Polygon] = []
    unclear: dict[int, list[Polygon]] = {}
    broken: list[int] = []
    lost: list[Astray] = []
    groups: dict[int, list[Polygon]] = {}
    for triangle, own in groupby(polygons, key=attrgetter("triangle")):
        found, joined = _with_arcs(pairing, triangle, list(own))
        if any(polygon is None for polygon in found):
            broken.append(triangle)
        else:
            groups[triangle] = [polygon for polygon in found if polygon is not None]
            decided.extend(joined)
    chains_of = {triangle: [each for each in own if each.open] for triangle, own in groups.items()}
    single = [triangle for triangle, chains in chains_of.items() if len(chains) == 1]
    alone = Polygons.of([chains_of[triangle][0] for triangle in single])
    bent = dict(zip(single, _are_bent(pairing, alone, np.arange(len(single))), strict=True))
    for triangle, every in groups.items():
        if bent.get(triangle, False) or (
            len(chains_of[triangle]) > 1 and not _closes_alone(pairing, chains_of[triangle])
        ):
            unclear[triangle] = every
        else:
            decided.extend(every)
    linked, astray = _linked(pairing, unclear)
    lost.extend(astray)
    decided.extend(linked)
    ambiguous = sorted(set(unclear) - {polygon.triangle for polygon in linked})
    undecided = set(ambiguous)
    decided = [polygon for polygon in decided if polygon.triangle not in undecided]
    return decided, ambiguous, broken, lost


def _linked(
    pairing: Pairing, unclear: dict[int, list[Polygon]]
) -> tuple[list[Polygon], list[Astray]]:
    """Polygons over those triangles on which constraints lead from end to end; and what is astray.

    Where sheets cross, these are not followed.
    """
    chains = {
        triangle: [polygon for polygon in own if polygon.open] for triangle, own in unclear.items()
    }
    chains = {
        triangle: own
        for triangle, own in chains.items()
        if not any(_crossings(pairing, chain) for chain in own)
    }
    polygons, lost = list[Polygon](), list[Astray]()
    for triangle, linked in link(pairing, chains).items():
        lost.extend(linked.astray)
        if linked.polygons is not None:
            closed = [polygon for polygon in unclear[triangle] if not polygon.open]
            polygons.extend([*closed, *linked.polygons])
        elif (
            linked.apart
            and len(chains[triangle]) > 1
            and _close_themselves(pairing, chains[triangle])
        ):
            polygons.extend(unclear[triangle])
    return polygons, lost


def _with_arcs(
    pairing: Pairing, triangle: int, found: list[Polygon]
) -> tuple[list[Polygon | None], list[Polygon]]:
    """Polygons over a triangle that no arc belongs to, and those with arcs.

    The sheet of an arc goes on through the next crossing of the sheet that it crosses: along
    another arc or an open chain. Where there is no such crossing, it leaves with the first.
    """
    sides = pairing.mesh.sides[triangle].tolist()
    every = [Polygon(triangle, arc, True) for edge in sides for arc in pairing.arcs.get(edge, ())]
    arcs = [arc for arc in every if _crossings(pairing, arc)]
    polygons, joined = list(found), []
    if not arcs:
        return [*found], []
    while arcs:
        arc = arcs.pop()
        met = _crossings(pairing, arc)
        across = [polygon for polygon in polygons if met <= _crossings(pairing, polygon)]
        following = [point for each in across for point in _crossings(pairing, each) - met]
        if len(across) != 1 or len(following) > 1:
            return [None], []
        if not following:
            joined.append(arc)
            continue
        others = [each for each in (*arcs, *polygons) if each not in across and each.open]
        partners = [each for each in others if following[0] in _crossings(pairing, each)]
        if len(partners) != 1:
            return [None], []
        joined.append(_join_chains(pairing, arc, partners[0]))
        arcs, polygons = ([e for e in own if e != partners[0]] for own in (arcs, polygons))
    return list(polygons), joined


def _crossings(pairing: Pairing, polygon: Polygon) -> set[int]:
    """Points of a polygon where another sheet crosses."""
    kinds = pairing.points.kind
    return {point for point in polygon.points if kinds[point] == VertexKind.CROSSING}


def _join_chains(pairing: Pairing, first: Polygon, second: Polygon) -> Polygon:
    """Polygon of two open chains whose nearer ends are joined along the constraint."""
    chain = first.points, second.points
    ends = np.array([own[k] for own in chain for k in (0, -1)])
    place = embed(pairing.setting, pairing.points.z[ends], pairing.points.p[ends])
    gap = np.linalg.norm(place[:2, None] - place[None, 2:], axis=2)
    turned = gap[1, 1] + gap[0, 0] < gap[1, 0] + gap[0, 1]
    points = (*chain[0], *(reversed(chain[1]) if turned else chain[1]))
    return Polygon(first.triangle, points, True, (len(chain[0]),))


def _closes_alone(pairing: Pairing, chains: list[Polygon]) -> bool:
    """Whether each of several open chains must be closed by itself: two smooth sheets that cross.

    Or its ends are near enough. A crossing that leaves and comes back in between is found out when
    its chord is given a point (see `assembly`).
    """
    crossings = [_crossings(pairing, chain) for chain in chains]
    if len(chains) == 2 and crossings[0] and crossings[0] == crossings[1]:
        return True
    if not any(crossings):
        return False
    return any(rule(pairing, chains) for rule in (_close_themselves, _on_own_sheets))


def _on_own_sheets(pairing: Pairing, chains: list[Polygon]) -> bool:
    """Whether each chain's ends lie along the sheet at each other, but not along the other sheets.

    So they do next to a crossing that lies beyond the constraint, at every scale. One of two
    sheets that cross is seen along the other, if that bends away from it, but not the other way.
    """
    ends = np.array([(chain.points[0], chain.points[-1]) for chain in chains]).ravel()
    off, own = _slopes_to(pairing, ends)
    itself = np.eye(len(ends), dtype=bool)
    aside = np.maximum(off, off.T)[~own]
    return bool((off[own & ~itself] < ALONG).all() and (aside > ASIDE).all())


def _slopes_to(pairing: Pairing, ends: Items) -> tuple[Float[np.ndarray, "n n"], Pairwise]:
    """Sines of the angles between the sheets at ends and the chords to others; which are partners.

    Ends are those of chains, two of each.
    """
    setting, store = pairing.setting, pairing.points
    z, p = store.z[ends], store.p[ends]
    place, d = embed(setting, z, p), len(setting.free)
    rows = np.zeros((len(ends), d, place.shape[1]))
    rows[:, :, -d:] = np.eye(d)
    planes = frames_in_embedding(setting, tangent_frames(setting, z, p, rows))
    chord = place[None] - place[:, None]
    flat = np.einsum("adc,abc->abd", planes, chord)
    length = np.maximum(np.linalg.norm(chord, axis=2), 1e-300)
    off = np.sqrt(np.maximum(1.0 - (np.linalg.norm(flat, axis=2) / length) ** 2, 0.0))
    chain = np.arange(len(ends)) // 2
    return off, chain[:, None] == chain[None]


def _close_themselves(pairing: Pairing, chains: list[Polygon]) -> bool:
    """Whether both ends of every open chain are much nearer to each other than to other chains."""
    ends = np.array([(chain.points[0], chain.points[-1]) for chain in chains]).ravel()
    place = embed(pairing.setting, pairing.points.z[ends], pairing.points.p[ends])
    gap = np.linalg.norm(place[:, None] - place[None], axis=2)
    chain = np.arange(len(ends)) // 2
    own = chain[:, None] == chain[None]
    to_itself = np.where(own, gap, 0.0).max(axis=1)
    return bool((to_itself < NEARER * np.where(own, np.inf, gap).min(axis=1)).all())


def _plain(
    pairing: Pairing, triangles: Some
) -> tuple[Int[np.ndarray, "P 3"], Int[np.ndarray, " P"], Int[np.ndarray, " S"]]:
    """Loops of three curves that go straight across; triangles over which other loops exist."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    known = points.vertex, points.head, points.following, pairing.rays, pairing.slots
    lines = curves.start, curves.end, curves.plain
    parts = [triangles[at : at + AT_ONCE] for at in range(0, max(len(triangles), 1), AT_ONCE)]
    tasks = [
        partial(find_plain_loops, own, mesh.triangles, mesh.sides, mesh.edges, *known, *lines)
        for own in parts
    ]
    loops, owner, special = zip(*results_of(tasks), strict=True)
    return np.concatenate(loops), np.concatenate(owner), triangles[np.concatenate(special)]
