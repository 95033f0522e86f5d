"""Following loci by pseudo-arclength, with the special points on the way and how they end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.optimize import brentq

from equimorph.equilibria.critical import Test
from equimorph.equilibria.locus import Locus, Point, Spot, advance
from equimorph.equilibria.steps import least_inside
from equimorph.equilibria.trace_options import TraceOptions

Values = Float[np.ndarray, " watches"]

ZERO = 1e-9
"""Size of a watched test that counts as zero: noise of tests that vanish identically."""
CLOSE = 0.05
"""Least value inside a step, as a share of those at its ends, that asks for shorter steps."""
BISECTIONS = 5
"""Halvings of a step in which the index changes."""
NARROW = 1e-3
"""Share of the first step below which hidden pairs of special points are not told apart."""


_SECOND = {
    True: ("double", "a second eigenvalue vanishes"),
    False: ("critical", "an eigenvalue vanishes"),
}


class LostPartError(Exception):
    """A part of a step failed where the whole succeeded: shorter steps will tell."""


@dataclass(frozen=True)
class Watch:
    """A test whose changes of sign are located: special points, or ends of the curve."""

    kind: str
    test: Test
    detail: str = ""
    ends: bool = False


@dataclass(frozen=True)
class Landmark:
    """Something located on a curve: kind, point, length from the start, detail."""

    kind: str
    spot: Spot
    length: float
    detail: str = ""


@dataclass(frozen=True)
class Side:
    """One side of a curve from its start: points with their lengths, landmarks, and the end."""

    spots: list[Spot]
    lengths: list[float]
    landmarks: list[Landmark]
    end: Landmark


@dataclass(frozen=True)
class Walk:
    """Where the walker is: point, its watched values with slopes, count of eigenvalues, length."""

    spot: Spot
    values: Values
    slopes: Values
    index: int
    length: float
    travelled: float
    bend: Point | None = None


def negative_others(locus: Locus, spot: Spot) -> int:
    """Negative eigenvalues of the constrained Hessian, those within 1e-7 of zero not counted."""
    z, p = locus.split(spot.x[None])
    nothing = np.zeros((1, 0, locus.structure.size))
    solved = locus.structure.solve(z, p, nothing, shift=np.array([-1e-7]))
    return int(solved.negative[0]) - locus.structure.constraints


def start_walk(locus: Locus, spot: Spot, watches: Sequence[Watch], options: TraceOptions) -> Walk:
    """Stand at the start."""
    values, slopes = watched(locus, spot, watches, np.zeros(len(watches)))
    index = negative_others(locus, spot)
    return Walk(spot, values, slopes, index, options.first_step, 0.0)


def watched(
    locus: Locus, spot: Spot, watches: Sequence[Watch], before: Values
) -> tuple[Values, Values]:
    """Watched tests with slopes; zeros keep the sign that they had `before`."""
    if not watches:
        return np.zeros(0), np.zeros(0)
    tests = tuple(watch.test for watch in watches)
    values, slopes = locus.slopes(spot.x, spot.tangent[None], tests, spot.b)
    return np.where(np.abs(values) < ZERO, 1e-200 * np.sign(before), values), slopes[:, 0]


def try_step(
    locus: Locus, walk: Walk, watches: Sequence[Watch], options: TraceOptions
) -> Walk | None:
    """One step; None if it failed or may hide a pair of special points: try a shorter one."""
    spot = advance(locus, walk.spot, walk.length, walk.bend)
    if spot is None:
        return None
    values, slopes = watched(locus, spot, watches, walk.values)
    index = negative_others(locus, spot)
    wide = walk.length > NARROW * options.first_step
    if wide and (abs(index - walk.index) > 1 or _hides(walk, values, slopes)):
        return None
    cosine = spot.tangent * locus.weights @ walk.spot.tangent
    turning = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    growth = float(np.clip(options.turning / max(turning, 1e-3), 0.5, 2.0))
    longer = min(walk.length * growth, options.largest_step)
    bend = (spot.tangent - walk.spot.tangent) / walk.length
    return Walk(spot, values, slopes, index, longer, walk.travelled + walk.length, bend)


def _hides(walk: Walk, values: Values, slopes: Values) -> bool:
    """Whether a watched test may touch zero inside a step, by the cubics through its ends."""
    sign = np.sign(walk.values)
    ends, rates = (sign * walk.values, sign * values), (sign * walk.slopes, sign * slopes)
    least = least_inside(ends, rates, np.full(len(values), walk.length))[1]
    return bool(((ends[1] > 0.0) & (least < CLOSE * np.minimum(*ends))).any())


def follow_side(locus: Locus, start: Spot, watches: Sequence[Watch], options: TraceOptions) -> Side:
    """Follow a locus from its start until it ends, closes or is lost."""
    walk = start_walk(locus, start, watches, options)
    spots, lengths = [start], [0.0]
    landmarks: list[Landmark] = []
    for watch, value, slope in zip(watches, walk.values, walk.slopes, strict=True):
        if watch.ends and value >= 0.0 and slope > 0.0:
            here = Landmark(watch.kind, start, 0.0, watch.detail)
            return Side(spots, lengths, landmarks, here)
    for _ in range(options.steps):
        stride = _stride(locus, walk, watches, options)
        if stride is None:
            lost = Landmark("lost", walk.spot, walk.travelled, "the step became too small")
            return Side(spots, lengths, landmarks, lost)
        walk, after, found = stride
        end = next((mark for mark, ends in found if ends), _closing(locus, start, walk, after))
        limit = np.inf if end is None else end.length
        landmarks += [mark for mark, ends in found if not ends and mark.length < limit]
        if end is not None:
            return Side([*spots, end.spot], [*lengths, end.length], landmarks, end)
        spots.append(after.spot)
        lengths.append(after.travelled)
        walk = after
    lost = Landmark("lost", walk.spot, walk.travelled, f"no end in {options.steps} steps")
    return Side(spots, lengths, landmarks, lost)


def _stride(
    locus: Locus, walk: Walk, watches: Sequence[Watch], options: TraceOptions
) -> tuple[Walk, Walk, list[tuple[Landmark, bool]]] | None:
    """Shorten the step until it succeeds: before, after, and what lies between."""
    while walk.length >= options.smallest_step:
        after = try_step(locus, walk, watches, options)
        if after is not None:
            try:
                return walk, after, _landmarks(locus, walk, after, watches)
            except LostPartError:
                pass
        walk = replace(walk, length=0.4 * walk.length)
    return None


def _part(locus: Locus, walk: Walk, length: float) -> Spot:
    """Point of a step at a length."""
    spot = advance(locus, walk.spot, length, walk.bend) if length > 0.0 else walk.spot
    if spot is None:
        raise LostPartError
    return spot


def _closing(locus: Locus, start: Spot, walk: Walk, after: Walk) -> Landmark | None:
    """Return to the start, if the step from `walk` passes it."""
    if walk.travelled == 0.0:
        return None
    gap = start.x - walk.spot.x
    step = after.travelled - walk.travelled
    ahead = float(walk.spot.tangent * locus.weights @ gap)
    if not 0.0 < ahead <= step or np.sqrt(gap**2 @ locus.weights) > 2.0 * step:
        return None
    spot = advance(locus, walk.spot, ahead, walk.bend)
    if spot is None or np.sqrt((spot.x - start.x) ** 2 @ locus.weights) > 1e-6:
        return None
    return Landmark("closed", spot, walk.travelled + ahead)


def _landmarks(
    locus: Locus, walk: Walk, after: Walk, watches: Sequence[Watch]
) -> list[tuple[Landmark, bool]]:
    """Special points and ends within a step, in order."""
    step, found = after.travelled - walk.travelled, []
    for watch, low, high in zip(watches, walk.values, after.values, strict=True):
        if high > 0.0 if watch.ends else low * high < 0.0:
            length = _by_newton(locus, walk, step, watch.test, (low, high))
            if length is None and after.index != walk.index and not watch.ends:
                continue  # tests have poles where a second eigenvalue vanishes
            if length is None:
                length = _by_bracketing(locus, walk, step, watch.test, (low, high))
            mark = Landmark(
                watch.kind, _part(locus, walk, length), walk.travelled + length, watch.detail
            )
            found.append((mark, watch.ends))
    if after.index != walk.index:
        length, spot = _double(locus, walk, step)
        kind, detail = _SECOND[locus.singular]
        found.append((Landmark(kind, spot, walk.travelled + length, detail), False))
    return sorted(found, key=lambda entry: entry[0].length)


def _by_newton(
    locus: Locus, walk: Walk, step: float, test: Test, ends: tuple[float, float]
) -> float | None:
    """Length at which a test vanishes within a step, by Newton; None if it fails."""
    guess = step * ends[0] / (ends[0] - ends[1])
    spot = advance(locus, walk.spot, guess, walk.bend, test)
    if spot is None:
        return None
    length = float((spot.x - walk.spot.x) * locus.weights @ walk.spot.tangent)
    return length if 0.0 <= length <= step else None


def _by_bracketing(
    locus: Locus, walk: Walk, step: float, test: Test, ends: tuple[float, float]
) -> float:
    """Length at which a test changes its sign within a step."""
    known, b = {0.0: ends[0], step: ends[1]}, walk.spot.b

    def value(length: float) -> float:
        if length in known:
            return known[length]
        return float(test(locus.critical(_part(locus, walk, length).x[None], b))[0])

    return float(brentq(value, 0.0, step, xtol=1e-13))


def _double(locus: Locus, walk: Walk, step: float) -> tuple[float, Spot]:
    """Where the index changes within a step: from points around it, since tests fail at it.

    Bisection on the index, then the root of the interpolated gap of a second border.
    """
    low, high = 0.0, step
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = negative_others(locus, _part(locus, walk, middle)) == walk.index
        low, high = (middle, high) if same else (low, middle)
    width = high - low
    first = min(max(low - 2.0 * width, 0.0), step - 5.0 * width)
    lengths = first + width * np.arange(6)
    spots = [_part(locus, walk, float(length)) for length in lengths]
    nearest = spots[int(np.argmin(np.abs(lengths - middle)))]
    c = _second_border(locus, nearest)
    # c·(solution) has a pole where the second eigenvalue vanishes: its inverse is smooth
    gaps = [-1.0 / float(c @ _solve_beside(locus, spot, c)) for spot in spots]
    place = _zero(np.array(gaps))
    weights = _lagrange(place)
    x = weights @ np.array([spot.x for spot in spots])
    x = x + locus.frame(x, nearest.b, nearest.basis * locus.weights)[0]
    return float(first + width * place), replace(nearest, x=x)


def _lagrange(place: float) -> Float[np.ndarray, " 6"]:
    """Weights that interpolate values at 0, 1, ..., 5."""
    others = place - np.arange(6.0)
    apart = np.subtract.outer(np.arange(6.0), np.arange(6.0)) + np.eye(6)
    whole = [np.prod(np.delete(others, j)) for j in range(6)]
    return np.asarray(np.array(whole) / apart.prod(axis=1))


def _zero(values: Float[np.ndarray, " 6"]) -> float:
    """Root of the polynomial through values at 0, 1, ..., 5, where their sign changes."""
    change = np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))
    if len(change) != 1:
        raise LostPartError
    at = float(change[0])
    return float(brentq(lambda place: _lagrange(place) @ values, at, at + 1.0, xtol=1e-13))


def _second_border(locus: Locus, spot: Spot) -> Float[np.ndarray, " bordered"]:
    """Null vector of the bordered matrix at a double point, by inverse iteration."""
    c = np.cos(1.1 * np.arange(locus.structure.size + int(locus.singular))) + 1.3
    for _ in range(3):
        solved = _solve_beside(locus, spot, c)
        if not np.isfinite(solved).all():
            break
        c = solved / np.linalg.norm(solved)
    return np.asarray(c)


def _solve_beside(
    locus: Locus, spot: Spot, rhs: Float[np.ndarray, " bordered"]
) -> Float[np.ndarray, " bordered"]:
    """Solve with F_z, bordered where it is singular along the whole locus."""
    at = locus.critical(spot.x[None], spot.b)
    if locus.singular:
        return np.asarray(at.solve(rhs[None, None])[0, 0])
    return np.asarray(locus.structure.solve(at.z, at.p, rhs[None, None]).x[0, 0])
