"""Where the planar model of a rod ends: contact with itself. For leaving the plane see `space`."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures.rod.measured import Measured

SAMPLES = 129
"""Arclengths at which distances are compared first."""
POLISHING = 4
"""Newton iterations towards the closest points."""

Curve = Float[np.ndarray, "lanes samples 4"]


def stations() -> Float[np.ndarray, " samples"]:
    """Arclengths at which `closest_approach` wants the fields."""
    return np.linspace(0.0, 1.0, SAMPLES)


def closest_approach(fields: Curve, apart: float) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart` at least.

    The closest pair of samples, improved by Newton on the osculating parabolas of both points;
    third order in the spacing of the samples.

    Parameters
    ----------
    fields
        (θ, κ, x, y) at `stations`, by lengths of the rod.
    apart
        Least distance along the rod, as a share of its length.

    Returns
    -------
    Distances, and the arclength of the first point of each pair.
    """
    s = stations()
    x, y = fields[:, :, 2], fields[:, :, 3]
    far = s[None, :] - s[:, None] >= apart - 1e-12
    square = (x[:, :, None] - x[:, None]) ** 2 + (y[:, :, None] - y[:, None]) ** 2
    square = np.where(far, square, np.inf).reshape(len(x), -1)
    first, last = np.divmod(square.argmin(axis=1), len(s))
    lanes = np.arange(len(x))
    here, there = fields[lanes, first], fields[lanes, last]
    spacing = s[1]
    start, stop = np.zeros((2, len(x)))
    for _ in range(POLISHING):
        gap, (t, n), (u, m) = _gap(here, there, start, stop)
        slope = np.stack([-_dot(gap, t), _dot(gap, u)])
        a = _dot(t, t) - _dot(gap, n)
        b, c = -_dot(t, u), _dot(u, u) + _dot(gap, m)
        determinant = a * c - b * b
        with np.errstate(divide="ignore", invalid="ignore"):
            moves = (b * slope[1] - c * slope[0], b * slope[0] - a * slope[1])
            moves = tuple(np.nan_to_num(move / determinant, posinf=0, neginf=0) for move in moves)
        convex = (determinant > 0.0) & (a > 0.0)
        start = np.clip(start + np.where(convex, moves[0], 0.0), -spacing, spacing)
        stop = np.clip(stop + np.where(convex, moves[1], 0.0), -spacing, spacing)
        near = s[last] + stop - s[first] - start < apart  # at the least distance along the rod
        outside = (s[first] + start < 0.0) | (s[last] + stop > 1.0) | near
        start, stop = np.where(outside, 0.0, start), np.where(outside, 0.0, stop)
    gap = _gap(here, there, start, stop)[0]
    refined = np.minimum(np.hypot(*gap), np.sqrt(square[lanes, first * len(s) + last]))
    return np.asarray(refined), np.asarray(s[first] + start)


def _dot(a: Float[np.ndarray, "2 lanes"], b: Float[np.ndarray, "2 lanes"]) -> Values:
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def _gap(
    here: Float[np.ndarray, "lanes 4"],
    there: Float[np.ndarray, "lanes 4"],
    start: Values,
    stop: Values,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Vector from one point to the other; first and second derivatives of both places."""
    (place, *first), (other, *last) = (
        _parabola(fields, move) for fields, move in ((here, start), (there, stop))
    )
    return other - place, (first[0], first[1]), (last[0], last[1])


def _parabola(
    fields: Float[np.ndarray, "lanes 4"], move: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place on the osculating parabola, with derivatives."""
    theta, kappa, x, y = fields.T
    tangent = np.stack([np.cos(theta), np.sin(theta)])
    normal = kappa * np.stack([-tangent[1], tangent[0]])
    place = np.stack([x, y]) + move * tangent + 0.5 * move**2 * normal
    return place, tangent + move * normal, normal


def clearance(rod: Measured, apart: float) -> Descriptor:
    """Smallest distance between points that lie `apart` or further along the rod."""
    number = float(apart) if isinstance(apart, int | float) else np.nan
    if not 0.0 < number < 1.0:
        raise InputError(
            f"`apart` must be a share of the rod's length between 0 and 1; got {apart!r}."
        )
    unit = rod.units.value("length")

    def found(z: Lanes, p: Parameters) -> tuple[Values, Values]:
        return closest_approach(rod.mechanics.fields(z, p, stations()), number)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * found(z, p)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return found(z, p)[1]

    name, label = f"clearance({number:.9g})", rod.units.label("length")
    return Descriptor(name, label, value, "clearance", rod.signature, place)
