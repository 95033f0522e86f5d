"""Tiles of a grid: parts of the box that are lifted and closed by themselves.

A tile has the grid cells between some grid lines, with all their vertices and edges: those on a
cut belong to the tiles on both sides. Numbers in a tile are in the order of those in the whole.

See docs/decisions.md, "Tiles are glued at their points".
"""

from dataclasses import dataclass
from itertools import chain

import numpy as np

from equimorph.arrays import Bool, EdgeFlags, Float, Int, Items
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.points import Points
from equimorph.manifold.lifting.grid import Lines
from equimorph.manifold.lifting.pairing import Pairing, RayMark, start_pairing

Cuts = tuple[Float[np.ndarray, " _"], ...]
"""Places of the cuts along each free parameter."""


def cuts_between(lines: Lines, tiles: tuple[int, ...]) -> Cuts:
    """Grid lines along which a grid is cut into so many tiles along each parameter."""
    places = (
        np.linspace(0, len(line) - 1, count + 1).round().astype(int)[1:-1]
        for line, count in zip(lines, tiles, strict=True)
    )
    return tuple(line[own] for line, own in zip(lines, places, strict=True))


@dataclass(frozen=True)
class Tile:
    """Numbers, in the whole, of what a tile has, in order.

    number: its place among all tiles; shared: which of its edges other tiles have, too;
    shared_triangles: the same.
    """

    number: int
    vertices: Int[np.ndarray, " V"]
    edges: Int[np.ndarray, " E"]
    triangles: Int[np.ndarray, " T"]
    tetrahedra: Int[np.ndarray, " N"]
    shared: EdgeFlags
    shared_triangles: Bool[np.ndarray, " T"]


def tiles_of(mesh: BaseMesh, cuts: Cuts) -> list[Tile]:
    """Tiles of a mesh, in the order of their places, the last parameter first."""
    middles = mesh.vertices[mesh.cells].mean(axis=1)
    places = [np.searchsorted(cut, middles[:, k]) for k, cut in enumerate(cuts)]
    counts = tuple(len(cut) + 1 for cut in cuts)
    owner = np.ravel_multi_index(places, counts)
    none = np.zeros(0, int)
    found = []
    for number in range(int(np.prod(counts))):
        cells = np.flatnonzero(owner == number)
        tetrahedra = cells if mesh.dimension == 3 else none
        triangles = (none, cells, np.unique(mesh.faces[tetrahedra]))[mesh.dimension - 1]
        edges = cells if mesh.dimension == 1 else np.unique(mesh.sides[triangles])
        found.append((np.unique(mesh.edges[edges]), edges, triangles, tetrahedra))
    shared = [
        np.bincount(np.concatenate([each[k] for each in found]), minlength=count) > 1
        for k, count in ((1, len(mesh.edges)), (2, len(mesh.triangles)))
    ]
    return [
        Tile(number, *each, shared[0][each[1]], shared[1][each[2]])
        for number, each in enumerate(found)
    ]


def mesh_of_tile(mesh: BaseMesh, tile: Tile) -> BaseMesh:
    """The mesh of a tile, and two vertices without cells at the corners of the whole box.

    So what is measured by the box is the same in every tile.
    """
    vertices, edges = mesh.vertices, mesh.edges[tile.edges]
    corners = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
    return BaseMesh(
        np.concatenate([vertices[tile.vertices], corners]),
        np.searchsorted(tile.vertices, edges),
        np.searchsorted(tile.vertices, mesh.triangles[tile.triangles]),
        np.searchsorted(tile.edges, mesh.sides[tile.triangles]),
        np.searchsorted(tile.vertices, mesh.tetrahedra[tile.tetrahedra]),
        np.searchsorted(tile.triangles, mesh.faces[tile.tetrahedra]),
    )


@dataclass(frozen=True)
class Part:
    """A tile, with the numbers in the whole of the points and curves that it is given."""

    tile: Tile
    points: Int[np.ndarray, " points"]
    curves: Int[np.ndarray, " curves"]


def parts_of(whole: Pairing, tiles: list[Tile]) -> list[Part]:
    """What is known of some tiles."""
    whole.fit()
    live = whole.live_curves()
    edge = whole.curves.edge[live]
    parts = []
    for tile in tiles:
        own = live[_flags(tile.edges, edge)]
        parts.append(Part(tile, _points_in(whole, tile), own))
    return parts


