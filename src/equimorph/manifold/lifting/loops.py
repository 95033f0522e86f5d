"""Sheet lifting, the loops: around each triangle the lifted edges close into polygons.

Every point over a corner of a triangle belongs to one curve on each of the two edges that meet
there, so that the curves form closed loops, and open chains that end on a constraint at both ends.
Each loop, and a chain closed along the constraint, bounds a disc of the equilibrium set.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Int, Items, Some
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.tangents import frames_in_embedding, tangent_frames
from equimorph.manifold.lifting.pairing import Pairing

ALONG, ASIDE = 0.1, 0.3
"""Sines of angles between sheets and chords: along them at most, aside at least."""
NEARER = 0.5
"""Most that the gap in a chain may be, relative to the distance from another chain."""


@dataclass(frozen=True)
class Polygon:
    """Boundary of a disc over one triangle: points in order; `open` if closed along a constraint.

    An open polygon runs from its first to its last point; the closing side lies on the constraint.
    So does, if it consists of two chains, the side that ends at the place `gap` among its points.
    """

    triangle: int
    points: tuple[int, ...]
    open: bool
    gap: int = 0


@dataclass(frozen=True)
class Loops:
    """Plain triangles as an array, other polygons, and triangles that need subdivision."""

    plain: Int[np.ndarray, "P 3"]
    plain_triangle: Int[np.ndarray, " P"]
    polygons: list[Polygon]
    ambiguous: list[int]
    """Triangles with several open chains: which ends belong together is not decided there."""
    broken: list[int]
    """Triangles whose curves do not close, or close only after going around twice."""


def find_loops(pairing: Pairing, wanted: Bool[np.ndarray, " T"] | None = None) -> Loops:
    """Close the curves around every triangle, or around the flagged ones."""
    triangles = np.arange(len(pairing.mesh.triangles))
    plain, owner, special = _plain(pairing, triangles if wanted is None else triangles[wanted])
    polygons: list[Polygon] = []
    ambiguous: list[int] = []
    broken: list[int] = []
    ends = np.searchsorted(owner, np.stack([special, special + 1]))
    for triangle, start, stop in zip(special.tolist(), *ends.tolist(), strict=True):
        found = list(_around(pairing, triangle, set(plain[start:stop].ravel().tolist())))
        found, joined = _with_arcs(pairing, triangle, found)
        chains = [polygon for polygon in found if polygon is not None and polygon.open]
        if any(polygon is None for polygon in found):
            broken.append(triangle)
        elif len(chains) > 1 and not _closes_alone(pairing, chains):
            ambiguous.append(triangle)
        else:
            polygons.extend(polygon for polygon in found if polygon is not None)
            polygons.extend(joined)
    return Loops(plain, owner, polygons, ambiguous, broken)


def _with_arcs(
    pairing: Pairing, triangle: int, found: list[Polygon | None]
) -> tuple[list[Polygon | None], list[Polygon]]:
    """Polygons over a triangle that no arc belongs to, and those with arcs.

    The sheet of an arc goes on through the next crossing of the sheet that it crosses: along
    another arc or an open chain. Where there is no such crossing, it leaves with the first.
    """
    sides = pairing.mesh.sides[triangle].tolist()
    arcs = [Polygon(triangle, arc, True) for edge in sides for arc in pairing.arcs.get(edge, ())]
    polygons, joined = [polygon for polygon in found if polygon is not None], []
    if not arcs or len(polygons) < len(found):
        return found, []
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
    return Polygon(first.triangle, points, True, gap=len(chain[0]))


def _closes_alone(pairing: Pairing, chains: list[Polygon]) -> bool:
    """Whether each of several open chains must be closed by itself: two smooth sheets that cross.

    Or its ends are near enough. A crossing that leaves and comes back in between is found out when
    its chord is given a point (see `assembly`).
    """
    crossings = [_crossings(pairing, chain) for chain in chains]
    if len(chains) == 2 and crossings[0] and crossings[0] == crossings[1]:
        return True
    return _close_themselves(pairing, chains) or _on_own_sheets(pairing, chains)


def _on_own_sheets(pairing: Pairing, chains: list[Polygon]) -> bool:
    """Whether each chain's ends lie along the sheet at each other, but not along the other sheets.

    So they do next to a crossing that lies beyond the constraint, at every scale. One of two
    sheets that cross is seen along the other, if that bends away from it, but not the other way.
    """
    ends = np.array([(chain.points[0], chain.points[-1]) for chain in chains]).ravel()
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
    own = chain[:, None] == chain[None]
    itself = np.eye(len(ends), dtype=bool)
    aside = np.maximum(off, off.T)[~own]
    return bool((off[own & ~itself] < ALONG).all() and (aside > ASIDE).all())


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
    mesh, points = pairing.mesh, pairing.points
    partner = _partners(pairing)
    vertex = points.vertex[: points.count]
    order = np.argsort(vertex, kind="stable")
    order = order[vertex[order] >= 0]
    amount = np.bincount(vertex[order], minlength=len(mesh.vertices))
    first = np.concatenate([[0], np.cumsum(amount)])
    here = amount[mesh.triangles[triangles, 0]]
    owner = np.repeat(triangles, here)
    offset = np.arange(len(owner)) - np.repeat(np.cumsum(here) - here, here)
    a = order[first[mesh.triangles[owner, 0]] + offset]
    b = _across(pairing, partner, a, mesh.sides[owner, 0])
    c = _across(pairing, partner, a, mesh.sides[owner, 2])
    closed = (b >= 0) & (c >= 0)
    closed[closed] = _across(pairing, partner, b[closed], mesh.sides[owner[closed], 1]) == c[closed]
    loops = np.bincount(owner[closed], minlength=len(mesh.triangles))
    special = (amount[mesh.triangles[triangles]] > loops[triangles, None]).any(axis=1)
    return np.stack([a, b, c], axis=1)[closed], owner[closed], triangles[special]


def _partners(pairing: Pairing) -> Int[np.ndarray, "count slots"]:
    """Point at the other end of each point's curves that go straight across; −1 elsewhere."""
    points, curves = pairing.points, pairing.curves
    if not curves.edge:
        return np.full((points.count, pairing.rays.shape[1]), -1)
    start, end = np.array(curves.start, int), np.array(curves.end, int)
    simple = end >= 0
    simple[list(curves.inner)] = False
    simple &= points.vertex[start] != points.vertex[end]
    curve = pairing.rays[: points.count]
    own = np.arange(points.count)[:, None]
    other = np.where(start[curve] == own, end[curve], start[curve])
    return np.where((curve >= 0) & simple[curve], other, -1)


