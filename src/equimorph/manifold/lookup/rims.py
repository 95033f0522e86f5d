"""Bands between the curved rims of sheets, at folds and constraints, and their straight cells."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold.geometry.topology import Adjacency, keys_of
from equimorph.manifold.lookup.cell_index import CellIndex

BEND = 0.25
"""Width of a band over the length of its facet and the angle to the next: an arc takes half."""
ASIDE = 0.3
"""How far beyond the ends of its facet a band reaches, in barycentric coordinates."""

Points = Float[np.ndarray, "n d"]
Facets = Int[np.ndarray, "F d"]


@dataclass(frozen=True)
class Rims:
    """Bands along facets, and the cells beside them.

    Parameters
    ----------
    bands
        Index of simplices on the facets, as high as these are long.
    beside
        Cells that have each facet, −1 where there are fewer than of others.
    """

    bands: CellIndex
    beside: Int[np.ndarray, "F most"]

    @classmethod
    def of(cls, x: Points, whole: Adjacency, chosen: Int[np.ndarray, " F"]) -> "Rims":
        """Bands along chosen facets of cells with vertices at x."""
        facets, beside = whole.facets[chosen], cells_beside(whole)[chosen]
        width = np.ptp(x, axis=0) if len(x) else np.ones(x.shape[1])
        unit = x / np.where(width > 0.0, width, 1.0)
        length = _lengths(unit[facets])
        share = BEND * np.minimum(_turns(unit, facets), np.pi)
        apex = unit[facets].mean(axis=1) + length[:, None] * _normals(unit[facets])
        corners = np.concatenate([apex[:, None], unit[facets]], axis=1)
        overhang = np.full(corners.shape[:2], ASIDE)
        overhang[:, 0] = share
        return cls(CellIndex.of(corners * width, overhang), beside)

    def near(self, points: Points) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Pairs of a point in a band, on either side of the facet, and a cell beside it."""
        hits = self.bands.near(points)
        if len(hits) == 0:  # the rule
            return hits.point, hits.cell
        close = hits.weights[:, 0] <= self.bands.overhang[hits.cell, 0]
        point, cell = (
            np.repeat(hits.point[close], self.beside.shape[1]),
            self.beside[hits.cell[close]].ravel(),
        )
        return point[cell >= 0], cell[cell >= 0]


def cells_beside(whole: Adjacency) -> Int[np.ndarray, "F most"]:
    """Cells that have each facet, −1 where there are fewer than of others."""
    number = whole.cell_facets.ravel()
    order = np.argsort(number, kind="stable")
    place = np.arange(len(order)) - np.searchsorted(number[order], number[order])
    out = np.full((len(whole.facets), int(whole.counts.max(initial=1))), -1)
    out[number[order], place] = order // whole.cell_facets.shape[1]
    return out


def _lengths(corners: Float[np.ndarray, "F d d"]) -> Float[np.ndarray, " F"]:
    """Longest sides of facets."""
    sides = corners[:, :, None] - corners[:, None]
    return np.asarray(np.linalg.norm(sides, axis=3).max(axis=(1, 2), initial=0.0))


def _normals(corners: Float[np.ndarray, "F d d"]) -> Float[np.ndarray, "F d"]:
    """Unit normals of facets, on either side."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.linalg.svd(sides)[2][:, -1])


def _turns(x: Points, facets: Facets) -> Float[np.ndarray, " F"]:
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
    x: Points, corner: Int[np.ndarray, " F"], ridge: Int[np.ndarray, "F corners"]
) -> Float[np.ndarray, "F d"]:
    """Unit vectors, orthogonal to a side of a facet, towards the corner across."""
    out = x[corner] - x[ridge[:, 0]]
    if ridge.shape[1] > 1:
        along = x[ridge[:, 1]] - x[ridge[:, 0]]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        out -= np.einsum("nd,nd->n", out, along)[:, None] * along
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))
