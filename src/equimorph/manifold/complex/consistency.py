"""Whether cells are what they say: their index against inertia counted anew and their orientation.

Independent of how the set was lifted: every vertex is factorised once more, and every cell off
folds must project over the parameters with the sense that the parity of its index demands.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.manifold.geometry.points import CORNER, CROSSING, FOLD
from equimorph.structures import States

SLIVER = 0.03
"""Height of a cell, relative to its longest edge, below which it may be overturned beside folds."""
VANISHING = 1e-4
"""Size of the eigenvalues that may count either way at folds and where sheets cross."""


def contradicted(
    points: States,
    kinds: Int[np.ndarray, " V"],
    cells: Int[np.ndarray, "C corners"],
    cell_index: Int[np.ndarray, " C"],
) -> Bool[np.ndarray, " C"]:
    """Cells with a vertex whose inertia is not that of their index.

    At folds, and where sheets cross, the eigenvalues that vanish may count or not.
    """
    structure, singular = points.structure, singular_points(kinds)
    low = structure.index(points.z, points.p)
    high = low.copy()
    z, p = points.z[singular], points.p[singular]
    nothing, shift = np.zeros((len(z), 0, structure.size)), np.full(len(z), VANISHING)
    for bound, sign in ((low, -1.0), (high, 1.0)):
        solved = structure.solve(z, p, nothing, shift=sign * shift)
        bound[singular] = solved.negative - structure.constraints
    index = cell_index[:, None]
    return np.asarray(((index < low[cells]) | (index > high[cells])).any(axis=1))


def turned_off_folds(
    kinds: Int[np.ndarray, " V"],
    cells: Int[np.ndarray, "C corners"],
    overturned: Bool[np.ndarray, " C"],
    place: Float[np.ndarray, "V d"],
) -> Bool[np.ndarray, " C"]:
    """Overturned cells without a vertex on a fold that are no slivers, in scaled parameters."""
    off = np.flatnonzero(overturned & ~singular_points(kinds)[cells].any(axis=1))
    corners = place[cells[off]]
    sides = corners[:, 1:] - corners[:, :1]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    turned = np.zeros(len(cells), bool)
    turned[off] = np.abs(np.linalg.det(sides)) > SLIVER * longest ** sides.shape[1]
    return turned


def singular_points(kinds: Int[np.ndarray, " V"]) -> Bool[np.ndarray, " V"]:
    """Which points lie on a fold, or where sheets cross."""
    return np.isin(kinds, (FOLD, CORNER, CROSSING))
