"""Barriers, across which the preferred state jumps, and gaps, where no state is preferred."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import (
    Facets,
    Float,
    Int,
    ItemValues,
    Place,
    Places,
    Points,
    Some,
    VertexFlags,
)
from equimorph.charts.domain import Domain, kinds_along, without_slivers
from equimorph.charts.location import Cells, EdgeKind, facet_kinds
from equimorph.charts.preference import Preference
from equimorph.charts.regions import regions_within
from equimorph.manifold.geometry.points import on_fold
from equimorph.manifold.geometry.topology import flags_of, pieces
from equimorph.model import Box
from equimorph.structures import States
from equimorph.structures.metric import metric_length

ASIDE = 1e-7
"""Distance across an edge, in ranges of the parameters, at which the other side is examined."""
JUMP = 1e-3
"""Distance in the metric from which on states on both sides are no neighbours."""
SHORT = 2e-4
"""Extent, in ranges of the parameters, of barriers that are round-off at a cusp.

So near it, its wedge is less than ten times as wide as `ASIDE`: it opens like the power 3/2.
"""
BESIDE = 0.4
"""Distance from another barrier, in lengths of its edges, within which a barrier is its image."""


@dataclass(frozen=True, eq=False)
class Barrier:
    """A curve across which the preferred state jumps.

    Parameters
    ----------
    kind
        "fold", "crossing" or "cap" where the near side ends; "tie" where the preference changes
        between two states that both continue.
    points
        Free parameters along it; a point (d = 1), a polyline (d = 2) or points of a surface.
    near, far
        Preferred states on both sides: on the curve, and just across it.
    jump
        Distances between the two states in the metric.
    facets
        Over three parameters: triangles of points, one a row.
    """

    kind: str
    points: Points
    near: States
    far: States
    jump: Float[np.ndarray, " points"]
    facets: Int[np.ndarray, "..."]

    def __repr__(self) -> str:
        """Kind and range of jumps."""
        low, high = self.jump.min(), self.jump.max()
        return f"Barrier({self.kind}: {len(self.points)} points, jumps {low:.3g} to {high:.3g})"

    @check_arguments
    def distance(self, points: Points, size: Place) -> ItemValues:
        """Distance of points from it as it is drawn, in units of `size`."""
        if self.points.shape[1] != 2 or len(self.points) < 2:
            gap = (points[:, None] - self.points) / size
            return np.asarray(np.linalg.norm(gap, axis=2).min(axis=1))
        a, b = self.points[:-1] / size, self.points[1:] / size
        best = np.full(len(points), np.inf)
        for at in range(0, len(points), 512):
            own = points[at : at + 512] / size
            reach, along = own[:, None] - a, b - a
            squared = np.maximum((along**2).sum(axis=1), 1e-300)
            share = np.clip((reach * along).sum(axis=2) / squared, 0.0, 1.0)
            gap = np.linalg.norm(reach - share[:, :, None] * along, axis=2)
            best[at : at + 512] = gap.min(axis=1)
        return best


def barriers_of(cells: Cells, preference: Preference) -> tuple[Barrier, ...]:
    """Barriers around the preferred cells; each is known once, from the side that ends there."""
    facets, kinds = facet_kinds(cells)
    kinds = np.where(kinds == EdgeKind.CUT, EdgeKind.TIE, kinds)
    ended = flags_of(facets, cells.whole.facets[cells.whole.counts == 1]) & ~np.isin(
        kinds, (EdgeKind.BOX, EdgeKind.HOLE)
    )
    facets, kinds = facets[ended], kinds[ended]
    used = np.unique(facets)
    if len(used) == 0:
        return ()
    z, p, jump = _across(cells, facets, used, preference)
    number = np.searchsorted(used, facets)
    apart = jump[number]
    # where a barrier ends, as at a cusp, its jump vanishes
    real = np.isfinite(apart).all(axis=1) & (apart > JUMP).any(axis=1)
    structure = cells.eset.structure
    found = []
    folded = on_fold(cells.eset.kinds)[used]
    for kind in dict.fromkeys(kinds[real].tolist()):
        for piece in _pieces_between_folds(number[real & (kinds == kind)], folded, kind):
            own = np.unique(piece) if piece.ndim == 2 else piece
            local = np.searchsorted(own, piece) if piece.ndim == 2 else np.arange(len(own))
            near = cells.eset.points[used[own]]
            far = States(structure, z[own], p[own])
            points = cells.values[used[own]]
            found.append(Barrier(kind, points, near, far, jump[own], local))
    return _each_once(found, cells)


def _pieces_between_folds(
    facets: Facets, folded: VertexFlags, kind: str
) -> list[Int[np.ndarray, "..."]]:
    """Pieces of a barrier; ties over two parameters end on folds: both sides meet at a cusp.

    `facets`: by numbers of vertices. `folded`: which of these lie on folds.
    """
    if kind != EdgeKind.TIE or facets.shape[1] != 2:
        return list(pieces(facets))
    row, side = np.nonzero(folded[facets])
    apart = facets.copy()
    apart[row, side] = len(folded) + np.arange(len(row))
    old = np.concatenate([np.arange(len(folded)), facets[row, side]])
    return [old[piece] for piece in pieces(apart)]


def _across(
    cells: Cells, facets: Facets, used: Some, preference: Preference
) -> tuple[Float[np.ndarray, "some size"], Float[np.ndarray, "some P"], Float[np.ndarray, " some"]]:
    """Preferred states just across vertices of the boundary, and their distances; ∞ if none."""
    eset, structure = cells.eset, cells.eset.structure
    size = eset.box.upper - eset.box.lower
    outward = _within(eset.box, cells.values[used], _outward(cells, facets, used, size))
    there = preference.over(cells.values[used] + ASIDE * size * outward)
    own = eset.points[used]
    z, p = np.full(own.z.shape, np.nan), np.full(own.p.shape, np.nan)
    z[there.point], p[there.point] = there.states.z, there.states.p
    gap = metric_length(structure, z - own.z)
    return z, p, np.where(np.isfinite(gap), gap, np.inf)


def _outward(cells: Cells, facets: Facets, used: Some, size: Place) -> Float[np.ndarray, "some d"]:
    """Directions at vertices of the boundary that point out of the adjacent cells."""
    whole = cells.whole
    base = int(whole.facets.max()) + 1
    keys = (whole.facets * base ** np.arange(whole.facets.shape[1])).sum(axis=1)
    wanted = (np.sort(facets, axis=1) * base ** np.arange(facets.shape[1])).sum(axis=1)
    cell, corner = np.nonzero(np.isin(keys, wanted)[whole.cell_facets])
    at = cells.values[cells.corners[cell]] / size
    first = np.take_along_axis(at, ((corner + 1) % at.shape[1])[:, None, None], axis=1)
    own = at[np.arange(len(cell)), corner]
    others = np.array([[k for k in range(at.shape[1]) if k != left] for left in range(at.shape[1])])
    rest = at[np.arange(len(cell))[:, None], others[corner]]
    along = rest[:, 1:] - rest[:, :1]
    away = first[:, 0] - own
    if along.shape[1]:
        basis = np.linalg.qr(np.swapaxes(along, 1, 2))[0]
        away = away - np.einsum("ndk,nk->nd", basis, np.einsum("ndk,nd->nk", basis, away))
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
    out = np.zeros((len(used), at.shape[2]))
    for k in range(1, at.shape[1]):
        vertex = cells.corners[cell, (corner + k) % at.shape[1]]
        place = np.searchsorted(used, vertex)
        known = (place < len(used)) & (used[np.minimum(place, len(used) - 1)] == vertex)
        np.add.at(out, place[known], away[known])
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-300))


def _within(box: Box, points: Points, directions: Places) -> Places:
    """Directions from points that do not lead out of the box."""
    size = box.upper - box.lower
    low, high = points <= box.lower + ASIDE * size, points >= box.upper - ASIDE * size
    inner = np.where((low & (directions < 0.0)) | (high & (directions > 0.0)), 0.0, directions)
    return np.asarray(inner / np.maximum(np.linalg.norm(inner, axis=1, keepdims=True), 1e-300))


def _each_once(found: list[Barrier], cells: Cells) -> tuple[Barrier, ...]:
    """Barriers without their images from the other side.

    The other side of a sheet's end is where the preference changes on another sheet; of a tie both
    sides are cut, and the one with the greater elevation (`Structure.elevation`) counts.
    """
    ends = [barrier for barrier in found if barrier.kind != EdgeKind.TIE]
    elevation = cells.eset.structure.elevation
    size = cells.eset.box.upper - cells.eset.box.lower
    kept = [barrier for barrier in ends if _extent(barrier, size) > SHORT]
    for barrier in found:
        if barrier.kind != EdgeKind.TIE or _extent(barrier, size) <= SHORT:
            continue
        steps = np.linalg.norm(np.diff(barrier.points / size, axis=0), axis=1)
        step = float(np.median(steps)) if len(steps) else 1e-6
        gap = np.min([e.distance(barrier.points, size) for e in ends], axis=0) if ends else np.inf
        if np.median(gap) < BESIDE * step:
            continue
        # both sides have the same points, so that their means have different signs
        if np.nanmean(elevation(barrier.near) - elevation(barrier.far)) >= 0.0:
            kept.append(barrier)
    return tuple(kept)


def _extent(barrier: Barrier, size: Place) -> float:
    """Extent of a barrier in units of `size`; single points are no shorter than they can be."""
    if barrier.points.shape[1] == 1:
        return np.inf
    return float((np.ptp(barrier.points, axis=0) / size).max())


def gaps_of(domain: Domain, box: Box, cell: Place) -> Domain:
    """What a domain leaves of a box, but for slivers thinner than a share of a cell."""
    names = domain.names
    low, high = box.lower, box.upper
    if len(names) != 2:
        return Domain(names, cells=np.zeros((0, len(names) + 1, len(names))))
    corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]], low])
    loops = [corners, *domain.loops]
    starts = np.cumsum([0, *(len(loop) for loop in loops)])
    edges = np.concatenate(
        [np.stack([np.arange(a, b - 1), np.arange(a + 1, b)], axis=1)
         for a, b in pairwise(starts.tolist())]
    )  # fmt: skip
    jump = np.concatenate(
        [np.full(len(loop) - 1, 1 if k == 0 else -1) for k, loop in enumerate(loops)]
    )
    regions = regions_within(np.concatenate(loops), edges, jump)
    kept = without_slivers(regions.loops(lambda n: n > 0), cell)
    ends = np.concatenate([np.stack([loop[:-1], loop[1:]], axis=1) for loop in loops])
    kinds = np.concatenate([np.full(4, EdgeKind.BOX, dtype=object), *domain.loop_kinds])
    return Domain(names, kept, tuple(kinds_along(loop, ends, kinds) for loop in kept))
