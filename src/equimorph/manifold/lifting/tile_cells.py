"""Cells in tiles: each tile closes its loops and balls, which are glued at the triangles on cuts.

Both tiles at a cut close the loops over its triangles, from the same numbers and in the same order:
so they find the same discs. Those of the tile that comes first stand for both; where the others
differ all the same, the triangle is in doubt.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np

from equimorph.arrays import Int, ItemFlags, Items, Triples
from equimorph.manifold.lifting.balls import Balls
from equimorph.manifold.lifting.cells import volumes_over
from equimorph.manifold.lifting.discs import Discs, assemble
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.tile_floods import NewPoints, new_points
from equimorph.manifold.lifting.tiles import Part


@dataclass(frozen=True)
class Closed:
    """Discs, and balls over three parameters, of a tile, in its numbers.

    points: new ones; hubs (h, 3): pairs of points with the one between them.
    """

    points: NewPoints
    hubs: Int[np.ndarray, "h 3"]
    discs: Discs
    balls: Balls


def close_tile(tile: Pairing) -> Closed:
    """Close the loops, and over three parameters the balls, of a tile that is lifted."""
    known = tile.points.count
    if tile.mesh.dimension == 2:
        discs, balls = assemble(tile, find_loops(tile)), Balls.none()
    else:
        volumes = volumes_over(tile, None)
        discs, balls = volumes.discs, volumes.balls
    hubs = [(*pair, point) for pair, point in tile.hubs.items() if point >= known]
    return Closed(new_points(tile, known), np.array(hubs, int).reshape(-1, 3), discs, balls)


class CellGlue:
    """Enters what tiles have closed into the whole, tile by tile in their order."""

    def __init__(self, whole: Pairing) -> None:
        self._whole = whole
        self._discs: list[Discs] = []
        self._balls: list[Balls] = []
        self._done = np.zeros(len(whole.mesh.triangles), bool)
        self._at_cuts: dict[int, Triples] = {}
        self._doubtful: list[int] = []

    def add(self, part: Part, found: Closed) -> None:
        """Enter the new points, discs and balls of a tile."""
        tile, discs = part.tile, found.discs
        numbers = np.concatenate([part.points, np.full(len(found.points.index), -1)])
        at_cuts = _at_cuts(part, discs)
        for triangle, corners in at_cuts.items():
            if triangle in self._at_cuts:
                _take_over(numbers, corners, self._at_cuts[triangle], len(part.points))
        self._enter_points(numbers, found.points, len(part.points))
        for triangle, corners in at_cuts.items():
            known = self._at_cuts.setdefault(triangle, numbers[corners])
            if not np.array_equal(known, numbers[corners]):
                self._doubtful.append(triangle)
        for first, second, point in numbers[found.hubs].tolist():
            self._whole.hubs.setdefault((first, second), point)
        kept = ~self._done[tile.triangles[discs.owner]]
        self._done[tile.triangles] = True
        self._discs.append(_discs_in_whole(discs, numbers, part, kept))
        self._balls.append(_balls_in_whole(found.balls, numbers, part))

    def joined(self) -> tuple[Discs, Balls]:
        """All discs and balls."""
        discs, balls = _join(self._discs), _join(self._balls)
        doubtful = np.union1d(discs.doubtful, np.array(self._doubtful, int))
        return replace(discs, doubtful=doubtful), balls

    def _enter_points(self, numbers: Items, new: NewPoints, known: int) -> None:
        """Enter new points of a tile that no other one has found."""
        own = np.flatnonzero(numbers[known:] < 0)
        columns = new.z[own], new.p[own], new.index[own], new.kind[own]
        numbers[known + own] = self._whole.points.add_many(*columns)


def _at_cuts(part: Part, discs: Discs) -> dict[int, Triples]:
    """Corners of the discs over each triangle that other tiles have, too."""
    out: dict[int, Triples] = {}
    shared = part.tile.shared_triangles
    own = np.flatnonzero(shared[discs.owner])
    own = own[np.argsort(discs.owner[own], kind="stable")]
    ends = np.searchsorted(discs.owner[own], np.flatnonzero(shared))
    triangles, groups = part.tile.triangles[shared].tolist(), np.split(own, ends)[1:]
    for triangle, rows in zip(triangles, groups, strict=True):
        out[triangle] = discs.corners[rows]
    return out


def _take_over(numbers: Items, corners: Triples, known: Triples, given: int) -> None:
    """Give new points of discs the numbers that the same ones have in an earlier tile."""
    if corners.shape == known.shape:
        new = corners >= given
        numbers[corners[new]] = known[new]


def _discs_in_whole(discs: Discs, numbers: Items, part: Part, kept: ItemFlags) -> Discs:
    """Some discs of a tile in numbers of the whole."""
    triangles = part.tile.triangles
    return Discs(
        numbers[discs.corners[kept]],
        discs.index[kept],
        triangles[discs.owner[kept]],
        discs.met[kept],
        discs.sheet[kept],
        numbers[discs.folds],
        numbers[discs.caps],
        numbers[discs.crossings],
        triangles[discs.doubtful],
    )


def _balls_in_whole(balls: Balls, numbers: Items, part: Part) -> Balls:
    """Balls of a tile in numbers of the whole."""
    tetrahedra = part.tile.tetrahedra
    return Balls(
        numbers[balls.corners],
        balls.index,
        tetrahedra[balls.owner],
        numbers[balls.folds],
        tetrahedra[balls.fold_owner],
        numbers[balls.caps],
        tetrahedra[balls.cap_owner],
        numbers[balls.crossings],
        tetrahedra[balls.crossing_owner],
        tetrahedra[balls.doubtful],
    )


Record = TypeVar("Record", Discs, Balls)


def _join(parts: Sequence[Record]) -> Record:
    """All rows of some parts."""
    names = [each.name for each in fields(parts[0])]
    columns = ([getattr(each, name) for each in parts] for name in names)
    return type(parts[0])(*map(np.concatenate, columns))
