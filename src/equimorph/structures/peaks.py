"""Local maxima of sampled functions that are smooth piece by piece."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

Columns = tuple[Float[np.ndarray, "lanes m"], Float[np.ndarray, "lanes m"]]

HALF = 4
"""Half the degree of the polynomials through neighbouring samples."""
INTERVALS = 16
"""Equal intervals of each piece."""
NEWTON = 5


def stations(breaks: Float[np.ndarray, " ends"]) -> Float[np.ndarray, " samples"]:
    """Places at which `peaks` wants the samples: each piece between breaks in equal intervals."""
    share = np.arange(INTERVALS) / INTERVALS
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * share
    return np.append(inner.ravel(), breaks[-1])


def peaks(values: Float[np.ndarray, "lanes samples"], at: Float[np.ndarray, " samples"]) -> Columns:
    """Local maxima of functions sampled at `stations`, ends included.

    Returned are their values, −∞ where a lane has fewer than others, and their places. Polynomials
    of degree 8 never cross the ends of pieces.
    """
    low = np.full((len(values), 1), -np.inf)
    left = np.concatenate([low, values[:, :-1]], axis=1)
    right = np.concatenate([values[:, 1:], low], axis=1)
    lane, sample = np.nonzero((values >= left) & (values > right))
    height, place = _polished(values, at, lane, sample)
    number = np.arange(len(lane)) - np.searchsorted(lane, lane)
    most = int(number.max(initial=0)) + 1
    out, places = np.full((len(values), most), -np.inf), np.zeros((len(values), most))
    out[lane, number], places[lane, number] = height, place
    return out, places


@lru_cache(maxsize=1)
def _inverse() -> Float[np.ndarray, "powers samples"]:
    """Coefficients of the polynomial through samples at −HALF … HALF."""
    return np.asarray(np.linalg.inv(np.vander(np.arange(-HALF, HALF + 1.0), increasing=True)))


def _polished(
    values: Float[np.ndarray, "lanes samples"],
    at: Float[np.ndarray, " samples"],
    lane: Int[np.ndarray, " n"],
    sample: Int[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Heights and places of maxima near samples, from the pieces on both sides."""
    height, place = values[lane, sample], at[sample]
    pieces = (values.shape[1] - 1) // INTERVALS
    for side in (-1, 0):
        piece = np.clip((sample + side) // INTERVALS, 0, pieces - 1)
        first = piece * INTERVALS
        middle = np.clip(sample, first + HALF, first + INTERVALS - HALF)
        window = values[lane[:, None], middle[:, None] + np.arange(-HALF, HALF + 1)]
        powers, start = window @ _inverse().T, (sample - middle).astype(float)
        low = np.maximum(start - 1.0, first - middle)
        high = np.minimum(start + 1.0, first + INTERVALS - middle)
        x = _climbed(powers, start, low, high)
        better = _value(powers, x) > height
        width = at[first + 1] - at[first]
        height = np.where(better, _value(powers, x), height)
        place = np.where(better, at[middle] + x * width, place)
    return height, place


def _climbed(
    powers: Float[np.ndarray, "n terms"],
    x: Float[np.ndarray, " n"],
    low: Float[np.ndarray, " n"],
    high: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    """Maxima of polynomials between bounds, by Newton's method."""
    slope = powers[:, 1:] * np.arange(1, powers.shape[1])
    bend = slope[:, 1:] * np.arange(1, slope.shape[1])
    for _ in range(NEWTON):
        second = _value(bend, x)
        concave = second < 0.0
        step = np.where(concave, -_value(slope, x) / np.where(concave, second, 1.0), 0.0)
        x = np.clip(x + step, low, high)
    return x


def _value(
    powers: Float[np.ndarray, "n terms"], x: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    total = np.zeros(len(x))
    for column in powers.T[::-1]:
        total = total * x + column
    return total
