"""The network of a frame: joints, members, hinges and supports."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from equimorph.errors import InputError, suggestion
from equimorph.structures.frame.member import AXES, Member, member_of, stiffnesses
from equimorph.structures.unit_system import UnitSystem
from equimorph.structures.walk import walk_along

WEIGHT = "weight"
_NAME = re.compile(r"[A-Za-z0-9_]+")


@dataclass(frozen=True, eq=False)
class Network:
    """Joints in their places, the members between them, and their supports.

    supports: stiffness against x, y and turning, ∞ where held, 0 where free.
    """

    joints: tuple[str, ...]
    places: Float[np.ndarray, "joints 2"]
    members: tuple[Member, ...]
    ends: Int[np.ndarray, "members 2"]
    supports: Float[np.ndarray, "joints 3"]

    @cached_property
    def chords(self) -> Float[np.ndarray, "members 2"]:
        """Vectors from start to end, as drawn."""
        return np.asarray(np.diff(self.places[self.ends], axis=1)[:, 0])

    @cached_property
    def lengths(self) -> Float[np.ndarray, " members"]:
        """Lengths of the members, free of stress."""
        chords = np.hypot(*self.chords.T)
        pairs = zip(self.members, chords, strict=True)
        return np.array([member.length(float(chord)) for member, chord in pairs])

    @cached_property
    def hinged(self) -> Bool[np.ndarray, "members 2"]:
        """Which ends are hinged."""
        return np.array([[end in each.hinges for end in each.ends] for each in self.members])

    @cached_property
    def rigid(self) -> Bool[np.ndarray, " joints"]:
        """Which joints turn with a member."""
        found = np.zeros(len(self.joints), bool)
        found[self.ends[~self.hinged]] = True
        return found

    @cached_property
    def walk(self) -> Int[np.ndarray, " steps"]:
        """Joints in the order of a walk along all members, some of them there and back."""
        return walk_along(self.ends, len(self.joints))

    def joint(self, name: Any) -> int:
        """Place of a joint in the list."""
        if name not in self.joints:
            raise InputError(
                f"`joint` must be one of {', '.join(self.joints)}; got {name!r}."
                f"{suggestion(str(name), self.joints)}"
            )
        return self.joints.index(name)

    def member(self, name: Any) -> tuple[int, float]:
        """Place of a member in the list, and −1 if it is named from end to start, else 1."""
        names = [member.name for member in self.members]
        turned = "-".join(reversed(name.split("-"))) if isinstance(name, str) else name
        for each, sign in ((name, 1.0), (turned, -1.0)):
            if each in names:
                return names.index(each), sign
        raise InputError(
            f"`member` must be one of {', '.join(names)}; got {name!r}."
            f"{suggestion(str(name), names)}"
        )

    def end(self, member: str, joint: str) -> tuple[int, int]:
        """Place of a member in the list, and 0 for its start or 1 for its end at a joint."""
        at, _ = self.member(member)
        ends = self.members[at].ends
        if joint not in ends:
            raise InputError(
                f"`joint` must be an end of member {self.members[at].name}; got {joint!r}."
            )
        return at, list(ends).index(joint)

    def supported(self, joint: Any, axis: Any) -> tuple[int, int]:
        """Joint and axis (0, 1, 2) of a support."""
        if axis not in AXES:
            raise InputError(f"`axis` must be one of {', '.join(AXES)}; got {axis!r}.")
        at = self.joint(joint), AXES.index(axis)
        if self.supports[at] == 0.0:
            raise InputError(f"`{joint}.{axis}` must be held or sprung by a support; it is free.")
        return at


def network(joints: Any, members: Iterable[Any], supports: Any, system: UnitSystem) -> Network:
    """Network from what a user gives, checked.

    Raises
    ------
    InputError
        For joints without place or members, members between unknown or equal joints, arcs that do
        not reach, unknown supports, or joints apart from the others.
    """
    names, places = _places(joints, system)
    made = tuple(member_of(each).measured(system) for each in members)
    ends = np.empty((len(made), 2), dtype=int)
    for k, member in enumerate(made):
        for i, end in enumerate(member.ends):
            if end not in names:
                raise InputError(
                    f"`ends` of member {member.name} must be joints ({', '.join(names)}); got "
                    f"{end}."
                )
            ends[k, i] = names.index(end)
    held = np.zeros((len(names), 3))
    for joint, given in items(supports, "supports", "joint"):
        if joint not in names:
            raise InputError(f"`supports` must be at joints ({', '.join(names)}); got {joint}.")
        held[names.index(joint)] = stiffnesses(joint, given, system)
    result = Network(names, places, made, ends, held)
    _check_members(result)
    _check_connection(result)
    _check_angles(result)
    return result


def items(given: Any, what: str, by: str) -> Iterable[tuple[Any, Any]]:
    """Pairs of a table, or InputError."""
    if not isinstance(given, Mapping):
        raise InputError(f"`{what}` must be a table by {by}; got {given!r}.")
    return given.items()


def numbers(given: Any, counts: Sequence[int], what: str) -> list[float]:
    """Finite numbers, as many as one of `counts`."""
    try:
        found = [float(x) for x in given]
    except (TypeError, ValueError):
        found = []
    if len(found) not in counts or not np.isfinite(found).all():
        many = " or ".join(map(str, counts))
        raise InputError(f"`{what}` must be {many} finite numbers; got {given!r}.")
    return found


def _places(
    joints: Any, system: UnitSystem
) -> tuple[tuple[str, ...], Float[np.ndarray, "joints 2"]]:
    given = dict(items(joints, "joints", "name"))
    if len(given) < 2:
        raise InputError(f"`joints` must be at least two; got {len(given)}.")
    for name in given:
        if not (isinstance(name, str) and _NAME.fullmatch(name)) or name == WEIGHT:
            raise InputError(
                "`joints` must have names of letters, digits and underscores, other than "
                f"{WEIGHT}; got {name!r}."
            )
    places = []
    for name, at in given.items():
        what = f"joints.{name}"
        places.append(numbers(system.numbers(at, "length", what), [2], what))
    return tuple(given), np.array(places)


def _check_members(made: Network) -> None:
    if not made.members:
        raise InputError("`members` must be one at least; got none.")
    seen: set[frozenset[str]] = set()
    for member, chord in zip(made.members, made.chords, strict=True):
        if frozenset(member.ends) in seen:
            raise InputError(
                f"`members` must join each pair of joints once; got {member.name} again. Put a "
                "joint on one of them."
            )
        seen.add(frozenset(member.ends))
        if not chord.any():
            raise InputError(
                f"`joints` of member {member.name} must lie apart; got one place for both."
            )
    assert made.lengths.all()


def _check_connection(made: Network) -> None:
    for i, joint in enumerate(made.joints):
        if i not in made.ends:
            raise InputError(
                f"`members` must reach every joint; got none at {joint}. Join it, or leave it out."
            )
    apart = set(range(len(made.joints))) - set(made.walk.tolist())
    if apart:
        names = [made.joints[i] for i in sorted(apart)]
        raise InputError(
            f"`members` must join all joints; got {', '.join(names)} apart from {made.joints[0]}. "
            "Join them, or make two frames."
        )


def _check_angles(made: Network) -> None:
    for joint, rigid, stiff in zip(made.joints, made.rigid, made.supports[:, 2], strict=True):
        if stiff and not rigid:
            raise InputError(
                f"`supports.{joint}` must not hold an angle where every member is hinged; got "
                "one that does. Leave out a hinge, or hold x and y only."
            )
