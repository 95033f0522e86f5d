"""Sheet lifting, part two: around each triangle the lifted edges close into polygons.

Every point over a corner of a triangle belongs to one curve on each of the two edges that meet
there, so that the curves form closed loops, and open chains that end on a constraint at both ends.
Each loop, and a chain closed along the constraint, bounds a disc of the equilibrium set.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from equimorph.manifold.pairing import Pairing


@dataclass(frozen=True)
class Polygon:
    """Boundary of a disc over one triangle: points in order; `open` if closed along a constraint.

    An open polygon runs from its first to its last point; the closing side lies on the constraint.
    """

    triangle: int
    points: tuple[int, ...]
    open: bool


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


def find_loops(pairing: Pairing) -> Loops:
    """Close the curves around every triangle."""
    plain, owner, special = _plain(pairing)
    polygons: list[Polygon] = []
    ambiguous: list[int] = []
    broken: list[int] = []
    for triangle in special.tolist():
        found = list(_around(pairing, triangle))
        chains = sum(polygon.open for polygon in found if polygon is not None)
        if any(polygon is None for polygon in found):
            broken.append(triangle)
        elif chains > 1:
            ambiguous.append(triangle)
        else:
            polygons.extend(polygon for polygon in found if polygon is not None)
    return Loops(plain, owner, polygons, ambiguous, broken)


def _plain(
    pairing: Pairing,
) -> tuple[Int[np.ndarray, "P 3"], Int[np.ndarray, " P"], Int[np.ndarray, " S"]]:
    """Loops of triangles over which all curves go straight across; the other triangles."""
    mesh, points, curves = pairing.mesh, pairing.points, pairing.curves
    count = points.count
    start, end = np.array(curves.start, int), np.array(curves.end, int)
    simple = end >= 0
    simple[list(curves.inner)] = False
    simple &= points.vertex[start] != points.vertex[end]
    curve = pairing.rays[:count]
    straight = np.where(curve >= 0, simple[curve], False)
    own = np.arange(count)[:, None]
    partner = np.where(start[curve] == own, end[curve], start[curve])
    partner = np.where(straight, partner, -1)
    # a triangle is plain if no point over its corners has a special ray over one of its sides
    vertex = points.vertex[:count]
    bad_point, bad_slot = np.nonzero(~straight & (vertex >= 0)[:, None])
    bad_edges = pairing.incident[vertex[bad_point], bad_slot]
    special_edge = np.zeros(len(mesh.edges) + 1, bool)
    special_edge[bad_edges] = True
    special_edge[-1] = False
    special = special_edge[mesh.sides].any(axis=1)
    order = np.argsort(vertex, kind="stable")
    order = order[vertex[order] >= 0]
    amount = np.bincount(vertex[order], minlength=len(mesh.vertices))
    first = np.concatenate([[0], np.cumsum(amount)])
    easy = np.flatnonzero(~special)
    corner = mesh.triangles[easy, 0]
    owner = np.repeat(easy, amount[corner])
    offset = np.arange(len(owner)) - np.repeat(
        np.cumsum(amount[corner]) - amount[corner], amount[corner]
    )
    a = order[first[mesh.triangles[owner, 0]] + offset]
    b = _across(pairing, partner, a, mesh.sides[owner, 0])
    c = _across(pairing, partner, a, mesh.sides[owner, 2])
    closed = _across(pairing, partner, b, mesh.sides[owner, 1]) == c
    twisted = np.zeros(len(mesh.triangles), bool)
    twisted[owner[~closed]] = True
    keep = ~twisted[owner]
    cells = np.stack([a, b, c], axis=1)[keep]
    return cells, owner[keep], np.flatnonzero(special | twisted)


def _across(
    pairing: Pairing,
    partner: Int[np.ndarray, "count slots"],
    point: Int[np.ndarray, " n"],
    edge: Int[np.ndarray, " n"],
) -> Int[np.ndarray, " n"]:
    side = (pairing.mesh.edges[edge, 1] == pairing.points.vertex[point]).astype(int)
    return np.asarray(partner[point, pairing.slots[edge, side]])


def _around(pairing: Pairing, triangle: int) -> Iterator[Polygon | None]:
    """Polygons over one triangle; None where curves are missing or go around twice."""
    points, at = pairing.points, edges_at(pairing, triangle)
    corners = pairing.mesh.triangles[triangle].tolist()
    todo = {point for corner in corners for point in points.over(corner)}
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
