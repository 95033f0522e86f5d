"""Common to planar frames and frames in space: networks, effects of parameters, numbers."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np

from equimorph.argument_kinds import is_listed, is_number, one_of
from equimorph.arrays import Bool, Float, Int
from equimorph.errors import InputError
from equimorph.model.units import STANDARD_GRAVITY
from equimorph.structures.frame.member import Stiffness
from equimorph.structures.network import Network, check_parameter_names, vector
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.unit_system import UnitSystem

WEIGHT = "weight"


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


Loads = Annotated[
    Mapping[str, Mapping[str, Sequence[float]]],
    "forces or line loads of finite numbers by joint or member (no `Pressure`, which acts on a "
    "`Rod` only), by the name of the load, like `{'F': {'B': (0, -1)}}`, or in space "
    "`{'F': {'B': (0, 0, -1)}}`",
]
KINDS = ("curvature", "length", "move", "turn")
Effects = Mapping[Annotated[str, one_of(*KINDS)], Mapping[str, float | Sequence[float]]]
Actuators = Annotated[
    Mapping[str, Effects],
    "effects of finite numbers (curvature, length, move, turn) by the name of the actuator, like "
    "`{'a': {'length': {'A-B': 1.0}}}`",
]
EULER = 10.0
"""Force that buckles a pinned rod of unit length and stiffness, about."""
OUTER_COUPLE = 2.0
"""Couple that bends such a rod by about 1."""
TENTH = 0.1
"""Move or elongation that does."""


@dataclass(frozen=True, eq=False)
class Patterns:
    """Forces, couples, line loads, strains, elongations, moves and turns by parameter.

    strains: the curvature, or in space twist and curvatures about n and b; turns: angles of the
    joints, or in space rotation vectors of the bodies; factors: parameters that multiply weights,
    and are numbers without unit.
    """

    forces: Float[np.ndarray, "parameters joints space"]
    couples: Float[np.ndarray, "parameters joints"]
    lines: Float[np.ndarray, "parameters pieces space"]
    strains: Float[np.ndarray, "parameters pieces axes"]
    length: Float[np.ndarray, "parameters pieces"]
    moves: Float[np.ndarray, "parameters joints space"]
    turns: Float[np.ndarray, "parameters turning axes"]
    factors: Bool[np.ndarray, " parameters"]

    @classmethod
    def none(cls, made: AnyFrameNetwork, count: int) -> "Patterns":
        """Parameters without any effect."""
        joints, pieces, axes = len(made.joints), len(made.ends), made.axes_of_turns
        forces, moves = np.zeros((2, count, joints, made.space))
        return cls(
            forces, np.zeros((count, joints)), np.zeros((count, pieces, made.space)),
            np.zeros((count, pieces, axes)), np.zeros((count, pieces)), moves,
            np.zeros((count, made.turning_places, axes)), np.zeros(count, bool),
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.forces)

    def scaled(self, length: float, bending: float) -> "Patterns":
        """The same with lengths in units of `length`, bending stiffnesses of `bending`."""
        force = bending / length**2
        return Patterns(
            self.forces / force,
            self.couples / (force * length),
            self.lines * (length / force),
            self.strains * length,
            self.length / length,
            self.moves / length,
            self.turns,
            self.factors,
        )

    def quantity(self, k: int) -> str:
        """What a parameter measures; "1" if it stands for several kinds."""
        given = {
            "force": self.forces[k].any(),
            "force·length": self.couples[k].any(),
            "force/length": self.lines[k].any(),
            "1/length": self.strains[k].any(),
            "length": self.length[k].any() or self.moves[k].any(),
            "rad": self.turns[k].any(),
        }
        found = [quantity for quantity, some in given.items() if some]
        return found[0] if len(found) == 1 and not self.factors[k] else "1"

    def typical(self, k: int) -> float:
        """Value of a non-dimensional parameter that bends a member of length 1 by about 1."""
        sizes = (
            np.abs(self.forces[k]).max(initial=0.0) / EULER,
            np.abs(self.lines[k]).max(initial=0.0) / EULER,
            np.abs(self.couples[k]).max(initial=0.0) / OUTER_COUPLE,
            np.abs(self.strains[k]).max(initial=0.0),
            np.abs(self.length[k]).max(initial=0.0) / TENTH,
            np.abs(self.moves[k]).max(initial=0.0) / TENTH,
            np.abs(self.turns[k]).max(initial=0.0),
        )
        return 1.0 / float(max(sizes))


def patterns(
    made: AnyFrameNetwork, actuators: Mapping[str, Effects], loads: Mapping[str, Any]
) -> Patterns:
    """Patterns of all parameters, actuators first.

    Raises
    ------
    InputError
        For names without meaning or used twice, unknown joints or members, or a parameter that has
        no effect.
    """
    check_parameter_names([*actuators, *loads])
    found = Patterns.none(made, len(actuators) + len(loads))
    for k, (name, given) in enumerate(actuators.items()):
        _fill_actuator(made, found, k, f"actuators.{name}", given)
    for k, (name, forces) in enumerate(loads.items(), len(actuators)):
        _fill_load(made, found, k, f"loads.{name}", forces)
    return found


def _fill_actuator(
    made: AnyFrameNetwork, into: Patterns, k: int, what: str, given: Effects
) -> None:
    if not given:
        raise InputError(f"`{what}` must have an effect ({', '.join(KINDS)}); got none.")
    for kind, table in given.items():
        if not table:
            raise InputError(f"`{what}.{kind}` must say where it acts; got an empty table.")
        for name, value in table.items():
            here = f"{what}.{kind}.{name}"
            sizes = {"length": 1, "move": made.space}
            change = _numbers(value, sizes.get(kind, made.axes_of_turns), here)
            if kind == "turn":
                into.turns[k, made.place_of_turn(name)] += change
            elif kind == "move":
                made.check_move(name, change, here)
                into.moves[k, made.joint(name)] += change
            else:
                _fill_pieces(made, into, k, name, change if kind == "curvature" else change[0])


def _fill_pieces(made: AnyFrameNetwork, into: Patterns, k: int, name: str, change: Any) -> None:
    """Strains of the pieces of a member, or a change of its length."""
    pieces = made.pieces_of(name)
    whole = made.lengths[[at for at, _ in pieces]].sum()
    for at, sign in pieces:
        if np.ndim(change):
            into.strains[k, at] += change * made.signs_of_strains(sign)
        else:
            into.length[k, at] += change * made.lengths[at] / whole


def _numbers(value: Any, size: int, what: str) -> Float[np.ndarray, " size"]:
    """Numbers that are not all 0; one may be given as it is."""
    if size == 1 and not (is_number(value) and value):
        raise InputError(f"`{what}` must be a finite number other than 0; got {value!r}.")
    given = value if is_listed(value) else [value]
    found = np.array(vector(list(given), [size], what), dtype=float)
    if not found.any():
        raise InputError(f"`{what}` must not be zero; got {value!r}.")
    return found


def _fill_load(
    made: AnyFrameNetwork, into: Patterns, k: int, what: str, given: Mapping[str, Sequence[float]]
) -> None:
    for name, value in given.items():
        here = f"{what}.{name}"
        if name in made.joints:
            force = np.array(vector(value, made.sizes_of_loads, here))
            joint = made.joint(name)
            into.forces[k, joint] += force[: made.space]
            into.couples[k, joint] += force[made.space :].sum()
            if into.couples[k, joint] and not made.has_rigid_member(joint):
                raise InputError(
                    f"`{here}` must have no couple where every member is hinged; got {value!r}."
                )
            continue
        line = np.array(vector(value, [made.space], here))
        if name == WEIGHT:
            weights = made.weights
            if not weights.any():
                raise InputError(f"`{here}` must act on members with a weight; got none that has.")
            into.factors[k] = True
            into.lines[k] += weights[:, None] * line
        elif "-" in name:
            into.lines[k, [at for at, _ in made.pieces_of(name)]] += line
        else:
            made.joint(name)
    if not into.lines[k].any() and made.bears(into.forces[k], into.couples[k]):
        raise InputError(f"`{what}` must act on a member, or on a joint that is free to move.")


Model = TypeVar("Model", bound="AnyFrameModel")


@dataclass(frozen=True, eq=False)
class AnyFrameModel(ABC):
    """Numbering of nodes and *scalars* y = (multipliers, p, 1), lengths, and loads.

    Parameters
    ----------
    network
        The frame as its user sees it.
    patterns
        What its parameters do, non-dimensional.
    mesh
        Elements of a piece of a member, of length 1.
    length, bending
        Units of length and of bending stiffness, in those of the user's `system`.
    """

    network: AnyFrameNetwork
    patterns: Patterns
    mesh: Mesh
    length: float
    bending: float
    system: UnitSystem

    @classmethod
    def of(
        cls: type[Model],
        network: AnyFrameNetwork,
        effects: tuple[dict[str, Any], dict[str, Any]],
        resolution: tuple[int, int],
        system: UnitSystem,
    ) -> Model:
        """Model of a network, in units of the mean length of its pieces and the mean stiffness.

        effects: of the actuators and of the loads, by name; resolution: elements, and their degree.
        """
        length, bending = float(network.lengths.mean()), network.bending
        mesh = Mesh(np.linspace(0.0, 1.0, resolution[0] + 1), reference_element(resolution[1]))
        found = patterns(network, *effects).scaled(length, bending)
        return cls(network, found, mesh, length, bending, system)

    @property
    @abstractmethod
    def multipliers(self) -> int:
        """Number of forces that balance without loads."""

    @property
    def force(self) -> float:
        """Unit of force."""
        return self.bending / self.length**2

    @property
    def energy(self) -> float:
        """Unit of energy and of couples."""
        return self.bending / self.length

    @cached_property
    def masses(self) -> Float[np.ndarray, " pieces"] | None:
        """Masses of the pieces, in units of force·time²/length; None if one is not known."""
        made, system, found = self.network, self.system, []
        owner = np.array(made.members_of_pieces)
        for m, weight, length in zip(owner.tolist(), made.weights, made.lengths, strict=True):
            member = made.members[m]
            what = f"mass of member {member.name}"
            if member.mass is not None:
                share = length / made.lengths[owner == m].sum()
                found.append(share * system.mass(member.mass, what))
            elif weight > 0.0 and not system.plain:
                pull = float(weight * length) * system.si("force")
                found.append(system.mass(pull / STANDARD_GRAVITY, what))
            else:
                return None
        return np.array(found)

    @property
    def scalars(self) -> int:
        """Number of multipliers and parameters, and 1 for the constant."""
        return self.multipliers + self.patterns.count + 1

    @property
    def own(self) -> slice:
        """Parameters among the scalars."""
        return slice(self.multipliers, self.scalars - 1)

    @property
    @abstractmethod
    def piece_nodes(self) -> Int[np.ndarray, "pieces nodes"]:
        """Nodes along each piece, from start to end."""

    @cached_property
    def nodes(self) -> Int[np.ndarray, "elements order"]:
        """Nodes of each element of each piece."""
        return self.piece_nodes[:, self.mesh.element_nodes].reshape(-1, self.mesh.degree + 1)

    @cached_property
    def lengths(self) -> Float[np.ndarray, " pieces"]:
        """Lengths of the pieces."""
        return np.asarray(self.network.lengths / self.length)

    @cached_property
    def loads(self) -> Float[np.ndarray, "parameters joints space"]:
        """Forces on the joints; a line load reaches the end of its piece.

        The share of its start is what the cycles of the network decide.
        """
        found = self.patterns.forces.copy()
        for k, end in enumerate(self.network.ends[:, 1].tolist()):
            found[:, end] += self.patterns.lines[:, k] * self.lengths[k]
        return found
