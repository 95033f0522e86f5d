"""What to draw around the shape of a structure: supports, loads and actuators, as plain data.

`Structure.drawing` returns them, so that no figure asks a structure for its type.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from equimorph.arrays import Float

Spots = Float[np.ndarray, "lanes space"]
"""One place or direction for each state."""
Arrays = Float[np.ndarray, "lanes places space"]
"""Several places or vectors for each state."""
VISIBLE = 1e-3
"""Share of a coordinate axis along which a support slides that its symbol may follow."""


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
    directions: Float[np.ndarray, "held space"],
    stiffness: Float[np.ndarray, " held"],
    turning: float,
    places: Spots,
    inward: Spots,
) -> tuple[Support, ...]:
    """Symbols of all that holds one point of a structure, in the plane or in space.

    Parameters
    ----------
    directions
        Orthonormal directions along which the point is held.
    stiffness
        Its stiffness along these: ∞ where held firmly, 0 where free.
    turning
        Stiffness against turning: ∞ where held, 0 where free.
    places
        Where the point is in each state.
    inward
        Unit vectors that point into the structure, for a clamp.
    """
    firm, fixed, found = directions[np.isinf(stiffness)], bool(np.isinf(turning)), []

    def add(kind: SupportKind, direction: Float[np.ndarray, "..."]) -> None:
        found.append(Support(kind, places, np.array(np.broadcast_to(direction, places.shape))))

    if len(firm) == places.shape[1]:
        add(SupportKind.CLAMP if fixed else SupportKind.PIN, inward)
    elif len(firm):
        across = np.eye(places.shape[1]) - firm.T @ firm
        sliding = across[np.argmax(np.linalg.norm(across, axis=1) > VISIBLE)]
        add(SupportKind.SLEEVE if fixed else SupportKind.ROLLER, sliding / np.linalg.norm(sliding))
    elif fixed:
        add(SupportKind.GRIP, inward)
    for direction, stiff in zip(directions, stiffness, strict=True):
        if 0.0 < stiff < np.inf:
            add(SupportKind.SPRING, direction)
    if 0.0 < turning < np.inf:
        add(SupportKind.COIL, inward)
    return tuple(found)
