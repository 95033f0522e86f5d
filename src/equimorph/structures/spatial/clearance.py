"""How near a rod in space comes to itself."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Values
from equimorph.structures.spatial.fields import Fields

SAMPLES = 129
"""Arclengths at which distances are compared first."""
POLISHING = 4
"""Newton iterations towards the closest points."""


def stations() -> Float[np.ndarray, " samples"]:
    """Arclengths at which `closest_approach` wants the fields."""
    return np.linspace(0.0, 1.0, SAMPLES)


def closest_approach(fields: Fields, apart: float) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart` at least.

    The closest pair of samples, improved by Newton on the osculating parabolas of both points;
    third order in the spacing of the samples.

    Parameters
    ----------
    fields
        Fields at `stations`, by lengths of the rod.
    apart
        Least distance along the rod, as a share of its length.

    Returns
    -------
    Distances, and the arclength of the first point of each pair.
    """
    s, places = stations(), fields.places
    far = s[None, :] - s[:, None] >= apart - 1e-12
    square = ((places[:, :, None] - places[:, None]) ** 2).sum(axis=-1)
    square = np.where(far, square, np.inf).reshape(len(places), len(s) ** 2)
    first, last = np.divmod(square.argmin(axis=1), len(s))
    lanes, spacing = np.arange(len(places)), s[1]
    frames, bends = fields.frames, fields.strains
    normals = frames[..., 1] * bends[..., 2:3] - frames[..., 2] * bends[..., 1:2]
    curves = np.stack([places, frames[..., 0], normals], axis=-2)
    here, there = curves[lanes, first], curves[lanes, last]
    start, stop = np.zeros((2, len(places)))
    for _ in range(POLISHING):
        (x, t, n), (y, u, m) = _parabola(here, start), _parabola(there, stop)
        gap = y - x
        slope = -_dot(gap, t), _dot(gap, u)
        a, b, c = _dot(t, t) - _dot(gap, n), -_dot(t, u), _dot(u, u) + _dot(gap, m)
        determinant = a * c - b * b
        convex = (determinant > 0.0) & (a > 0.0)
        safe = np.where(convex, determinant, np.inf)
        moves = (b * slope[1] - c * slope[0]) / safe, (b * slope[0] - a * slope[1]) / safe
        start = np.clip(start + moves[0], -spacing, spacing)
        stop = np.clip(stop + moves[1], -spacing, spacing)
        near = s[last] + stop - s[first] - start < apart  # at the least distance along the rod
        outside = (s[first] + start < 0.0) | (s[last] + stop > 1.0) | near
        start, stop = np.where(outside, 0.0, start), np.where(outside, 0.0, stop)
    gap = _parabola(there, stop)[0] - _parabola(here, start)[0]
    refined = np.minimum(_dot(gap, gap), square[lanes, first * len(s) + last])
    return np.sqrt(refined), np.asarray(s[first] + start)


def _dot(a: Float[np.ndarray, "lanes 3"], b: Float[np.ndarray, "lanes 3"]) -> Values:
    return np.asarray((a * b).sum(axis=-1))


def _parabola(
    curve: Float[np.ndarray, "lanes 3 3"], move: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place on the osculating parabola, with derivatives."""
    place, tangent, normal = np.moveaxis(curve, 1, 0)
    by = move[:, None]
    return place + by * tangent + 0.5 * by**2 * normal, tangent + by * normal, normal
