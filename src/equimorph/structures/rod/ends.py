"""How the ends of a rod are supported."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_vocabulary import POSITIVE
from equimorph.arrays import Float
from equimorph.errors import InputError

Holding = Annotated[
    Annotated[str, one_of("held", "free")] | Annotated[float, POSITIVE],
    "'held', 'free' or the stiffness of a spring, a positive number",
]
HELD, FREE = "held", "free"
WORDS: dict[str, tuple[Holding, Holding, Holding]] = {
    "clamped": (HELD, HELD, HELD),
    "pinned": (FREE, HELD, HELD),
    "free": (FREE, FREE, FREE),
    "sliding": (HELD, FREE, HELD),
}


class Support(ABC):
    """Support of one end of a rod, in the plane or in space."""

    @property
    @abstractmethod
    def turning(self) -> Holding:
        """What happens to its rotation."""

    @property
    @abstractmethod
    def along_directions(self) -> tuple[Float[np.ndarray, "held axes"], Float[np.ndarray, " held"]]:
        """Orthonormal directions, and the stiffness along each: ∞ where held, 0 where free."""

    @property
    def holds_rotation(self) -> bool:
        """Whether the rotation of the end is prescribed."""
        return self.turning == HELD

    @abstractmethod
    def data(self) -> str | dict[str, Any]:
        """A word if there is one for it, else its parts."""


@check_arguments
@dataclass(frozen=True)
class End(Support):
    """Support of one end of a rod: what happens to its angle and its two coordinates.

    Each is "held" (at the value of a parameter), "free", or held by a spring: a number, its
    stiffness, with the parameter as the place where the spring is at rest.

    Parameters
    ----------
    angle
        The end's tangent angle.
    x, y
        Its coordinates.
    slide
        Direction in radians from the x axis of a line on which the support rolls: along it the end
        is free, across it held at the distance `offset` from the other end, which holds x and y.
    """

    angle: Holding = HELD
    x: Holding = HELD
    y: Holding = HELD
    slide: float | None = None

    def __post_init__(self) -> None:
        """Refuse a slide of an end that is not held across it."""
        if self.slide is not None and (self.x, self.y) != (HELD, HELD):
            raise InputError(
                "`slide` must be given to an end whose x and y are 'held': it says along which "
                f"line they are not; got x = {self.x!r}, y = {self.y!r}."
            )

    @property
    def turning(self) -> Holding:
        """What happens to its angle."""
        return self.angle

    @property
    def along_directions(self) -> tuple[Float[np.ndarray, "held 2"], Float[np.ndarray, " held"]]:
        """Both axes, or the normal of the line on which it rolls."""
        if self.slide is not None:
            normal = np.array([[-np.sin(self.slide), np.cos(self.slide)]])
            return normal, np.array([np.inf])
        return np.eye(2), np.array([stiffness(self.x), stiffness(self.y)])

    def scaled(self, angle: float, force: float) -> "End":
        """The same end with its stiffnesses divided by units of moment and of force per length."""
        parts = ((self.angle, angle), (self.x, force), (self.y, force))
        turn, x, y = (each if isinstance(each, str) else each / unit for each, unit in parts)
        return End(turn, x, y, self.slide)

    def data(self) -> str | dict[str, Any]:
        """A word if there is one for it, else its parts."""
        parts = (self.angle, self.x, self.y)
        words = [word for word, meaning in WORDS.items() if meaning == parts]
        if self.slide is not None:
            return asdict(self)
        return words[0] if words else dict(zip(("angle", "x", "y"), parts, strict=True))


EndSpec = Annotated[
    End
    | Annotated[str, one_of("clamped", "pinned", "free", "sliding")]
    | Mapping[Annotated[str, one_of("angle", "x", "y", "slide")], Any],
    "ends: 'clamped', 'pinned', 'free', 'sliding', or an `End` or its data",
]


def end(spec: EndSpec) -> End:
    """End of a word, of plain data, or the end itself."""
    if isinstance(spec, End):
        return spec
    return End(*WORDS[spec]) if isinstance(spec, str) else End(**spec)


@dataclass(frozen=True)
class Axis:
    """A direction in which both ends are supported, or not.

    name: of the parameter that places end B along it, if both are.
    """

    name: str
    unit: tuple[float, ...]
    first: Holding
    last: Holding

    @property
    def opposed(self) -> bool:
        """Whether both ends are supported in this direction: then there is a multiplier."""
        return FREE not in (self.first, self.last)

    @property
    def rigid(self) -> bool:
        """Whether both ends are held in this direction, without a spring."""
        return self.first == self.last == HELD


def support_axes(ends: tuple[End, End]) -> tuple[Axis, Axis]:
    """x and y, or the direction along which an end slides and the one across it."""
    first, last = ends
    slide = last.slide if first.slide is None else first.slide
    if slide is None:
        return (
            Axis("nu", (1.0, 0.0), first.x, last.x),
            Axis("rise", (0.0, 1.0), first.y, last.y),
        )
    c, s = float(np.cos(slide)), float(np.sin(slide))
    along = (HELD if first.slide is None else FREE, HELD if last.slide is None else FREE)
    return Axis("", (c, s), *along), Axis("offset", (-s, c), HELD, HELD)


def stiffness(holding: Holding) -> float:
    """Stiffness of a support along an axis: ∞ where held, 0 where free."""
    return {HELD: np.inf, FREE: 0.0}[holding] if isinstance(holding, str) else holding


def compliance(holding: Holding) -> float:
    """Displacement of a support under a unit force: 0 where it is held."""
    return 0.0 if holding == HELD else 1.0 / float(holding)


def check_supports(ends: tuple[End, End]) -> None:
    """Refuse a rod that can move as a whole: nothing holds x, or y, or the rotation."""
    first, last = ends
    if first.slide is not None or last.slide is not None:
        other = last if first.slide is not None else first
        if (other.x, other.y, other.slide) != (HELD, HELD, None):
            raise InputError(
                "`ends` must hold x and y of the end opposite to one that slides; got "
                f"{other.data()!r}. Hold it, or turn the axes so that x or y is free."
            )
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
