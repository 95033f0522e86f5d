"""Centrelines of rods, in the plane and in space, and how near they come to themselves."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Values
from equimorph.model.obstacle import smooth_arcs

SAMPLES = 129
"""Arclengths at which distances are compared first."""
POLISHING = 4
"""Newton iterations towards the closest points."""
WAYS = (np.eye(2), np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]]), np.array([[1.0, 1.0]]))
"""How both points move: each for itself, one alone, where the other is an end, or together, where
they are as near along the rod as they may be."""
ROUNDS = 2
"""Rounds through these ways."""
EQUAL_ARCLENGTHS = 1e-12
"""Round-off of the difference of two arclengths."""
ARCS = 128
"""Number of cubic arcs along a rod: their error is below 1e-10 for κ = 10."""
NEXT = 1e-4
"""Arclength to neighbouring places whose differences are the derivatives of places."""

Vectors = Float[np.ndarray, "lanes points axes"]
Moves = Float[np.ndarray, "lanes 2"]
Hessians = Float[np.ndarray, "lanes 2 2"]


@dataclass(frozen=True, eq=False)
class Centreline:
    """Centreline of a rod at arclengths, with the axes of its cross-sections."""

    places: Vectors
    """Coordinates."""
    tangents: Vectors
    """Unit vectors."""
    normals: Float[np.ndarray, "lanes points normals axes"]
    """The other axes of the cross-sections: in the plane one, on the left; in space n and b."""


def curves_of(
    places: Callable[[Float[np.ndarray, " points"]], Vectors], s: Float[np.ndarray, " points"]
) -> Float[np.ndarray, "lanes points 3 axes"]:
    """Places at arclengths with first and second derivatives, which know stretch and shear.

    Of the parabola through three places beside each arclength. All lie on one side of it, as fields
    that are no equilibrium may jump where elements meet.
    """
    side = np.where(s < 0.5, NEXT, -NEXT)
    points = s + np.array([[0.5], [1.5], [2.5]]) * side
    near, middle, far = np.split(places(points.ravel()), 3, axis=1)
    bend = far - 2.0 * middle + near
    slope = middle - near - bend
    at, step = near - 0.5 * slope - 0.125 * bend, side[:, None]
    return np.stack([at, slope / step, bend / step**2], axis=2)


def arcs_through(
    places: Callable[[Float[np.ndarray, " points"]], Vectors],
) -> Float[np.ndarray, "lanes arcs 4 axes"]:
    """Cubic arcs along a rod with its places and their derivatives at their ends."""
    at, rates, _ = np.moveaxis(curves_of(places, np.linspace(0.0, 1.0, ARCS + 1)), 2, 0)
    return smooth_arcs(at, rates, 1.0 / ARCS)


def closest_approach(
    places: Callable[[Float[np.ndarray, " points"]], Vectors], apart: float
) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart`, and where it is.

    The closest pair of samples, or of a sample and the point `apart` from it, improved by Newton on
    the osculating circles of both points; third order in the spacing of the samples. `apart` is the
    least difference, as a share of the length; the arclength is that of the first point of each
    pair.
    """
    s = np.linspace(0.0, 1.0, SAMPLES)
    curves = curves_of(places, s)
    first, last, stop = _closest_samples(curves, s, apart)
    lanes = np.arange(len(curves))
    pair = _Pair(
        np.stack([curves[lanes, first], curves[lanes, last]], axis=1),
        np.stack([s[first], s[last]], axis=1),
        apart,
    )
    moves = np.stack([np.zeros(len(curves)), stop], axis=1)
    least = pair.squares(moves)[0]
    for _ in range(ROUNDS):
        for ways in WAYS:
            after = moves
            for _ in range(POLISHING):
                after = pair.inside(after + _newton(*pair.squares(after)[1:], ways))
            square = pair.squares(after)[0]
            moves = np.where((square < least)[:, None], after, moves)
            least = np.minimum(square, least)
    return np.sqrt(least), np.asarray(s[first] + moves[:, 0])


