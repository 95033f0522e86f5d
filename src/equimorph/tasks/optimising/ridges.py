"""Highest points of the curves on which a map of limit loads bends or jumps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.equilibria.conditions import bound, branching, gap, grazing, quadratic
from equimorph.equilibria.critical import Critical, null_border
from equimorph.equilibria.locus import Locus, Spot, Test, advance, settle
from equimorph.model import position
from equimorph.structures import State
from equimorph.tasks.maps import LimitLoadMap, MapCurve

Pair = Float[np.ndarray, " 2"]

ITERATIONS = 20
LONGEST, LEVEL = 0.05, 1e-12
"""Longest step along a curve; slope of the load at which its top is reached."""
STILL = 1e-9
CLOSE = 1e-6
"""Distance from a curve, in scales, at which its sides are looked at."""
ALIKE = 1e-7
WIDEST, NARROW = 0.02, 1e-4
"""Distances along a cliff between the values of the first and the last parabola."""
SLOPE = 1e-3
"""First step along a curve, to see how its slope changes."""
MET = 1e-6
"""Size of a test that vanishes."""


@dataclass(frozen=True)
class Ridge:
    """Highest point of a curve of a map.

    Parameters
    ----------
    setting
        Where.
    value
        Limit load on the curve, or on the higher side of a cliff.
    slope
        Slope of that along the curve, per unit of length: what is left of zero.
    across
        Direction across the curve in the plane of settings, of unit length in scales.
    cliff
        Whether the value is the limit from one side only.
    """

    setting: Pair
    value: float
    slope: float
    across: Pair
    cliff: bool


def highest(lmap: LimitLoadMap, curve: MapCurve) -> Ridge | None:
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
    spot = settle(locus, np.concatenate([z, p[free]]))
    if spot is None:
        return None
    beside = _beside(lmap, spot)
    if spot.x[-1] >= beside.max() - ALIKE:
        return _top_of_ridge(lmap, locus, spot)
    return _top_of_cliff(lmap, locus, spot, 1.0 if beside[1] > beside[0] else -1.0)


def _beside(lmap: LimitLoadMap, spot: Spot) -> Float[np.ndarray, " 2"]:
    """Limit loads close to a curve on both sides."""
    step = CLOSE * normal_of(lmap, spot)
    place = spot.x[-3:-1]
    values = lmap.rays(np.stack([place - step, place + step]))
    return np.asarray(np.nan_to_num(values, nan=-np.inf))


def _top_of_ridge(lmap: LimitLoadMap, locus: Locus, spot: Spot | None) -> Ridge | None:
    """Make the load stationary along the curve, by Newton's method on its slope."""
    for _ in range(ITERATIONS):
        if spot is None:
            return None
        slope = _rise(spot)
        if abs(slope) < LEVEL:
            break
        ahead = advance(locus, spot, SLOPE)
        if ahead is None:
            return None
        change = (_rise(ahead) - slope) / SLOPE
        step = -slope / change if change < 0.0 else LONGEST * float(np.sign(slope))
        step = float(np.clip(step, -LONGEST, LONGEST))
        if abs(step) < STILL:
            break
        spot = advance(locus, spot, step)
    if spot is None:
        return None
    value, slope = float(spot.x[-1]), abs(_rise(spot))
    return Ridge(spot.x[-3:-1], value, slope, normal_of(lmap, spot), False)


def _top_of_cliff(lmap: LimitLoadMap, locus: Locus, spot: Spot, side: float) -> Ridge | None:
    """Climb the limit load on the higher side of a cliff along the curve, by parabolas."""
    width, slope = WIDEST, np.nan
    for _ in range(ITERATIONS):
        around = [advance(locus, spot, -width), spot, advance(locus, spot, width)]
        if any(each is None for each in around):
            return None
        known = [each for each in around if each is not None]
        places = [e.x[-3:-1] + side * CLOSE * _aligned(lmap, e, spot) for e in known]
        left, middle, right = lmap.rays(np.array(places)).tolist()
        slope, bend = (right - left) / (2.0 * width), (left - 2.0 * middle + right) / width**2
        step = -slope / bend if bend < 0.0 else 2.0 * width * float(np.sign(slope))
        if not np.isfinite(step):
            return None
        ahead = advance(locus, spot, float(np.clip(step, -2.0 * width, 2.0 * width)))
        if ahead is None:
            return None
        spot = ahead
        if abs(step) < 0.3 * width:
            width *= 0.2
        if width < NARROW:
            break
    across = normal_of(lmap, spot)
    near = spot.x[-3:-1] + side * CLOSE * np.array([[1.0], [2.0]]) * across
    one, two = lmap.rays(near).tolist()
    return Ridge(spot.x[-3:-1], 2.0 * one - two, abs(float(slope)), across, True)


def _aligned(lmap: LimitLoadMap, spot: Spot, other: Spot) -> Pair:
    """Direction across the curve that points to the same side as at another of its points."""
    own, theirs = normal_of(lmap, spot), normal_of(lmap, other)
    return np.asarray(own * (1.0 if own @ theirs > 0.0 else -1.0))


def _rise(spot: Spot) -> float:
    """Slope of the load, the last coordinate, along the curve."""
    return float(spot.tangent[-1])


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


def normal_of(lmap: LimitLoadMap, spot: Spot) -> Float[np.ndarray, " 2"]:
    """Direction across a curve in the plane of settings, of unit length in their scales."""
    structure = lmap.structure
    scales = np.array(
        [structure.scales[position(structure.parameters, name)] for name in lmap.grid.names]
    )
    along = spot.tangent[-3:-1] / scales
    across = np.array([-along[1], along[0]])
    return np.asarray(scales * across / np.linalg.norm(across))
