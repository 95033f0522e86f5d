"""Regions of internal coordinates: outlines with what each piece of them lies on."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from equimorph.arrays import Points
from equimorph.charts.arrangement import cross, winding
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.lookup.cell_index import CellIndex

Loop = Float[np.ndarray, "_ 2"]

THIN = 0.05
"""Regions less wide than this share of a cell are gaps between chords and curves."""


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

    def contains(self, points: Points) -> Bool[np.ndarray, " points"]:
        """Which points lie in the region as its cells draw it: curved edges are chords."""
        if self.cells is not None:
            hits = CellIndex.of(self.cells, np.zeros(len(self.cells))).near(points)
            return np.bincount(hits.point[hits.inside], minlength=len(points)) > 0
        if not self.loops:
            return np.zeros(len(points), bool)
        sides = np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in self.loops])
        return winding(points, sides, np.ones(len(sides), int)) > 0

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


def wide(loops: tuple[Loop, ...], size: Float[np.ndarray, " 2"]) -> tuple[Loop, ...]:
    """Loops of regions that are wider than slivers between the chords of two curves.

    Parameters
    ----------
    loops
        Closed outlines.
    size
        Extent of a typical cell.
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
