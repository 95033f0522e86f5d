"""What grid cells hide from their edges: necks and holes inside, and points where sheets touch.

See docs/decisions.md, "Approaching sheets are followed to where they are nearest".
"""

from dataclasses import dataclass, field, replace

import numpy as np

from equimorph.arrays import Bool, CellFlags, Float, Place, Some
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.cells import Cells, Seen
from equimorph.manifold.lifting.crossing_chords import crossing_turns
from equimorph.manifold.lifting.fold_chords import (
    Turns,
    beyond_folds,
    facing_folds,
    fold_chords,
    sharp_turns,
    ways_out,
)
from equimorph.manifold.lifting.grid import NEAR_AN_END
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import chord_of
from equimorph.manifold.lifting.stationary_points import approaches, stationary_points
from equimorph.tolerances import SAME_STATE

Places = Float[np.ndarray, "t d"]


@dataclass(frozen=True)
class Unseen:
    """What was found inside grid cells.

    hidden: cells in which something is joined or parted that their edges do not show; touching:
    free parameters of points at which two sheets touch; exits: edges through which tongues of the
    set leave hidden cells, with the part of the way between their ends at which they do.
    """

    hidden: Some
    touching: Places
    exits: dict[int, float] = field(default_factory=dict)


class UnseenFinder:
    """Looks into the cells of a mesh that is being bisected; into each once.

    Middles of folds that turn sharply inside a cell are entered in the pairing (`tips`).

    exits: those that the last look found; see `Unseen`.
    """

    def __init__(self) -> None:
        self.exits: dict[int, float] = {}
        self._seen: Seen | None = None
        self._hidden = np.zeros(0, int)
        self._touching: Places | None = None

    def look(self, pairing: Pairing, cells: Cells) -> Cells:
        """Cells that hide something among the doubtful ones, and the points where sheets touch."""
        mesh, d = pairing.mesh, pairing.mesh.dimension
        if d == 1:  # edges are traced, and have no inside besides
            return cells
        seen = Seen.of(pairing)
        new, crossed = ~seen.same(self._seen), _crossed(pairing)
        wanted = new & ~crossed
        flags = wanted if d == 2 else wanted[mesh.faces].any(axis=1)
        flags[self._hidden] = True  # they wait for bisection
        found = [_holes(pairing, cells, flags)]
        if d == 2:
            found += [_necks(pairing, cells, flags), _strips(pairing, cells, new & crossed)]
        self.exits = {edge: share for each in found for edge, share in each.exits.items()}
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


def _holes(pairing: Pairing, cells: Cells, wanted: CellFlags) -> Unseen:
    """Cells over which two sheets are joined around a hole inside, and where they touch."""
    starts = approaches(pairing, cells, wanted)
    found = stationary_points(pairing.setting, starts, saddles=False)
    hidden = starts.cell[found.none | found.lost]
    return Unseen(hidden, found.place[found.touching])


def _necks(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Unseen:
    """Triangles in which folds are not what their chords say, and where sheets touch."""
    chords = fold_chords(pairing, cells, wanted)
    facing = facing_folds(pairing, chords)
    found = stationary_points(pairing.setting, facing.starts, saddles=True)
    joined = found.parted & beyond_folds(pairing, chords, facing, found.place)
    turns = sharp_turns(pairing, chords)
    hidden, touching = facing.starts.cell[joined], found.place[found.touching]
    if turns is None:
        return Unseen(hidden, touching)
    _enter_tips(pairing, turns.take(turns.inside))
    outside = turns.take(~turns.inside)
    hidden = np.concatenate([hidden, outside.triangle])
    return Unseen(hidden, touching, _exits(pairing, outside))


def _strips(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Unseen:
    """Triangles that crossings of sheets leave through a side which does not show it."""
    turns = crossing_turns(pairing, cells, wanted)
    nowhere = np.zeros((0, pairing.mesh.dimension))
    if turns is None:
        return Unseen(np.zeros(0, int), nowhere)
    outside = turns.take(~turns.inside)
    return Unseen(outside.triangle, nowhere, _exits(pairing, outside))


def _enter_tips(pairing: Pairing, turns: Turns) -> None:
    """Points of folds that turn sharply in their triangles: their chords are parted there."""
    for k, (one, other) in enumerate(turns.ends.tolist()):
        low = int(pairing.points.index[[one, other]].min())
        point = pairing.points.add(turns.z[k], turns.p[k], low, VertexKind.FOLD)
        pairing.tips[chord_of(one, other)] = point


def _exits(pairing: Pairing, turns: Turns) -> dict[int, float]:
    """Edges to which curves lead straight from both their ends; where, in the middle of both."""
    mesh = pairing.mesh
    exits: dict[int, float] = {}
    ways = ways_out(pairing, turns.ends, turns.triangle, turns.normals)
    apexes, middle = ways.apexes, ways.middle
    for k in np.flatnonzero(apexes[:, 0] == apexes[:, 1]).tolist():
        # sides are ab, bc, ca
        first, last = (int(apexes[k, 0] + turn) % 3 for turn in (1, 2))
        side = int(mesh.sides[turns.triangle[k], first])
        turned = mesh.triangles[turns.triangle[k], first] != mesh.edges[side, 0]
        share = float(middle[k, first if turned else last])
        if NEAR_AN_END < share < 1.0 - NEAR_AN_END:
            exits[side] = share
    return exits


def _distinct(places: Places, setting: Setting) -> Places:
    """Places, each once: neighbouring cells find the same."""
    kept: list[Place] = []
    for place in places:
        if all(np.linalg.norm((place - other) / setting.scales) > SAME_STATE for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, len(setting.free))
