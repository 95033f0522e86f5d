"""Obstacles for a shape: half-planes and discs, in space extended along z.

How near arcs of a structure come to them, and where. Distances are descriptors, so that every task
takes them as constraints.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_notes import DIRECTION, PAIR
from equimorph.arrays import Float, Values

Pair = Annotated[Sequence[float], PAIR]
Places = Float[np.ndarray, "*points axes"]
"""(x, y), or (x, y, z) of which obstacles do not depend on z."""
Distances = Float[np.ndarray, "*points"]
STEPS = 8
"""Newton steps towards the nearest point of an arc."""
STARTS = np.array([0.0, 1.0])
"""Places on an arc from which Newton's method starts: its ends."""
Vectors = Float[np.ndarray, "lanes points space"]
Arcs = Float[np.ndarray, "lanes arcs 4 space"]
"""Cubic arcs: both ends, and the derivatives there with respect to the share of the arc."""


@check_arguments
@dataclass(frozen=True)
class HalfPlane:
    """Forbidden side of a line: places behind `point`, seen along `normal`.

    For a structure in space it is the forbidden side of a plane that contains the z-axis.

    Parameters
    ----------
    point
        A point on the line, in the structure's unit of length.
    normal
        Direction into the allowed side, of any length.
    """

    point: Pair
    normal: Annotated[Sequence[float], DIRECTION]

    def __post_init__(self) -> None:
        """Give the normal unit length."""
        x, y = map(float, self.normal)
        size = float(np.hypot(x, y))
        object.__setattr__(self, "point", tuple(map(float, self.point)))
        object.__setattr__(self, "normal", (x / size, y / size))

    def __str__(self) -> str:
        """Return it as it is written."""
        (x, y), (a, b) = self.point, self.normal
        return f"half_plane({x:.9g}, {y:.9g}, {a:.9g}, {b:.9g})"

    def distance(self, places: Places) -> Distances:
        """Signed distance of places: negative behind the line."""
        return np.asarray((places[..., :2] - np.array(self.point)) @ np.array(self.normal))

    def derivatives(self, place: Places, rate: Places, bend: Places) -> tuple[Distances, Distances]:
        """First and second derivative of a growing function of the distance along curves."""
        normal = np.array(self.normal)
        return np.asarray(rate[..., :2] @ normal), np.asarray(bend[..., :2] @ normal)


@check_arguments
@dataclass(frozen=True)
class Disc:
    """A disc that the shape must not enter or, with `inside`, must not leave.

    For a structure in space it is a cylinder without end along the z-axis.

    Parameters
    ----------
    centre, radius
        In the structure's unit of length.
    inside
        Whether the inside is allowed and the outside is not.
    """

    centre: Pair
    radius: float
    inside: bool = False

    def __post_init__(self) -> None:
        """Make numbers of the centre's coordinates."""
        object.__setattr__(self, "centre", tuple(map(float, self.centre)))

    def __str__(self) -> str:
        """Return it as it is written."""
        name = "room" if self.inside else "disc"
        return f"{name}({self.centre[0]:.9g}, {self.centre[1]:.9g}, {self.radius:.9g})"

    @property
    def _sign(self) -> float:
        return -1.0 if self.inside else 1.0

    def distance(self, places: Places) -> Distances:
        """Signed distance of places from the circle: negative where it is forbidden."""
        gap = np.linalg.norm(places[..., :2] - np.array(self.centre), axis=-1)
        return np.asarray(self._sign * (gap - self.radius))

    def derivatives(self, place: Places, rate: Places, bend: Places) -> tuple[Distances, Distances]:
        """First and second derivative of a growing function of the distance along curves."""
        gap, velocity = place[..., :2] - np.array(self.centre), rate[..., :2]
        first = (gap * velocity).sum(axis=-1)
        second = (velocity * velocity).sum(axis=-1) + (gap * bend[..., :2]).sum(axis=-1)
        return self._sign * first, self._sign * second


Obstacle = HalfPlane | Disc


def straight_arcs(corners: Vectors) -> Arcs:
    """Arcs of a polygon."""
    side = np.diff(corners, axis=1)
    return np.stack([corners[:, :-1], corners[:, 1:], side, side], axis=2)


def smooth_arcs(places: Vectors, tangents: Vectors, spacing: float) -> Arcs:
    """Arcs through equidistant points of curves whose tangents are known: of fourth order."""
    rate = spacing * tangents
    return np.stack([places[:, :-1], places[:, 1:], rate[:, :-1], rate[:, 1:]], axis=2)


def nearest(arcs: Arcs, obstacle: Obstacle) -> tuple[Values, Values]:
    """Smallest signed distance of arcs from an obstacle, and the share of the way where it is.

    All arcs are tried at a few points; on the best of them and its neighbours Newton's method
    finds the extremum.
    """
    count = arcs.shape[1]
    shares = _starts(arcs, obstacle)
    distance = obstacle.distance(_points(arcs[:, :, None], shares)[0])
    best = distance.min(axis=2).argmin(axis=1)
    lanes = np.arange(len(arcs))
    least, where = np.full((2, len(arcs)), np.inf)
    for beside in (0, -1, 1):
        arc = np.clip(best + beside, 0, count - 1)
        start = shares[lanes, arc, distance[lanes, arc].argmin(axis=1)]
        value, share = _polish(arcs[lanes, arc], obstacle, start)
        better = value < least - 1e-15
        least = np.where(better, value, least)
        where = np.where(better, (arc + share) / count, where)
    return least, where


def _starts(arcs: Arcs, obstacle: Obstacle) -> Float[np.ndarray, "lanes arcs starts"]:
    """Both ends, and the extremum on the chord."""
    chord = arcs[:, :, 1] - arcs[:, :, 0]
    zero = np.zeros_like(chord)
    first, second = obstacle.derivatives(arcs[:, :, 0], chord, zero)
    inner = np.clip(-first / np.where(second > 0.0, second, np.inf), 0.0, 1.0)
    fixed = np.broadcast_to(STARTS, (*inner.shape, len(STARTS)))
    return np.concatenate([fixed, inner[:, :, None]], axis=2)


def _points(
    arcs: Float[np.ndarray, "*some 4 axes"], share: Float[np.ndarray, "*shares"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places on cubic arcs, with first and second derivatives."""
    t = share[..., None]
    a, b, da, db = (arcs[..., k, :] for k in range(4))
    c2, c3 = 3.0 * (b - a) - 2.0 * da - db, 2.0 * (a - b) + da + db
    place = a + t * (da + t * (c2 + t * c3))
    return place, da + t * (2.0 * c2 + 3.0 * t * c3), 2.0 * c2 + 6.0 * t * c3


def _polish(
    arcs: Float[np.ndarray, "lanes 4 axes"], obstacle: Obstacle, start: Values
) -> tuple[Values, Values]:
    """Least distance on one arc a lane, and where."""
    share, best = start, start
    value = obstacle.distance(_points(arcs, start)[0])
    for _ in range(STEPS):
        first, second = obstacle.derivatives(*_points(arcs, share))
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = np.nan_to_num(first / second)
        step = np.where(second > 0.0, newton, np.sign(first))
        share = np.clip(share - step, 0.0, 1.0)
        now = obstacle.distance(_points(arcs, share)[0])
        best = np.where(now < value, share, best)
        value = np.minimum(now, value)
    return value, best
