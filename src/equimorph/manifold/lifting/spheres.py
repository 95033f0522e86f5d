"""Connected surfaces that the discs over the faces of each grid tetrahedron form.

And the regions of closed ones between folds, with the points from which they are coned.
"""

from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Float, Int, ItemFlags, Items, ItemValues, Pairs, Triples
from equimorph.linalg.graphs import components
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import (
    adjacency,
    distinct,
    keys_of,
    labels,
    orientation,
    runs,
)
from equimorph.manifold.lifting.discs import Discs


@dataclass(frozen=True)
class Surfaces:
    """Triangles of surfaces over grid tetrahedra, closed or open along one loop at a constraint.

    corners, index, surface: of the triangles, those of one surface in a row; met: which of their
    sides ab, bc, ca lie where another sheet crosses; owner: grid tetrahedron of each surface; rims:
    open sides, with their surface and the adjacent index.
    """

    corners: Triples
    index: Items
    surface: Items
    met: Bool[np.ndarray, "n 3"]
    owner: Int[np.ndarray, " S"]
    rims: Int[np.ndarray, "r 2"]
    rim_surface: Int[np.ndarray, " r"]
    rim_index: Int[np.ndarray, " r"]


@dataclass(frozen=True)
class Spheres:
    """Spheres that are tetrahedra of one index, general ones, and undecided grid tetrahedra."""

    plain: Int[np.ndarray, "P 4"]
    plain_index: Int[np.ndarray, " P"]
    plain_owner: Int[np.ndarray, " P"]
    others: Surfaces
    doubtful: Int[np.ndarray, " k"]


@dataclass(frozen=True)
class Rings:
    """Closed curves that edges form, group by group.

    label: curve of each edge; amount: of curves of each group; closed: groups in which two edges
    meet at every point.
    """

    label: Items
    amount: Int[np.ndarray, " groups"]
    closed: Bool[np.ndarray, " groups"]


@dataclass(frozen=True)
class _Copies:
    """Triangles of discs as seen from the grid tetrahedra, sorted by the pieces that they form."""

    corners: Triples
    index: Items
    owner: Items
    met: Bool[np.ndarray, "n 3"]
    shares: Triples
    """How many triangles of the same tetrahedron share sides ab, bc, ca; of the same sheet, where
    another crosses."""
    starts: Int[np.ndarray, " pieces"]
    sizes: Int[np.ndarray, " pieces"]


