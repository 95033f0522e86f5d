"""Lids: discs on constraints that close surfaces of discs along their rims, in grid tetrahedra.

Where folds meet a rim, it is parted into rims of one index each, along the folds of its lid. Two
rims of one region might be the ends of a tube on the constraint.

See docs/decisions.md, "Two lids are no tube if each lies before the planes that touch the other".
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from equimorph.arrays import Bool, Int, Items, Lanes, Pairs, Parameters, Places
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.simplices import shares_in
from equimorph.manifold.geometry.tangents import (
    cap_normals,
    cap_slopes,
    fold_forms,
    fold_rows,
    frames_in_embedding,
    tangent_frames,
)
from equimorph.manifold.geometry.topology import distinct
from equimorph.manifold.lifting.inner_points import (
    ON_FACE,
    grouped,
    groups_of,
    marks_of,
    pin_inside,
)
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.rim_chords import CORNERS, chords_of_rims
from equimorph.manifold.lifting.spheres import Parts
from equimorph.manifold.lifting.surfaces import Surfaces, rings


def close_rims(
    pairing: Pairing, surfaces: Surfaces
) -> tuple[Surfaces, Int[np.ndarray, " rims"], Bool[np.ndarray, " rims"]]:
    """Surfaces whose rims are parted along folds, points from which to close these, which lack one.

    −1 where none is needed: a rim of three points can be closed by their triangle.
    """
    surfaces, caps, lost = _parted(pairing, surfaces)
    count, owner = len(caps), surfaces.owner[surfaces.rim_surface]
    amount = np.bincount(surfaces.surface, minlength=len(surfaces.owner))[surfaces.rim_surface]
    around = np.bincount(surfaces.rim, minlength=count)
    at, points = grouped(surfaces.rim, surfaces.sides, marks_of(pairing.points))
    kind = pairing.points.kind[points]
    meeting = kind == VertexKind.CROSSING
    crossed = np.bincount(at[meeting], minlength=count)
    left = (caps < 0) & ~lost
    # what is singular runs from end to end, maybe far from the middle of the rim
    lost |= left & ~np.isin(crossed, (0, CORNERS))
    through = left & (crossed == CORNERS)
    plain = left & (crossed == 0) & (around > 0) & ((amount > 3) | (around > 3))
    for sought, own, used in (
        (VertexKind.CROSSING, through, meeting & through[at]),
        (VertexKind.CAP, plain, plain[at]),
    ):
        groups = groups_of(at[used], points[used], np.flatnonzero(own))
        caps[own] = pin_inside(pairing, groups, sought, owner[own], cap=True)
        lost |= own & (caps < 0) & ((sought != VertexKind.CAP) | (around > 3))
    for rim in np.flatnonzero(lost & plain).tolist():
        sides = surfaces.sides[surfaces.rim == rim]
        caps[rim] = _on_rim(pairing, owner[rim], sides, points[at == rim])
        lost[rim] = caps[rim] < 0
    return surfaces, caps, lost


def _on_rim(pairing: Pairing, owner: int, sides: Pairs, points: Items) -> int:
    """Point of a rim from which to draw a lid without inner edges on faces; −1 if there is none."""
    mesh, setting = pairing.mesh, pairing.setting
    corners = np.tile(mesh.vertices[mesh.tetrahedra[owner]], (len(points), 1, 1))
    on = shares_in(corners, pairing.points.p[points][:, setting.free]) < ON_FACE
    apart = ~(on[:, None] & on).any(axis=2) | np.eye(len(points), dtype=bool)
    for point, away in zip(points.tolist(), apart, strict=True):
        if (away | np.isin(points, sides[(sides == point).any(axis=1)])).all():
            return int(point)
    return -1


def _parted(
    pairing: Pairing, surfaces: Surfaces
) -> tuple[Surfaces, Int[np.ndarray, " rims"], Bool[np.ndarray, " rims"]]:
    """Surfaces whose rims are parted along the folds of their lids, with a corner on each of these.

    See `chords_of_rims`.
    """
    lost = np.zeros(len(surfaces.rim_surface), bool)
    rim, low, ends = chords_of_rims(pairing, surfaces, lost)
    owner = surfaces.owner[surfaces.rim_surface[rim]]
    middle = np.array(pin_inside(pairing, ends.tolist(), VertexKind.CORNER, owner, cap=True), int)
    lost[rim[middle < 0]] = True
    kept = ~lost[rim]
    rim, low, ends, middle = (each[kept] for each in (rim, low, ends, middle))
    # each side of each fold, from both ends to the middle
    sides = np.stack([ends, np.stack([middle, middle], axis=1)], axis=2).reshape(-1, 2)
    old = len(surfaces.sides)
    sides = np.concatenate([surfaces.sides, sides, sides])
    side_rim = np.concatenate([surfaces.rim, np.tile(np.repeat(rim, 2), 2)])
    side_index = np.concatenate([surfaces.side_index, np.repeat([low, low + 1], 2)])
    # between two folds there may be several parts of one index
    parted = np.where(np.isin(side_rim, rim), 1 + side_index, 0)
    key = side_rim * (int(parted.max(initial=0)) + 1) + parted
    groups, group = np.unique(key, return_inverse=True)
    label = rings(sides, group, len(groups)).label
    caps = np.full(int(label.max(initial=-1)) + 1, -1)
    caps[label[old:]] = sides[old:, 1]
    of_rim = np.zeros(len(caps), int)
    of_rim[label] = side_rim
    parts = replace(
        surfaces,
        sides=sides,
        rim=label,
        side_index=side_index,
        rim_surface=surfaces.rim_surface[of_rim],
    )
    return parts, caps, lost[of_rim]


def joined_by_tubes(pairing: Pairing, parts: Parts) -> Int[np.ndarray, " k"]:
    """Surfaces with a region of which two lids might be one tube."""
    closed, store, setting = parts.closed, pairing.points, pairing.setting
    lid = np.flatnonzero(closed.lid)
    base = len(closed.caps) + 1
    key = parts.region[lid] * base + closed.rim[lid]
    own = distinct(key) // base
    several = np.isin(parts.region[lid], own[1:][np.diff(own) == 0])
    at, points = grouped(key[several], closed.corners[lid[several]], marks_of(store))
    used, number = np.unique(points, return_inverse=True)
    if len(used) == 0:
        return used
    z, p, on_fold = store.z[used], store.p[used], store.kind[used] == VertexKind.CORNER
    over = _over_parameters(setting, z, p, on_fold), _along_set(setting, z, p, on_fold)
    meeting = store.kind[used] == VertexKind.CROSSING
    first = np.flatnonzero(np.diff(at, prepend=-1))
    lids = np.split(number, first[1:])
    region = at[first] // base
    return np.unique(
        [
            parts.region_surface[region[one]]
            for one, other in _pairs(region)
            if meeting[lids[one]].any()
            or not any(_are_apart(*each, lids[one], lids[other]) for each in over)
        ]
    ).astype(int)


def _pairs(region: Items) -> Iterator[tuple[int, int]]:
    """Pairs of lids of one region, by number; those of a region follow each other."""
    for own in np.split(np.arange(len(region)), np.flatnonzero(np.diff(region)) + 1):
        yield from combinations(own.tolist(), 2)


def _are_apart(place: Places, rise: Places, one: Items, other: Items) -> bool:
    """Whether all points of a lid are before the planes that touch the constraint at the other.

    rise: slopes of the excess.
    """
    way = place[one][:, None] - place[other]
    towards_one = np.einsum("abc,ac->ab", way, rise[one])
    towards_other = np.einsum("abc,bc->ab", -way, rise[other])
    return bool((towards_one > 0.0).all() or (towards_other > 0.0).all())


def _over_parameters(
    setting: Setting, z: Lanes, p: Parameters, on_fold: Bool[np.ndarray, " n"]
) -> tuple[Places, Places]:
    """Places among the free parameters, and slopes of the largest excess along these.

    On folds there are none: nothing lies before their planes.
    """
    slopes = np.full((len(z), len(setting.free)), np.nan)
    slopes[~on_fold] = cap_normals(setting, z[~on_fold], p[~on_fold])
    return p[:, setting.free] / setting.scales, slopes


def _along_set(
    setting: Setting, z: Lanes, p: Parameters, on_fold: Bool[np.ndarray, " n"]
) -> tuple[Places, Places]:
    """Places in the embedding, and slopes of the largest excess along the set."""
    n, d = setting.structure.unknowns, len(setting.free)
    rows = np.zeros((len(z), d, n + d))
    rows[:, :, n:] = np.eye(d)
    rows[on_fold] = fold_rows(setting, fold_forms(setting, z[on_fold], p[on_fold]))
    frames = tangent_frames(setting, z, p, rows)
    slopes = cap_slopes(setting, z, p, frames)
    return embed(setting, z, p), np.einsum(
        "nd,ndc->nc", slopes, frames_in_embedding(setting, frames)
    )
