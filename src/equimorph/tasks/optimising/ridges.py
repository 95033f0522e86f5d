"""Highest points of the curves on which a map of limit loads bends or jumps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Pair
from equimorph.equilibria.critical import Critical, Test, null_border
from equimorph.equilibria.critical_tests import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.locus import Locus, Spots, advance, nearest
from equimorph.model import position
from equimorph.structures import State
from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap
from equimorph.tolerances import LAST_STEP

ITERATIONS = 20
"""Steps along a curve towards its highest point."""
LONGEST, LEVEL = 0.05, 1e-12
"""Longest step along a curve; slope of the load at which its top is reached."""
CLOSE = 1e-6
"""Distance from a curve, in scales, at which its sides are examined."""
ALIKE = 1e-7
"""Difference of limit loads on a curve and next to it up to which the map is continuous there."""
WIDEST, NARROW = 0.02, 1e-4
"""Distances along a cliff between the values of the first and the last polynomial."""
STENCIL, SURE = np.arange(-3.0, 4.0), 3e-5
"""Places of these values; share of the last term in the bend of a polynomial that is trusted."""
BESIDE = 10.0 ** -np.arange(2.0, 7.0)
"""Distances from a ridge, in scales, at which both sides are examined."""
SLOPE = 1e-3
"""First step along a curve, to see how its slope changes."""
MET = 1e-6
"""Size of a test that vanishes."""


@dataclass(frozen=True)
class Ridge:
    """Highest point of a curve of a map."""

    setting: Pair
    """Where."""
    value: float
    """Limit load on the curve, or on the higher side of a cliff."""
    slope: float
    """Slope of the load along the curve, per unit of length; zero at an exact optimum."""
    across: Pair
    """Direction across the curve in the plane of settings, of unit length in scales."""
    cliff: bool
    """Whether the value is the limit from one side only."""
    sides: Float[np.ndarray, "2 distances"] | None = None
    """Of a cliff: limit loads on both sides, at distances `BESIDE`."""


def highest_point(lmap: LimitLoadMap, curve: MapCurve) -> Ridge | None:
    """Highest point of a curve whose states are known by the tests that vanish; else None."""
    best = np.maximum(np.nan_to_num(curve.values[:, 1]), curve.states[lmap.load])
    number = int(best.argmax())
    tests = _tests(lmap, curve.kind, curve.states[number])
    if tests is None:
        return None
    structure = lmap.structure
    names = (*lmap.grid.names, lmap.load)
    free = np.array([position(structure.parameters, name) for name in names])
    z, p = curve.states.z[number], curve.states.p[number]
    locus = Locus(structure, p, free, tests, False, singular=curve.kind != "grazing")
    spot, found = nearest(locus, locus.join(z[None], p[None]))
    if not found[0]:
        return None
    beside = _beside(lmap, spot)
    if spot.x[0, -1] >= beside.max() - ALIKE:
        return _top_of_ridge(lmap, locus, spot)
    return _top_of_cliff(lmap, locus, spot, 1.0 if beside[1] > beside[0] else -1.0)


def _beside(lmap: LimitLoadMap, spot: Spots) -> Float[np.ndarray, " 2"]:
    """Limit loads close to a curve on both sides."""
    step = CLOSE * normal_of(lmap, spot)
    place = spot.x[0, -3:-1]
    values = lmap.rays(np.stack([place - step, place + step]))
    return np.asarray(np.nan_to_num(values, nan=-np.inf))


def _step_along(locus: Locus, spot: Spots, step: float) -> Spots | None:
    """Point of a curve at a step along it; None if it is not found."""
    there, found = advance(locus, spot, np.array([step]))
    return there if found[0] else None


def _top_of_ridge(lmap: LimitLoadMap, locus: Locus, spot: Spots | None) -> Ridge | None:
    """Make the load stationary along the curve, by Newton's method on its slope."""
    for _ in range(ITERATIONS):
        if spot is None:
            return None
        slope = _rise(spot)
        if abs(slope) < LEVEL:
            break
        ahead = _step_along(locus, spot, SLOPE)
        if ahead is None:
            return None
        change = (_rise(ahead) - slope) / SLOPE
        step = -slope / change if change < 0.0 else LONGEST * float(np.sign(slope))
        step = float(np.clip(step, -LONGEST, LONGEST))
        if abs(step) < LAST_STEP:
            break
        spot = _step_along(locus, spot, step)
    if spot is None:
        return None
    value, slope = float(spot.x[0, -1]), abs(_rise(spot))
    return Ridge(spot.x[0, -3:-1], value, slope, normal_of(lmap, spot), False)