def find_spheres(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> Spheres:
    """Join the discs around flagged grid tetrahedra without undecided triangles."""
    copies = _copies(mesh, discs, wanted)
    starts, sizes = copies.starts, copies.sizes
    lowest, highest = (f.reduceat(copies.index, starts) for f in (np.minimum, np.maximum))
    closed = np.logical_and.reduceat((copies.shares == 2).all(axis=1), starts)
    candidates = np.flatnonzero(closed & (sizes == 4) & (lowest == highest))
    rows = starts[candidates, None] + np.arange(4)
    points = np.sort(copies.corners[rows].reshape(-1, 12), axis=1).reshape(-1, 4, 3)
    four = (points == points[:, :, :1]).all(axis=(1, 2))
    plain = np.zeros(len(starts), bool)
    plain[candidates[four]] = True
    others, doubtful = _surfaces(copies, plain)
    return Spheres(
        points[four, :, 0],
        copies.index[starts[candidates[four]]],
        copies.owner[starts[candidates[four]]],
        others,
        doubtful,
    )


def _surfaces(
    copies: _Copies, plain: Bool[np.ndarray, " pieces"]
) -> tuple[Surfaces, Int[np.ndarray, " k"]]:
    """Pieces that are not plain, and the owners of those with several rims or crowded sides."""
    piece = np.repeat(np.arange(len(copies.sizes)), copies.sizes)
    sides = np.stack([copies.corners, np.roll(copies.corners, -1, axis=1)], axis=2)
    open_ = (copies.shares == 1) & ~plain[piece, None]
    row, side = np.nonzero(open_)
    rims = rings(sides[row, side], piece[row], len(plain))
    crowded = np.logical_or.reduceat((copies.shares > 2).any(axis=1), copies.starts)
    bad = ~plain & (crowded | ~rims.closed | (rims.amount > 1))
    good = ~plain & ~bad
    number = np.cumsum(good) - 1
    own, rim = good[piece], good[piece[row]]
    surfaces = Surfaces(
        copies.corners[own],
        copies.index[own],
        number[piece[own]],
        copies.met[own],
        copies.owner[copies.starts[good]],
        sides[row[rim], side[rim]],
        number[piece[row[rim]]],
        copies.index[row[rim]],
    )
    return surfaces, np.unique(copies.owner[copies.starts[bad]])


def rings(edges: Pairs, group: Items, groups: int) -> Rings:
    """Curves of edges that hang together within their group."""
    base = int(edges.max(initial=0)) + 1
    _, ends = np.unique((group[:, None] * base + edges).ravel(), return_inverse=True)
    ends = ends.reshape(-1, 2)
    degree = np.bincount(ends.ravel())
    of_point = labels(len(degree), ends)
    _, first, label = np.unique(of_point[ends[:, 0]], return_index=True, return_inverse=True)
    closed = np.ones(groups, bool)
    closed[group[(degree[ends] != 2).any(axis=1)]] = False
    return Rings(label, np.bincount(group[first], minlength=groups), closed)


def _copies(mesh: BaseMesh, discs: Discs, wanted: Bool[np.ndarray, " N"]) -> _Copies:
    """Every triangle of a disc once for each adjacent flagged grid tetrahedron."""
    amount = np.bincount(discs.owner, minlength=len(mesh.triangles))
    first = np.concatenate([[0], np.cumsum(amount)])
    by_owner = np.argsort(discs.owner, kind="stable")
    unclear = np.zeros(len(mesh.triangles), bool)
    unclear[discs.doubtful] = True
    clear = np.flatnonzero(wanted & ~unclear[mesh.faces].any(axis=1))
    faces = mesh.faces[clear].ravel()
    count = amount[faces]
    triangle = by_owner[runs(first[faces], count)[1]]
    owner = np.repeat(np.repeat(clear, 4), count)
    met = discs.met[triangle]
    shares, piece = _pieces(
        discs.corners[triangle], owner, np.where(met, 1 + discs.sheet[triangle, None], 0)
    )
    order = np.argsort(piece, kind="stable")
    sizes = np.bincount(piece)
    starts = np.cumsum(sizes) - sizes
    corners, index = discs.corners[triangle[order]], discs.index[triangle[order]]
    return _Copies(corners, index, owner[order], met[order], shares[order], starts, sizes)


def _pieces(corners: Triples, owner: Items, sheet: Triples) -> tuple[Triples, Items]:
    """How many triangles share each side within a tetrahedron, and the pieces that they form.

    Sides of different sheets are different, but for sheet 0.
    """
    base = int(corners.max(initial=0)) + 1
    keys = np.stack([keys_of(corners[:, [k, (k + 1) % 3]], base) for k in range(3)], axis=1)
    _, edges = np.unique(keys.ravel(), return_inverse=True)
    local = np.repeat(owner, 3) * (edges.max(initial=0) + 1) + edges.ravel()
    local = local * (sheet.max(initial=0) + 1) + sheet.ravel()
    _, inverse, counts = np.unique(local, return_inverse=True, return_counts=True)
    order = np.argsort(inverse, kind="stable")
    same = np.flatnonzero(inverse[order[1:]] == inverse[order[:-1]])
    pairs = np.stack([order[same], order[same + 1]], axis=1) // 3
    return counts[inverse].reshape(-1, 3), components(len(owner), pairs)


@dataclass(frozen=True)
class Closed:
    """Triangles of closed surfaces: some with a lid on the constraint.

    corners, index, surface, lid: of the triangles; met: which of their sides ab, bc, ca lie where
    another sheet crosses; owner, cap: of the surfaces, their grid
    tetrahedron, and the point from which the lid was drawn (−1 if there is none).
    """

    corners: Triples
    index: Items
    surface: Items
    lid: ItemFlags
    met: Bool[np.ndarray, "n 3"]
    owner: Int[np.ndarray, " S"]
    cap: Int[np.ndarray, " S"]


@dataclass(frozen=True)
class Parts:
    """How closed surfaces are parted.

    region: of each triangle; region_surface, region_index, first_curve: of the regions, one of the
    curves around it (−1 if there is none); folds, curve, beside: sides between two indices, or
    where another sheet crosses, the closed curve that they belong to, and the regions on both
    sides; curve_surface, curve_met: of the curves, the surface and whether another sheet crosses;
    whole: surfaces that are spheres, parted without contradiction.
    """

    closed: Closed
    region: Items
    region_surface: Int[np.ndarray, " regions"]
    region_index: Int[np.ndarray, " regions"]
    first_curve: Int[np.ndarray, " regions"]
    folds: Int[np.ndarray, "f 2"]
    curve: Int[np.ndarray, " f"]
    beside: Int[np.ndarray, "f 2"]
    curve_surface: Int[np.ndarray, " curves"]
    curve_met: Bool[np.ndarray, " curves"]
    whole: Bool[np.ndarray, " S"]


def closed_surfaces(
    surfaces: Surfaces,
    caps: Int[np.ndarray, " S"],
    wanted: Bool[np.ndarray, " S"],
    crossing: Bool[np.ndarray, " points"],
) -> Closed:
    """Close surfaces along their rims: from a cap, maybe on the rim, or by one triangle.

    `crossing` flags the points that are crossings: between two of them, lids are met.
    """
    number = np.cumsum(wanted) - 1
    own, rim = wanted[surfaces.surface], wanted[surfaces.rim_surface]
    rim &= (surfaces.rims != caps[surfaces.rim_surface, None]).all(axis=1)
    at, sides, index = surfaces.rim_surface[rim], surfaces.rims[rim], surfaces.rim_index[rim]
    capped = caps[at] >= 0
    fans = np.concatenate([np.sort(sides[capped], axis=1), caps[at[capped], None]], axis=1)
    # rims without a cap have three sides, one after the other
    order = np.flatnonzero(~capped)[np.argsort(at[~capped], kind="stable")]
    first, second = order[::3], order[1::3]
    third = np.where(
        (sides[second] == sides[first, :1]) | (sides[second] == sides[first, 1:]), -1, sides[second]
    ).max(axis=1)
    triangles = np.concatenate([sides[first], third[:, None]], axis=1)
    lids = np.concatenate([fans, triangles])
    return Closed(
        np.concatenate([surfaces.corners[own], lids]),
        np.concatenate([surfaces.index[own], index[capped], index[first]]),
        number[np.concatenate([surfaces.surface[own], at[capped], at[first]])],
        np.arange(own.sum() + len(lids)) >= own.sum(),
        np.concatenate([surfaces.met[own], _sides_on_crossings(lids, crossing)]),
        surfaces.owner[wanted],
        caps[wanted],
    )


def _sides_on_crossings(
    corners: Triples, crossing: Bool[np.ndarray, " points"]
) -> Bool[np.ndarray, "n 3"]:
    """Which sides ab, bc, ca of lids join two crossings."""
    at = crossing[corners]
    return np.asarray(at & np.roll(at, -1, axis=1))


def part(closed: Closed, marks: Float[np.ndarray, " points"]) -> Parts:
    """Part closed surfaces along the sides at which the index jumps.

    Curves are in the order of the mean `marks` of their points: which one is the first one around a
    region does not depend on the order in which points were found.
    """
    corners, index, surface = closed.corners, closed.index, closed.surface
    count = len(closed.owner)
    base = int(corners.max(initial=0)) + 1
    sides = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    triangle = np.tile(np.arange(len(corners)), 3)
    order = np.lexsort([keys_of(sides, base), surface[triangle]])
    # on a closed surface every side has two triangles, one after the other
    first, second = order[::2], order[1::2]
    pairs = triangle[np.stack([first, second], axis=1)]
    met = closed.met.T.ravel()[first]
    folded = (index[pairs[:, 0]] != index[pairs[:, 1]]) | met
    region = labels(len(corners), pairs[~folded])
    region_surface, region_index = _of_regions(region, surface, index)
    folds, beside = sides[first[folded]], region[pairs[folded]]
    fold_surface = surface[pairs[folded, 0]]
    curves = rings(folds, fold_surface, count)
    curves = replace(curves, label=_in_order(curves.label, marks[folds].mean(axis=1)))
    curve_surface = np.zeros(int(curves.amount.sum()), int)
    curve_surface[curves.label] = fold_surface
    first_curve = np.full(len(region_index), len(curve_surface))
    for side in range(2):
        np.minimum.at(first_curve, beside[:, side], curves.label)
    first_curve[first_curve == len(curve_surface)] = -1
    curve_met = np.zeros(len(curve_surface), bool)
    curve_met[curves.label] = met[folded]
    jumps = np.abs(index[pairs[folded, 0]] - index[pairs[folded, 1]])
    fits = np.where(curve_met[curves.label], met[folded] & (jumps <= 1), jumps == 1)
    whole = curves.closed & (_characteristics(closed, base) == 2)
    whole &= np.bincount(region_surface, minlength=count) == curves.amount + 1
    whole[fold_surface[~fits | (met[folded] != curve_met[curves.label])]] = False
    return Parts(
        closed, region, region_surface, region_index, first_curve,
        folds, curves.label, beside, curve_surface, curve_met, whole,
    )  # fmt: skip


def _in_order(label: Items, marks: ItemValues) -> Items:
    """Labels in the order of their mean marks."""
    mean = np.bincount(label, marks) / np.maximum(np.bincount(label), 1)
    rank = np.empty(len(mean), int)
    rank[np.argsort(mean)] = np.arange(len(mean))
    return np.asarray(rank[label])


def _of_regions(
    region: Items, surface: Items, index: Items
) -> tuple[Int[np.ndarray, " regions"], Int[np.ndarray, " regions"]]:
    """Surface and index of each region."""
    some = np.zeros(int(region.max(initial=-1)) + 1, int)
    some[region] = np.arange(len(region))
    return surface[some], index[some]


def _characteristics(closed: Closed, base: int) -> Int[np.ndarray, " S"]:
    """Euler characteristic of each closed surface: vertices less half the triangles."""
    count = len(closed.owner)
    own = distinct((closed.surface[:, None] * base + closed.corners).ravel()) // base
    triangles = np.bincount(closed.surface, minlength=count)
    return np.asarray(np.bincount(own, minlength=count) - triangles // 2)


NOISE = 1e-9
"""Share of a region's volume that does not count as overturned."""


def fans_of(parts: Parts, middles: Int[np.ndarray, " curves"]) -> tuple[Triples, Items]:
    """Triangles from the middle of every curve to its sides, and the numbers of these sides."""
    middle = middles[parts.curve]
    fans = np.concatenate([np.sort(parts.folds, axis=1), middle[:, None]], axis=1)
    proper = np.flatnonzero((middle >= 0) & (fans[:, :2] != middle[:, None]).all(axis=1))
    return fans[proper], proper


def upright_apexes(
    parts: Parts,
    middles: Int[np.ndarray, " curves"],
    apexes: Int[np.ndarray, " regions"],
    place: Float[np.ndarray, "points 3"],
) -> tuple[Int[np.ndarray, " regions"], Bool[np.ndarray, " regions"]]:
    """Apexes, or points in their stead that overturn less, and the regions overturned even so.

    Of a region with a lid the point on the constraint can be taken, of one between several folds
    the middle of another. Over the faces of its grid tetrahedron a region is coned upright from all
    points inside, if the discs there are upright; those at cusps are not, at any scale, nor are
    fans of several folds that meet there: regions at folds count only if they have a lid.
    """
    fans, sides = fans_of(parts, middles)
    facets = np.concatenate([parts.closed.corners, fans, fans])
    region = np.concatenate([parts.region, *parts.beside[sides].T])
    signs = _coherent(facets, region)
    count = len(apexes)
    lidded = np.zeros(count, bool)
    lidded[parts.region[parts.closed.lid]] = True
    folded = parts.first_curve >= 0
    inner = np.concatenate([parts.closed.lid, np.ones(2 * len(fans), bool)]) | ~folded[region]
    best, least = apexes.copy(), np.full(count, np.inf)
    for candidates in (apexes, *_others(parts, middles, lidded)):
        corners = np.concatenate([facets, candidates[region, None]], axis=1)
        volume = volumes(place[corners]) * signs
        total = np.bincount(region, volume, count)
        over = np.where(inner, np.maximum(-volume * np.sign(total)[region], 0.0), 0.0)
        share = np.bincount(region, over, count) / np.maximum(np.abs(total), 1e-300)
        better = (candidates >= 0) & (share < least - NOISE)
        best[better], least[better] = candidates[better], share[better]
    return best, (least > NOISE) & (lidded | ~folded)


def _others(
    parts: Parts, middles: Int[np.ndarray, " curves"], lidded: Bool[np.ndarray, " regions"]
) -> tuple[Int[np.ndarray, " regions"], Int[np.ndarray, " regions"]]:
    """Other points from which regions can be coned: of their lid, and of their last curve."""
    last = np.full(len(lidded), -1)
    for side in parts.beside.T:
        np.maximum.at(last, side, parts.curve)
    caps = np.where(lidded, parts.closed.cap[parts.region_surface], -1)
    return caps, np.append(middles, -1)[last]


def _coherent(facets: Triples, region: Items) -> Items:
    """Signs that orient the facets around each region coherently."""
    base = int(facets.max(initial=0)) + 1
    _, own = np.unique((region[:, None] * base + facets).ravel(), return_inverse=True)
    own = own.reshape(-1, 3)
    return orientation(own, adjacency(own))[0]
