"""Cells over points, and cells near them at curved folds and constraints."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items, Place, Places
from equimorph.columns import Columns
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import Adjacency, keys_of
from equimorph.manifold.lookup.kernels import cells_by_bin, cells_near

MOST_BINS = 4
"""Bins per cell, at most."""
NUDGE = 1e-9
"""Shift, in ranges of the parameters, that puts points between cells into one of them."""
FLAT = 1e-15
"""Volume, in the unit cube, below which a cell has no barycentric coordinates."""
TRIANGLE = 3
"""Number of corners."""


@dataclass(frozen=True)
class Hits(Columns):
    """Pairs of a point and a cell near it, sorted by point.

    weights: barycentric coordinates of the point in the cell; inside: whether the cell contains the
    point, where points between cells belong to one of them on each sheet.
    """

    point: Int[np.ndarray, " hits"]
    cell: Int[np.ndarray, " hits"]
    weights: Float[np.ndarray, "hits corners"]
    inside: Bool[np.ndarray, " hits"]

    def with_others(self, others: "Hits") -> "Hits":
        """All pairs of both, each point's own first; `others` are sorted, too."""
        place = np.searchsorted(self.point, others.point, side="right")
        columns = zip(vars(self).values(), vars(others).values(), strict=True)
        return Hits(*(np.insert(mine, place, more, axis=0) for mine, more in columns))

    def __len__(self) -> int:
        """Return the number of pairs."""
        return len(self.point)


@dataclass(frozen=True)
class CellIndex:
    """Bins over a box that list the cells above them, and the barycentric maps of the cells.

    Points are scaled to the unit cube. Cells of bin b are ``cells[starts[b] : starts[b + 1]]``;
    barycentric coordinates of x in cell c are ``maps[c] @ (x, 1)``, nan if it has no volume.
    """

    lower: Place
    width: Place
    counts: Int[np.ndarray, " d"]
    starts: Int[np.ndarray, " bins_and_one"]
    cells: Int[np.ndarray, " entries"]
    maps: Float[np.ndarray, "C corners corners"]
    overhang: Float[np.ndarray, "C corners"]

    @classmethod
    def of(
        cls, corners: Float[np.ndarray, "C corners d"], overhang: Float[np.ndarray, "*some"]
    ) -> "CellIndex":
        """Index of cells.

        Parameters
        ----------
        corners
            Corners of the cells.
        overhang
            How far beyond each cell, or across the facet opposite to each corner, a point may lie
            to be found near it, in barycentric coordinates.
        """
        d = corners.shape[2]
        flat = corners.reshape(-1, d)
        lower = flat.min(axis=0) if len(flat) else np.zeros(d)
        width = flat.max(axis=0) - lower if len(flat) else np.ones(d)
        width = np.where(width > 0.0, width, 1.0)
        unit = (corners - lower) / width
        low, high = unit.min(axis=1), unit.max(axis=1)
        extent = high - low
        counts = _bins(extent)
        overhang = np.ascontiguousarray(np.broadcast_to(overhang.T, (d + 1, len(corners))).T)
        # a corner moves with the facets opposite to the other corners
        room = np.sort(overhang, axis=1)[:, 1:].sum(axis=1, keepdims=True) * extent
        first, last = (
            np.clip((side * counts).astype(int), 0, counts - 1)
            for side in (low - room, high + room)
        )
        starts, cells = cells_by_bin(first, last, counts)
        return cls(lower, width, counts, starts, cells, _maps(unit), overhang)

    def near(self, points: Places) -> Hits:
        """Cells that contain points or that these miss by at most their overhang."""
        bins = self.lower, self.width, self.counts, self.starts, self.cells
        points = np.ascontiguousarray(points, dtype=float)
        return Hits(*cells_near(points, bins, self.maps, self.overhang, NUDGE))

    def weights(self, points: Places, cell: Items) -> Float[np.ndarray, "n corners"]:
        """Barycentric coordinates of points, each in its cell."""
        unit, maps = (points - self.lower) / self.width, self.maps[cell]
        return np.asarray(np.einsum("nij,nj->ni", maps[:, :, :-1], unit) + maps[:, :, -1])


def _bins(extent: Float[np.ndarray, "C d"]) -> Int[np.ndarray, " d"]:
    """Number of bins along each parameter: half the size of a typical cell, but not too many."""
    typical = np.median(extent, axis=0) if len(extent) else np.ones(extent.shape[1])
    counts = np.clip(np.round(2.0 / np.maximum(typical, 1e-6)), 1, None)
    share = MOST_BINS * max(len(extent), 1) / counts.prod()
    fitting = np.maximum(counts * min(1.0, share ** (1.0 / len(counts))), 1)
    return np.asarray(fitting.astype(int))


def _maps(unit: Float[np.ndarray, "C corners d"]) -> Float[np.ndarray, "C corners corners"]:
    """Inverse of the matrix of each cell's corners over ones."""
    ones = np.ones((*unit.shape[:2], 1))
    homogeneous = np.concatenate([unit, ones], axis=2)
    flat = np.abs(volumes(unit)) < FLAT
    homogeneous[flat] = np.eye(homogeneous.shape[1])
    if unit.shape[1] == TRIANGLE:  # the products of two corners are all minors
        first, second, third = np.swapaxes(homogeneous, 0, 1)
        pairs = (second, third), (third, first), (first, second)
        maps = np.stack([np.cross(*pair) for pair in pairs], axis=1)
        maps /= np.einsum("ci,ci->c", first, maps[:, 0])[:, None, None]
    else:
        maps = np.linalg.inv(np.swapaxes(homogeneous, 1, 2))
    maps[flat] = np.nan
    return np.asarray(maps)


BEND, STEEPEST = 0.25, np.radians(75.0)
"""Height, over its base, of a parabola with slope 1 at both ends: bands hold those which begin as
steep as the next facet goes on, which is twice what an arc takes; largest angle for that."""
ASIDE = 0.3
"""How far beyond the ends of its facet a band reaches, in barycentric coordinates."""

Points = Places
Facets = Int[np.ndarray, "F d"]


@dataclass(frozen=True)
class Rims:
    """Bands along facets, and the adjacent cells.

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
        share = BEND * np.tan(np.minimum(_turns(unit, facets), STEEPEST))
        apex = unit[facets].mean(axis=1) + length[:, None] * _normals(unit[facets])
        corners = np.concatenate([apex[:, None], unit[facets]], axis=1)
        overhang = np.full(corners.shape[:2], ASIDE)
        overhang[:, 0] = share
        return cls(CellIndex.of(corners * width, overhang), beside)

    def near(self, points: Points) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Pairs of a point in a band, on either side of the facet, and an adjacent cell."""
        hits = self.bands.near(points)
        if len(hits) == 0:  # the rule
            return hits.point, hits.cell
        close = hits.weights[:, 0] <= self.bands.overhang[hits.cell, 0]
        point = np.repeat(hits.point[close], self.beside.shape[1])
        cell = self.beside[hits.cell[close]].ravel()
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
