"""Networks of planar frames and of frames in space: joints, and pieces of members between them."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from equimorph.arrays import Float
from equimorph.structures.frame.member import Stiffness
from equimorph.structures.network import Network

WEIGHT, PRESSURE = "weight", "pressure"
"""Words among the loads that are no joints."""


@dataclass(frozen=True, eq=False)
class AnyFrameNetwork(Network):
    """Joints in their places, the pieces of members between them, and their supports.

    made: the stiffness of each member.
    """

    made: tuple[Stiffness, ...]
    edge: ClassVar[str] = "member"
    whole: ClassVar[str] = "frames"
    axes_of_turns: ClassVar[int]
    """Components of a turn and of a curvature: one in the plane, three in space."""
    sizes_of_loads: ClassVar[tuple[int, ...]]
    """Numbers that a load on a joint may have: those of a force, with or without a couple."""

    @property
    @abstractmethod
    def turning_places(self) -> int:
        """Number of places that actuators may turn."""

    @abstractmethod
    def place_of_turn(self, joint: str) -> int:
        """Which of these a support at a joint turns; InputError if it does not."""

    @abstractmethod
    def check_move(self, joint: str, move: Float[np.ndarray, " space"], what: str) -> None:
        """Refuse a move of a support along directions that it does not hold."""

    @abstractmethod
    def has_rigid_member(self, joint: int) -> bool:
        """Whether a member is rigidly joined to a joint."""

    @abstractmethod
    def press(self, joints: Sequence[str], what: str) -> Float[np.ndarray, " pieces"]:
        """Signs of the pieces along a chain of joints that is under pressure, 0 elsewhere."""

    @abstractmethod
    def bears(
        self, forces: Float[np.ndarray, "joints space"], couples: Float[np.ndarray, " joints"]
    ) -> bool:
        """Whether supports alone bear a load on the joints."""

    @cached_property
    def lengths(self) -> Float[np.ndarray, " pieces"]:
        """Lengths of the pieces as drawn."""
        chords = np.linalg.norm(self.chords, axis=1).tolist()
        pairs = zip(self.members_of_pieces, chords, strict=True)
        return np.array([self.members[m].arc_length(each, self.made[m]) for m, each in pairs])

    @property
    def weights(self) -> Float[np.ndarray, " pieces"]:
        """Weights per length; 0 where none is given."""
        return np.array([self.made[m].weight or 0.0 for m in self.members_of_pieces])

    @property
    def bending(self) -> float:
        """Mean stiffness against bending in the members' planes: the unit of such stiffnesses."""
        return float(np.mean([each.strain[-1] for each in self.made]))

    @property
    def members_of_pieces(self) -> list[int]:
        """Member to which each piece belongs."""
        return [self.member_of(k) for k in range(len(self.ends))]

    def member_of(self, piece: int) -> int:
        """Member to which a piece belongs."""
        return piece

    def name_of_member(self, piece: int) -> str:
        """Name of the member to which a piece belongs."""
        return str(self.members[self.member_of(piece)].name)

    def pieces_of(self, name: str) -> list[tuple[int, float]]:
        """Pieces of a member, each with −1 if it is named from end to start, else 1."""
        return [self.place_of_edge(name)]

    @abstractmethod
    def signs_of_strains(self, direction: float) -> Float[np.ndarray, " axes"]:
        """Signs of strains that are given from end to start (−1) or from start to end (1)."""