def _across(
    pairing: Pairing, partner: Int[np.ndarray, "count slots"], point: Items, edge: Items
) -> Items:
    side = (pairing.mesh.edges[edge, 1] == pairing.points.vertex[point]).astype(int)
    return np.asarray(partner[point, pairing.slots[edge, side]])


def _around(pairing: Pairing, triangle: int, plain: set[int]) -> Iterator[Polygon | None]:
    """Polygons over one triangle that are not plain; None where curves are missing or go twice."""
    points, at = pairing.points, edges_at(pairing, triangle)
    corners = pairing.mesh.triangles[triangle].tolist()
    todo = {point for corner in corners for point in points.over(corner)} - plain
    ends = [
        (point, edge)
        for point in sorted(todo)
        for edge in at[int(points.vertex[point])]
        if pairing.ray(point, edge) >= 0 and pairing.curves.end[pairing.ray(point, edge)] < 0
    ]
    for point, edge in ends:
        if point in todo:
            yield _walk(pairing, triangle, point, edge, todo)
    while todo:
        point = min(todo)
        yield _walk(pairing, triangle, point, None, todo)


def _walk(
    pairing: Pairing, triangle: int, point: int, came_by: int | None, todo: set[int]
) -> Polygon | None:
    """Follow curves from a point; from an exit if `came_by` names the edge that leads to it."""
    points, curves, at = pairing.points, pairing.curves, edges_at(pairing, triangle)
    path: list[int] = []
    if came_by is not None:
        path.extend(reversed(curves.inner[pairing.ray(point, came_by)]))
    first, visited = point, []
    here = at[int(points.vertex[point])]
    edge = here[0] if came_by is None else _other(here, came_by)
    while True:
        path.append(point)
        visited.append(point)
        todo.discard(point)
        curve = pairing.ray(point, edge)
        if curve < 0 or len(visited) > 64:
            return None
        inner = curves.inner.get(curve, [])
        forward = curves.start[curve] == point
        path.extend(inner if forward else reversed(inner))
        following = curves.end[curve] if forward else curves.start[curve]
        if following < 0:
            return Polygon(triangle, tuple(path), True) if came_by is not None else None
        if following == first and came_by is None:
            break
        if following in visited:
            return None
        point = following
        edge = _other(at[int(points.vertex[point])], edge)
    return None if _twice(pairing, triangle, visited) else Polygon(triangle, tuple(path), False)


def edges_at(pairing: Pairing, triangle: int) -> dict[int, tuple[int, int]]:
    """Return the two sides of a triangle that meet at each of its corners."""
    mesh = pairing.mesh
    corners, sides = mesh.triangles[triangle].tolist(), mesh.sides[triangle].tolist()
    return {corners[k]: (sides[k], sides[(k + 2) % 3]) for k in range(3)}


def _twice(pairing: Pairing, triangle: int, visited: list[int]) -> bool:
    """Whether a loop without folds or exits passes over a corner more than once."""
    vertices = [int(pairing.points.vertex[point]) for point in visited]
    if len(set(vertices)) == len(vertices):
        return False
    at = edges_at(pairing, triangle)
    curves = (
        pairing.ray(point, edge)
        for point, vertex in zip(visited, vertices, strict=True)
        for edge in at[vertex]
    )
    return not any(pairing.curves.inner.get(curve) for curve in curves)


def _other(pair: tuple[int, int], edge: int) -> int:
    return pair[1] if pair[0] == edge else pair[0]
