"""Rounds in which all tiles of a grid are lifted or closed by workers, and glued.

All tiles of a round begin with the same whole, and are glued in their order when the last one is
there: the result does not depend on who computes them, nor on which is finished first. Findings of
each tile in each round are an entry of the journal.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

from equimorph.manifold.lifting.balls import Balls
from equimorph.manifold.lifting.discs import Discs
from equimorph.manifold.lifting.pairing import Pairing, RayMark
from equimorph.manifold.lifting.tile_cells import CellGlue, Closed, close_tile
from equimorph.manifold.lifting.tile_floods import Flooded, FloodGlue, flood_tile
from equimorph.manifold.lifting.tiles import Cuts, Part, cut_out, parts_of, tiles_of
from equimorph.model import Journal, Progress, Workers, map_chunks

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
        found = self._each(close_tile, Closed, whole, parts, progress)
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