def _top_of_cliff(lmap: LimitLoadMap, locus: Locus, spot: Spots, side: float) -> Ridge | None:
    """Climb the limit load on the higher side of a cliff along the curve, by polynomials."""
    width = WIDEST
    for _ in range(ITERATIONS):
        values = _along(lmap, locus, spot, side, width)
        if values is None:  # the curve ends, or the cliff does
            width *= 0.2
        else:
            top, unsure = _top_of(values)
            ahead = _step_along(locus, spot, top * width) if top != 0.0 else spot
            if ahead is None:
                return None
            spot = ahead
            if abs(top) < STENCIL[-1]:
                if unsure < SURE:
                    break
                width *= 0.2
        if width < NARROW:
            break
    return _cliff_at(lmap, locus, spot, side)


def _along(
    lmap: LimitLoadMap, locus: Locus, spot: Spots, side: float, width: float
) -> Float[np.ndarray, " stencil"] | None:
    """Limit loads close to a curve, on one side of it, at steps of a width along it."""
    spots = [spot if step == 0.0 else _step_along(locus, spot, step * width) for step in STENCIL]
    known = [each for each in spots if each is not None]
    if len(known) < len(spots):
        return None
    places = [each.x[0, -3:-1] + side * CLOSE * _align(lmap, each, spot) for each in known]
    values = lmap.rays(np.array(places))
    return values if np.isfinite(values).all() else None


def _top_of(values: Float[np.ndarray, " stencil"]) -> tuple[float, float]:
    """Where a polynomial through values is largest, in widths, and how large its last term is.

    The terms are relative to the quadratic one: truncation moves the maximum by less than that.
    """
    powers = np.linalg.solve(np.vander(STENCIL, increasing=True), values)
    polynomial = np.polynomial.Polynomial(powers)
    roots = polynomial.deriv().roots()
    real = roots.real[np.abs(roots.imag) < 1e-9]
    tried = np.concatenate([STENCIL[[0, -1]], real[np.abs(real) < STENCIL[-1]]])
    share = abs(powers[-1]) / max(abs(powers[2]), 1e-300)
    return float(tried[polynomial(tried).argmax()]), float(share)


def _cliff_at(lmap: LimitLoadMap, locus: Locus, spot: Spots, side: float) -> Ridge | None:
    """Value, slope and sides of a cliff at a point of its curve."""
    setting, across = spot.x[0, -3:-1], normal_of(lmap, spot)
    ends = [_step_along(locus, spot, step) for step in (-NARROW, NARROW)]
    known = [each for each in ends if each is not None]
    if len(known) < len(ends):
        return None
    along = [each.x[0, -3:-1] + side * CLOSE * _align(lmap, each, spot) for each in known]
    near = setting + side * CLOSE * np.array([[1.0], [2.0]]) * across
    values = lmap.rays(np.concatenate([near, along, settings_across(setting, across)]))
    one, two, left, right = values[:4].tolist()
    slope = abs(right - left) / (2.0 * NARROW)
    return Ridge(setting, 2.0 * one - two, slope, across, True, values[4:].reshape(2, -1))


def settings_across(setting: Pair, across: Pair) -> Float[np.ndarray, "settings 2"]:
    """Settings on one side and on the other, at distances `BESIDE`."""
    steps = BESIDE[:, None] * across
    return np.concatenate([setting - steps, setting + steps])


def _align(lmap: LimitLoadMap, spot: Spots, other: Spots) -> Pair:
    """Direction across the curve that points to the same side as at another of its points."""
    own, theirs = normal_of(lmap, spot), normal_of(lmap, other)
    return np.asarray(own * (1.0 if own @ theirs > 0.0 else -1.0))


def _rise(spot: Spots) -> float:
    """Slope of the load, the last coordinate, along the curve."""
    return float(spot.tangent[0, -1])


def _tests(lmap: LimitLoadMap, kind: str, state: State) -> tuple[Test, ...] | None:
    """What vanishes along a curve of a map; None if that is not known."""
    structure = lmap.structure
    limits = [bound(each) for each in lmap.within]
    if kind == "branch point":
        return gap, branching(structure, lmap.load)
    if kind == "cusp":
        return gap, quadratic
    met = _vanishing(limits, state)
    if kind == "exchange" and met:
        return (gap, limits[met[0]]) if len(met) == 1 else (limits[met[0]], limits[met[1]])
    if kind == "grazing" and met:
        touched = lmap.within[met[0]]
        return limits[met[0]], grazing(structure, touched, lmap.load)
    return None


def _vanishing(tests: Sequence[Test], state: State) -> list[int]:
    z, p = state.z[None].copy(), state.p[None].copy()
    at = Critical(state.structure, z, p, null_border(state.structure, z, p))
    return [k for k, test in enumerate(tests) if abs(float(test(at)[0])) < MET]


def normal_of(lmap: LimitLoadMap, spot: Spots) -> Float[np.ndarray, " 2"]:
    """Direction across a curve in the plane of settings, of unit length in their scales."""
    structure = lmap.structure
    scales = np.array(
        [structure.scales[position(structure.parameters, name)] for name in lmap.grid.names]
    )
    along = spot.tangent[0, -3:-1] / scales
    across = np.array([-along[1], along[0]])
    return np.asarray(scales * across / np.linalg.norm(across))
