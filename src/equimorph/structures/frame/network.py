"""The network of a frame: joints, members, hinges and supports."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.array_types import Bool, Float
from equimorph.errors import InputError
from equimorph.structures.frame.any_model import WEIGHT, AnyFrameNetwork
from equimorph.structures.frame.member import (
    AXES,
    Member,
    MemberSpec,
    SupportSpec,
    stiffnesses,
    support_data,
)
from equimorph.structures.network import (
    Joints,
    edges_between,
    places_of_joints,
    supported_joints,
)
from equimorph.structures.unit_system import UnitSystem


@dataclass(frozen=True, eq=False)
class FrameNetwork(AnyFrameNetwork):
    """Joints in their places, the members between them, and their supports.

    supports: stiffness against x, y and turning, ∞ where held, 0 where free.
    """

    members: tuple[Member, ...]
    supports: Float[np.ndarray, "joints 3"]
    axes_of_turns: ClassVar[int] = 1
    sizes_of_loads: ClassVar[tuple[int, ...]] = (2, 3)

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

    def supports_data(self) -> list[dict[str, Any]]:
        """Tables of the supports."""
        return [support_data(row) for row in self.supports]

    @property
    def bending(self) -> float:
        """Mean bending stiffness of the members: the unit of bending stiffnesses."""
        return float(np.mean([float(member.EI) for member in self.members]))

    @property
    def weights(self) -> Float[np.ndarray, " members"]:
        """Weights per length; 0 where none is given."""
        return np.array([float(member.weight or 0.0) for member in self.members])

    @property
    def turning_places(self) -> int:
        """Joints."""
        return len(self.joints)

    def place_of_turn(self, joint: str) -> int:
        """Joint that a support turns; InputError if it does not."""
        return self.support_place(joint, "angle")[0]

    def check_move(self, joint: str, move: Float[np.ndarray, "2"], what: str) -> None:
        """Refuse a move of a support along an axis that it neither holds nor springs."""
        del what
        for axis in np.flatnonzero(move):
            self.support_place(joint, AXES[axis])

    def has_rigid_member(self, joint: int) -> bool:
        """Whether a member is rigidly joined to a joint."""
        return bool(self.rigid[joint])

    def bears(
        self, forces: Float[np.ndarray, "joints 2"], couples: Float[np.ndarray, " joints"]
    ) -> bool:
        """Whether supports alone bear a load on the joints."""
        given = np.column_stack([forces, couples])
        return not given[~np.isinf(self.supports)].any()

    def signs_of_strains(self, direction: float) -> Float[np.ndarray, "1"]:
        """A curvature to the left is one to the right from the other end."""
        return np.array([direction])

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
    made = tuple(Member.read(each).measured(system) for each in members)
    ends, _ = edges_between(made, names)
    held = np.zeros((len(names), 3))
    for at, joint, given in supported_joints(supports, names):
        held[at] = stiffnesses(joint, given, system)
    result = FrameNetwork(names, places, ends, made, held)
    result.check()
    assert result.lengths.all()  # arcs that do not reach are refused here
    _check_angles(result)
    for axis, stiff in zip(AXES, held.T[:2], strict=False):
        if not stiff.any():
            raise InputError(
                f"`frame` must be no mechanism; nothing holds it in {axis}. Add a support."
            )
    return result


def _check_angles(made: FrameNetwork) -> None:
    for joint, rigid, stiff in zip(made.joints, made.rigid, made.supports[:, 2], strict=True):
        if stiff and not rigid:
            raise InputError(
                f"`supports.{joint}` must not hold an angle where every member is hinged; got "
                "one that does. Leave out a hinge, or hold x and y only."
            )
