"""Sheets of a set over coordinates: where they lie alone, and where they lie over each other."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.charts.arrangement import outline
from equimorph.charts.domain import Domain, Edge, Loop, kinds_along, wide
from equimorph.charts.location import Cells, facet_kinds
from equimorph.charts.regions import Regions, regions_within
from equimorph.manifold.geometry.topology import keys_of, labels, pieces
from equimorph.manifold.lookup.cell_index import CellIndex

FLAT = 0.5
FEW = 3
"""Sheets smaller than so many typical cells, or of so few cells, are turned over by chords."""


@dataclass(frozen=True, eq=False)
class Overlap:
    """Coordinates that more than one state has.

    Parameters
    ----------
    kind
        "self-overlap": one sheet lies over itself; "fold": two sheets that join where the
        coordinates fold; "sheets": two that do not.
    sheets
        Numbers of the sheets.
    domain
        The region, bounded by the images of the edges of both.
    """

    kind: str
    sheets: tuple[int, ...]
    domain: Domain

    def __repr__(self) -> str:
        """Kind, sheets and size."""
        return f"Overlap({self.kind} of {self.sheets}: size {self.domain.size:.6g})"


def sheet_labels(cells: Cells) -> Int[np.ndarray, " own"]:
    """Connected pieces of cells on which the coordinates do not fold, the largest first."""
    whole = cells.whole
    label = labels(len(cells.numbers), whole.links[~cells.turning[whole.across]])
    size = np.bincount(label, np.abs(cells.turn))
    small = size < FLAT * np.median(np.abs(cells.turn))
    small |= np.bincount(label) <= FEW
    small &= np.arange(len(size)) != size.argmax()
    a, b = label[whole.links].T
    for one, other in ((a, b), (b, a)):
        # a sliver goes to a neighbour that is none
        join = np.flatnonzero(small[one] & ~small[other])
        target = np.arange(len(size))
        target[one[join]] = other[join]
        label = np.where(small[label], target[label], label)
    order = np.argsort(-np.bincount(label, minlength=len(size)), kind="stable")
    rank = np.empty(len(size), int)
    rank[order] = np.arange(len(size))
    return np.asarray(rank[label])


def alone(cells: Cells) -> Domain:
    """Coordinates that exactly one state has."""
    names = cells.coordinates.names
    if len(names) != 2:
        return _of_cells(cells, ~_covered(cells))
    edges, jump = outline(cells.values, cells.corners)
    regions = regions_within(cells.values, edges, jump)
    return _bounded(cells, (regions.loops(lambda n: n == 1),), (edges,))


def single_valued(cells: Cells) -> bool:
    """Whether no coordinates have more than one state, as far as the cells can tell."""
    if len(cells.coordinates.names) != 2:
        return not _covered(cells).any()
    regions = regions_within(cells.values, *outline(cells.values, cells.corners))
    return not wide(regions.loops(lambda n: n > 1), typical_extent(cells))


def overlaps(cells: Cells) -> tuple[Overlap, ...]:
    """Where sheets lie over themselves and over each other."""
    if len(cells.coordinates.names) != 2:
        return _overlaps_by_cells(cells)
    label = sheet_labels(cells)
    own = [cells.corners[label == k] for k in range(label.max(initial=-1) + 1)]
    drawn = [outline(cells.values, corners) for corners in own]
    known = [regions_within(cells.values, *each) for each in drawn]
    found = []
    for k, regions in enumerate(known):
        domain = _bounded(cells, (regions.loops(lambda n: n > 1),), (drawn[k][0],))
        found.append(Overlap("self-overlap", (k,), domain))
    a, b = label[cells.whole.links].T
    joined = set(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True))
    for i, j in combinations(range(len(own)), 2):
        loops = _common(known[i], known[j])
        kind = "fold" if (i, j) in joined else "sheets"
        domain = _bounded(cells, (loops,), (drawn[i][0], drawn[j][0]))
        found.append(Overlap(kind, (i, j), domain))
    return tuple(each for each in found if each.domain.loops)


def _common(first: Regions, second: Regions) -> tuple[Loop, ...]:
    """Outlines of what both regions cover."""
    places, edges, count = [], [], 0
    for regions in (first, second):
        for loop in regions.loops(lambda n: n > 0):
            number = count + np.arange(len(loop))
            places.append(loop)
            edges.append(np.stack([number[:-1], number[1:]], axis=1))
            count += len(loop)
    if not places:
        return ()
    low = [np.min([r.places.min(axis=0)], axis=0) for r in (first, second)]
    high = [np.max([r.places.max(axis=0)], axis=0) for r in (first, second)]
    if (np.maximum(*low) >= np.minimum(*high)).any():
        return ()
    joined = np.concatenate(edges)
    return regions_within(np.concatenate(places), joined, np.ones(len(joined), int)).loops(
        lambda n: n > 1
    )


def _bounded(
    cells: Cells, loops: tuple[tuple[Loop, ...], ...], edges: tuple[Int[np.ndarray, "_ 2"], ...]
) -> Domain:
    """Domain inside loops, whose edges lie on those of the cells' outlines."""
    kept = wide(loops[0], typical_extent(cells))
    drawn = np.concatenate(edges)
    facets, kinds = facet_kinds(cells)
    base = len(cells.eset.points)
    keys = keys_of(facets, base)
    order = np.argsort(keys)
    own = keys_of(drawn, base)
    at = order[np.minimum(np.searchsorted(keys, own, sorter=order), len(keys) - 1)]
    of_drawn = np.where(keys[at] == own, kinds[at], "singular")
    ends = cells.values[drawn]
    along = tuple(kinds_along(loop, ends, of_drawn) for loop in kept)
    return Domain(cells.coordinates.names, kept, along)


