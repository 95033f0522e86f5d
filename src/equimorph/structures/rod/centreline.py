"""Centrelines of rods, in the plane and in space, and how near they come to themselves."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Values

SAMPLES = 129
"""Arclengths at which distances are compared first."""
POLISHING = 4
"""Newton iterations towards the closest points."""
EQUAL_ARCLENGTHS = 1e-12
"""Round-off of the difference of two arclengths."""

Vectors = Float[np.ndarray, "lanes points axes"]
Spots = Float[np.ndarray, "lanes axes"]


@dataclass(frozen=True, eq=False)
class Centreline:
    """Centreline of a rod at arclengths, with the axes of its cross-sections.

    Attributes
    ----------
    places
        Coordinates, in the unit of `length`.
    tangents
        Unit vectors.
    normals
        The other axes of the cross-sections: in the plane one, on the left; in space n and b.
    bends
        Derivatives of the tangents with respect to the arclength, a share of the length.
    length
        That of the rod; arclengths are shares of it.
    """

    places: Vectors
    tangents: Vectors
    normals: Float[np.ndarray, "lanes points normals axes"]
    bends: Vectors
    length: float


def stations() -> Float[np.ndarray, " samples"]:
    """Arclengths at which `closest_approach` needs the centreline."""
    return np.linspace(0.0, 1.0, SAMPLES)


def closest_approach(line: Centreline, apart: float) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart`, and where it is.

    The closest pair of samples at `stations`, improved by Newton on the osculating parabolas of
    both points; third order in the spacing of the samples. `apart` is the least difference, as a
    share of the length; the arclength is that of the first point of each pair.
    """
    s, places = stations(), line.places
    far = s[None, :] - s[:, None] >= apart - EQUAL_ARCLENGTHS
    square = np.zeros((len(places), len(s), len(s)))
    for x in np.moveaxis(places, 2, 0):
        square += (x[:, :, None] - x[:, None]) ** 2
    squares = np.where(far, square, np.inf).reshape(len(places), len(s) ** 2)
    first, last = np.divmod(squares.argmin(axis=1), len(s))
    lanes, spacing = np.arange(len(places)), s[1]
    length = line.length
    curves = np.stack([places, length * line.tangents, length * line.bends], axis=-2)
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
    refined = np.minimum(_dot(gap, gap), squares[lanes, first * len(s) + last])
    return np.sqrt(refined), np.asarray(s[first] + start)


def _dot(a: Spots, b: Spots) -> Values:
    return np.asarray((a * b).sum(axis=-1))


def _parabola(
    curve: Float[np.ndarray, "lanes 3 axes"], move: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place on the osculating parabola, with derivatives."""
    place, tangent, bend = np.moveaxis(curve, 1, 0)
    by = move[:, None]
    return place + by * tangent + 0.5 * by**2 * bend, tangent + by * bend, bend
