"""Networks of planar frames and of frames in space: joints, and pieces of members between them.

Members have a stiffness of their own where their section is known.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures.network import Edge, Network, arc_length
from equimorph.structures.rod.fibres import Fibres
from equimorph.structures.rod.sections import CrossSection, SectionProperties, cross_section
from equimorph.structures.rod.units import SI
from equimorph.structures.unit_system import Quantity, UnitSystem

WEIGHT, PRESSURE = "weight", "pressure"
"""Words among the loads that are no joints."""


@dataclass(frozen=True)
class Stiffness:
    """Numbers of a cross-section in the units of the frame.

    strain: in the plane against bending; in space against twist, bending about n and bending about
    b; EA None: inextensible; fibres: of a section whose size is known.
    """

    strain: tuple[float, ...]
    EA: float | None
    weight: float | None
    fibres: Fibres | None


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


class AnyMember(Edge, ABC):
    """A member with its section or its stiffnesses: a frozen dataclass."""

    edge: ClassVar[str] = "member"
    from_section: ClassVar[tuple[str, ...]]
    """Fields that a section gives."""
    section: CrossSection | Mapping[str, Any] | None
    EA: Quantity | None
    inextensible: bool
    weight: Quantity | None
    curvature: Quantity

    def check_section(self) -> None:
        """Refuse what a section gives, too."""
        twice = [key for key in self.from_section if getattr(self, key) is not None]
        if self.section is not None and twice:
            raise InputError(
                f"`{twice[0]}` of member {self.name} must be left out beside `section`, which "
                f"gives it; got {getattr(self, twice[0])!r}."
            )

    @abstractmethod
    def bending_and_twist(self, section: SectionProperties | None) -> tuple[float, ...]:
        """Stiffnesses of a section, or those given, in the order of `Stiffness.strain`."""

    def stiffness(self, system: UnitSystem) -> Stiffness:
        """Stiffnesses and weight in the units of the frame."""
        made, fibres, axial, weight = None, None, self.EA, self.weight
        if self.section is not None:
            shape = cross_section(self.section)
            made, fibres = shape.in_system(system), shape.fibres(SI if system.plain else system)
            axial, weight = made.EA, made.weight
        axial = None if self.inextensible or axial is None else float(axial)
        weight = None if weight is None else float(weight)
        return Stiffness(self.bending_and_twist(made), axial, weight, fibres)

    def arc_length(self, chord: float, stiff: Stiffness) -> float:
        """Length of an arc over a chord; InputError if no slender arc fits."""
        gyration = 0.0 if stiff.EA is None else float(np.sqrt(min(stiff.strain[-2:]) / stiff.EA))
        return arc_length(self, float(self.curvature), chord, gyration)

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = super().data()
        if self.section is not None:
            given["section"] = cross_section(self.section).data()
        return given
