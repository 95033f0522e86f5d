"""Surfaces of discs over grid tetrahedra closed by lids on constraints, and parted along folds.

And the regions between folds, with the points from which they are coned.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from equimorph.arrays import Bool, Float, Int, ItemFlags, Items, ItemValues, Triples
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import (
    PAIR,
    adjacency,
    distinct,
    keys_of,
    labels,
    orientation,
)
from equimorph.manifold.lifting.surfaces import Surfaces, rings


@dataclass(frozen=True)
class Closed:
    """Triangles of closed surfaces: some with lids on the constraint.

    corners, index, surface, rim: of the triangles, `rim` the number of the loop that a lid closes,
    −1 for others; met: which of their sides ab, bc, ca lie where another sheet crosses; owner: grid
    tetrahedron of each surface; caps: of the loops, the point inside it from which the lid was
    drawn, −1 if there is none: on faces lie discs that a point there would be coned with.
    """

    corners: Triples
    index: Items
    surface: Items
    rim: Items
    met: Bool[np.ndarray, "n 3"]
    owner: Int[np.ndarray, " S"]
    caps: Int[np.ndarray, " rims"]

    @property
    def lid(self) -> ItemFlags:
        """Which triangles are parts of lids."""
        return np.asarray(self.rim >= 0)


@dataclass(frozen=True)
class Parts:
    """How closed surfaces are parted.

    region: of each triangle; region_surface, region_index, region_cap, first_curve: of the regions,
    the point from which their last lid was drawn and one of the curves around them (−1 if there is
    none); folds, curve, beside: sides between two indices, or
    where another sheet crosses, the closed curve that they belong to, and the regions on both
    sides; curve_surface, curve_met: of the curves, the surface and whether another sheet crosses;
    whole: surfaces that are spheres, parted without contradiction.
    """

    closed: Closed
    region: Items
    region_surface: Int[np.ndarray, " regions"]
    region_index: Int[np.ndarray, " regions"]
    region_cap: Int[np.ndarray, " regions"]
    first_curve: Int[np.ndarray, " regions"]
    folds: Int[np.ndarray, "f 2"]
    curve: Int[np.ndarray, " f"]
    beside: Int[np.ndarray, "f 2"]
    curve_surface: Int[np.ndarray, " curves"]
    curve_met: Bool[np.ndarray, " curves"]
    whole: Bool[np.ndarray, " S"]


def closed_surfaces(
    surfaces: Surfaces,
    caps: Int[np.ndarray, " rims"],
    wanted: Bool[np.ndarray, " S"],
    crossing: Bool[np.ndarray, " points"],
) -> Closed:
    """Close surfaces along their rims: from a cap, maybe on the rim, or by one triangle.

    `crossing` flags the points that are crossings: between two of them, lids are met.
    """
    number = np.cumsum(wanted) - 1
    own, open_ = wanted[surfaces.surface], wanted[surfaces.rim_surface][surfaces.rim]
    open_ &= (surfaces.sides != caps[surfaces.rim, None]).all(axis=1)
    rim, sides, index = surfaces.rim[open_], surfaces.sides[open_], surfaces.side_index[open_]
    capped = caps[rim] >= 0
    fans = np.concatenate([np.sort(sides[capped], axis=1), caps[rim[capped], None]], axis=1)
    # rims without a cap have three sides, one after the other
    order = np.flatnonzero(~capped)[np.argsort(rim[~capped], kind="stable")]
    first, second = order[::3], order[1::3]
    third = np.where(
        (sides[second] == sides[first, :1]) | (sides[second] == sides[first, 1:]), -1, sides[second]
    ).max(axis=1)
    triangles = np.concatenate([sides[first], third[:, None]], axis=1)
    lids, closing = np.concatenate([fans, triangles]), np.concatenate([rim[capped], rim[first]])
    return Closed(
        np.concatenate([surfaces.corners[own], lids]),
        np.concatenate([surfaces.index[own], index[capped], index[first]]),
        number[np.concatenate([surfaces.surface[own], surfaces.rim_surface[closing]])],
        np.concatenate([np.full(np.count_nonzero(own), -1), closing]),
        np.concatenate([surfaces.met[own], _sides_on_crossings(lids, crossing)]),
        surfaces.owner[wanted],
        np.where(np.isin(caps, surfaces.corners), -1, caps),
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
    fits = np.where(curve_met[curves.label], met[folded] & (jumps <= PAIR), jumps == 1)
    whole = curves.closed & (_characteristics(closed, base) == 2)
    whole &= np.bincount(region_surface, minlength=count) == curves.amount + 1
    whole[fold_surface[~fits | (met[folded] != curve_met[curves.label])]] = False
    region_cap = _caps_of(closed, region, len(region_index))
    return Parts(
        closed, region, region_surface, region_index, region_cap, first_curve,
        folds, curves.label, beside, curve_surface, curve_met, whole,
    )  # fmt: skip


def _caps_of(closed: Closed, region: Items, count: int) -> Int[np.ndarray, " regions"]:
    """Points from which the last lids of regions were drawn, −1 where there is none."""
    lid, last = np.flatnonzero(closed.lid), np.full(count, -1)
    np.maximum.at(last, region[lid], closed.rim[lid])
    return np.where(last >= 0, np.append(closed.caps, -1)[last], -1)


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
    cusped: Bool[np.ndarray, " regions"],
) -> tuple[Int[np.ndarray, " regions"], Bool[np.ndarray, " regions"]]:
    """Apexes, or points in their stead that overturn less, and the regions overturned even so.

    Points from which lids or folds around the region are drawn can be taken. Over the faces of its
    grid tetrahedron a region is coned upright from all points inside, if the discs there are
    upright; those at cusps are not, at any scale, nor are fans of several folds that meet there:
    regions at folds count only if they have a lid, and of those at cusps only the lids count.
    """
    fans, sides = fans_of(parts, middles)
    facets = np.concatenate([parts.closed.corners, fans, fans])
    region = np.concatenate([parts.region, *parts.beside[sides].T])
    signs = _coherent(facets, region)
    count = len(apexes)
    lidded = np.zeros(count, bool)
    lidded[parts.region[parts.closed.lid]] = True
    folded = parts.first_curve >= 0
    inner = (
        np.concatenate([parts.closed.lid, ~cusped[parts.beside[sides].T.ravel()]]) | ~folded[region]
    )
    best, least = apexes.copy(), np.full(count, np.inf)
    for candidates in (apexes, *_inner_points(parts, middles)):
        corners = np.concatenate([facets, candidates[region, None]], axis=1)
        volume = volumes(place[corners]) * signs
        total = np.bincount(region, volume, count)
        over = np.where(inner, np.maximum(-volume * np.sign(total)[region], 0.0), 0.0)
        share = np.bincount(region, over, count) / np.maximum(np.abs(total), 1e-300)
        better = (candidates >= 0) & (share < least - NOISE)
        best[better], least[better] = candidates[better], share[better]
    return best, (least > NOISE) & (lidded | ~folded)


def _inner_points(
    parts: Parts, middles: Int[np.ndarray, " curves"]
) -> Iterator[Int[np.ndarray, " regions"]]:
    """Points from which lids and folds around regions are drawn: one of each region at a time."""
    closed, lid = parts.closed, np.flatnonzero(parts.closed.lid)
    region = np.concatenate([parts.region[lid], *parts.beside.T])
    point = np.concatenate([closed.caps[closed.rim[lid]], np.tile(middles[parts.curve], 2)])
    base = int(point.max(initial=0)) + 1
    region, point = np.divmod(distinct((region * base + point)[point >= 0]), base)
    first = np.flatnonzero(np.diff(region, prepend=-1))
    rank = np.arange(len(region)) - np.repeat(first, np.diff(first, append=len(region)))
    for number in range(int(rank.max(initial=-1)) + 1):
        own = rank == number
        out = np.full(len(parts.region_cap), -1)
        out[region[own]] = point[own]
        yield out


def _coherent(facets: Triples, region: Items) -> Items:
    """Signs that orient the facets around each region coherently."""
    base = int(facets.max(initial=0)) + 1
    _, own = np.unique((region[:, None] * base + facets).ravel(), return_inverse=True)
    own = own.reshape(-1, 3)
    return orientation(own, adjacency(own))[0]
