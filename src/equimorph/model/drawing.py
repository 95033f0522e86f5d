"""What to draw around the shape of a structure: supports, loads and actuators, as plain data.

See docs/decisions.md, "The structure says what to draw".
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Values

Spots = Float[np.ndarray, "lanes space"]
"""One place or direction for each state."""
Arrays = Float[np.ndarray, "lanes places space"]
"""Several places or vectors for each state."""
Stiffness = Float[np.ndarray, "3"]
"""Against moves in x and y and against turning: ∞ where held, 0 where free."""
AXES = np.eye(2)


class SupportKind(StrEnum):
    """What a support holds, by which its symbol is chosen."""

    CLAMP = "clamp"
    """Place and angle; its direction points into the structure."""
    PIN = "pin"
    """Place."""
    ROLLER = "roller"
    """The place across its direction, along which it rolls."""
    SLEEVE = "sleeve"
    """The angle, and the place across its direction, along which it slides."""
    GRIP = "grip"
    """The angle alone."""
    SPRING = "spring"
    """The place along its direction, elastically."""
    COIL = "coil"
    """The angle, elastically."""


@dataclass(frozen=True, eq=False)
class Support:
    """A support of a structure in a batch of states.

    Attributes
    ----------
    kind
        What it holds.
    places
        Where it is, in the structure's unit of length.
    directions
        Unit vectors; see `SupportKind`. The direction of a pin or a coil has no meaning.
    """

    kind: SupportKind
    places: Spots
    directions: Spots


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces of one kind on a structure in a batch of states.

    Attributes
    ----------
    places
        Points of application.
    vectors
        Forces, or loads per length. Their lengths in a picture are compared among all single forces
        of the structure, or among all distributed ones.
    distributed
        Whether they are samples of a load per length, in order along a line.
    """

    places: Arrays
    vectors: Arrays
    distributed: bool = False


@dataclass(frozen=True, eq=False)
class Couples:
    """Couples on a planar structure in a batch of states, counterclockwise if positive."""

    places: Arrays
    moments: Float[np.ndarray, "lanes places"]


class ActuatorKind(StrEnum):
    """What an actuator in or on a structure does."""

    LENGTH = "length"
    """It changes the length of a bar."""
    CURVATURE = "curvature"
    """It bends a piece of a rod."""
    CABLE = "cable"
    """It pulls on a cable."""


@dataclass(frozen=True, eq=False)
class Actuator:
    """An actuator in a batch of states, as the line on which it works."""

    kind: ActuatorKind
    line: Arrays


@dataclass(frozen=True, eq=False)
class Drawing:
    """Everything to draw around the shape of a structure in a batch of states.

    Supports come in the same order for every batch, and so do forces, couples and actuators:
    a film draws each once and moves it.
    """

    supports: tuple[Support, ...] = ()
    forces: tuple[Forces, ...] = ()
    couples: tuple[Couples, ...] = ()
    actuators: tuple[Actuator, ...] = ()


def supports_of_point(
    stiffness: Stiffness, places: Spots, tangents: Spots, slide: float | None = None
) -> tuple[Support, ...]:
    """Symbols of all that holds one point of a planar structure.

    Parameters
    ----------
    stiffness
        Against moves in x, in y, and turns.
    places
        Where the point is in each state.
    tangents
        Unit vectors that point into the structure, for a clamp.
    slide
        Direction in radians along which a point that is held in x and y may move all the same.
    """
    held = np.isinf(stiffness)
    firm, fixed = held[:2], bool(held[2])
    found = []
    if slide is not None:
        kind = SupportKind.SLEEVE if fixed else SupportKind.ROLLER
        found.append(_support(kind, places, np.array([np.cos(slide), np.sin(slide)])))
    elif firm.all():
        found.append(Support(SupportKind.CLAMP if fixed else SupportKind.PIN, places, tangents))
    elif firm.any():
        kind = SupportKind.SLEEVE if fixed else SupportKind.ROLLER
        found.append(_support(kind, places, AXES[int(np.argmin(firm))]))
    elif fixed:
        found.append(Support(SupportKind.GRIP, places, tangents))
    for axis, stiff in zip(AXES, stiffness[:2], strict=True):
        if 0.0 < stiff < np.inf:
            found.append(_support(SupportKind.SPRING, places, axis))
    if 0.0 < stiffness[2] < np.inf:
        found.append(Support(SupportKind.COIL, places, tangents))
    return tuple(found)


def unit_vectors(angles: Values) -> Spots:
    """Unit vectors at angles."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _support(kind: SupportKind, places: Spots, direction: Float[np.ndarray, "2"]) -> Support:
    return Support(kind, places, np.tile(direction, (len(places), 1)))
