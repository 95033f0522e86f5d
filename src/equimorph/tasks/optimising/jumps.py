"""Where an optimum that is followed ends: its curvature falls like a square root before."""

import numpy as np

INSIDE, OUTSIDE = 0.95, 3.0
"""Where the end is approached, in shares of the way to where it is expected."""
CLOSE = 0.02
"""Way to the expected end, relative to that to a known failure, at which its far side is tried."""


def expected_end(times: tuple[float, float], curvatures: tuple[float, float]) -> float:
    """Time at which a minimum merges with a saddle, from its curvatures at two times before.

    Its square falls to zero in proportion to the time that is left. Not a number where it does not
    fall.
    """
    (t, later), (first, second) = times, curvatures
    if not 0.0 < second < first < np.inf:
        return np.nan
    return float(later + (later - t) * second**2 / (first**2 - second**2))


def tried_next(here: float, end: float, failure: float) -> float:
    """Time between an optimum and a failure to look at next, near the expected end."""
    gap = end - here
    if gap > CLOSE * (failure - here):
        return here + INSIDE * gap
    return here + OUTSIDE * gap


def extrapolated(times: tuple[float, float], ahead: float, end: float) -> float:
    """Step of what moves like the square root of the time left, in last steps; or evenly."""
    first, second = times
    if not (second < ahead < end):
        return (ahead - second) / (second - first)
    left = np.sqrt([end - first, end - second, end - ahead])
    return float((left[1] - left[2]) / (left[0] - left[1]))
