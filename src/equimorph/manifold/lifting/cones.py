"""From which points the regions of spheres are coned: so that no tetrahedron is overturned."""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.geometry.topology import adjacency, orientation
from equimorph.manifold.lifting.sphere_regions import Parts

NOISE = 1e-9
"""Share of a region's volume that does not count as overturned."""


def fans_of(
    parts: Parts, middles: Int[np.ndarray, " curves"]
) -> tuple[Int[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
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


def _coherent(
    facets: Int[np.ndarray, "n 3"], region: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " n"]:
    """Signs that orient the facets around each region coherently."""
    base = int(facets.max(initial=0)) + 1
    _, own = np.unique((region[:, None] * base + facets).ravel(), return_inverse=True)
    own = own.reshape(-1, 3)
    return orientation(own, adjacency(own))[0]
