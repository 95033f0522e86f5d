"""Regions of coordinates with one state or several, and what bounds them."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from scipy.spatial import cKDTree

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Float, Int, Points
from equimorph.charts.arrangement import cross, outline, winding
from equimorph.charts.location import Cells, EdgeKind, facet_kinds
from equimorph.charts.regions import Regions, regions_within
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import labels, pieces, places_among
from equimorph.manifold.lookup.cell_index import CellIndex

Loop = Float[np.ndarray, "_ 2"]

THIN = 0.05
"""Regions less wide than this share of a cell are gaps between chords and curves."""

FLAT = 0.5
"""Size of a sheet, in median cells, below which it is a sliver turned over by chords."""
FEW = 3
"""Number of cells up to which a sheet counts as a sliver."""


@dataclass(frozen=True, eq=False)
class Edge:
    """A piece of the boundary of a region.

    Parameters
    ----------
    kind
        What it lies on: a "fold", a "crossing" of other sheets, a "cap" (constraint), the "box", a
        "cut" to another chart, a "barrier", or "singular" where the coordinates themselves turn
        back.
    points
        A point (d = 1), a polyline (d = 2), or triangles (d = 3) in the coordinates.
    """

    kind: str
    points: Float[np.ndarray, "..."]


@dataclass(frozen=True, eq=False)
class Domain:
    """A region in the space of coordinates.

    Parameters
    ----------
    names
        Names of the coordinates.
    loops
        Over two coordinates: closed outlines, counter-clockwise around and clockwise inside.
    loop_kinds
        What each edge of each loop lies on.
    cells
        Over one or three coordinates: the segments or tetrahedra that make up the region.
    ends
        Over one or three coordinates: the pieces of the boundary.
    """

    names: tuple[str, ...]
    loops: tuple[Loop, ...] = ()
    loop_kinds: tuple[np.ndarray, ...] = ()
    cells: Float[np.ndarray, "C corners d"] | None = None
    ends: tuple[Edge, ...] = ()

    def __repr__(self) -> str:
        """Names, size and kinds of edges."""
        kinds = ", ".join(sorted({edge.kind for edge in self.edges})) or "nothing"
        return f"Domain({', '.join(self.names)}: size {self.size:.6g}, bounded by {kinds})"

    @property
    def size(self) -> float:
        """Length, area or volume."""
        if self.cells is not None:
            return float(np.abs(volumes(self.cells)).sum())
        return sum(area_of(loop) for loop in self.loops)

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """Pieces of the boundary, split where their kind changes."""
        runs = []
        for loop, kinds in zip(self.loops, self.loop_kinds, strict=True):
            runs += _runs(loop, kinds)
        return (*self.ends, *runs)

    @check_arguments
    def contains(self, points: Points) -> Bool[np.ndarray, " points"]:
        """Which points lie in the region as its cells draw it: curved edges are chords."""
        if self.cells is not None:
            hits = CellIndex.of(self.cells, np.zeros(len(self.cells))).near(points)
            return np.bincount(hits.point[hits.inside], minlength=len(points)) > 0
        if not self.loops:
            return np.zeros(len(points), bool)
        sides = np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in self.loops])
        return winding(points, sides, np.ones(len(sides), int)) > 0

    @check_arguments
    def nearest_kind(self, points: Points) -> np.ndarray:
        """Kind of the edge nearest to each point; "" without edges."""
        if not self.edges or len(points) == 0:
            return np.full(len(points), "", dtype=object)
        d = len(self.names)
        places, kinds = [], []
        for edge in self.edges:
            own = _marks(edge.points, d)
            places.append(own)
            kinds.append(np.full(len(own), edge.kind, dtype=object))
        known = np.concatenate(places)
        spread = np.maximum(np.ptp(known, axis=0), 1e-300)
        return np.asarray(np.concatenate(kinds)[cKDTree(known / spread).query(points / spread)[1]])


def _marks(points: Float[np.ndarray, "..."], d: int) -> Points:
    """Points along an edge."""
    if d != 2:
        return points.reshape(-1, d)
    share = np.linspace(0.0, 1.0, 4, endpoint=False)[:, None, None]
    between = points[:-1] + share * np.diff(points, axis=0)
    return np.concatenate([between.reshape(-1, 2), points[-1:]])


def _runs(loop: Loop, kinds: np.ndarray) -> list[Edge]:
    """Runs of equal kinds around a loop; one that is all of one kind stays closed."""
    change = np.flatnonzero(kinds != np.roll(kinds, 1))
    if len(change) == 0:
        return [Edge(str(kinds[0]), loop)]
    turned = np.roll(loop[:-1], -change[0], axis=0)
    kinds = np.roll(kinds, -change[0])
    starts = np.append(change - change[0], len(kinds))
    closed = np.concatenate([turned, turned[:1]])
    return [Edge(str(kinds[a]), closed[a : b + 1]) for a, b in pairwise(starts.tolist())]


def area_of(loop: Loop) -> float:
    """Signed area inside a closed loop, relative to its first point to keep digits."""
    spokes = loop - loop[0]
    return float(cross(spokes[:-1], spokes[1:]).sum() / 2.0)


def without_slivers(loops: tuple[Loop, ...], size: Float[np.ndarray, " 2"]) -> tuple[Loop, ...]:
    """Loops of regions that are wider than slivers between the chords of two curves.

    `size` is the extent of a typical cell.
    """
    kept = []
    for loop in loops:
        scaled = loop / size
        length = np.linalg.norm(np.diff(scaled, axis=0), axis=1).sum()
        if 2.0 * abs(area_of(scaled)) > THIN * length:
            kept.append(loop)
    return tuple(kept)


def kinds_along(loop: Loop, ends: Float[np.ndarray, "edges 2 2"], kinds: np.ndarray) -> np.ndarray:
    """Kind of the nearest of some edges for each edge of a loop."""
    middle = 0.5 * (loop[:-1] + loop[1:])
    spread = np.maximum(np.ptp(ends.reshape(-1, 2), axis=0), 1e-300)
    return np.asarray(kinds[_nearest(middle / spread, ends / spread)])


def _nearest(
    points: Float[np.ndarray, "points 2"], ends: Float[np.ndarray, "edges 2 2"]
) -> Int[np.ndarray, " points"]:
    """Nearest edge of each point."""
    along = ends[:, 1] - ends[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    best = np.empty(len(points), int)
    for at in range(0, len(points), 256):
        reach = points[at : at + 256, None] - ends[:, 0]
        share = np.clip((reach * along).sum(axis=2) / squared, 0.0, 1.0)
        best[at : at + 256] = ((reach - share[:, :, None] * along) ** 2).sum(axis=2).argmin(axis=1)
    return best


@dataclass(frozen=True, eq=False)
class Overlap:
    """Coordinates at which there is more than one state.

    Parameters
    ----------
    kind
        "self-overlap": one sheet overlaps itself; "fold": two sheets that join where the
        coordinates fold; "sheets": two sheets that do not.
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
        # a sliver is merged with a neighbour that is no sliver
        join = np.flatnonzero(small[one] & ~small[other])
        target = np.arange(len(size))
        target[one[join]] = other[join]
        label = np.where(small[label], target[label], label)
    order = np.argsort(-np.bincount(label, minlength=len(size)), kind="stable")
    rank = np.empty(len(size), int)
    rank[order] = np.arange(len(size))
    return np.asarray(rank[label])


