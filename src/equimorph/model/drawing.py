"""What to draw around the shape of a structure: supports, loads and actuators, as plain data.

See docs/decisions.md, "The structure says what to draw".
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Float

Spots = Float[np.ndarray, "lanes space"]
"""One place or direction for each state."""
Arrays = Float[np.ndarray, "lanes places space"]
"""Several places or vectors for each state."""


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
