"""Which of many points are different.

Only points are compared whose projections on a line are as close as the tolerance: of n points some
n log n, not n².
"""

from bisect import bisect_left, bisect_right, insort
from functools import lru_cache

import numpy as np

from equimorph.arrays import Bool, Float, Int

Places = Float[np.ndarray, "points coordinates"]

ROOM = 1e-9
"""Added to the tolerance, as a share of the largest coordinate, for round-off of projections."""
AT_ONCE = 4_000_000
"""Most numbers that pairs of points may fill while they are compared."""


def firsts_apart(places: Places, tolerance: float, known: int = 0) -> Int[np.ndarray, " distinct"]:
    """Numbers of the points that lie further than a tolerance from all earlier ones of these.

    The first `known` are taken to be different.
    """
    position = places @ _line(places.shape[1])
    reach = tolerance + ROOM * float(np.abs(places).max(initial=0.0))
    fresh = np.arange(known, len(places))
    if known:
        fresh = fresh[~_beside_known(places, position, known, tolerance, reach)]
    kept, line = list(range(known)), list[tuple[float, int]]()
    for k, there in zip(fresh.tolist(), position[fresh].tolist(), strict=True):
        first = bisect_left(line, (there - reach, -1))
        last = bisect_right(line, (there + reach, len(places)))
        near = [other for _, other in line[first:last]]
        if near and np.linalg.norm(places[near] - places[k], axis=1).min() <= tolerance:
            continue
        insort(line, (there, k))
        kept.append(k)
    return np.array(kept, dtype=int)


@lru_cache(maxsize=64)
def _line(width: int) -> Float[np.ndarray, " coordinates"]:
    """Direction of the line on which points are projected."""
    along = np.random.default_rng(0).normal(size=width)
    return np.asarray(along / np.linalg.norm(along))


def _beside_known(
    places: Places,
    position: Float[np.ndarray, " points"],
    known: int,
    tolerance: float,
    reach: float,
) -> Bool[np.ndarray, " others"]:
    """Whether each of the other points lies beside one of the first."""
    order = np.argsort(position[:known])
    line, others = position[order], position[known:]
    first, last = np.searchsorted(line, others - reach), np.searchsorted(line, others + reach)
    beside = np.zeros(len(others), bool)
    block = max(1, AT_ONCE // max(1, places.shape[1]))
    point = np.repeat(np.arange(len(others)), last - first)
    start = np.repeat(first - np.cumsum(last - first) + (last - first), last - first)
    other = order[start + np.arange(len(point))]
    for k in range(0, len(point), block):
        mine, theirs = point[k : k + block], other[k : k + block]
        gap = np.linalg.norm(places[known + mine] - places[theirs], axis=1)
        beside[mine[gap <= tolerance]] = True
    return beside
