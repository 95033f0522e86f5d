"""The network of a frame in space: joints, pieces of members, and what turns with each joint."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.errors import InputError
from equimorph.structures.frame.any_network import PRESSURE, WEIGHT, AnyFrameNetwork
from equimorph.structures.network import Joints, edges_between, places_of_joints, supported_joints
from equimorph.structures.space_frame.member import (
    BALL,
    FREE,
    HELD,
    NO_SUPPORT,
    SpatialMember,
    SpatialMemberSpec,
    SpatialSupport,
    SpatialSupportSpec,
    spatial_support,
)
from equimorph.structures.unit_system import UnitSystem


class Turning(IntEnum):
    """How a body turns: freely, as a support says, or about an axis of another body."""

    FREE = 0
    HELD = 1
    HINGED = 2


@dataclass(frozen=True)
class Body:
    """What turns as a whole at a joint: members that are rigidly joined, or one that is hinged.

    parent, axis: of a hinge, the body on which it turns and its axis as drawn.
    """

    joint: int
    turning: Turning
    parent: int = -1
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SpatialNetwork(AnyFrameNetwork):
    """Joints in their places, the pieces of members between them, and their supports.

    owner: the member of each piece.
    """

    members: tuple[SpatialMember, ...]
    owner: Int[np.ndarray, " pieces"]
    supports: tuple[SpatialSupport, ...]
    axes_of_turns: ClassVar[int] = 3
    sizes_of_loads: ClassVar[tuple[int, ...]] = (3,)

    @cached_property
    def stretched(self) -> Float[np.ndarray, " pieces"]:
        """Strain of each piece that is free of stress: 0 where that is its length as drawn."""
        found = np.zeros(len(self.owner))
        for m, member in enumerate(self.members):
            if member.length is not None:
                mine = self.owner == m
                found[mine] = float(member.length) / self.lengths[mine].sum() - 1.0
        return found

    @cached_property
    def axes(self) -> Float[np.ndarray, "pieces 3 3"]:
        """Tangent, normal and binormal, as columns, in the middle of each piece as drawn."""
        pairs = zip(self.owner.tolist(), self.chords, strict=True)
        return np.stack([self.members[m].axes(chord) for m, chord in pairs])

    def supports_data(self) -> list[dict[str, Any]]:
        """Tables of the supports."""
        return [dict(support.data) for support in self.supports]

    def member_of(self, piece: int) -> int:
        """Member to which a piece belongs."""
        return int(self.owner[piece])

    def pieces_of(self, name: str) -> list[tuple[int, float]]:
        """Pieces of a member, or the one of that name, with −1 where it is named backwards."""
        for m, member in enumerate(self.members):
            if member.name == name:
                return [(int(k), 1.0) for k in np.flatnonzero(self.owner == m)]
        return [self.place_of_edge(name)]

    @property
    def turning_places(self) -> int:
        """Bodies."""
        return len(self.bodies)

    def place_of_turn(self, joint: str) -> int:
        """Body that a support turns; InputError if it turns none."""
        return self.held_body(joint)

    def check_move(self, joint: str, move: Float[np.ndarray, "3"], what: str) -> None:
        """Refuse a move of a support along directions that it does not hold."""
        if not self.supports[self.joint(joint)].holds(move):
            written = ", ".join(f"{x:g}" for x in move)
            raise InputError(
                f"`{what}` must be along directions that the support of {joint} holds; got "
                f"({written})."
            )

    def has_rigid_member(self, joint: int) -> bool:
        """Whether a member is rigidly joined to a joint."""
        return self._rigid[joint]

    def press(self, joints: Sequence[str], what: str) -> Float[np.ndarray, " pieces"]:
        """Refuse pressure: it has no potential on a curve in space."""
        raise InputError(
            f"`{what}` must act on a planar frame; got joints in space ({', '.join(joints)}): "
            "pressure has no potential on a curve there. Use dead line loads."
        )

    def bears(
        self, forces: Float[np.ndarray, "joints 3"], couples: Float[np.ndarray, " joints"]
    ) -> bool:
        """Whether supports alone bear a load on the joints."""
        pairs = zip(self.supports, forces, strict=True)
        return all(
            support.holds(force) and bool(np.isinf(support.stiffness).all())
            for support, force in pairs
            if force.any()
        )

    def signs_of_strains(self, direction: float) -> Float[np.ndarray, "3"]:
        """From the other end the tangent and the binormal are reversed, the normal is not."""
        return np.array([1.0, direction, 1.0])

    # --- bodies ---------------------------------------------------------------------------------

    @cached_property
    def _bodies(
        self,
    ) -> tuple[list[Body], Int[np.ndarray, " joints"], Int[np.ndarray, "pieces 2"]]:
        """Bodies, that of each joint (−1: none), and those of the ends of the pieces."""
        bodies: list[Body] = []
        own = np.full(len(self.joints), -1)
        for j, support in enumerate(self.supports):
            if not (self._rigid[j] or support.holds_rotation):
                continue
            if isinstance(support.rotation, tuple):
                bodies.append(Body(j, Turning.HELD))
                bodies.append(Body(j, Turning.HINGED, len(bodies) - 1, support.rotation))
            else:
                held = support.rotation == HELD
                bodies.append(Body(j, Turning.HELD if held else Turning.FREE))
            own[j] = len(bodies) - 1
        hinged: dict[tuple[int, int], int] = {}
        for m, member in enumerate(self.members):
            for name in member.hinges:
                j = self.joint(name)
                bodies.append(self._hinged(member, j, own, bodies))
                hinged[m, j] = len(bodies) - 1
        ends = [
            [hinged.get((m, j), int(own[j])) for j in pair]
            for m, pair in zip(self.owner.tolist(), self.ends.tolist(), strict=True)
        ]
        return bodies, own, np.array(ends)

    def _hinged(
        self, member: SpatialMember, j: int, own: Int[np.ndarray, " joints"], bodies: list[Body]
    ) -> Body:
        """Body of a member that is hinged to a joint."""
        hinge = member.hinge(self.joints[j])
        if hinge == BALL or not isinstance(hinge, tuple):
            return Body(j, Turning.FREE)
        what, parent = f"hinges.{self.joints[j]}", int(own[j])
        if parent < 0:
            raise InputError(
                f"`{what}` of member {member.name} must turn about an axis of a joint to which a "
                "member is rigidly joined; got none. Leave out one of the hinges there."
            )
        if bodies[parent].turning is Turning.HINGED:
            raise InputError(
                f"`{what}` of member {member.name} must not be at a joint whose support turns "
                "about an axis itself. Hold its rotation, or put a short member between."
            )
        x, y, z = (np.array(hinge) / np.linalg.norm(hinge)).tolist()
        return Body(j, Turning.HINGED, parent, (x, y, z))

    @cached_property
    def _rigid(self) -> list[bool]:
        """Whether a member is rigidly joined to each joint."""
        found = [False] * len(self.joints)
        for member in self.members:
            for name in member.joints:
                if member.hinge(name) is None:
                    found[self.joint(name)] = True
        return found

    @property
    def bodies(self) -> list[Body]:
        """Everything that turns as a whole at a joint."""
        return self._bodies[0]

    @property
    def body_of_joint(self) -> Int[np.ndarray, " joints"]:
        """Body that turns with each joint; −1 where all members are hinged."""
        return self._bodies[1]

    @property
    def body_of_end(self) -> Int[np.ndarray, "pieces 2"]:
        """Bodies of the starts and ends of the pieces."""
        return self._bodies[2]

    def held_body(self, joint: str) -> int:
        """Body of a joint whose support turns it."""
        at = int(self.body_of_joint[self.joint(joint)])
        body = self.bodies[at] if at >= 0 else None
        if body is not None and body.turning is Turning.HINGED:
            at, body = body.parent, self.bodies[body.parent]
        if body is None or body.turning is not Turning.HELD:
            raise InputError(f"`{joint}.rotation` must be held by a support; it is free.")
        return at

    def check_rotations(self) -> None:
        """Refuse supports that hold the rotation of nothing."""
        held = {each.parent for each in self.bodies}
        used = set(self.body_of_end.ravel().tolist()) | held
        for joint, support, own in zip(self.joints, self.supports, self.body_of_joint, strict=True):
            if support.rotation != FREE and int(own) not in used:
                raise InputError(
                    f"`supports.{joint}` must not hold a rotation where every member is hinged by "
                    "a ball joint; got one that does. Leave out a hinge, or hold the place only."
                )


def spatial_network(
    joints: Joints,
    members: Iterable[SpatialMemberSpec],
    supports: Mapping[str, SpatialSupportSpec],
    system: UnitSystem,
) -> SpatialNetwork:
    """Network from what a user gives, checked.

    Refused for joints without place or members, members between unknown or equal joints, arcs that
    do not reach, impossible hinges, unknown supports, or joints that are not connected.
    """
    names, places = places_of_joints(joints, system, (3,), reserved=(WEIGHT, PRESSURE))
    made = tuple(SpatialMember.read(each).measured(system) for each in members)
    ends, owner = edges_between(made, names)
    held = [NO_SUPPORT] * len(names)
    for at, joint, given in supported_joints(supports, names):
        held[at] = spatial_support(joint, given, system)
    stiff = tuple(each.stiffness(system) for each in made)
    result = SpatialNetwork(names, places, ends, made, stiff, owner, tuple(held))
    result.check()
    assert result.lengths.all()  # arcs that do not reach are refused here
    result.check_rotations()
    _check_coinciding(result)
    return result


def _check_coinciding(made: SpatialNetwork) -> None:
    """Refuse two joints in one place: what joins them is said by hinges."""
    apart = np.abs(made.places[:, None] - made.places).max(axis=2)
    near = 1e-9 * np.ptp(made.places, axis=0).max()
    for i, j in np.argwhere(np.triu(apart <= near, 1)).tolist():
        raise InputError(
            f"`joints` must lie apart; got {made.joints[i]} and {made.joints[j]} in one place. "
            "Make them one joint, with hinges."
        )
