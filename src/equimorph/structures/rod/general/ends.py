"""How the ends of a rod are supported."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from equimorph.errors import InputError

Holding = str | float
HELD, FREE = "held", "free"
WORDS: dict[str, tuple[Holding, Holding, Holding]] = {
    "clamped": (HELD, HELD, HELD),
    "pinned": (FREE, HELD, HELD),
    "free": (FREE, FREE, FREE),
    "sliding": (HELD, FREE, HELD),
}


@dataclass(frozen=True)
class End:
    """Support of one end of a rod: what happens to its angle and its two coordinates.

    Each is "held" (at the value of a parameter), "free", or held by a spring: a number, its
    stiffness, with the parameter as the place where the spring is at rest.

    Parameters
    ----------
    angle
        The end's tangent angle.
    x, y
        Its coordinates.
    """

    angle: Holding = HELD
    x: Holding = HELD
    y: Holding = HELD

    def __post_init__(self) -> None:
        """Check the words and stiffnesses."""
        for name, value in asdict(self).items():
            if value in (HELD, FREE):
                continue
            number = np.nan
            if isinstance(value, int | float) and not isinstance(value, bool):
                number = float(value)
            if not 0.0 < number < np.inf:
                raise InputError(
                    f"`{name}` of an end must be 'held', 'free' or the stiffness of a spring, a "
                    f"positive number; got {value!r}."
                )

    def scaled(self, angle: float, force: float) -> "End":
        """The same end with its stiffnesses divided by units of moment and of force per length."""
        parts = ((self.angle, angle), (self.x, force), (self.y, force))
        return End(*(value if isinstance(value, str) else value / unit for value, unit in parts))

    def data(self) -> str | dict[str, Any]:
        """A word if there is one for it, else the three parts."""
        parts = (self.angle, self.x, self.y)
        words = [word for word, meaning in WORDS.items() if meaning == parts]
        return words[0] if words else asdict(self)


def end(spec: Any, name: str) -> End:
    """End of a word, of plain data, or the end itself.

    Raises
    ------
    InputError
        For anything else.
    """
    if isinstance(spec, End):
        return spec
    if isinstance(spec, str) and spec in WORDS:
        return End(*WORDS[spec])
    if isinstance(spec, Mapping) and set(spec) <= {"angle", "x", "y"}:
        return End(**spec)
    raise InputError(
        f"`{name}` must be one of {', '.join(map(repr, WORDS))}, or an End(angle, x, y) of "
        f"'held', 'free' and spring stiffnesses; got {spec!r}."
    )


def compliance(holding: Holding) -> float:
    """Displacement of a support under a unit force: 0 where it is held."""
    return 0.0 if holding == HELD else 1.0 / float(holding)


def check_supports(ends: tuple[End, End]) -> None:
    """Refuse a rod that can move as a whole.

    Raises
    ------
    InputError
        If neither end holds x, or y, or nothing holds the rotation.
    """
    first, last = ends
    for axis in ("x", "y"):
        if getattr(first, axis) == FREE and getattr(last, axis) == FREE:
            raise InputError(
                f"`ends` must hold {axis} at one end at least; got two that are free in {axis}: "
                "the rod could drift. Hold one, or give it a spring."
            )
    turned = first.angle != FREE or last.angle != FREE
    both = [getattr(first, axis) != FREE and getattr(last, axis) != FREE for axis in ("x", "y")]
    if not (turned or any(both)):
        raise InputError(
            "`ends` must hold an angle, or both ends in one direction; got a rod that could turn "
            "about its only support. Clamp an end, or support the other one."
        )
