"""How the ends of a rod in space are supported."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures.rod.ends import FREE, HELD, Axis, Holding, Support, stiffness

AXES = ("x", "y", "z")
PLACES = ("nu", "rise", "sideways")
"""Parameters that place end B relative to end A along x, y and z."""
WORDS: dict[str, tuple[Holding, Holding, Holding, Holding]] = {
    "clamped": (HELD, HELD, HELD, HELD),
    "pinned": (FREE, HELD, HELD, HELD),
    "free": (FREE, FREE, FREE, FREE),
    "guided": (HELD, FREE, HELD, HELD),
}


@check_arguments
@dataclass(frozen=True)
class SpatialEnd(Support):
    """Support of one end of a rod in space: what happens to its rotation and its coordinates.

    "clamped" holds all; "pinned" is a ball joint: it holds the place; "free" holds nothing;
    "guided" is a sleeve along x: it holds the rotation, y and z.

    Parameters
    ----------
    rotation
        "held" at the angles of parameters, or "free".
    x, y, z
        Each "held" at the value of a parameter, "free", or held by a spring: a number, its
        stiffness, with the parameter as the place where the spring is at rest.
    """

    rotation: str = HELD
    x: Holding = HELD
    y: Holding = HELD
    z: Holding = HELD

    def __post_init__(self) -> None:
        """Check the word for the rotation."""
        if self.rotation not in (HELD, FREE):
            raise InputError(
                f"`rotation` of an end must be 'held' or 'free'; got {self.rotation!r}. A spring "
                "against rotations in space is not modelled."
            )

    @property
    def turns(self) -> bool:
        """Whether the rotation is free."""
        return self.rotation == FREE

    @property
    def turning(self) -> Holding:
        """What happens to its rotation."""
        return self.rotation

    @property
    def along_directions(self) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
        """The three axes."""
        return np.eye(3), np.array([stiffness(self.along(axis)) for axis in AXES])

    def along(self, axis: str) -> Holding:
        """What happens to a coordinate."""
        return getattr(self, axis)  # type: ignore[no-any-return]

    def scaled(self, unit: float) -> "SpatialEnd":
        """The same end with its stiffnesses divided by a unit of force per length."""
        places = [self.along(axis) for axis in AXES]
        x, y, z = (each if isinstance(each, str) else each / unit for each in places)
        return SpatialEnd(self.rotation, x, y, z)

    def data(self) -> str | dict[str, Any]:
        """A word if there is one for it, else its parts."""
        parts = (self.rotation, self.x, self.y, self.z)
        words = [word for word, meaning in WORDS.items() if meaning == parts]
        return words[0] if words else asdict(self)


Ends = tuple[SpatialEnd, SpatialEnd]


def spatial_end(spec: Any, name: str) -> SpatialEnd:
    """End of a word, of plain data, or the end itself."""
    if isinstance(spec, SpatialEnd):
        return spec
    if isinstance(spec, str) and spec in WORDS:
        return SpatialEnd(*WORDS[spec])  # type: ignore[arg-type]  # the first of them is a word
    if isinstance(spec, Mapping) and set(spec) <= {"rotation", *AXES}:
        return SpatialEnd(**spec)
    raise InputError(
        f"`{name}` must be one of {', '.join(map(repr, WORDS))}, or a SpatialEnd(rotation, x, y, "
        f"z) of 'held', 'free' and spring stiffnesses; got {spec!r}."
    )


def support_axes(ends: Ends) -> tuple[Axis, ...]:
    """x, y and z with what both ends hold."""
    units = np.eye(3).tolist()
    return tuple(
        Axis(place, tuple(unit), ends[0].along(axis), ends[1].along(axis))
        for axis, place, unit in zip(AXES, PLACES, units, strict=True)
    )


def check_supports(ends: Ends) -> None:
    """Refuse a rod that can move as a whole: no end holds a coordinate, or none the rotation."""
    for axis in AXES:
        if all(end.along(axis) == FREE for end in ends):
            raise InputError(
                f"`ends` must hold {axis} at one end at least; got two that are free in {axis}: "
                "the rod could drift. Hold one, or give it a spring."
            )
    if all(end.turns for end in ends):
        raise InputError(
            "`ends` must hold the rotation of one end at least; got two that turn: the rod could "
            "spin about the line between them, and its states would not be isolated. Clamp or "
            "guide one end."
        )
