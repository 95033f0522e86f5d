"""What grid cells hide from their edges: necks and holes inside, and points where sheets touch.

See docs/decisions.md, "Approaching sheets are followed to where they are nearest".

Nor need the straight crossings of sheets in grid triangles show all that the curved ones do.
Between two nearly parallel pitchfork curves a side branch is a strip. Where it is narrower than the
grid and passes over a vertex, its edges show a crossing on each of two sides of a triangle, and
their chord would close the strip around the vertex; yet both crossings lead on through the third.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from equimorph.arrays import Bool, CellFlags, Float, Place, Some
from equimorph.manifold.geometry.crossings import crossing_directions
from equimorph.manifold.geometry.exact_points import pin_crossings
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting.cells import Cells, Seen
from equimorph.manifold.lifting.courses import split_sides, ways_out
from equimorph.manifold.lifting.fold_chords import (
    FoldChords,
    Turns,
    beyond_folds,
    chords_across,
    facing_folds,
    facing_sides,
    fold_chords,
    lie_inside,
    sharp_turns,
)
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.polygon_cuts import chord_of, planes
from equimorph.manifold.lifting.stationary_points import approaches, stationary_points
from equimorph.tolerances import SAME_STATE

Places = Float[np.ndarray, "t d"]


@dataclass(frozen=True)
class Unseen:
    """What was found inside grid cells.

    hidden: cells in which something is joined or parted that their edges do not show; touching:
    free parameters of points at which two sheets touch; exits: edges through which tongues of the
    set leave hidden cells, with the part of the way between their ends at which they do; faces: of
    tetrahedra, whose edges do not show what folds over them join.
    """

    hidden: Some
    touching: Places
    exits: dict[int, float] = field(default_factory=dict)
    faces: Some = field(default_factory=lambda: np.zeros(0, int))


class UnseenFinder:
    """Looks into the cells of a mesh that is being bisected; into each once.

    Middles of folds that turn sharply inside a cell are entered in the pairing (`tips`).

    exits: those that the last look found; see `Unseen`.
    """

    def __init__(self) -> None:
        self.exits: dict[int, float] = {}
        self._seen: Seen | None = None
        self._hidden = self._faces = np.zeros(0, int)
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
        wanted[self._faces] = True
        found = [_holes(pairing, cells, flags)]
        if d == 2:
            found += [_necks(pairing, cells, flags), _strips(pairing, cells, new & crossed)]
        else:
            found.append(_torn_faces(pairing, cells, wanted))
        self.exits = {edge: share for each in found for edge, share in each.exits.items()}
        self._seen = seen
        before = np.zeros((0, d)) if self._touching is None else self._touching
        places = np.concatenate([before, *(each.touching for each in found)])
        self._touching = _distinct(places, pairing.setting)
        self._hidden = np.unique(np.concatenate([each.hidden for each in found]))
        self._faces = np.unique(np.concatenate([each.faces for each in found]))
        triangles = np.union1d(cells.doubtful_triangles, self._hidden if d == 2 else self._faces)
        tetrahedra = cells.doubtful_tetrahedra
        return replace(
            cells,
            doubtful_triangles=triangles,
            doubtful_tetrahedra=np.union1d(tetrahedra, self._hidden) if d == 3 else tetrahedra,
            touching=self._touching,
        )


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
    chords = fold_chords(pairing, cells.folds, wanted)
    facing = facing_folds(pairing, chords)
    found = stationary_points(pairing.setting, facing.starts, saddles=True)
    joined = found.parted & beyond_folds(pairing, chords, facing, found.place)
    hidden, exits = _torn(pairing, chords)
    hidden = np.concatenate([facing.starts.cell[joined], hidden])
    return Unseen(hidden, found.place[found.touching], exits)


def _torn_faces(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Unseen:
    """Faces of tetrahedra in which folds are not what their chords say."""
    sides = np.concatenate([cells.folds[:, pair] for pair in ([0, 1], [1, 2], [0, 2])])
    chords = fold_chords(pairing, np.unique(np.sort(sides, axis=1), axis=0), wanted)
    faces, exits = _torn(pairing, chords)
    return Unseen(faces[:0], np.zeros((0, 3)), exits, faces)


def _torn(pairing: Pairing, chords: FoldChords) -> tuple[Some, dict[int, float]]:
    """Triangles which folds leave between the ends of their chords, and the sides where they do.

    Over two parameters, chords of folds that turn inside are parted there.
    """
    hidden, exits = facing_sides(pairing, chords)
    turns = sharp_turns(pairing, chords)
    if turns is None:
        return hidden, exits
    if pairing.mesh.dimension == 2:
        _enter_tips(pairing, turns.take(turns.inside))
    outside = turns.take(~turns.inside)
    return np.concatenate([hidden, outside.triangle]), exits | _exits(pairing, outside)


def _strips(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Unseen:
    """Triangles that crossings of sheets leave through a side which does not show it."""
    turns = _crossing_turns(pairing, cells, wanted)
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
    ways = ways_out(pairing, turns.ends, turns.triangle, turns.normals)
    same = np.flatnonzero(ways.together)
    return split_sides(pairing.mesh, turns.triangle[same], ways.take(same))


def _distinct(places: Places, setting: Setting) -> Places:
    """Places, each once: neighbouring cells find the same."""
    kept: list[Place] = []
    for place in places:
        if all(np.linalg.norm((place - other) / setting.scales) > SAME_STATE for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, len(setting.free))


def _crossing_turns(pairing: Pairing, cells: Cells, wanted: Bool[np.ndarray, " T"]) -> Turns | None:
    """Crossings that lead through the third side of a triangle from both ends, and their middles.

    None if there are none. They are looked for in the flagged triangles.
    """
    points, setting = pairing.points, pairing.setting
    ends, triangle = chords_across(pairing, cells.crossings, wanted)
    if len(ends) == 0:
        return None
    used, place = np.unique(ends, return_inverse=True)
    along = crossing_directions(setting, points.z[used], points.p[used])
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)[place.reshape(ends.shape)]
    ways = ways_out(pairing, ends, triangle, across)
    chosen = ways.together
    ends, triangle, across = ends[chosen], triangle[chosen], across[chosen]
    if len(ends) == 0:
        return None
    span = planes(pairing, triangle.tolist())
    middle = pin_crossings(setting, points, ends.tolist(), span)
    inside = middle.found & lie_inside(pairing, triangle, ends, middle.p)
    return Turns(ends, triangle, across, middle.z, middle.p, inside)
