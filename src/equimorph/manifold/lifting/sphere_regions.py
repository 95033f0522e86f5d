"""Closed surfaces parted along their folds: regions of one index, and the curves between them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from equimorph.manifold.geometry.topology import distinct, keys_of, labels
from equimorph.manifold.lifting.spheres import Surfaces, rings


@dataclass(frozen=True)
class Closed:
    """Triangles of closed surfaces: some with a lid on the constraint.

    corners, index, surface, lid: of the triangles; met: which of their sides ab, bc, ca lie where
    another sheet crosses; owner, cap: of the surfaces, their grid
    tetrahedron, and the point from which the lid was drawn (−1 if there is none).
    """

    corners: Int[np.ndarray, "n 3"]
    index: Int[np.ndarray, " n"]
    surface: Int[np.ndarray, " n"]
    lid: Bool[np.ndarray, " n"]
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
    region: Int[np.ndarray, " n"]
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
    """Close wanted surfaces along their rims: from a cap, maybe on the rim, or by one triangle.

    `crossing` tells which points are crossings: between two of them, lids are met.
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
        np.concatenate([surfaces.met[own], _met(lids, crossing)]),
        surfaces.owner[wanted],
        caps[wanted],
    )


def _met(
    corners: Int[np.ndarray, "n 3"], crossing: Bool[np.ndarray, " points"]
) -> Bool[np.ndarray, "n 3"]:
    """Which sides ab, bc, ca of lids join two crossings."""
    at = crossing[corners]
    return np.asarray(at & np.roll(at, -1, axis=1))


def part(closed: Closed) -> Parts:
    """Part closed surfaces along the sides at which the index jumps."""
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


def _of_regions(
    region: Int[np.ndarray, " n"], surface: Int[np.ndarray, " n"], index: Int[np.ndarray, " n"]
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
