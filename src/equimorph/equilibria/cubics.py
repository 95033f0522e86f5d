"""Cubics through values and slopes at both ends of a step: what a scalar does in between."""

import numpy as np

from equimorph.arrays import Values


def least_inside(
    values: tuple[Values, Values], slopes: tuple[Values, Values], length: Values
) -> tuple[Values, Values]:
    """Place and least value of the cubics; places are shares of the length, ends included."""
    (f, g), (a, b) = values, (slopes[0] * length, slopes[1] * length)
    c2, c3 = 3.0 * (g - f) - 2.0 * a - b, a + b - 2.0 * (g - f)
    # roots of the slope a + 2 c2 s + 3 c3 s², without cancellation
    root = np.sqrt(np.maximum(c2**2 - 3.0 * a * c3, 0.0))
    sum_ = -(c2 + np.where(c2 >= 0.0, root, -root))
    with np.errstate(divide="ignore", invalid="ignore"):
        turns = np.stack([a / sum_, sum_ / (3.0 * c3)])
    shares = np.stack([np.zeros_like(f), np.ones_like(f), *np.nan_to_num(turns, posinf=0.0)])
    shares = np.clip(shares, 0.0, 1.0)
    heights = f + shares * (a + shares * (c2 + shares * c3))
    at = np.argmin(heights, axis=0)[None]
    return np.take_along_axis(shares, at, 0)[0], np.take_along_axis(heights, at, 0)[0]
