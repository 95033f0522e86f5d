"""Rounds in which all tiles of a grid are lifted or closed by workers, and glued.

All tiles of a round begin with the same whole, and are glued in their order when the last one is
there: the result does not depend on who computes them, nor on which is finished first. Findings of
each tile in each round are an entry of the journal.

Each tile closes its loops and balls, which are glued at the triangles on cuts. Both tiles at a cut
close the loops over its triangles, from the same numbers and in the same order: so they find the
same discs. Those of the tile that comes first stand for both; where the others differ all the same,
the triangle is in doubt.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np

from equimorph.arrays import Int, ItemFlags, Items, Triples
from equimorph.manifold.lifting.balls import Balls
from equimorph.manifold.lifting.cells import volumes_over
from equimorph.manifold.lifting.discs import Discs, assemble
from equimorph.manifold.lifting.loops import find_loops
from equimorph.manifold.lifting.pairing import Pairing, RayMark
from equimorph.manifold.lifting.polygon_cuts import chord_of
from equimorph.manifold.lifting.tile_floods import (
    Flooded,
    FloodGlue,
    NewPoints,
    flood_tile,
    new_points,
)
from equimorph.manifold.lifting.tiles import Cuts, Part, cut_out, parts_of, tiles_of
from equimorph.model import Journal, Progress, Workers, map_chunks


@dataclass(frozen=True)
class Closed:
    """Discs, and balls over three parameters, of a tile, in its numbers.

    points: new ones; hubs (h, 3): pairs of points with the one between them.
    """

    points: NewPoints
    hubs: Int[np.ndarray, "h 3"]
    discs: Discs
    balls: Balls


Record = TypeVar("Record", Discs, Balls)
Found = TypeVar("Found", Flooded, Closed)


@dataclass
class TileRounds:
    """Tiles of a grid, who lifts them, where findings are kept, and how many rounds there were."""

    cuts: Cuts
    workers: Workers | None
    journal: Journal | None
    rounds: int = field(default=0, init=False)

    def flood(self, whole: Pairing, progress: Progress) -> None:
        """Flood tiles that have rays to be lifted, until there are none; see `flood`."""
        tiles = tiles_of(whole.mesh, self.cuts)
        while not whole.is_full:
            waiting = np.zeros(len(whole.mesh.edges), bool)
            waiting[whole.rays_with(RayMark.UNTRACED).edges] = True
            some = [tile for tile in tiles if waiting[tile.edges].any()]
            if not some:
                return
            parts = parts_of(whole, some)
            found = self._each(flood_tile, Flooded, whole, parts, progress)
            for part, each in zip(parts, found, strict=True):
                FloodGlue(whole, part, each).enter()

    def close(self, whole: Pairing, progress: Progress) -> tuple[Discs, Balls]:
        """Discs and balls over all tiles."""
        parts = parts_of(whole, tiles_of(whole.mesh, self.cuts))
        glue = CellGlue(whole)
        found = self._each(_close_tile, Closed, whole, parts, progress)
        for part, each in zip(parts, found, strict=True):
            glue.add(part, each)
        return glue.joined()

    def _each(
        self,
        function: Callable[[Pairing], Found],
        kind: type[Found],
        whole: Pairing,
        parts: Sequence[Part],
        progress: Progress,
    ) -> list[Found]:
        """What a function finds in each part: kept by the journal, else computed by the workers."""
        self.rounds += 1
        names = [f"round {self.rounds}, tile {part.tile.number}" for part in parts]
        found = list(_kept(self.journal, names, kind))
        chunks = (cut_out(whole, part) for part in parts[len(found) :])
        for each in map_chunks(function, chunks, self.workers):
            if self.journal is not None:
                self.journal.keep(names[len(found)], tuple(_arrays(each)))
            found.append(each)
            progress.report("lifting tiles", len(found), len(parts))
        return found


def _kept(journal: Journal | None, names: Sequence[str], kind: type[Found]) -> Iterator[Found]:
    """Findings that a journal keeps, up to the first that it does not."""
    for name in names:
        findings = journal.recall(name) if journal else None
        if findings is None:
            return
        yield _record(kind, iter(findings))


def _arrays(record: Any) -> Iterator[np.ndarray]:
    """All arrays of a record, and of those in it."""
    for each in fields(record):
        value = getattr(record, each.name)
        if is_dataclass(value):
            yield from _arrays(value)
        else:
            yield value


def _record(kind: Any, arrays: Iterator[np.ndarray]) -> Any:
    """Return the record that `_arrays` took apart."""
    return kind(
        *(
            _record(each.type, arrays) if is_dataclass(each.type) else next(arrays)
            for each in fields(kind)
        )
    )


def _close_tile(tile: Pairing) -> Closed:
    """Close the loops, and over three parameters the balls, of a tile that is lifted."""
    known = tile.points.count
    if tile.mesh.dimension == 2:
        discs, balls = assemble(tile, find_loops(tile)), Balls.none()
    else:
        volumes = volumes_over(tile, None)
        discs, balls = volumes.areas.discs, volumes.balls
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
            self._whole.hubs.setdefault(chord_of(first, second), point)
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


def _discs_in_whole(
    discs: Discs, numbers: Int[np.ndarray, " points"], part: Part, kept: ItemFlags
) -> Discs:
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
        np.column_stack([triangles[discs.astray[:, 0]], numbers[discs.astray[:, 1:]]]),
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


def _join(parts: Sequence[Record]) -> Record:
    """All rows of some parts."""
    names = [each.name for each in fields(parts[0])]
    columns = ([getattr(each, name) for each in parts] for name in names)
    return type(parts[0])(*map(np.concatenate, columns))
