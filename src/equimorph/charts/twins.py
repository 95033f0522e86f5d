"""Second states beside given ones with the same coordinates, where these nearly fold.

Along the direction v in which the coordinates change least, their component along u follows
``σ t + c t²/2``, which vanishes again at ``t = −2σ/c``. The curvature c comes from points on both
sides along v, on the set to second order, so that no singular state has to be known.
"""

import numpy as np

from equimorph.arrays import Float, Items, Lanes, Parameters, Points, Rows
from equimorph.charts.coordinates import Coordinates, solve_on_the_set
from equimorph.charts.location import Cells, Found
from equimorph.charts.singular_pairs import unite
from equimorph.manifold.geometry.tangents import InPlanes, split_step
from equimorph.structures import States

STEP = 0.02
"""Step along the set, in the metric, by which the bending of the coordinates is measured."""
FARTHEST = 0.5
"""Distance along the set, in the metric, within which a second state is looked for."""


def add_twins(cells: Cells, found: Found, points: Points) -> Found:
    """States found over points, and their twins on the same cells."""
    if len(found.point) == 0:
        return found
    place = np.searchsorted(cells.numbers, found.cell)
    rows = cells.planes(place)
    z, p, of = _guesses(cells.coordinates, found.states.z, found.states.p, rows, cells.ranges)
    if len(of) == 0:
        return found
    own = solve_on_the_set(cells.coordinates, z, p, points[found.point[of]], rows[of])
    some = own.found.nonzero()[0]
    states, of = States(cells.eset.structure, own.z[some], own.p[some]), of[some]
    cell = cells.nearest(states)
    good = np.flatnonzero(cells.hold(states, own.index[some], cell))
    new = Found(
        states[good],
        found.point[of[good]],
        cells.numbers[cell[good]],
        np.zeros(len(good), bool),
    )
    return unite(cells, found, new)


def _guesses(
    coordinates: Coordinates, z: Lanes, p: Parameters, rows: Rows, ranges: np.ndarray
) -> tuple[Float[np.ndarray, "n size"], Float[np.ndarray, "n parameters"], Items]:
    """Guesses of the twins that are near enough, and the number of the state of each."""
    setting = coordinates.setting
    planes = InPlanes(setting, z, p, rows)
    frames = planes.frames
    slopes = coordinates.derivative(z, p, frames) / ranges[:, None]
    left, sizes, right = np.linalg.svd(slopes)
    steps = np.einsum("lk,lkf->lf", right[:, -1], frames)
    dz, dp = split_step(setting, steps)
    bent = split_step(setting, planes.bend_along(steps))
    # both sides at once: single states cost calls, not arithmetic
    every = (
        np.concatenate([here, here - STEP * d + half, here + STEP * d + half])
        for here, d, half in ((z, dz, 0.5 * STEP**2 * bent[0]), (p, dp, 0.5 * STEP**2 * bent[1]))
    )
    here, below, above = (coordinates(*every) / ranges).reshape(3, *slopes.shape[:2])
    second = (below - 2.0 * here + above) / STEP**2
    bend = np.einsum("lm,lm->l", left[:, :, -1], second)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -2.0 * sizes[:, -1] / bend
    near = (np.abs(t) < FARTHEST).nonzero()[0]
    move = t[near, None]
    return z[near] + move * dz[near], p[near] + move * dp[near], near
