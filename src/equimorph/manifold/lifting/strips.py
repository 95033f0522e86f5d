"""Strips of a set between a fold and a constraint, where they are narrower than grid triangles.

A strip that passes over a vertex shows the fold and the constraint on the sides around it, and the
polygon there looks like one that ends in a corner, where both meet. But both lead on, through a
side which lies across the strip and has no vertex over it, so that it shows nothing. There it is to
be split: the next vertex lies over the strip, too, and in a few rounds it is known from end to end.
See docs/decisions.md, "Strips between a fold and a constraint are led along".
"""

import numpy as np

from equimorph.arrays import Float, Int, Items
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.tangents import cap_normals, fold_forms
from equimorph.manifold.lifting.courses import WaysOut, split_sides, ways_out
from equimorph.manifold.lifting.pairing import Pairing


def strips_astray(pairing: Pairing, astray: Int[np.ndarray, "a 4"]) -> dict[int, float]:
    """Sides through which strips leave triangles, and where between the fold and the constraint.

    `astray`: triangles with the fold and both ends of an open polygon without a corner. Where both
    sheets go on beside the fold, the side is split over the narrower of them. And sides over which
    rings close, in the middle of these.
    """
    out = dict(pairing.rings)
    kind = pairing.points.kind[astray[:, 1:3]]
    astray = astray[(kind == [VertexKind.FOLD, VertexKind.CAP]).all(axis=1)]
    if len(astray) == 0:
        return out
    triangle, fold = astray[:, 0], astray[:, 1]
    along = [_ways(pairing, triangle, fold, end) for end in astray[:, 2:].T]
    width = np.stack([_widths(each) for each in along])
    chosen, known = width.argmin(axis=0), np.isfinite(width).any(axis=0)
    for k, ways in enumerate(along):
        own = np.flatnonzero(known & (chosen == k))
        out |= split_sides(pairing.mesh, triangle[own], ways.take(own))
    return out


def _ways(pairing: Pairing, triangle: Items, fold: Items, end: Items) -> WaysOut:
    """Where folds and constraints lead, straight, out of triangles."""
    setting, points = pairing.setting, pairing.points
    across = fold_forms(setting, points.z[fold], points.p[fold]).existence
    normals = np.stack([across, cap_normals(setting, points.z[end], points.p[end])], axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    return ways_out(pairing, np.stack([fold, end], axis=1), triangle, normals)


def _widths(ways: WaysOut) -> Float[np.ndarray, " a"]:
    """Distances between fold and constraint where they leave; infinite where they do not so."""
    gap = np.linalg.norm(ways.places[:, 1] - ways.places[:, 0], axis=1)
    return np.where(ways.together & ~ways.cross, gap, np.inf)
