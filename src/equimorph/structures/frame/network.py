"""The network of a frame: joints, members, hinges and supports."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float

from equimorph.errors import InputError
from equimorph.structures.frame.member import (
    AXES,
    Member,
    MemberSpec,
    SupportSpec,
    member_of,
    stiffnesses,
)
from equimorph.structures.network import (
    Joints,
    Network,
    ends_of_edges,
    places_of_joints,
    supported_joints,
)
from equimorph.structures.unit_system import UnitSystem

WEIGHT = "weight"


@dataclass(frozen=True, eq=False)
class FrameNetwork(Network):
    """Joints in their places, the members between them, and their supports.

    supports: stiffness against x, y and turning, ∞ where held, 0 where free.
    """

    members: tuple[Member, ...]
    supports: Float[np.ndarray, "joints 3"]
    edge: ClassVar[str] = "member"
    whole: ClassVar[str] = "frames"

    @property
    def edge_names(self) -> list[str]:
        """Names of the members."""
        return [member.name for member in self.members]

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

    def member(self, name: str) -> tuple[int, float]:
        """Place of a member in the list, and −1 if it is named from end to start, else 1."""
        return self.place_of_edge(name)

    def end(self, member: str, joint: str) -> tuple[int, int]:
        """Place of a member in the list, and 0 for its start or 1 for its end at a joint."""
        at, _ = self.member(member)
        ends = self.members[at].ends
        if joint not in ends:
            raise InputError(
                f"`joint` must be an end of member {self.members[at].name}; got {joint!r}."
            )
        return at, list(ends).index(joint)

    def support_place(self, joint: str, axis: str) -> tuple[int, int]:
        """Joint and axis (0, 1, 2) of a support."""
        if axis not in AXES:
            raise InputError(f"`axis` must be one of {', '.join(AXES)}; got {axis!r}.")
        at = self.joint(joint), AXES.index(axis)
        if self.supports[at] == 0.0:
            raise InputError(f"`{joint}.{axis}` must be held or sprung by a support; it is free.")
        return at


def frame_network(
    joints: Joints,
    members: Iterable[MemberSpec],
    supports: Mapping[str, SupportSpec],
    system: UnitSystem,
) -> FrameNetwork:
    """Network from what a user gives, checked.

    Raises
    ------
    InputError
        For joints without place or members, members between unknown or equal joints, arcs that do
        not reach, unknown supports, or joints that are not connected to the rest.
    """
    names, places = places_of_joints(joints, system, (2,), reserved=(WEIGHT,))
    made = tuple(member_of(each).measured(system) for each in members)
    ends = ends_of_edges(made, names, "member")
    held = np.zeros((len(names), 3))
    for at, joint, given in supported_joints(supports, names):
        held[at] = stiffnesses(joint, given, system)
    result = FrameNetwork(names, places, ends, made, held)
    result.check()
    assert result.lengths.all()  # arcs that do not reach are refused here
    _check_angles(result)
    return result


def _check_angles(made: FrameNetwork) -> None:
    for joint, rigid, stiff in zip(made.joints, made.rigid, made.supports[:, 2], strict=True):
        if stiff and not rigid:
            raise InputError(
                f"`supports.{joint}` must not hold an angle where every member is hinged; got "
                "one that does. Leave out a hinge, or hold x and y only."
            )
