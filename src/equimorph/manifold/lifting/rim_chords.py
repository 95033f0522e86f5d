"""Folds on lids: which corners of a rim they join.

Where a rim has two corners between two indices, a fold leads from one to the other. Where it has
more, each is followed along the constraint through its grid tetrahedron, as folds are followed in
triangles.

See docs/decisions.md, "Two lids are no tube if each lies before the planes that touch the other".
"""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from equimorph.arrays import Bool, Items, Pairs
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.lifting.fold_walks import STEPS, nearest_at
from equimorph.manifold.lifting.inner_points import marks_of
from equimorph.manifold.lifting.pairing import CapExit, Pairing
from equimorph.manifold.lifting.polygon_cuts import Chord, chord_of, match_folds
from equimorph.manifold.lifting.surfaces import Surfaces
from equimorph.manifold.lifting.walks import Walk

CORNERS = 2
"""Corners of a rim between two indices: the ends of a fold on its lid."""


def chords_of_rims(
    pairing: Pairing, surfaces: Surfaces, lost: Bool[np.ndarray, " rims"]
) -> tuple[Items, Items, Pairs]:
    """Rims, lower indices and ends of the folds on lids; rims are `lost` where these are not known.

    Where sheets cross on a rim with corners, too.
    """
    rim, corner, low, fits = _corners(pairing, surfaces)
    lost[rim[~fits]] = True
    mixed = pairing.points.kind[surfaces.sides] == VertexKind.CROSSING
    lost[np.intersect1d(rim, surfaces.rim[mixed.any(axis=1)])] = True
    first = np.flatnonzero(np.diff(rim, prepend=-1) | np.diff(low, prepend=low[:1]))
    several = np.unique(rim[first[np.diff(first, append=len(rim)) != CORNERS]])
    several = several[~lost[several]]
    known = _followed(pairing, surfaces, several, rim, corner, lost)
    first = first[~lost[rim[first]] & ~np.isin(rim[first], several)]
    lows = dict(zip(corner.tolist(), low.tolist(), strict=True))
    ends = np.concatenate(
        [corner[first[:, None] + np.arange(CORNERS)], *(np.array(own) for own in known.values())]
    )
    rims = np.concatenate([rim[first], *(np.full(len(own), each) for each, own in known.items())])
    order = np.lexsort([marks_of(pairing.points)[ends].sum(axis=1), rims])
    rims, ends = rims[order], ends[order]
    return rims, np.array([lows[end] for end in ends[:, 0].tolist()], int), ends


def _corners(
    pairing: Pairing, surfaces: Surfaces
) -> tuple[Items, Items, Items, Bool[np.ndarray, " n"]]:
    """Rim, point and lower index of the corners of rims; whether one index is the next."""
    row, end = np.nonzero(pairing.points.kind[surfaces.sides] == VertexKind.CORNER)
    rim, point, index = surfaces.rim[row], surfaces.sides[row, end], surfaces.side_index[row]
    # along a rim every point has two sides
    pairs = np.lexsort([index, point, rim]).reshape(-1, 2)
    rim, point, low, high = rim[pairs[:, 0]], point[pairs[:, 0]], *index[pairs].T
    order = np.lexsort([marks_of(pairing.points)[point], low, rim])
    return rim[order], point[order], low[order], (high == low + 1)[order]


def _followed(
    pairing: Pairing,
    surfaces: Surfaces,
    rims: Items,
    rim: Items,
    corner: Items,
    lost: Bool[np.ndarray, " rims"],
) -> dict[int, list[Chord]]:
    """Chords of rims with several folds between two indices, by where these lead."""
    own = np.isin(rim, rims)
    owner = surfaces.owner[surfaces.rim_surface[rim[own]]]
    exits = dict(
        zip(
            zip(rim[own].tolist(), corner[own].tolist(), strict=True),
            _follow(pairing, owner, corner[own]),
            strict=True,
        )
    )
    known = dict[int, list[Chord]]()
    for each in rims.tolist():
        points = corner[rim == each]
        led = {at: exit_ for at in points.tolist() if (exit_ := exits[each, at]) is not None}
        ends = dict(zip(led, nearest_at(pairing, list(led.values()), points), strict=True))
        chords = {chord_of(at, end) for at, end in ends.items()}
        sides = surfaces.rim == each
        around = _around(surfaces.sides[sides], surfaces.side_index[sides], points)
        ways = match_folds(
            range(len(around)),
            [int(code >= 0) for code in around].__getitem__,
            [-1 - code for code in around].__getitem__,
            [chord_of(*map(around.index, chord)) for chord in chords if -1 not in chord],
        )
        found = [[chord_of(*(around[end] for end in chord)) for chord in way] for way in ways]
        found = [way for way in found if chords <= set(way)]
        lost[each] = len(found) != 1
        if not lost[each]:
            known[each] = found[0]
    return known


def _around(sides: Pairs, index: Items, corners: Items) -> list[int]:
    """Corners along a rim, and minus one minus the index of each side, in order."""
    beside: dict[int, list[int]] = {}
    for number, end in enumerate(chain(*sides.tolist())):
        beside.setdefault(end, []).append(number // 2)
    around, point, side = list[int](), int(sides[0, 0]), 0
    for _ in range(len(sides)):
        around += [*([point] if point in corners else []), -1 - int(index[side])]
        point = int(sides[side].sum() - point)
        side = sum(beside[point]) - side
    return around


def _follow(pairing: Pairing, tetrahedra: Items, points: Items) -> Sequence[CapExit | None]:
    """Follow folds on constraints from corners on faces to where they leave grid tetrahedra."""
    setting, store, mesh = pairing.setting, pairing.points, pairing.mesh
    corners = mesh.vertices[mesh.tetrahedra[tetrahedra]]
    start = store.z[points], store.p[points], store.index[points]
    walk = Walk.start_from(setting, corners, *start, VertexKind.CORNER)
    left, found = np.ones(len(points), bool), np.zeros(len(points), bool)
    for _ in range(STEPS):
        lanes = np.flatnonzero(left)
        if len(lanes) == 0:
            break
        own, apex = walk.take(lanes).step(setting)
        walk = walk.with_rows(lanes, own)
        found[lanes[apex >= 0]] = True
        left[lanes[(apex >= 0) | (own.length == 0.0)]] = False
    return [
        CapExit(-1, walk.z[k], walk.p[k], []) if good else None
        for k, good in enumerate(found.tolist())
    ]
