"""Cells over points, and cells that miss them by little."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items, Place, Places
from equimorph.columns import Columns
from equimorph.manifold.geometry.simplices import volumes
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
        low = high = unit[:, 0]
        for k in range(1, d + 1):  # rows of few numbers are slow to reduce
            low, high = np.minimum(low, unit[:, k]), np.maximum(high, unit[:, k])
        extent = high - low
        overhang = np.ascontiguousarray(np.broadcast_to(overhang.T, (d + 1, len(corners))).T)
        # a corner moves with the facets opposite to the other corners
        room = np.sort(overhang, axis=1)[:, 1:].sum(axis=1, keepdims=True) * extent
        counts = _bins(extent + 2.0 * room)
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
    """Number of bins along each parameter: halves of what typical cells reach, but not too many."""
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
        x, y, ones = homogeneous.T
        maps = np.empty(homogeneous.shape)
        for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
            maps[:, k, 0] = y[i] * ones[j] - ones[i] * y[j]
            maps[:, k, 1] = ones[i] * x[j] - x[i] * ones[j]
            maps[:, k, 2] = x[i] * y[j] - y[i] * x[j]
        maps /= np.einsum("ci,ci->c", homogeneous[:, 0], maps[:, 0])[:, None, None]
    else:
        maps = np.linalg.inv(np.swapaxes(homogeneous, 1, 2))
    maps[flat] = np.nan
    return np.asarray(maps)
