"""What grid cells hide from their edges: necks and holes inside, and points where sheets touch.

See docs/decisions.md, "Approaching sheets are followed to where they are nearest".
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from equimorph.arrays import Some
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.approaches import approaches
from equimorph.manifold.lifting.cells import Cells, Seen
from equimorph.manifold.lifting.fold_chords import (
    beyond_folds,
    facing_folds,
    fold_chords,
    unseen_turns,
)
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.stationary_points import stationary_points
from equimorph.tolerances import SAME_STATE

Places = Float[np.ndarray, "t d"]


@dataclass(frozen=True)
class Unseen:
    """What was found inside grid cells.

    hidden: cells in which something is joined or parted that their edges do not show; touching:
    free parameters of points at which two sheets touch.
    """

    hidden: Some
    touching: Places


class UnseenFinder:
    """Looks into the cells of a mesh that is being bisected; into each once."""

    def __init__(self) -> None:
        self._seen: Seen | None = None
        self._hidden = np.zeros(0, int)
        self._touching: Places | None = None

    def look(self, pairing: Pairing, cells: Cells) -> Cells:
        """Cells that hide something among the doubtful ones, and the points where sheets touch."""
        mesh, d = pairing.mesh, pairing.mesh.dimension
        if d == 1:  # edges are traced, and have no inside besides
            return cells
        seen = Seen.of(pairing)
        wanted = ~seen.same(self._seen) & ~_crossed(pairing)
        flags = wanted if d == 2 else wanted[mesh.faces].any(axis=1)
        flags[self._hidden] = True  # they wait for bisection
        found = [_holes(pairing, cells, flags)]
        if d == 2:
            found.append(_necks(pairing, cells, flags))
        self._seen = seen
        before = np.zeros((0, d)) if self._touching is None else self._touching
        places = np.concatenate([before, *(each.touching for each in found)])
        self._touching = _distinct(places, pairing.setting)
        doubtful = cells.doubtful_triangles if d == 2 else cells.doubtful_tetrahedra
        self._hidden = np.unique(np.concatenate([each.hidden for each in found]))
        doubtful = np.union1d(doubtful, self._hidden)
        if d == 2:
            return replace(cells, doubtful_triangles=doubtful, touching=self._touching)
        return replace(cells, doubtful_tetrahedra=doubtful, touching=self._touching)


def _crossed(pairing: Pairing) -> Bool[np.ndarray, " T"]:
    """Triangles through which crossings of sheets pass: there sheets meet along curves."""
    crossed = np.zeros(len(pairing.mesh.edges), bool)
    crossed[[edge for edge, points in pairing.crossings.items() if points]] = True
    return np.asarray(crossed[pairing.mesh.sides].any(axis=1))


def _holes(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " C"]) -> Unseen:
    """Cells over which two sheets are joined around a hole inside, and where they touch."""
    starts = approaches(pairing, cells, wanted)
    found = stationary_points(pairing.setting, starts, saddles=False)
    return Unseen(starts.cell[found.none | found.lost], found.place[found.touching])


def _necks(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Unseen:
    """Triangles in which folds are not what their chords say, and where sheets touch."""
    chords = fold_chords(pairing, cells, wanted)
    facing = facing_folds(pairing, chords)
    found = stationary_points(pairing.setting, facing.starts, saddles=True)
    joined = found.parted & beyond_folds(pairing, chords, facing, found.place)
    hidden = np.concatenate([facing.starts.cell[joined], unseen_turns(pairing, chords)])
    return Unseen(hidden, found.place[found.touching])


def _distinct(places: Places, setting: Setting) -> Places:
    """Places, each once: neighbouring cells find the same."""
    kept: list[Float[np.ndarray, " d"]] = []
    for place in places:
        if all(np.linalg.norm((place - other) / setting.scales) > SAME_STATE for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, len(setting.free))
