"""Determinant of F_z along steps: whether it may touch zero, or cross it twice, inside of them.

It costs one factorisation, and says where an eigenvalue has to be looked at; see `inside_steps`.
"""

import numpy as np

from equimorph.arrays import Bool, Determinants, Float, Lanes, Parameters, Some
from equimorph.equilibria.curves import Curve
from equimorph.equilibria.locate import hermite
from equimorph.equilibria.steps import Bracket
from equimorph.linalg.determinants import in_units
from equimorph.marching.judgement_kernels import EARLY_DIP, EARLY_NEAR
from equimorph.structures import Structure

Values = Float[np.ndarray, " points"]
Trio = Float[np.ndarray, "3 steps"]
"""Places inside steps, as shares in order, or values there."""

LOOKS, APART, NEARLY_ZERO = 4, 0.05, 1e-3
"""Parabolas that lead to the least determinant inside a step; distance between places where it is
computed, as a share; value, relative to the smaller one at the ends, that counts as zero."""


def determinants(structure: Structure, z: Lanes, p: Parameters) -> Determinants:
    """Determinant of F_z at some states, m nan where it costs more than the solution."""
    return structure.respond(z, p, np.zeros((len(z), 0, p.shape[1]))).determinant


def determinant(curve: Curve, z: Lanes, t: Values) -> Determinants:
    """Determinant of F_z."""
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    return curve.advance(np.ascontiguousarray(z), t, still, one, none).determinant


def may_vanish(values: Float[np.ndarray, "3 steps"]) -> Bool[np.ndarray, " steps"]:
    """Whether what has such values at start, middle and end may touch zero or cross it twice."""
    start, middle, end = np.sign(values[0]) * values
    with np.errstate(divide="ignore", invalid="ignore"):
        bow, slope = start + end - 2.0 * middle, end - start
        least = middle - slope * (slope / (8.0 * bow))  # a determinant's square may overflow
    dips = (np.abs(slope) < 2.0 * bow) & (least < EARLY_DIP * np.minimum(start, end))
    low = np.minimum(start, end) < EARLY_NEAR * middle
    return np.asarray(dips | low | (middle < EARLY_NEAR * np.minimum(start, end)))


def hides_two_zeros(curve: Curve, step: Bracket) -> Bool[np.ndarray, " steps"]:
    """Whether the determinant of F_z, of one sign at both ends of a step, vanishes twice inside.

    Parabolas through three of its values lead to where it is least. Where that is nearly zero
    counts, too.
    """
    count = len(step.lanes)
    pair = [determinant(curve, front.z, front.t) for front in (step.before, step.after)]
    unit = pair[0][:, 1]
    ends = [in_units(each, unit) for each in pair]
    size = np.minimum(*np.abs(ends))

    def value(lanes: Some, share: Values) -> Values:
        at = determinant(curve.take(lanes), *hermite(step.take(lanes), share))
        return np.asarray(np.sign(ends[0][lanes]) * in_units(at, unit[lanes]) / size[lanes])

    with np.errstate(divide="ignore", invalid="ignore"):
        middle = value(np.arange(count), np.full(count, 0.5))
        values = np.stack([np.abs(ends[0]) / size, middle, np.abs(ends[1]) / size])
    out, lanes = np.zeros(count, bool), np.flatnonzero(may_vanish(values))
    if len(lanes) == 0:
        return out
    places, values = np.array([[0.0], [0.5], [1.0]]).repeat(len(lanes), 1), values[:, lanes]
    for _ in range(LOOKS):
        least = _least_of_parabola(places, values)
        found = value(lanes, least)
        places, values = _around_least(places, values, least, found)
    out[lanes] = values[1] < NEARLY_ZERO
    return out


def _least_of_parabola(places: Trio, values: Trio) -> Values:
    """Where the parabola through three values is least, away from their places."""
    (a, m, b), (f, g, h) = places, values
    left, right = (g - f) / (m - a), (h - g) / (b - m)
    bow = (right - left) / (b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = 0.5 * (a + m - left / bow)
    least = np.where(bow > 0.0, least, np.where(f < h, a, b))
    away = APART * (b - a)
    least = np.where(np.abs(least - m) < away, m + np.where(m - a > b - m, -away, away), least)
    return np.asarray(np.clip(least, a + away, b - away))


def _around_least(places: Trio, values: Trio, place: Values, value: Values) -> tuple[Trio, Trio]:
    """The least of three values and one more, and its neighbours on both sides."""
    all_places, all_values = np.vstack([places, place]), np.vstack([values, value])
    order = np.argsort(all_places, axis=0)
    all_places = np.take_along_axis(all_places, order, 0)
    all_values = np.take_along_axis(all_values, order, 0)
    least = 1 + np.argmin(all_values[1:3], axis=0)
    near = least + np.array([[-1], [0], [1]])
    return np.take_along_axis(all_places, near, 0), np.take_along_axis(all_values, near, 0)
