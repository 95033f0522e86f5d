"""Sheet lifting, the balls: discs close into spheres around tetrahedra, filled by coning.

A sphere of four triangles of one index bounds one tetrahedron. Others are coned from an exact point
inside: on the fold surface that parts two indices, on the constraint that cuts the ball off, else
near the centroid of its vertices. Several closed fold curves on a sphere each bound a disc of the
fold surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.exact_points import Pinned, Span, middles, pin, pin_crossings
from equimorph.manifold.geometry.points import Points, VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.simplices import shares_in, volumes
from equimorph.manifold.geometry.topology import distinct
from equimorph.manifold.lifting.discs import Discs
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.spheres import (
    Parts,
    closed_surfaces,
    fans_of,
    part,
    upright_apexes,
)
from equimorph.manifold.lifting.surfaces import Surfaces, find_spheres

SHARES = (0.25, 0.5, 0.8, 0.95)
"""Fractions between centroid and member used as retry starting points. Of 10 600 points inside
cells they gave 336, 157, 129 and 59."""
TRIED = 6
"""Points of a group towards which is tried at most: further ones gave none of these."""
ON_FACE = 1e-9
"""Barycentric coordinate below which a point lies on a face of a grid cell."""

Frames = Float[np.ndarray, "lanes corners d"]


def pin_in_cells(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    frames: Frames,
) -> Pinned:
    """Exact points between groups of points, inside grid cells.

    Where the one in the normal space through the middle is not, those through points between the
    middle and one of the group are tried: near its own points a constraint with kinks is smooth,
    and a fold does not leave the cell. Folds may bulge beyond a face between edges that they do not
    meet, and behind cusps: if none of their points is inside, the one least far outside is taken.

    `groups`, `kind`, `span`: as in `pin`. `frames`: corners of the grid cells, in free parameters.
    """
    sizes = np.array([len(group) for group in groups], int)
    z, p, _ = middles(setting, points, groups)
    best = np.full(len(groups), -np.inf if kind == VertexKind.FOLD else ON_FACE)
    found = np.zeros(len(groups), bool)
    for share in (0.0, *SHARES):
        left = np.flatnonzero(best <= ON_FACE)
        if len(left) == 0:
            break
        few = np.minimum(sizes[left], TRIED if share else 1)
        row, member = np.nonzero(np.arange(TRIED) < few[:, None])
        lane = left[row]
        # towards all members at once: each call takes long, be it for few lanes
        own = [groups[each] for each in lane.tolist()]
        pinned = pin(setting, points, own, kind, span[lane], member, share)
        inside = shares_in(frames[lane], pinned.p[:, setting.free]).min(axis=1)
        depth = np.where(pinned.found, inside, -np.inf)
        for number in range(int(few.max())):
            tried = np.flatnonzero(member == number)
            at = lane[tried]
            better = (best[at] <= ON_FACE) & (depth[tried] > best[at])
            at, tried = at[better], tried[better]
            z[at], p[at], best[at] = pinned.z[tried], pinned.p[tried], depth[tried]
            found[at] = True
    return Pinned(z, p, found)


SHEETS = 2
"""Number of sheets that meet at a crossing."""
DIVIDED = 1 / 100
"""Share of the largest grid tetrahedron below which none is divided, although a fold may overturn
cells there."""


@dataclass(frozen=True)
class Balls:
    """Tetrahedra with their index, their facets on folds, on constraints and where sheets cross.

    owner, fold_owner, cap_owner, crossing_owner: grid tetrahedra below them; doubtful: those over
    which the ball is undecided.
    """

    corners: Int[np.ndarray, "n 4"]
    index: Items
    owner: Items
    folds: Int[np.ndarray, "f 3"]
    fold_owner: Int[np.ndarray, " f"]
    caps: Int[np.ndarray, "c 3"]
    cap_owner: Int[np.ndarray, " c"]
    crossings: Int[np.ndarray, "x 3"]
    crossing_owner: Int[np.ndarray, " x"]
    doubtful: Int[np.ndarray, " k"]

    @classmethod
    def none(cls) -> "Balls":
        """No balls, as over fewer parameters."""
        corners, facets, none = np.zeros((0, 4), int), np.zeros((0, 3), int), np.zeros(0, int)
        return cls(corners, none, none, facets, none, facets, none, facets, none, none)


def fill(pairing: Pairing, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> Balls:
    """Fill all spheres over the flagged grid tetrahedra."""
    spheres = find_spheres(pairing.mesh, discs, wanted)
    doubtful = np.zeros(len(pairing.mesh.tetrahedra), bool)
    doubtful[spheres.doubtful] = True
    caps, lost = _caps(pairing, spheres.others)
    doubtful[spheres.others.owner[spheres.others.rim_surface[lost]]] = True
    crossing = pairing.points.kind == VertexKind.CROSSING
    closed = closed_surfaces(spheres.others, caps, ~doubtful[spheres.others.owner], crossing)
    parts = part(closed, _marks(pairing.points))
    doubtful[closed.owner[~parts.whole]] = True
    middles = _middles(pairing, parts, doubtful)
    apexes = _apexes(pairing, parts, middles, doubtful)
    known = pairing.points.p[
        : pairing.points.count
    ]  # no point has number −1, the last one stands in
    apexes, overturned = upright_apexes(parts, middles, apexes, known[:, pairing.setting.free])
    own = closed.owner[parts.region_surface]
    doubtful[own[overturned & ((parts.first_curve < 0) | _large(pairing.mesh)[own])]] = True
    filled = _cone(parts, middles, apexes, ~doubtful[closed.owner])
    return Balls(
        np.concatenate([spheres.plain, filled.corners]),
        np.concatenate([spheres.plain_index, filled.index]),
        np.concatenate([spheres.plain_owner, filled.owner]),
        filled.folds,
        filled.fold_owner,
        filled.caps,
        filled.cap_owner,
        filled.crossings,
        filled.crossing_owner,
        np.flatnonzero(doubtful),
    )


def _marks(points: Points) -> Float[np.ndarray, " points"]:
    """A number for each point that hardly any other one has."""
    z = points.z[: points.count]
    return np.asarray(z @ np.cos(np.arange(z.shape[1])))


def _large(mesh: BaseMesh) -> Bool[np.ndarray, " N"]:
    """Grid tetrahedra that have not been divided often."""
    size = np.abs(volumes(mesh.vertices[mesh.tetrahedra]))
    return np.asarray(size > DIVIDED * size.max(initial=0.0))


def _caps(
    pairing: Pairing, surfaces: Surfaces
) -> tuple[Int[np.ndarray, " rims"], Bool[np.ndarray, " rims"]]:
    """Points on the constraint from which rims are closed, and where one is missing.

    −1 where none is needed: a rim of three points can be closed by their triangle.
    """
    count, owner = len(surfaces.rim_surface), surfaces.owner[surfaces.rim_surface]
    amount = np.bincount(surfaces.surface, minlength=len(surfaces.owner))[surfaces.rim_surface]
    around = np.bincount(surfaces.rim, minlength=count)
    at, points = _group(surfaces.rim, surfaces.sides, _marks(pairing.points))
    ends = {
        kind: pairing.points.kind[points] == kind
        for kind in (VertexKind.CORNER, VertexKind.CROSSING)
    }
    ended = {kind: np.bincount(at[own], minlength=count) for kind, own in ends.items()}
    every = sum(ended.values())
    # a fold runs from corner to corner, maybe far from the middle of the rim
    singular = {kind: (own == 2) & (every == 2) for kind, own in ended.items()}
    plain = (every == 0) & (around > 0) & (amount > 3)
    caps, lost = np.full(count, -1), (every > 0) & ~np.logical_or(*singular.values())
    for kind, own in (*singular.items(), (VertexKind.CAP, plain)):
        used = own[at] & ends.get(kind, np.True_)
        groups = _groups(at[used], points[used], np.flatnonzero(own))
        caps[own] = _pin(pairing, groups, kind, owner[own], cap=True)
        lost |= own & (caps < 0) & ((kind != VertexKind.CAP) | (around > 3))
    return caps, lost


def _group(
    group: Items, points: Int[np.ndarray, "n k"], marks: Float[np.ndarray, " points"]
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """Distinct points of each group, in the order of their marks: their groups and their numbers.

    So what is computed from them does not depend on the order in which they were found.
    """
    base = int(points.max(initial=0)) + 1
    at, own = np.divmod(distinct((group[:, None] * base + points).ravel()), base)
    return at, own[np.lexsort([marks[own], at])]


def _groups(
    at: Int[np.ndarray, " m"], points: Int[np.ndarray, " m"], numbers: Int[np.ndarray, " k"]
) -> list[list[int]]:
    """Points of the groups with these numbers."""
    first, last = np.searchsorted(at, numbers), np.searchsorted(at, numbers, side="right")
    every = points.tolist()
    return [every[a:b] for a, b in zip(first.tolist(), last.tolist(), strict=True)]


def _middles(
    pairing: Pairing, parts: Parts, doubtful: Bool[np.ndarray, " N"]
) -> Int[np.ndarray, " curves"]:
    """Exact point inside every curve: a fold, or a crossing; it can be on the constraint."""
    count = len(parts.curve_surface)
    at, points = _group(parts.curve, parts.folds, _marks(pairing.points))
    middles = np.full(count, -1)
    own = np.isin(points, parts.closed.caps)
    middles[at[own]] = points[own]
    left = (middles < 0) & parts.whole[parts.curve_surface]
    for kind, own in ((VertexKind.FOLD, ~parts.curve_met), (VertexKind.CROSSING, parts.curve_met)):
        chosen = np.flatnonzero(left & own)
        owner = parts.closed.owner[parts.curve_surface[chosen]]
        middles[chosen] = _pin(pairing, _groups(at, points, chosen), kind, owner)
    wanted = np.flatnonzero(left)
    owner = parts.closed.owner[parts.curve_surface[wanted]]
    doubtful[owner[middles[wanted] < 0]] = True
    return middles


def _apexes(
    pairing: Pairing,
    parts: Parts,
    middles: Int[np.ndarray, " curves"],
    doubtful: Bool[np.ndarray, " N"],
) -> Int[np.ndarray, " regions"]:
    """Apex of every region: on a fold, on the constraint, or near the centroid of its vertices."""
    count = len(parts.region_surface)
    folded = parts.first_curve >= 0
    apexes: Int[np.ndarray, " regions"] = parts.region_cap.copy()
    apexes[folded] = middles[parts.first_curve[folded]]
    size = np.bincount(parts.region, minlength=count)
    four = np.flatnonzero(~folded & (apexes < 0) & (size == 4))
    by_region = np.argsort(parts.region, kind="stable")
    first = np.cumsum(size) - size
    apexes[four] = parts.closed.corners[by_region[first[four]], 0]
    whole = parts.whole[parts.region_surface]
    wanted = np.flatnonzero(~folded & (apexes < 0) & whole)
    at, points = _group(parts.region, parts.closed.corners, _marks(pairing.points))
    owner = parts.closed.owner[parts.region_surface[wanted]]
    found = np.array(_pin(pairing, _groups(at, points, wanted), VertexKind.AMID, owner), int)
    apexes[wanted] = found
    doubtful[owner[found < 0]] = True
    return apexes


def _cone(
    parts: Parts,
    middles: Int[np.ndarray, " curves"],
    apexes: Int[np.ndarray, " regions"],
    wanted: Bool[np.ndarray, " S"],
) -> Balls:
    """Tetrahedra from the apex of each region to its triangles and to the folds around it."""
    closed = parts.closed
    fans, sides = fans_of(parts, middles)
    proper = wanted[parts.curve_surface[parts.curve[sides]]]
    fans, sides = fans[proper], sides[proper]
    fan_surface, beside = parts.curve_surface[parts.curve[sides]], parts.beside[sides]
    facets = np.concatenate([closed.corners, fans, fans])
    region = np.concatenate([parts.region, beside[:, 0], beside[:, 1]])
    apex, surface = apexes[region], parts.region_surface[region]
    kept = wanted[surface] & (facets != apex[:, None]).all(axis=1)
    lids = closed.lid & wanted[closed.surface]
    met = parts.curve_met[parts.curve[sides]]
    return Balls(
        np.concatenate([facets, apex[:, None]], axis=1)[kept],
        parts.region_index[region[kept]],
        closed.owner[surface[kept]],
        fans[~met],
        closed.owner[fan_surface[~met]],
        closed.corners[lids],
        closed.owner[closed.surface[lids]],
        fans[met],
        closed.owner[fan_surface[met]],
        np.zeros(0, int),
    )


def _pin(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool = False,
) -> list[int]:
    """Numbers of new exact points of a kind near groups over grid tetrahedra; −1 where none is.

    Crossings belong to two surfaces, whose groups are the same; `cap`: on a constraint.
    """
    if kind == VertexKind.CROSSING:
        return _pin_shared(pairing, groups, owner, cap=cap)
    return _new(pairing, groups, kind, owner, cap=cap)


def _pin_shared(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> list[int]:
    """Numbers of new crossings near groups that are given twice."""
    keys = [tuple(group) for group in groups]
    once = {key: keys.count(key) for key in keys}
    over = dict(zip(keys, owner.tolist(), strict=True))
    own = np.array([over[key] for key in once], int)
    found = dict(
        zip(once, _new(pairing, list(once), VertexKind.CROSSING, own, cap=cap), strict=True)
    )
    return [found[key] if once[key] == SHEETS else -1 for key in keys]


def _new(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> list[int]:
    """Numbers of new exact points of a kind near groups; −1 where none was found."""
    out = [-1] * len(groups)
    if not groups:
        return out
    store = pairing.points
    pinned = _pin_inside(pairing, groups, kind, owner, cap=cap)
    for lane in np.flatnonzero(pinned.found).tolist():
        # on folds and crossings that of the lower side, elsewhere that of all
        low = int(store.index[list(groups[lane])].min())
        out[lane] = store.add(pinned.z[lane], pinned.p[lane], low, kind)
    return out


def _pin_inside(
    pairing: Pairing,
    groups: Sequence[Sequence[int]],
    kind: int,
    owner: Int[np.ndarray, " groups"],
    *,
    cap: bool,
) -> Pinned:
    """Pin points inside their grid tetrahedra; crossings, and folds if need be, in the box."""
    setting, mesh = pairing.setting, pairing.mesh
    span = np.tile(np.eye(len(setting.free)), (len(groups), 1, 1))
    if kind == VertexKind.CROSSING:
        pinned = pin_crossings(setting, pairing.points, groups, span, cap)
    else:
        frames = mesh.vertices[mesh.tetrahedra[owner]]
        pinned = pin_in_cells(setting, pairing.points, groups, kind, span, frames)
    pinned.found[:] &= mesh.covers(pinned.p[:, setting.free])
    if kind == VertexKind.FOLD:
        _pin_beside_sides(pairing, groups, owner, pinned)
    return pinned


def _pin_beside_sides(
    pairing: Pairing, groups: Sequence[Sequence[int]], owner: Int[np.ndarray, " groups"], at: Pinned
) -> None:
    """Pin folds in place that were beyond a side, in the plane parallel to it through the middle.

    Behind a cusp in a side folds bulge beyond it, in cells of every size.
    """
    setting, mesh = pairing.setting, pairing.mesh
    for axis in range(len(setting.free)):
        lanes = np.flatnonzero(~at.found)
        if len(lanes) == 0:
            return
        own = [groups[lane] for lane in lanes.tolist()]
        span = np.tile(np.delete(np.eye(len(setting.free)), axis, axis=0), (len(lanes), 1, 1))
        frames = mesh.vertices[mesh.tetrahedra[owner[lanes]]]
        held = pin_in_cells(setting, pairing.points, own, VertexKind.FOLD, span, frames)
        good = held.found & mesh.covers(held.p[:, setting.free])
        at.z[lanes[good]], at.p[lanes[good]] = held.z[good], held.p[good]
        at.found[lanes[good]] = True
