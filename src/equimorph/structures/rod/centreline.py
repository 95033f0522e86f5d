"""Centrelines of rods, in the plane and in space, and how near they come to themselves."""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Float, Int, Values
from equimorph.structures.rod.discretisation import Mesh

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

Vectors = Float[np.ndarray, "lanes points axes"]
Moves = Float[np.ndarray, "lanes 2"]
Hessians = Float[np.ndarray, "lanes 2 2"]


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


def stretches(
    shortenings: Float[np.ndarray, "lanes nodes"], mesh: Mesh
) -> Float[np.ndarray, "lanes samples"]:
    """Stretches of the axis at `stations`, from shortenings at the nodes of every element.

    Rods that do not stretch have one shortening, 0.
    """
    at = mesh.nodes[mesh.element_nodes].ravel() if shortenings.shape[1] > 1 else np.zeros(1)
    return 1.0 - np.array([np.interp(stations(), at, each) for each in shortenings])


def closest_approach(
    line: Centreline, stretch: Float[np.ndarray, "lanes points"], apart: float
) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart`, and where it is.

    The closest pair of samples at `stations`, or of a sample and the point `apart` from it,
    improved by Newton on the osculating circles of both points; third order in the spacing of
    the samples. The axis there is stretched by `stretch`; shear is left out between samples.
    `apart` is the least difference, as a share of the length; the arclength is that of the first
    point of each pair.
    """
    s, length = stations(), line.length
    rates = length * stretch[:, :, None]
    curves = np.stack([line.places, rates * line.tangents, rates * line.bends], axis=-2)
    first, last, stop = _closest_samples(curves, apart)
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
    curves: Float[np.ndarray, "lanes points 3 axes"], apart: float
) -> tuple[Int[np.ndarray, " lanes"], Int[np.ndarray, " lanes"], Values]:
    """Both points of the closest pairs, and how far from its sample the second one lies.

    It lies beside it only where it is `apart` from the first one.
    """
    s, places = stations(), curves[:, :, 0]
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
