"""Rims, facets of a set on folds and constraints: bands along them, and ways out across them."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Flags, Float, Int, Items, Places, Some
from equimorph.manifold.geometry.topology import Adjacency, keys_of
from equimorph.manifold.lookup.cell_index import CellIndex, Hits

BEND, STEEPEST = 0.25, np.radians(75.0)
"""Height, over its base, of a parabola with slope 1 at both ends: bands hold those which begin as
steep as the next facet goes on, which is twice what an arc takes; largest angle for that."""
ASIDE = 0.3
"""How far beyond the ends of its facet a band reaches, in barycentric coordinates."""

RIMS = 64
"""Rims, the nearest ones, across which states over one point are lifted. A set in shreds, of a
chain, had 690 near a point, which took minutes; clean sets hardly ever ask for any."""

Facets = Int[np.ndarray, "F d"]


@dataclass(frozen=True)
class Rims:
    """Bands along facets, and the adjacent cells."""

    bands: CellIndex
    """Index of simplices on the facets, as high as these are long."""
    beside: Int[np.ndarray, "F most"]
    """Cells that have each facet, −1 where there are fewer than of others."""

    @classmethod
    def of(cls, x: Places, whole: Adjacency, chosen: Int[np.ndarray, " F"]) -> "Rims":
        """Bands along chosen facets of cells with vertices at x."""
        facets, beside = whole.facets[chosen], whole.beside[chosen]
        width = np.ptp(x, axis=0) if len(x) else np.ones(x.shape[1])
        unit = x / np.where(width > 0.0, width, 1.0)
        length = _lengths(unit[facets])
        share = BEND * np.tan(np.minimum(_turns(unit, facets), STEEPEST))
        apex = unit[facets].mean(axis=1) + length[:, None] * _normals(unit[facets])
        corners = np.concatenate([apex[:, None], unit[facets]], axis=1)
        overhang = np.full(corners.shape[:2], ASIDE)
        overhang[:, 0] = share
        return cls(CellIndex.of(corners * width, overhang), beside)

    def near(self, points: Places) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Pairs of a point in a band, on either side of the facet, and an adjacent cell."""
        hits = self.bands.near(points)
        if len(hits) == 0:  # the rule
            return hits.point, hits.cell
        close = hits.weights[:, 0] <= self.bands.overhang[hits.cell, 0]
        point = np.repeat(hits.point[close], self.beside.shape[1])
        cell = self.beside[hits.cell[close]].ravel()
        return point[cell >= 0], cell[cell >= 0]


def _lengths(corners: Float[np.ndarray, "F d d"]) -> Float[np.ndarray, " F"]:
    """Longest sides of facets."""
    sides = corners[:, :, None] - corners[:, None]
    return np.asarray(np.linalg.norm(sides, axis=3).max(axis=(1, 2), initial=0.0))


def _normals(corners: Float[np.ndarray, "F d d"]) -> Float[np.ndarray, "F d"]:
    """Unit normals of facets, on either side."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.linalg.svd(sides)[2][:, -1])


def _turns(x: Places, facets: Facets) -> Float[np.ndarray, " F"]:
    """Largest angle between a facet and those that go on across its sides; zero without any."""
    count, d = facets.shape
    for_all = [np.delete(facets, k, axis=1) for k in range(d)]
    if d == 1:
        return np.zeros(count)
    key = np.concatenate([keys_of(ridge, len(x)) for ridge in for_all])
    away = np.concatenate([_away(x, facets[:, k], for_all[k]) for k in range(d)])
    order = np.argsort(key, kind="stable")
    least = np.full(len(key), np.inf)
    for apart in range(1, len(key)):
        one, other = order[:-apart], order[apart:]
        same = key[one] == key[other]
        if not same.any():
            break
        one, other = one[same], other[same]
        angle = np.arccos(np.clip(-np.einsum("nd,nd->n", away[one], away[other]), -1.0, 1.0))
        np.minimum.at(least, one, angle)
        np.minimum.at(least, other, angle)
    least[np.isinf(least)] = 0.0
    return np.asarray(least.reshape(d, count).max(axis=0))


def _away(
    x: Places, corner: Int[np.ndarray, " F"], ridge: Int[np.ndarray, "F corners"]
) -> Float[np.ndarray, "F d"]:
    """Unit vectors, orthogonal to a side of a facet, towards the corner across."""
    out = x[corner] - x[ridge[:, 0]]
    if ridge.shape[1] > 1:
        along = x[ridge[:, 1]] - x[ridge[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        out -= np.einsum("nd,nd->n", out, along)[:, None] * along
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def nearest_rims(
    near: Hits, brims: Bool[np.ndarray, "C corners"], wanted: Flags, index: CellIndex
) -> tuple[Some, Some]:
    """Wanted hits on cells at rims, and the corners opposite to these; the nearest of a point.

    brims: facets of cells on rims, by the corner across.
    """
    hit, corner = np.nonzero(brims[near.cell] & wanted[:, None])
    away = np.abs(near.weights[hit, corner]) / np.linalg.norm(
        _slopes(near.cell[hit], corner, index), axis=1
    )
    point = near.point[hit]
    order = np.lexsort((away, point))
    rank = np.arange(len(order)) - np.searchsorted(point[order], point[order])
    kept = np.sort(order[rank < RIMS])
    return hit[kept], corner[kept]


def ways_out(
    cell: Items, corner: Items, corners: Float[np.ndarray, "n corners d"], index: CellIndex
) -> Places:
    """Ways out of cells across the facets opposite to corners, as long as the cells are wide."""
    out = -_slopes(cell, corner, index)
    length = np.linalg.norm(out, axis=1, keepdims=True)
    reach = np.ptp(corners, axis=1).max(axis=1, keepdims=True)
    return np.asarray(out / np.maximum(length, 1e-300) * reach)


def _slopes(cell: Items, corner: Items, index: CellIndex) -> Places:
    """Gradients of the barycentric coordinates of corners."""
    return np.asarray(index.maps[cell, corner, :-1] / index.width)