def single_domain(cells: Cells) -> Domain:
    """Coordinates that exactly one state has."""
    names = cells.coordinates.names
    if len(names) != 2:
        return _of_cells(cells, ~_overlapping(cells))
    edges, jump = outline(cells.values, cells.corners)
    regions = regions_within(cells.values, edges, jump)
    return _domain_inside(cells, regions.loops(lambda n: n == 1), edges)


def single_valued(cells: Cells) -> bool:
    """Whether no coordinates have more than one state, at the resolution of the cells."""
    if len(cells.coordinates.names) != 2:
        return not _overlapping(cells).any()
    regions = regions_within(cells.values, *outline(cells.values, cells.corners))
    return not without_slivers(regions.loops(lambda n: n > 1), cells.extent)


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
        domain = _domain_inside(cells, regions.loops(lambda n: n > 1), drawn[k][0])
        found.append(Overlap("self-overlap", (k,), domain))
    a, b = label[cells.whole.links].T
    joined = set(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True))
    for i, j in combinations(range(len(own)), 2):
        loops = _common(known[i], known[j])
        kind = "fold" if (i, j) in joined else "sheets"
        domain = _domain_inside(cells, loops, np.concatenate([drawn[i][0], drawn[j][0]]))
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


def _domain_inside(cells: Cells, loops: tuple[Loop, ...], drawn: Int[np.ndarray, "_ 2"]) -> Domain:
    """Domain inside loops, whose edges lie on those of the cells' outlines."""
    kept = without_slivers(loops, cells.extent)
    facets, kinds = facet_kinds(cells)
    at = places_among(drawn, facets, len(cells.eset.points))
    of_drawn = np.where(at >= 0, kinds[at], EdgeKind.SINGULAR)
    ends = cells.values[drawn]
    along = tuple(kinds_along(loop, ends, of_drawn) for loop in kept)
    return Domain(cells.coordinates.names, kept, along)


def _overlapping(cells: Cells) -> Bool[np.ndarray, " own"]:
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
    """Overlaps over one or three coordinates: cells that contain midpoints of other cells."""
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
