"""Points amid others corrected onto the set, together with their tangent spaces and their index.

The last factorisation of Newton's iteration gives both, so that nothing is solved a second time.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Flags, Frames, Lanes, Parameters, Rows, Values
from equimorph.manifold.geometry.embedding import embed
from equimorph.manifold.geometry.exact_points import NEWTON_STEPS, REACH
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.tangents import border_of, orthonormal

LAST = 1e-8
"""Size of a step after which there is none: its error is its square."""
FOLLOWING = 1e-13
"""Size of the following step, as far as the last two tell, that is not worth taking."""
NEAR = 1e-5
"""Size of the last step, at whose start tangent spaces and index are those of its end."""
DOUBTFUL = 1e-4
"""Pivot ratio below which the index is counted anew."""


@dataclass(frozen=True)
class Corrected:
    """Points of the set, which of them can be trusted, and what is known there."""

    z: Lanes
    p: Parameters
    frames: Frames
    index: Int[np.ndarray, " lanes"]
    found: Flags

    def take(self, some: Flags) -> "Corrected":
        """Return some of the points."""
        return Corrected(*(column[some] for column in vars(self).values()))


def corrected_amid(
    setting: Setting,
    states: tuple[Lanes, Parameters],
    middle: Float[np.ndarray, "lanes coordinates"],
    rows: Rows,
    around: Values,
) -> Corrected:
    """Newton on F = 0 in the normal spaces of planes through middles, from states nearby.

    Parameters
    ----------
    middle, rows
        Points of the embedding, and d directions each: the planes through the points.
    around
        How far neighbours are: points farther than `pins.REACH` times that cannot be trusted.
    """
    z, p = (each.copy() for each in states)
    structure, free = setting.structure, setting.free
    (lanes, size), d = z.shape, len(free)
    raw, index = np.empty((lanes, d, size + d)), np.zeros(lanes, int)
    doubtful, last = np.zeros(lanes, bool), np.full(lanes, np.inf)
    done, todo = np.zeros(lanes, bool), np.arange(lanes)
    for number in range(NEWTON_STEPS):
        own_z, own_p, own = z[todo], p[todo], rows[todo]
        away = np.einsum("ldc,lc->ld", own, embed(setting, own_z, own_p) - middle[todo])
        rhs = np.zeros((len(todo), 1 + (d if number else 0), size + d))
        rhs[:, 0, :size], rhs[:, 0, size:] = -structure.residual(own_z, own_p), -away
        if number:
            rhs[:, 1:, size:] = np.eye(d)
        solved = structure.solve(own_z, own_p, rhs, border_of(setting, own_z, own_p, own))
        step = solved.x[:, 0]
        now, before = np.abs(step).max(axis=1), last[todo]
        share = np.minimum(1.0, 0.5 / np.maximum(now, 1e-300))[:, None] * step
        z[todo] += share[:, :size]
        p[np.ix_(todo, free)] += share[:, size:] * setting.scales
        last[todo] = now
        if number:
            raw[todo], index[todo] = solved.x[:, 1:], solved.negative - structure.constraints
            doubtful[todo] = solved.pivoted | (solved.pivot_ratio < DOUBTFUL)
            near = (now < NEAR) & (now**3 < FOLLOWING * before**2)
            done[todo] = near | (now < LAST)
        todo = todo[~done[todo] & np.isfinite(now)]
        if len(todo) == 0:
            break
    gap = np.linalg.norm(embed(setting, z, p) - middle, axis=1)
    found = done & (gap <= REACH * around + 1e-3)
    for constraint in setting.constraints:
        found[found] &= constraint.excess(z[found], p[found]) < 1e-9
    frames = np.zeros_like(raw)
    frames[found] = orthonormal(setting, raw[found])
    doubtful &= found
    index[doubtful] = structure.index(z[doubtful], p[doubtful])
    return Corrected(z, p, frames, index, found)
