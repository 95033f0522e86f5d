"""The network of a truss: joints, bars and supports, and what can move."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.errors import InputError
from equimorph.structures.truss.bar import Bar, bar_of
from equimorph.structures.unit_system import UnitSystem
from equimorph.structures.walk import walk_along

AXES = "xyz"
_NAME = re.compile(r"[A-Za-z0-9_]+")


@dataclass(frozen=True, eq=False)
class Network:
    """Joints in their places, which bars join them, and which of their moves are held."""

    joints: tuple[str, ...]
    places: Float[np.ndarray, "joints space"]
    bars: tuple[Bar, ...]
    ends: Int[np.ndarray, "bars 2"]
    held: Bool[np.ndarray, "joints space"]

    @property
    def space(self) -> int:
        """Two or three dimensions."""
        return int(self.places.shape[1])

    @cached_property
    def unknowns(self) -> Int[np.ndarray, "joints space"]:
        """Number of the unknown of each move of a joint; −1 where it is held."""
        numbers = np.cumsum(~self.held.ravel()).reshape(self.held.shape) - 1
        return np.where(self.held, -1, numbers)

    @cached_property
    def moves(self) -> tuple[str, ...]:
        """Names of the unknowns: joint and axis, like ``B.y``."""
        return tuple(
            f"{joint}.{axis}"
            for joint, free in zip(self.joints, ~self.held, strict=True)
            for axis, moves in zip(AXES, free, strict=False)
            if moves
        )

    @cached_property
    def lengths(self) -> Float[np.ndarray, " bars"]:
        """Distances of the joints of each bar, as drawn."""
        return np.asarray(np.linalg.norm(np.diff(self.places[self.ends], axis=1)[:, 0], axis=1))

    @cached_property
    def rests(self) -> Float[np.ndarray, " bars"]:
        """Lengths of the bars at which they are free of stress."""
        return np.array(
            [
                drawn if bar.rest is None else float(bar.rest)
                for bar, drawn in zip(self.bars, self.lengths, strict=True)
            ]
        )

    @cached_property
    def walk(self) -> Int[np.ndarray, " steps"]:
        """Joints in the order of a walk along all bars, some of them there and back."""
        return walk_along(self.ends, len(self.joints))

    def joint(self, name: Any) -> int:
        """Place of a joint in the list."""
        if name not in self.joints:
            raise InputError(f"`joint` must be one of {', '.join(self.joints)}; got {name!r}.")
        return self.joints.index(name)

    def bar(self, name: Any) -> int:
        """Place of a bar in the list, whichever end is named first."""
        names = [bar.name for bar in self.bars]
        turned = "-".join(reversed(name.split("-"))) if isinstance(name, str) else name
        for each in (name, turned):
            if each in names:
                return names.index(each)
        raise InputError(f"`bar` must be one of {', '.join(names)}; got {name!r}.")

    def move(self, joint: Any, axis: Any) -> int:
        """Number of the unknown of a joint along an axis."""
        axes = AXES[: self.space]
        if not (isinstance(axis, str) and len(axis) == 1 and axis in axes):
            raise InputError(f"`axis` must be one of {', '.join(axes)}; got {axis!r}.")
        unknown = int(self.unknowns[self.joint(joint), axes.index(axis)])
        if unknown < 0:
            raise InputError(f"`{joint}.{axis}` must be free to move; it is held by a support.")
        return unknown

    def vector(self, forces: Any, what: str) -> Float[np.ndarray, " unknowns"]:
        """Nodal vectors by joint as one vector of the unknowns."""
        total = np.zeros(self.held.shape)
        for joint, given in _items(forces, what):
            total[self.joint(joint)] = _numbers(given, self.space, f"{what} on {joint}")
        free = total[~self.held]
        if not free.any():
            raise InputError(f"`{what}` must act on a joint that is free to move; got {forces!r}.")
        return np.asarray(free)


def network(joints: Any, bars: Iterable[Any], supports: Any, system: UnitSystem) -> Network:
    """Network from what a user gives, checked.

    Raises
    ------
    InputError
        For joints without place or bars, bars between unknown, equal or held joints, unknown
        supports, or if nothing can move.
    """
    names, places = _places(joints, system)
    made = tuple(bar_of(each).measured(system) for each in bars)
    ends = np.empty((len(made), 2), dtype=int)
    for k, bar in enumerate(made):
        for i, end in enumerate(bar.ends):
            if end not in names:
                raise InputError(
                    f"`ends` of bar {bar.name} must be joints ({', '.join(names)}); got {end}."
                )
            ends[k, i] = names.index(end)
    held = np.zeros(places.shape, bool)
    for joint, axes in _items(supports, "supports"):
        held[_known(joint, names), _held_axes(joint, axes, places.shape[1])] = True
    result = Network(names, places, made, ends, held)
    _check_bars(result)
    _check_connection(result)
    _check_supports(result)
    return result


def _items(given: Any, what: str) -> Iterable[tuple[Any, Any]]:
    if not isinstance(given, Mapping):
        raise InputError(f"`{what}` must be a table by joint; got {given!r}.")
    return given.items()


def _known(joint: Any, names: Sequence[str]) -> int:
    if joint not in names:
        raise InputError(f"`supports` must be at joints ({', '.join(names)}); got {joint}.")
    return names.index(joint)


def _numbers(given: Any, count: int, what: str) -> Float[np.ndarray, " count"]:
    try:
        numbers = np.array([float(x) for x in given])
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise InputError(f"`{what}` must be {count} finite numbers; got {given!r}.")
    return numbers


def _places(
    joints: Any, system: UnitSystem
) -> tuple[tuple[str, ...], Float[np.ndarray, "joints space"]]:
    given = dict(_items(joints, "joints"))
    if len(given) < 2:
        raise InputError(f"`joints` must be at least two; got {len(given)}.")
    for name in given:
        if not (isinstance(name, str) and _NAME.fullmatch(name)):
            raise InputError(
                f"`joints` must have names of letters, digits and underscores; got {name!r}."
            )
    first = next(iter(given.values()))
    space = len(first) if isinstance(first, Sequence) and len(first) in (2, 3) else 2
    places = []
    for name, place in given.items():
        what = f"joints.{name}"
        places.append(_numbers(system.numbers(place, "length", what), space, what))
    return tuple(given), np.array(places)


def _held_axes(joint: str, axes: Any, space: int) -> list[int]:
    known = AXES[:space]
    fine = isinstance(axes, str) and axes and set(axes) <= set(known)
    if not fine or len(set(axes)) < len(axes):
        raise InputError(
            f"`supports.{joint}` must hold some of the axes {known}, each once; got {axes!r}."
        )
    return [known.index(axis) for axis in axes]


def _check_bars(made: Network) -> None:
    pairs = [frozenset(bar.ends) for bar in made.bars]
    for i, j in combinations(range(len(pairs)), 2):
        if pairs[i] == pairs[j]:
            raise InputError(
                f"`bars` must join each pair of joints once; got {made.bars[j].name} again."
            )
    for bar, length in zip(made.bars, made.lengths, strict=True):
        if length == 0.0:
            raise InputError(f"`joints` of bar {bar.name} must lie apart; got one place for both.")
    for i, joint in enumerate(made.joints):
        if i not in made.ends:
            raise InputError(
                f"`bars` must reach every joint; got none at {joint}. Join it, or leave it out."
            )


def _check_connection(made: Network) -> None:
    apart = set(range(len(made.joints))) - set(made.walk.tolist())
    if apart:
        names = [made.joints[i] for i in sorted(apart)]
        raise InputError(
            f"`bars` must join all joints; got {', '.join(names)} apart from {made.joints[0]}. "
            "Join them, or make two trusses."
        )


def _check_supports(made: Network) -> None:
    if made.held.all():
        raise InputError("`supports` must leave a joint free to move; got all of them held.")
    fast = np.asarray(made.held.all(axis=1))
    for bar, (i, j) in zip(made.bars, made.ends, strict=True):
        if fast[i] and fast[j]:
            raise InputError(
                f"`supports` must leave an end of every bar free; got bar {bar.name} with both "
                "held, so that nothing depends on it. Leave it out."
            )