def typical_extent(cells: Cells) -> Float[np.ndarray, " d"]:
    """Median extent of the cells along each coordinate."""
    extent = np.ptp(cells.values[cells.corners], axis=1)
    return np.asarray(np.maximum(np.median(extent, axis=0), 1e-300))


def _covered(cells: Cells) -> Bool[np.ndarray, " own"]:
    """Cells whose middles lie in other cells, too."""
    corners = cells.values[cells.corners]
    hits = CellIndex.of(corners, np.zeros(len(corners))).near(corners.mean(axis=1))
    return np.bincount(hits.point[hits.inside], minlength=len(corners)) > 1


def _of_cells(cells: Cells, some: Bool[np.ndarray, " own"]) -> Domain:
    """Domain made of whole cells."""
    facets, kinds = facet_kinds(Cells(cells.eset, cells.coordinates, cells.numbers[some]))
    ends = [
        Edge(str(kind), cells.values[piece])
        for kind in np.unique(kinds)
        for piece in pieces(facets[kinds == kind])
    ]
    return Domain(
        cells.coordinates.names, cells=cells.values[cells.corners[some]], ends=tuple(ends)
    )


def _overlaps_by_cells(cells: Cells) -> tuple[Overlap, ...]:
    """Overlaps over one or three coordinates: cells with the middles of others over them."""
    label = sheet_labels(cells)
    corners = cells.values[cells.corners]
    hits = CellIndex.of(corners, np.zeros(len(corners))).near(corners.mean(axis=1))
    hits = hits.take(hits.inside & (hits.point != hits.cell))
    pairs = np.sort(np.stack([label[hits.point], label[hits.cell]], axis=1), axis=1)
    a, b = label[cells.whole.links].T
    joined = set(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True))
    found = []
    for i, j in np.unique(pairs, axis=0).tolist():
        some = np.zeros(len(corners), bool)
        some[hits.point[(pairs == (i, j)).all(axis=1)]] = True
        kind = "self-overlap" if i == j else "fold" if (i, j) in joined else "sheets"
        sheets = (i,) if i == j else (i, j)
        found.append(Overlap(kind, sheets, _of_cells(cells, some)))
    return tuple(found)
