"""Floods in tiles: each tile by itself, then glued, until no tile learns anything new.

What tiles find over the same vertex is one point, that of the tile that comes first, whose numbers
all others are given. A curve on an edge of several tiles must be the same in all of them, with the
same points inside; else it is taken back, and traced again in finer steps by all.
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Items
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.flood import flood
from equimorph.manifold.lifting.pairing import Pairing, RayMark, Rays
from equimorph.manifold.lifting.tiles import Part
from equimorph.model import Silent


@dataclass(frozen=True)
class NewPoints:
    """Points that were found in a tile, after those that it was given; see `Points`."""

    z: Float[np.ndarray, "n size"]
    p: Float[np.ndarray, "n P"]
    index: Items
    kind: Items
    vertex: Items
    edge: Items


def new_points(pairing: Pairing, known: int) -> NewPoints:
    """Points of a tile after the known ones."""
    store, own = pairing.points, slice(known, pairing.points.count)
    columns = (store.z, store.p, store.index, store.kind, store.vertex, store.edge)
    return NewPoints(*(each[own].copy() for each in columns))


@dataclass(frozen=True)
class Flooded:
    """What a flood of a tile has found, in numbers of the tile.

    points: new ones; curves (c, 3): edge, start and end of new curves, −1 for an end on a
    constraint; amount, inner: how many points inside each of them, and these; dead: known curves
    that were taken back; effort: of each edge; abandoned (a, 2): points and edges of rays that were
    given up; conflicts: one number, of contradictions.
    """

    points: NewPoints
    curves: Int[np.ndarray, "c 3"]
    amount: Int[np.ndarray, " c"]
    inner: Int[np.ndarray, " i"]
    dead: Int[np.ndarray, " k"]
    effort: Int[np.ndarray, " E"]
    abandoned: Int[np.ndarray, "a 2"]
    conflicts: Int[np.ndarray, " 1"]


def flood_tile(tile: Pairing) -> Flooded:
    """Flood a tile from all points that it is given."""
    known, given = tile.points.count, len(tile.curves.edge)
    flood(tile, Silent())
    live = tile.live_curves()
    new = live[live >= given]
    curves, inner = tile.curves, tile.curves.inner
    filled = new[~curves.plain[new]].tolist()
    points, slots = np.nonzero(tile.rays[: tile.points.count] == RayMark.ABANDONED)
    edges = tile.incident[tile.points.vertex[points], slots]
    used = (tile.points.vertex[points] >= 0) & (edges >= 0)
    return Flooded(
        new_points(tile, known),
        np.stack([curves.edge, curves.start, curves.end], axis=1)[new],
        curves.amount[new],
        np.array([point for curve in filled for point in inner[curve]], int),
        np.setdiff1d(np.arange(given), live),
        tile.effort,
        np.stack([points, edges], axis=1)[used],
        np.array([tile.conflicts]),
    )


class FloodGlue:
    """Enters what floods of tiles have found into the whole, tile by tile in their order."""

    def __init__(self, whole: Pairing, part: Part, found: Flooded) -> None:
        self._whole, self._part, self._found = whole, part, found
        new = found.points
        self._known = len(part.points)
        self._numbers = np.concatenate([part.points, np.full(len(new.index), -1)])
        over = np.flatnonzero(new.vertex >= 0)
        vertices = part.tile.vertices[new.vertex[over]]
        ids, _ = whole.points.over_vertices(vertices, new.z[over], new.p[over], new.index[over])
        self._numbers[self._known + over] = ids
        whole.fit()

    def enter(self) -> None:
        """Enter all curves, and what became of rays without one."""
        whole, tile, found = self._whole, self._part.tile, self._found
        for curve in self._part.curves[found.dead].tolist():
            whole.forget(curve)
        whole.effort[tile.edges] = np.maximum(whole.effort[tile.edges], found.effort)
        tried = whole.effort.copy()
        whole.conflicts += int(found.conflicts.sum())
        edges, start, end = found.curves.T
        at_once = (found.amount == 0) & (end >= 0) & ~tile.shared[edges]
        own = tile.edges[edges[at_once]]
        near = self._numbers[start[at_once]]
        sides = (whole.mesh.edges[own, 1] == whole.points.vertex[near]).astype(int)
        whole.enter_many(Rays(near, own, sides), self._numbers[end[at_once]])
        first = np.cumsum(found.amount) - found.amount
        for curve in np.flatnonzero(~at_once).tolist():
            inner = found.inner[first[curve] : first[curve] + found.amount[curve]]
            edge, near, far = found.curves[curve].tolist()
            self._enter_alone(edge, near, far, inner.tolist(), tried)
        for point, edge in found.abandoned.tolist():
            near_point, whole_edge = int(self._numbers[point]), int(tile.edges[edge])
            if whole.ray(near_point, whole_edge) < 0:
                whole.set_ray(near_point, whole_edge, RayMark.ABANDONED)
        whole.looked_at = len(whole.curves.edge)

    def _enter_alone(self, edge: int, start: int, end: int, inner: list[int], tried: Items) -> None:
        """Enter a curve, unless it is known; take it back if other points inside are known."""
        whole, edge = self._whole, int(self._part.tile.edges[edge])
        start, end = int(self._numbers[start]), int(self._numbers[end]) if end >= 0 else -1
        known = whole.ray(start, edge)
        if known >= 0 and whole.other_end(known, start) == end:
            there = whole.curves.inner.get(known, [])
            there = there if whole.curves.start[known] == start else there[::-1]
            kinds = self._found.points.kind[[each - self._known for each in inner]]
            if _singular(whole.points.kind[there]) != _singular(kinds):
                whole.contradict(edge, int(tried[edge]))
                whole.forget(known)
            return
        own = [self._number(point, edge) for point in inner]
        whole.enter(start, edge, end, own, int(tried[edge]))
        whole.fit()

    def _number(self, point: int, edge: int) -> int:
        """Number in the whole of a new point inside an edge."""
        if self._numbers[point] < 0:
            new, k = self._found.points, point - self._known
            place, index, kind = (new.z[k], new.p[k]), int(new.index[k]), VertexKind(new.kind[k])
            if kind == VertexKind.CROSSING:
                self._numbers[point] = self._whole.crossing(*place, index, edge)
            else:
                self._numbers[point] = self._whole.points.add(*place, index, kind, edge)
        return int(self._numbers[point])


def _singular(kinds: Int[np.ndarray, " n"]) -> list[int]:
    """Kinds of points inside an edge that are there for their own sake."""
    return [kind for kind in kinds.tolist() if kind != VertexKind.BETWEEN]