def _points_in(whole: Pairing, tile: Tile) -> Items:
    """Points over the vertices of a tile, on its edges, and those kept for pairs of them."""
    store = whole.points
    chosen = _flags(tile.vertices, store.vertex[: store.count])
    chosen |= _flags(tile.edges, store.edge[: store.count])
    # a pair may hold a point that was kept before
    for pair, point in chain(whole.tips.items(), whole.hubs.items()):
        chosen[point] |= chosen[[*pair]].all()
    return np.flatnonzero(chosen)


def _flags(own: Items, numbers: Int[np.ndarray, " all"]) -> Bool[np.ndarray, " all"]:
    """Which numbers, −1 for none, are among some."""
    there = np.zeros(max(int(numbers.max(initial=0)), int(own.max(initial=0))) + 2, bool)
    there[own] = True
    return np.asarray(there[numbers])


def cut_out(whole: Pairing, part: Part) -> Pairing:
    """What is known of a tile, as a pairing of its own."""
    tile, at = part.tile, part.points
    mesh = mesh_of_tile(whole.mesh, tile)
    out = start_pairing(whole.setting, mesh, whole.limit)
    out.points = _store_of(whole, part, len(mesh.vertices))
    number = np.full(whole.points.count + 1, -1)
    number[at] = np.arange(len(at))
    curves = whole.curves
    # the last number stands for ends on a constraint
    start, end = (number[each[part.curves]] for each in (curves.start, curves.end))
    edge = np.searchsorted(tile.edges, curves.edge[part.curves])
    out.curves.extend(edge, start, end)
    for k in np.flatnonzero(~curves.plain[part.curves]).tolist():
        out.curves.put_inside(k, number[curves.inner[int(part.curves[k])]].tolist())
    out.looked_at = len(edge)
    out.effort = whole.effort[tile.edges]
    _copy_rays(whole, part, out)
    _copy_tables(whole, part, out, number)
    return out


def _store_of(whole: Pairing, part: Part, vertices: int) -> Points:
    """Copy of the points of a tile, over each vertex in the same order."""
    store, at = whole.points, part.points
    vertex, edge = store.vertex[at], store.edge[at]
    vertex = np.where(vertex < 0, -1, np.searchsorted(part.tile.vertices, vertex))
    known = _flags(part.tile.edges, edge) & (edge >= 0)
    edge = np.where(known, np.searchsorted(part.tile.edges, edge), -1)
    order = np.argsort(vertex, kind="stable")
    order = order[vertex[order] >= 0]
    following, head = np.full(len(at), -1), np.full(vertices, -1)
    same = np.diff(vertex[order]) == 0
    following[order[1:][same]] = order[:-1][same]
    head[vertex[order]] = order  # the last one over each vertex stays
    known_values = store.z[at], store.p[at], store.index[at], store.kind[at]
    return Points(store.structure, *known_values, vertex, edge, following, head, len(at))


def _copy_rays(whole: Pairing, part: Part, out: Pairing) -> None:
    """Enter the curves and marks of the points over the vertices of a tile."""
    tile, store = part.tile, out.points
    over = np.flatnonzero(store.vertex >= 0)
    vertex = store.vertex[over]
    rays = np.full((len(store.z), out.incident.shape[1]), RayMark.UNTRACED)
    own = out.incident[vertex]
    edges = tile.edges[own]
    side = (whole.mesh.edges[edges, 1] == tile.vertices[vertex][:, None]).astype(int)
    known = whole.rays[part.points[over][:, None], whole.slots[edges, side]]
    curve = np.full(whole.curves.count + 1, RayMark.UNTRACED)
    curve[part.curves] = np.arange(len(part.curves))
    rays[over] = np.where(own < 0, RayMark.UNTRACED, np.where(known < 0, known, curve[known]))
    out.rays = rays


def _copy_tables(
    whole: Pairing, part: Part, out: Pairing, number: Int[np.ndarray, " points"]
) -> None:
    """Points of crossings, and points and curves that are known to lie between others."""
    edges = dict(zip(part.tile.edges.tolist(), range(len(part.tile.edges)), strict=True))
    out.crossings = {
        edges[edge]: number[points].tolist()
        for edge, points in whole.crossings.items()
        if edge in edges
    }
    out.arcs = {
        edges[edge]: [tuple(number[list(arc)].tolist()) for arc in own]
        for edge, own in whole.arcs.items()
        if edge in edges
    }
    for mine, theirs in ((out.tips, whole.tips), (out.hubs, whole.hubs)):
        for pair, point in theirs.items():
            first, second = number[list(pair)].tolist()
            if min(first, second) >= 0:
                mine[first, second] = int(number[point])
