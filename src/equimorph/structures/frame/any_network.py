"""What networks of planar frames and of frames in space have in common."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from equimorph.array_types import Float
from equimorph.structures.network import Network

WEIGHT = "weight"


@dataclass(frozen=True, eq=False)
class AnyFrameNetwork(Network):
    """Joints in their places, the pieces of members between them, and their supports."""

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
    def bears(
        self, forces: Float[np.ndarray, "joints space"], couples: Float[np.ndarray, " joints"]
    ) -> bool:
        """Whether supports alone bear a load on the joints."""

    @property
    @abstractmethod
    def weights(self) -> Float[np.ndarray, " pieces"]:
        """Weights per length; 0 where none is given."""

    @property
    @abstractmethod
    def bending(self) -> float:
        """Mean bending stiffness of the members: the unit of bending stiffnesses."""

    def name_of_member(self, piece: int) -> str:
        """Name of the member to which a piece belongs."""
        return self.edge_names[piece]

    def pieces_of(self, name: str) -> list[tuple[int, float]]:
        """Pieces of a member, each with −1 if it is named from end to start, else 1."""
        return [self.place_of_edge(name)]

    @abstractmethod
    def signs_of_strains(self, direction: float) -> Float[np.ndarray, " axes"]:
        """Signs of strains that are given from end to start (−1) or from start to end (1)."""
