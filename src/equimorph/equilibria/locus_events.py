"""Special points on loci: what is watched along them, and where tests change sign within a step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from equimorph.arrays import Float, Numbers, Values
from equimorph.columns import Columns
from equimorph.equilibria.critical import Test
from equimorph.equilibria.locus import Locus, Points, Spots, advance, onto_set, test_slopes
from equimorph.equilibria.trace_options import EventKind

Watched = Float[np.ndarray, "lanes watches"]

ZERO = 1e-9
"""Size of a watched test that counts as zero: noise of tests that vanish identically."""
BISECTIONS = 5
"""Halvings of a step in which the index changes."""
STENCIL = 6
"""Points around a double point, from which it is interpolated."""
_SECOND = {
    True: (EventKind.DOUBLE, "a second eigenvalue vanishes"),
    False: (EventKind.CRITICAL, "an eigenvalue vanishes"),
}


class LostPartError(Exception):
    """A part of a step failed where the whole succeeded: shorter steps will decide."""


@dataclass(frozen=True)
class Watch:
    """A test whose changes of sign are located: special points, or ends of the curve."""

    kind: EventKind
    test: Test
    detail: str = ""
    ends: bool = False


@dataclass(frozen=True)
class Landmark:
    """Something located on a curve: kind, point, length from the start, detail."""

    kind: EventKind
    spot: Spots
    length: float
    detail: str = ""


@dataclass(frozen=True)
class Walks(Columns):
    """Where curves are, one a lane.

    Points, watched values with slopes, length of the next step, way so far, and the points before
    with their tangents.
    """

    spots: Spots
    values: Watched
    slopes: Watched
    length: Values
    travelled: Values
    last: Points
    last_tangent: Points

    @property
    def index(self) -> Numbers:
        """Negative eigenvalues in addition to those that vanish."""
        return self.spots.index


def predict(locus: Locus, here: Walks, lengths: Values) -> Points:
    """Points at lengths along the tangents: by cubics through the points before, if there are any.

    In the coordinate along a tangent a curve is a graph, whose derivative is the unit tangent over
    the cosine of the angle between.
    """
    there, row = here.spots.x, here.spots.basis[:, 0] * locus.weights
    gap = here.last - there
    back = np.einsum("li,li->l", row, gap)
    rate = np.einsum("li,li->l", row, here.last_tangent)
    known = back < 0.0
    share = np.where(known, lengths / np.where(known, back, 1.0), 0.0)
    factors = (
        (3.0 - 2.0 * share) * share**2,
        lengths * (1.0 - share) ** 2,
        (lengths - back) * share**2 / rate,
    )
    moves = (gap, here.spots.basis[:, 0], here.last_tangent)
    for factor, move in zip(factors, moves, strict=True):
        there = there + factor[:, None] * move
    return there


def watch_tests(
    locus: Locus, spots: Spots, watches: Sequence[Watch], before: Watched
) -> tuple[Watched, Watched]:
    """Watched tests with slopes; zeros keep the sign that they had `before`."""
    tests = tuple(watch.test for watch in watches)
    values, slopes = test_slopes(locus, spots.x, spots.basis[:, :1], tests, spots.b)
    slopes = slopes[:, :, 0]
    return np.where(np.abs(values) < ZERO, 1e-200 * np.sign(before), values), slopes


def _parts(locus: Locus, walk: Walks, lengths: Values) -> Spots:
    """Points of one step at lengths."""
    many = walk.take(np.zeros(len(lengths), int))
    spots, found = advance(locus, many.spots, lengths, predict(locus, many, lengths))
    if not found.all():
        raise LostPartError
    return spots


def _part(locus: Locus, walk: Walks, length: float) -> Spots:
    """Point of a step at a length."""
    return _parts(locus, walk, np.array([length])) if length > 0.0 else walk.spots


def landmarks(
    locus: Locus, walk: Walks, after: Walks, watches: Sequence[Watch]
) -> list[tuple[Landmark, bool]]:
    """Special points and ends within a step, in order."""
    start, found = float(walk.travelled[0]), []
    size, turned = float(after.travelled[0]) - start, after.index[0] != walk.index[0]
    for watch, low, high in zip(watches, walk.values[0], after.values[0], strict=True):
        if high > 0.0 if watch.ends else low * high < 0.0:
            length = _by_newton(locus, walk, size, watch.test, (low, high))
            if length is None and turned and not watch.ends:
                continue  # tests have poles where a second eigenvalue vanishes
            if length is None:
                length = _by_bracketing(locus, walk, size, watch.test, (low, high))
            spot = _part(locus, walk, length)
            found.append((Landmark(watch.kind, spot, start + length, watch.detail), watch.ends))
    if turned:
        length, spot = _double(locus, walk, size)
        kind, detail = _SECOND[locus.singular]
        found.append((Landmark(kind, spot, start + length, detail), False))
    return sorted(found, key=lambda entry: entry[0].length)


def _by_newton(
    locus: Locus, walk: Walks, size: float, test: Test, ends: tuple[float, float]
) -> float | None:
    """Length at which a test vanishes within a step, by Newton; None if it fails."""
    share = np.array([size * ends[0] / (ends[0] - ends[1])])
    spot, found = advance(locus, walk.spots, share, predict(locus, walk, share), test)
    if not found[0]:
        return None
    length = float((spot.x - walk.spots.x)[0] * locus.weights @ walk.spots.tangent[0])
    return length if 0.0 <= length <= size else None


def _by_bracketing(
    locus: Locus, walk: Walks, size: float, test: Test, ends: tuple[float, float]
) -> float:
    """Length at which a test changes its sign within a step."""
    known = {0.0: float(ends[0]), size: float(ends[1])}

    def value(length: float) -> float:
        if length in known:
            return known[length]
        spot = _part(locus, walk, length)
        return float(test(locus.critical(spot.x, walk.spots.b))[0])

    return float(brentq(value, 0.0, size, xtol=1e-13))


def _double(locus: Locus, walk: Walks, size: float) -> tuple[float, Spots]:
    """Where the index changes within a step: from points around it, since tests fail at it.

    Bisection on the index, then the root of the interpolated gap of a second border.
    """
    low, high = 0.0, size
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = _part(locus, walk, middle).index[0] == walk.index[0]
        low, high = (middle, high) if same else (low, middle)
    width = high - low
    first = min(max(low - 2.0 * width, 0.0), size - (STENCIL - 1) * width)
    lengths = first + width * np.arange(STENCIL)
    spots = _parts(locus, walk, np.maximum(lengths, 1e-300))
    nearest = spots.take(np.array([int(np.argmin(np.abs(lengths - middle)))]))
    c = _second_border(locus, nearest)
    # c·(solution) has a pole where the second eigenvalue vanishes: its inverse is smooth
    gaps = -1.0 / (_solve_beside(locus, spots, np.tile(c, (STENCIL, 1))) @ c)
    place = _zero(gaps)
    x = (_lagrange(place) @ spots.x)[None]
    return float(first + width * place), replace(nearest, x=onto_set(locus, x, nearest))


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


def _second_border(locus: Locus, spot: Spots) -> Float[np.ndarray, " bordered"]:
    """Null vector of the bordered matrix at a double point, by inverse iteration."""
    c = np.cos(1.1 * np.arange(locus.structure.size + int(locus.singular))) + 1.3
    for _ in range(3):
        solved = _solve_beside(locus, spot, c[None])[0]
        if not np.isfinite(solved).all():
            break
        c = solved / np.linalg.norm(solved)
    return np.asarray(c)


def _solve_beside(
    locus: Locus, spots: Spots, rhs: Float[np.ndarray, "lanes bordered"]
) -> Float[np.ndarray, "lanes bordered"]:
    """Solve with F_z, bordered where it is singular along the whole locus."""
    at = locus.critical(spots.x, spots.b)
    if locus.singular:
        return np.asarray(at.solve(rhs[:, None])[:, 0])
    return np.asarray(locus.structure.solve(at.z, at.p, rhs[:, None]).x[:, 0])
