"""Exact points confined to a grid cell: what lies over it projects inside it.

A point amid others that lies beyond a face of their grid cell would turn cells over, far beyond
folds. Newton's method leads there where a fold or a constraint is strongly curved, and anywhere
where a constraint has a kink.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Values
from equimorph.manifold.geometry.exact_points import Pinned, Span, middles, pin
from equimorph.manifold.geometry.points import AMID, CAP, FOLD, Points
from equimorph.manifold.geometry.setting import Setting

SHARES = (0.25, 0.5, 0.8, 0.95)
"""Shares of the way from the middle of a group to one of its points, at which is tried again."""
TRIED = 8
"""Points of a group towards which is tried at most."""
ON_FACE = 1e-9
"""Barycentric coordinate below which a point lies on a face of a grid cell."""

Frames = Float[np.ndarray, "lanes corners d"]


def pin_confined(
    setting: Setting,
    points: Points,
    groups: Sequence[Sequence[int]],
    kind: int,
    span: Span,
    frames: Frames,
) -> Pinned:
    """Exact points amid groups, inside grid cells and of the right index.

    Where the one in the normal space through the middle is not, those through points between the
    middle and one of the group are tried: near its own points a constraint with kinks is smooth,
    and a fold does not leave the cell. Folds may bulge beyond a face between edges that they do not
    meet, and behind cusps: if none of their points is inside, the one least far outside is taken.

    Parameters
    ----------
    groups, kind, span
        As in `pins.pin`.
    frames
        Corners of the grid cells, in free parameters.
    """
    low = np.array([points.index[list(group)].min() for group in groups], int)
    sizes = np.array([len(group) for group in groups])
    z, p, _ = middles(setting, points, groups)
    best = np.full(len(groups), -np.inf if kind == FOLD else ON_FACE)
    found = np.zeros(len(groups), bool)
    towards = product(SHARES, range(min(TRIED, int(sizes.max(initial=0)))))
    for share, member in ((0.0, 0), *towards):
        lanes = np.flatnonzero((~found | (best <= ON_FACE)) & (sizes > member))
        if len(lanes) == 0:
            continue
        own = [groups[lane] for lane in lanes.tolist()]
        pinned = pin(setting, points, own, kind, span[lanes], (member, share))
        depth = np.where(pinned.found, depths(frames[lanes], pinned.p[:, setting.free]), -np.inf)
        if kind in {CAP, AMID}:
            near = np.flatnonzero(depth > best[lanes])
            index = setting.structure.index(pinned.z[near], pinned.p[near])
            depth[near[index != low[lanes[near]]]] = -np.inf
        better = depth > best[lanes]
        at = lanes[better]
        z[at], p[at], best[at], found[at] = pinned.z[better], pinned.p[better], depth[better], True
    return Pinned(z, p, found)


def depths(frames: Frames, points: Float[np.ndarray, "lanes d"]) -> Values:
    """Smallest barycentric coordinates in simplices with these corners; negative outside."""
    sides = frames[:, 1:] - frames[:, :1]
    shares = np.einsum("ld,ldk->lk", points - frames[:, 0], np.linalg.pinv(sides))
    return np.asarray(np.minimum(shares.min(axis=1), 1.0 - shares.sum(axis=1)))
