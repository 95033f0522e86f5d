"""Cells over points, and cells that miss them by little."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items, Pairs, Place, Places
from equimorph.columns import Columns
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.lookup.kernels import cells_by_bin, cells_near, pairs_in_bins

MOST_BINS = 4
"""Bins per cell, at most."""
MOST_ENTRIES = 16
"""Bins that each cell is listed in, on average, at most. Where few cells reach far, finer bins list
as many of these, and no fewer are tried for a point."""
COARSER = 0.7
"""Share of the bins along each parameter that is left where there are too many entries."""
NUDGE = 1e-9
"""Shift, in ranges of the parameters, that puts points between cells into one of them."""
FLAT = 1e-15
"""Volume, in the unit cube, below which a cell has no barycentric coordinates."""
PLANE = 2
"""Number of parameters."""


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

        `corners`: corners of the cells. `overhang`: how far beyond each cell, or across the facet
        opposite to each corner, a point may lie to be found near it, in barycentric coordinates.
        """
        unit, lower, width = _in_unit_cube(corners)
        low, high = unit.min(axis=1), unit.max(axis=1)
        around = np.broadcast_to(overhang.T, (len(unit) + 1, len(corners)))
        # a corner moves with the facets opposite to the other corners
        room = (around.sum(axis=0) - around.min(axis=0)) * (high - low)
        counts, first, last = _bins(low - room, high + room)
        starts, cells = cells_by_bin(first, last, counts)
        maps, overhang = _maps(unit), np.ascontiguousarray(around.T)
        return cls(lower, width, counts, starts, cells, maps, overhang)

    def near(self, points: Places) -> Hits:
        """Cells that contain points or that these miss by at most their overhang, in order."""
        bins = self.lower, self.width, self.counts, self.starts, self.cells
        points = np.ascontiguousarray(points, dtype=float)
        return Hits(*cells_near(points, bins, self.maps, self.overhang, NUDGE))

    def weights(self, points: Places, cell: Items) -> Float[np.ndarray, "n corners"]:
        """Barycentric coordinates of points, each in its cell."""
        unit, maps = (points - self.lower) / self.width, self.maps[cell]
        return np.asarray(np.einsum("nij,nj->ni", maps[:, :, :-1], unit) + maps[:, :, -1])


def meeting_boxes(corners: Float[np.ndarray, "C corners d"]) -> Pairs:
    """Pairs of cells with given corners whose boxes around them meet."""
    unit, _, _ = _in_unit_cube(corners)
    low, high = unit.min(axis=1), unit.max(axis=1)
    counts, first, last = _bins(low, high)
    listed = cells_by_bin(first, last, counts)
    return np.asarray(pairs_in_bins(low, high, first, counts, *listed))


def _in_unit_cube(
    corners: Float[np.ndarray, "C corners d"],
) -> tuple[Float[np.ndarray, "d corners C"], Place, Place]:
    """Corners in the box around them, and its lower corner and width.

    One coordinate of one corner a row: rows of few numbers are slow to reduce.
    """
    unit, d = np.ascontiguousarray(corners.T), corners.shape[2]
    flat = unit.reshape(d, -1)
    lower = flat.min(axis=1) if flat.size else np.zeros(d)
    width = flat.max(axis=1) - lower if flat.size else np.ones(d)
    width = np.where(width > 0.0, width, 1.0)
    return (unit - lower[:, None, None]) / width[:, None, None], lower, width


def _bins(
    low: Float[np.ndarray, "d C"], high: Float[np.ndarray, "d C"]
) -> tuple[Int[np.ndarray, " d"], Int[np.ndarray, "C d"], Int[np.ndarray, "C d"]]:
    """Number of bins along each parameter, and the first and last that cells reach.

    Bins are halves of what typical cells reach, but not too many.
    """
    reach = high - low
    d, cells = reach.shape
    typical = np.median(reach, axis=1) if cells else np.ones(d)
    counts = np.clip(np.round(2.0 / np.maximum(typical, 1e-6)), 1, None)
    share = MOST_BINS * max(cells, 1) / counts.prod()
    counts = np.maximum(counts * min(1.0, share ** (1.0 / d)), 1).astype(int)
    while counts.max() > 1:
        entries = np.prod(1.0 + reach * counts[:, None], axis=0)
        if entries.sum() <= MOST_ENTRIES * cells:
            break
        counts = np.maximum(COARSER * counts, 1).astype(int)
    first, last = (
        np.clip((side.T * counts).astype(int, order="C"), 0, counts - 1) for side in (low, high)
    )
    return counts, first, last


def _maps(unit: Float[np.ndarray, "d corners C"]) -> Float[np.ndarray, "C corners corners"]:
    """Inverse of the matrix of each cell's corners over ones."""
    size = volumes(unit.T)
    flat = np.abs(size) < FLAT
    if len(unit) == PLANE:  # the products of two corners are all minors
        (x, y), maps = unit, np.empty((len(size), 3, 3))
        by = 0.5 / np.where(flat, 1.0, size)
        for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
            maps[:, k, 0] = (y[i] - y[j]) * by
            maps[:, k, 1] = (x[j] - x[i]) * by
            maps[:, k, 2] = (x[i] * y[j] - y[i] * x[j]) * by
    else:
        homogeneous = np.concatenate([unit, np.ones((1, *unit.shape[1:]))]).transpose(2, 0, 1)
        homogeneous[flat] = np.eye(homogeneous.shape[1])
        maps = np.linalg.inv(homogeneous)
    maps[flat] = np.nan
    return np.asarray(maps)
