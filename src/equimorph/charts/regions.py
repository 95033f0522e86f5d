"""How many equilibria there are over each region of the parameter plane.

Projecting the cells of the set to the plane of parameters, the number of cells over a point is

    N(p) = Σ_T [p ∈ T] = Σ_e j_e w_e(p) ,

a winding number: turn every projected cell counter-clockwise and add up its edges. Inside a sheet
the contributions of neighbours cancel; what remains are the edges e on which the set folds over
(jump j = ±2) or ends (±1). Cutting these edges at their crossings gives the exact regions
of constant N, with no raster in between. Close to cusps a few cells lie overturned under their
neighbours, because they are straight and the sheet is not: these count minus one time, so that
only folds and ends of a sheet are edges of regions (N is the degree of the projection).

See docs/decisions.md, "Charts are cells over coordinates".
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.charts.arrangement import arrange, cross, outline, sides, winding, winding_raster
from equimorph.manifold import EquilibriumSet, overturned_cells

Counts = Int[np.ndarray, " edges"]
Flags = Bool[np.ndarray, " edges"]

SPACINGS = (1e-9, 1e-7, 1e-5)
"""Spacings of the grid to which cuts are rounded, relative to the extent of the set.

The coarser ones are for edges so crowded (cells squeezed flat at a cusp) that rounding tangles
them.
"""
ON_FRAME = 1e-9
"""Distance from a side of a box, relative to its width, of places that lie on it."""


@dataclass(frozen=True)
class Regions:
    """Regions of constant count, as nested levels."""

    levels: tuple[tuple[Float[np.ndarray, "_ 2"], ...], ...]
    """For k = 1, 2, …: closed loops, counter-clockwise around and clockwise inside the set of
    parameters with at least k equilibria; fill them with the non-zero rule."""
    places: Float[np.ndarray, "places 2"]
    edges: Int[np.ndarray, "edges 2"]
    """Where edges end, and which of the places are the ends of each."""
    jump: Int[np.ndarray, " edges"]
    left: Int[np.ndarray, " edges"]
    """Count on the left of each edge less that on its right, and the count on its left."""

    @property
    def ends(self) -> Float[np.ndarray, "edges 2 2"]:
        """Both ends of each edge."""
        return np.asarray(self.places[self.edges])

    @property
    def largest(self) -> int:
        """Largest count that occurs."""
        return len(self.levels)

    def count(self, places: Float[np.ndarray, "places 2"]) -> Int[np.ndarray, " places"]:
        """Number of cells over each of the places; exact off the edges themselves."""
        return winding(places, self.ends, self.jump)

    def raster(
        self, x: Float[np.ndarray, " columns"], y: Float[np.ndarray, " rows"]
    ) -> Int[np.ndarray, "rows columns"]:
        """`count` on a grid with columns at rising x and rows at y."""
        return winding_raster(x, y, self.ends, self.jump)

    def loops(self, wanted: Callable[[Counts], Flags]) -> tuple[Float[np.ndarray, "_ 2"], ...]:
        """Outlines of the region whose counts satisfy a predicate; it is on their left."""
        inside = [wanted(count) for count in (self.left, self.left - self.jump)]
        return tuple(self.places[loop] for loop in _loops(self.edges, *inside))

    def areas(self) -> dict[int, float]:
        """Area of the parameters with exactly k equilibria, for every k ≥ 1."""
        at_least = [sum(loop_area(loop) for loop in level) for level in self.levels] + [0.0]
        return {k + 1: at_least[k] - at_least[k + 1] for k in range(self.largest)}


def count_regions(
    coordinates: Float[np.ndarray, "vertices 2"],
    cells: Int[np.ndarray, "cells 3"],
    overturned: Bool[np.ndarray, " cells"] | None = None,
) -> Regions:
    """Exact regions of the plane by the number of projected cells that cover them.

    The cells are all of a set, or those of one index; overturned ones count minus one time.
    Crossings are rounded to 1e-9 of the extent of the set. Without cells there are no regions.
    """
    return regions_within(coordinates, *outline(coordinates, cells, overturned))


def count_equilibria(eset: EquilibriumSet, *, stable_only: bool = False) -> Regions:
    """Exact regions of the plane of two free parameters by the number of equilibria over them."""
    overturned = overturned_cells(eset)
    chosen = eset.cell_index == 0 if stable_only else np.ones(len(eset.cells), bool)
    return count_regions(eset.coordinates, eset.cells[chosen], overturned[chosen])


def empty_regions(
    regions: Regions, lower: Float[np.ndarray, "2"], upper: Float[np.ndarray, "2"]
) -> list[list[Float[np.ndarray, "_ 2"]]]:
    """Connected parts of a box over which there is no equilibrium.

    Returns for each part its outline, counter-clockwise, and then its holes, clockwise.
    """
    covered = regions.levels[0] if regions.levels else ()
    frame = _frame(covered, lower, upper)
    loops = [*covered, frame]
    places = np.concatenate(loops)
    edges, jump, first = [], [], 0
    for loop in loops:
        number = np.arange(first, first + len(loop))
        edges.append(np.stack([number[:-1], number[1:]], axis=1))
        jump.append(np.full(len(loop) - 1, 1 if loop is frame else -1))
        first += len(loop)
    outside = regions_within(places, np.concatenate(edges), np.concatenate(jump)).levels
    rims = [loop for loop in (outside[0] if outside else ()) if loop_area(loop) > 0.0]
    holes = [loop for loop in (outside[0] if outside else ()) if loop_area(loop) <= 0.0]
    return [[rim, *(hole for hole in holes if _is_inside(hole, rim))] for rim in rims]


def _frame(
    loops: Sequence[Float[np.ndarray, "_ 2"]],
    lower: Float[np.ndarray, "2"],
    upper: Float[np.ndarray, "2"],
) -> Float[np.ndarray, "_ 2"]:
    """Outline of a box, counter-clockwise, through those places of loops that lie on it."""
    slack = ON_FRAME * (upper - lower)
    corners = np.array([lower, [upper[0], lower[1]], upper, [lower[0], upper[1]]])
    points = np.concatenate([*loops, np.empty((0, 2))])
    sides = []
    for k in range(4):
        axis, along = (1, 0) if k % 2 == 0 else (0, 1)
        on_side = points[np.abs(points[:, axis] - corners[k, axis]) <= slack[axis]]
        own = np.unique(np.concatenate([on_side, corners[k : k + 1]]), axis=0)
        own = own[np.argsort(own[:, along])] if k < 2 else own[np.argsort(-own[:, along])]
        following = corners[(k + 1) % 4, along]
        sides.append(own[np.abs(own[:, along] - following) > slack[along]])
    return np.concatenate([*sides, sides[0][:1]])


def _is_inside(loop: Float[np.ndarray, "_ 2"], rim: Float[np.ndarray, "_ 2"]) -> bool:
    """Whether a closed loop lies inside another one; they do not cross."""
    number = np.arange(len(rim) - 1)
    ends = np.stack([rim[number], rim[number + 1]], axis=1)
    middle = 0.5 * (loop[:1] + loop[1:2])
    return bool(winding(middle, ends, np.ones(len(number), int))[0] != 0)


def regions_within(
    coordinates: Float[np.ndarray, "vertices 2"],
    edges: Int[np.ndarray, "given 2"],
    jump: Int[np.ndarray, " given"],
) -> Regions:
    """Exact regions of the plane between closed curves, by how often these wind around them.

    `coordinates`: places of the ends of edges. `edges`, `jump`: directed edges, and the count on
    their left less that on their right.
    """
    none = np.empty(0, int)
    nothing = Regions((), np.empty((0, 2)), np.empty((0, 2), int), none, none)
    if not len(edges):
        return nothing
    origin, extent = coordinates.min(axis=0), np.ptp(coordinates, axis=0)
    for spacing in SPACINGS:
        places, pieces, jumps = arrange((coordinates - origin) / (extent * spacing), edges, jump)
        if not len(pieces):
            return nothing
        left, right = sides(places[pieces], jumps)
        if _has_closed_boundaries(pieces, left, right):
            break
    places = origin + places * extent * spacing
    levels = tuple(
        tuple(places[loop] for loop in _loops(pieces, left >= k, right >= k))
        for k in range(1, int(max(left.max(), right.max())) + 1)
    )
    return Regions(levels, places, pieces, jumps, left)


def _has_closed_boundaries(
    edges: Int[np.ndarray, "edges 2"],
    left: Int[np.ndarray, " edges"],
    right: Int[np.ndarray, " edges"],
) -> bool:
    """Whether the boundary of every level is closed, as it is when no edges are tangled."""
    surplus = np.zeros(int(edges.max()) + 1, int)
    for k in range(1, int(max(left.max(), right.max())) + 1):
        forward = (left >= k).astype(int) - (right >= k)
        np.add.at(surplus, edges[:, 0], forward)
        np.subtract.at(surplus, edges[:, 1], forward)
        if surplus.any():
            return False
    return bool(min(left.min(), right.min()) >= 0)


def _loops(
    edges: Int[np.ndarray, "edges 2"],
    inside_left: Bool[np.ndarray, " edges"],
    inside_right: Bool[np.ndarray, " edges"],
) -> list[Int[np.ndarray, " _"]]:
    """Closed chains of the edges that part inside from outside, with the inside on their left."""
    forward, backward = inside_left & ~inside_right, inside_right & ~inside_left
    directed = np.concatenate([edges[forward], edges[backward][:, ::-1]])
    leaving: dict[int, list[int]] = {}
    for a, b in directed.tolist():
        leaving.setdefault(a, []).append(b)
    loops = []
    while leaving:
        chain = [next(iter(leaving))]
        while chain[-1] in leaving:  # any way out will do: all are part of the same boundary
            following = leaving[chain[-1]]
            chain.append(following.pop())
            if not following:
                del leaving[chain[-2]]
        loops.append(np.array(chain))
    return loops


def loop_area(loop: Float[np.ndarray, "n 2"]) -> float:
    """Signed area inside a closed loop, relative to its first vertex to keep digits."""
    spokes = loop - loop[0]
    return float(cross(spokes[:-1], spokes[1:]).sum() / 2)
