"""Sheet lifting, the balls: discs close into spheres around tetrahedra, filled by coning.

A sphere of four triangles of one index bounds one tetrahedron. Others are coned from an exact point
inside: on the fold surface that parts two indices, on the constraint that cuts the ball off, else
near the centroid of its vertices. Several closed fold curves on a sphere each bound a disc of the
fold surface.

See docs/decisions.md, "At cusps only lids must be upright".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Bool, Int, Items
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.tangents import fold_forms
from equimorph.manifold.lifting.discs import Discs
from equimorph.manifold.lifting.inner_points import grouped, groups_of, marks_of, pin_inside
from equimorph.manifold.lifting.lids import close_rims, joined_by_tubes
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.spheres import (
    Parts,
    closed_surfaces,
    fans_of,
    part,
    upright_apexes,
)
from equimorph.manifold.lifting.surfaces import find_spheres

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
    surfaces, caps, lost = close_rims(pairing, spheres.others)
    doubtful[surfaces.owner[surfaces.rim_surface[lost]]] = True
    crossing = pairing.points.kind == VertexKind.CROSSING
    closed = closed_surfaces(surfaces, caps, ~doubtful[surfaces.owner], crossing)
    parts = part(closed, marks_of(pairing.points))
    parts.whole[joined_by_tubes(pairing, parts)] = False
    doubtful[closed.owner[~parts.whole]] = True
    middles = _middles(pairing, parts, doubtful)
    apexes = _apexes(pairing, parts, middles, doubtful)
    known = pairing.points.p[
        : pairing.points.count
    ]  # no point has number −1, the last one stands in
    apexes, overturned = upright_apexes(
        parts, middles, apexes, known[:, pairing.setting.free], _at_cusps(pairing, parts)
    )
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


def _at_cusps(pairing: Pairing, parts: Parts) -> Bool[np.ndarray, " regions"]:
    """Regions with a fold on which a cusp lies between two neighbours around the tetrahedron."""
    store, out = pairing.points, np.zeros(len(parts.region_surface), bool)
    own = np.flatnonzero(~parts.curve_met[parts.curve])
    points, ends = np.unique(parts.folds[own], return_inverse=True)
    forms = fold_forms(pairing.setting, store.z[points], store.p[points])
    cusps = own[forms.parted_by_cusps(*ends.reshape(-1, 2).T)]
    out[parts.beside[cusps]] = True
    return out


def _large(mesh: BaseMesh) -> Bool[np.ndarray, " N"]:
    """Grid tetrahedra that have not been divided often."""
    size = np.abs(volumes(mesh.vertices[mesh.tetrahedra]))
    return np.asarray(size > DIVIDED * size.max(initial=0.0))


def _middles(
    pairing: Pairing, parts: Parts, doubtful: Bool[np.ndarray, " N"]
) -> Int[np.ndarray, " curves"]:
    """Exact point inside every curve: a fold, or a crossing.

    It can be on the constraint if the curve has one fold there: drawn from an end of one of two on
    the same lid, the fold surface between them would be the lid.
    """
    count = len(parts.curve_surface)
    at, points = grouped(parts.curve, parts.folds, marks_of(pairing.points))
    middles = np.full(count, -1)
    on_lids = np.isin(points, parts.closed.caps)
    on_lids &= np.bincount(at[on_lids], minlength=count)[at] == 1
    middles[at[on_lids]] = points[on_lids]
    left = (middles < 0) & parts.whole[parts.curve_surface]
    for kind, own in ((VertexKind.FOLD, ~parts.curve_met), (VertexKind.CROSSING, parts.curve_met)):
        chosen = np.flatnonzero(left & own)
        owner = parts.closed.owner[parts.curve_surface[chosen]]
        middles[chosen] = pin_inside(pairing, groups_of(at, points, chosen), kind, owner)
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
    at, points = grouped(parts.region, parts.closed.corners, marks_of(pairing.points))
    owner = parts.closed.owner[parts.region_surface[wanted]]
    found = np.array(
        pin_inside(pairing, groups_of(at, points, wanted), VertexKind.AMID, owner), int
    )
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
