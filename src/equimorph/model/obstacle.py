"""Obstacles for a shape: half-planes and discs, in space extended along z."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_notes import DIRECTION, PAIR
from equimorph.arrays import Float

Pair = Annotated[Sequence[float], PAIR]
Places = Float[np.ndarray, "*points axes"]
"""(x, y), or (x, y, z) of which obstacles do not depend on z."""
Values = Float[np.ndarray, "*points"]


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

    def distance(self, places: Places) -> Values:
        """Signed distance of places: negative behind the line."""
        return np.asarray((places[..., :2] - np.array(self.point)) @ np.array(self.normal))

    def derivatives(self, place: Places, rate: Places, bend: Places) -> tuple[Values, Values]:
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

    def distance(self, places: Places) -> Values:
        """Signed distance of places from the circle: negative where it is forbidden."""
        gap = np.linalg.norm(places[..., :2] - np.array(self.centre), axis=-1)
        return np.asarray(self._sign * (gap - self.radius))

    def derivatives(self, place: Places, rate: Places, bend: Places) -> tuple[Values, Values]:
        """First and second derivative of a growing function of the distance along curves."""
        gap, velocity = place[..., :2] - np.array(self.centre), rate[..., :2]
        first = (gap * velocity).sum(axis=-1)
        second = (velocity * velocity).sum(axis=-1) + (gap * bend[..., :2]).sum(axis=-1)
        return self._sign * first, self._sign * second


Obstacle = HalfPlane | Disc