def _closest_samples(
    curves: Float[np.ndarray, "lanes points 3 axes"], s: Float[np.ndarray, " points"], apart: float
) -> tuple[Int[np.ndarray, " lanes"], Int[np.ndarray, " lanes"], Values]:
    """Both points of the closest pairs, and how far from its sample the second one lies.

    It lies beside it only where it is `apart` from the first one.
    """
    places = curves[:, :, 0]
    far = s[None, :] - s[:, None] >= apart - EQUAL_ARCLENGTHS
    square = np.zeros((len(places), len(s), len(s)))
    for x in np.moveaxis(places, 2, 0):
        square += (x[:, :, None] - x[:, None]) ** 2
    square = np.where(far, square, np.inf)
    begin = np.flatnonzero(s + apart <= 1.0 + EQUAL_ARCLENGTHS)
    beside = np.rint((s[begin] + apart) / s[1]).astype(int)
    by = s[begin] + apart - s[beside]
    nearest = _circle(curves[:, beside], by)[0] - places[:, begin]
    edge = _dot(nearest, nearest)
    k, lanes = edge.argmin(axis=1), np.arange(len(places))
    first, last = np.divmod(square.reshape(len(places), len(s) ** 2).argmin(axis=1), len(s))
    inner = square[lanes, first, last] <= edge[lanes, k]
    return (
        np.where(inner, first, begin[k]),
        np.where(inner, last, beside[k]),
        np.where(inner, 0.0, by[k]),
    )


@dataclass(frozen=True, eq=False)
class _Pair:
    """Osculating circles at two samples of each lane, on which points may move.

    curves: places and derivatives by the arclength; at: arclengths; apart: least difference.
    """

    curves: Float[np.ndarray, "lanes 2 3 axes"]
    at: Float[np.ndarray, "lanes 2"]
    apart: float

    def squares(self, moves: Float[np.ndarray, "lanes 2"]) -> tuple[Values, Moves, Hessians]:
        """Half of the squares' derivatives, first and second, after the squares of distances."""
        (x, y), (t, u), (n, m) = np.moveaxis(_circle(self.curves, moves), 2, 1)
        gap, across = y - x, -_dot(t, u)
        hessian = np.array(
            [[_dot(t, t) - _dot(gap, n), across], [across, _dot(u, u) + _dot(gap, m)]]
        )
        slope = np.stack([-_dot(gap, t), _dot(gap, u)], axis=1)
        return _dot(gap, gap), slope, np.moveaxis(hessian, 2, 0)

    def inside(self, moves: Float[np.ndarray, "lanes 2"]) -> Moves:
        """The moves that are allowed: a spacing of samples at most, on the rod, and `apart`."""
        spacing = 1.0 / (SAMPLES - 1)
        lower, upper = np.maximum(-spacing, -self.at), np.minimum(spacing, 1.0 - self.at)
        start, stop = np.clip(moves, lower, upper).T
        gap = self.apart - (self.at[:, 1] - self.at[:, 0])
        short = np.maximum(gap - (stop - start), 0.0)
        start = np.maximum(start - 0.5 * short, lower[:, 0])
        stop = np.minimum(np.maximum(stop, start + gap), upper[:, 1])
        return np.stack([np.minimum(start, stop - gap), stop], axis=1)


def _newton(slope: Moves, hessian: Hessians, ways: Float[np.ndarray, "k 2"]) -> Moves:
    """Newton's moves along some ways, none where the squares are not convex along these."""
    inner = ways @ hessian @ ways.T
    convex = np.linalg.eigvalsh(inner)[:, 0] > 0.0
    inner = np.where(convex[:, None, None], inner, np.eye(len(ways)))
    along = np.linalg.solve(inner, (slope @ ways.T)[:, :, None])[:, :, 0]
    return np.asarray(np.where(convex[:, None], -along @ ways, 0.0))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray((a * b).sum(axis=-1))


def _circle(curve: Float[np.ndarray, "*some 3 axes"], move: np.ndarray) -> np.ndarray:
    """Place on the osculating circle, to third order, with derivatives, along axis 0."""
    place, tangent, bend = np.moveaxis(curve, -2, 0)
    by = np.asarray(move)[..., None]
    turn = -(_dot(bend, bend) / _dot(tangent, tangent))[..., None] * tangent
    at = place + by * (tangent + by * (bend / 2.0 + by * turn / 6.0))
    return np.stack([at, tangent + by * (bend + by * turn / 2.0), bend + by * turn])
