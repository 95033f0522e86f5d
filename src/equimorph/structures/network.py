"""Networks of named joints and edges between them: what trusses and frames have in common."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np

from equimorph.argument_notes import NAME
from equimorph.arrays import Float, Int
from equimorph.errors import InputError, suggestion
from equimorph.structures.unit_system import Quantity, UnitSystem

Part = TypeVar("Part", bound="Edge")
Ends = Int[np.ndarray, "edges 2"]
Places = Float[np.ndarray, "joints space"]
Joints = Annotated[
    Mapping[str, Sequence[Quantity]],
    "places of finite numbers, or texts with their unit, by joint, like `{'A': (0, 1)}`",
]

SLENDER = 0.5
"""Largest radius of gyration √(EI/EA) of a member, relative to its length."""


@dataclass(frozen=True, eq=False)
class Network(ABC):
    """Joints in their places, and which of them each edge joins."""

    joints: tuple[str, ...]
    places: Places
    ends: Ends
    members: tuple[Any, ...]
    """What its user gave as edges; a member in space may have several."""
    edge: ClassVar[str]
    """What one edge is called."""
    whole: ClassVar[str]
    """What the network is called."""

    @cached_property
    def edge_names(self) -> list[str]:
        """Names of the edges: the joints at their starts and ends, joined."""
        return ["-".join(self.joints[end] for end in pair) for pair in self.ends.tolist()]

    @property
    @abstractmethod
    def lengths(self) -> Float[np.ndarray, " edges"]:
        """Lengths of the edges that actuators change."""

    @abstractmethod
    def supports_data(self) -> list[Any]:
        """Supports of the joints, as their user gives them."""

    @property
    def space(self) -> int:
        """Two or three dimensions."""
        return int(self.places.shape[1])

    @cached_property
    def chords(self) -> Float[np.ndarray, "edges space"]:
        """Vectors from start to end, as drawn."""
        return np.asarray(np.diff(self.places[self.ends], axis=1)[:, 0])

    @cached_property
    def walk(self) -> Int[np.ndarray, " steps"]:
        """Joints in the order of a walk along all edges, some of which it passes twice."""
        return walk_along(self.ends, len(self.joints))

    def joint(self, name: Any) -> int:
        """Place of a joint in the list."""
        return position_of_joint(name, self.joints)

    def place_of_edge(self, name: Any) -> tuple[int, float]:
        """Place of an edge in the list, and −1 if it is named from end to start, else 1."""
        names = self.edge_names
        turned = "-".join(reversed(name.split("-"))) if isinstance(name, str) else name
        for each, sign in ((name, 1.0), (turned, -1.0)):
            if each in names:
                return names.index(each), sign
        raise InputError(
            f"`{self.edge}` must be one of {', '.join(names)}; got {name!r}."
            f"{suggestion(str(name), names)}"
        )

    def end(self, name: str, joint: str) -> tuple[int, int]:
        """Place of an edge in the list, and 0 for its start or 1 for its end at a joint."""
        at, _ = self.place_of_edge(name)
        ends = self.edge_names[at].split("-")
        if joint not in ends:
            raise InputError(
                f"`joint` must be an end of {self.edge} {self.edge_names[at]}; got {joint!r}."
            )
        return at, ends.index(joint)

    def check(self) -> None:
        """Refuse what is no network in one piece.

        It has edges, no two between the same joints, none without length, none of its joints
        without edges, and all of them are connected.
        """
        if not self.edge_names:
            raise InputError(f"`{self.edge}s` must be one at least; got none.")
        self._check_edges()
        for i, joint in enumerate(self.joints):
            if i not in self.ends:
                raise InputError(
                    f"`{self.edge}s` must reach every joint; got none at {joint}. Join it, or "
                    "leave it out."
                )
        apart = set(range(len(self.joints))) - set(self.walk.tolist())
        if apart:
            names = [self.joints[i] for i in sorted(apart)]
            raise InputError(
                f"`{self.edge}s` must join all joints; got {', '.join(names)} apart from "
                f"{self.joints[0]}. Join them, or make two {self.whole}."
            )

    def _check_edges(self) -> None:
        seen: set[frozenset[int]] = set()
        for name, ends, chord in zip(self.edge_names, self.ends, self.chords, strict=True):
            pair = frozenset(ends.tolist())
            if pair in seen:
                raise InputError(
                    f"`{self.edge}s` must join each pair of joints once; got {name} again. Put a "
                    "joint on one of them."
                )
            seen.add(pair)
            if not chord.any():
                raise InputError(
                    f"`joints` of {self.edge} {name} must lie apart; got one place for both."
                )


def places_of_joints(
    given: Joints, system: UnitSystem, spaces: Sequence[int], reserved: Sequence[str] = ()
) -> tuple[tuple[str, ...], Places]:
    """Names of joints and their places, all of one dimension among `spaces`.

    Refused for fewer than two joints, a name that is no word or `reserved`, or a place of another
    dimension.
    """
    if len(given) < 2:
        raise InputError(f"`joints` must be at least two; got {len(given)}.")
    for name in given:
        if not NAME.fullmatch(name) or name in reserved:
            other = f", other than {', '.join(reserved)}" if reserved else ""
            raise InputError(
                f"`joints` must have names of letters, digits and underscores{other}; got {name!r}."
            )
    first = len(next(iter(given.values())))
    space = first if first in spaces else spaces[0]
    places = []
    for name, place in given.items():
        what = f"joints.{name}"
        places.append(vector(system.numbers(place, "length", what), [space], what))
    return tuple(given), np.array(places)


class Edge:
    """A bar or member as its user describes it, through two or more joints: a frozen dataclass."""

    edge: ClassVar[str]
    """What it is called."""
    through: ClassVar[str] = "ends"
    """Field with the names of its joints."""
    quantities: ClassVar[Mapping[str, str]]
    """What each of its numbers measures."""

    @property
    def corners(self) -> Sequence[str]:
        """Names of its joints."""
        found: Sequence[str] = getattr(self, self.through)
        return found

    @property
    def name(self) -> str:
        """Its joints, joined: A-B."""
        return "-".join(self.corners)

    @classmethod
    def read(cls: type[Part], given: Any) -> Part:
        """Itself, or one from its data or the names of its joints.

        Raises
        ------
        InputError
            For data that it does not take; what is wrong with one value is said by the edge.
        """
        if isinstance(given, cls):
            return given
        data = given if isinstance(given, Mapping) else {cls.through: given}
        known = [field.name for field in fields(cls)]  # type: ignore[arg-type]  # all are dataclasses
        if cls.through not in data or not set(data) <= set(known):
            raise InputError(
                f"`{cls.edge}s` must hold {cls.__name__}s ({', '.join(known)}) or pairs of joints; "
                f"got {given!r}."
            )
        return cls(**data)

    def measured(self: Part, system: UnitSystem) -> Part:
        """The same with its numbers in a system of units."""
        there = {key: of for key, of in self.quantities.items() if getattr(self, key) is not None}
        return system.measured(self, there, f"{self.edge} {self.name}")

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = asdict(self)  # type: ignore[call-overload]  # all are dataclasses
        given = {key: value for key, value in given.items() if value is not None}
        return {**given, self.through: list(self.corners)}


def check_hinges(member: Edge, hinges: Collection[str], which: str) -> None:
    """Refuse hinges that are not at different joints of a member."""
    strange = [end for end in hinges if end not in member.corners]
    if strange or len(set(hinges)) < len(hinges):
        raise InputError(
            f"`hinges` of member {member.name} must name {which}, each once; got {hinges!r}."
        )


def arc_length(member: Edge, curvature: float, chord: float, gyration: float) -> float:
    """Length of an arc over a chord, of a member with a radius of gyration √(EI/EA).

    Refused if no slender arc fits.
    """
    half = 0.5 * abs(curvature) * chord
    if half >= 1.0:
        raise InputError(
            f"`curvature` of member {member.name} must be less than 2 over the distance of its "
            f"joints, {2.0 / chord:.6g}, a half circle; got {curvature!r}."
        )
    length = chord if half == 0.0 else chord * float(np.arcsin(half)) / half
    if gyration > SLENDER * length:
        raise InputError(
            f"`EI` and `EA` of member {member.name} must be those of a slender rod in one system "
            f"of units; got a radius of gyration of {gyration:.3g} and a length of {length:.3g}."
        )
    return length


def edges_between(
    members: Iterable[Edge], joints: Sequence[str]
) -> tuple[Ends, Int[np.ndarray, " edges"]]:
    """Numbers of the joints that edges join, one edge for each two successive joints of a member.

    And the member to which each edge belongs. Unknown joints are refused.
    """
    found, owner = [], []
    for m, each in enumerate(members):
        for joint in each.corners:
            if joint not in joints:
                raise InputError(
                    f"`{each.through}` of {each.edge} {each.name} must be joints "
                    f"({', '.join(joints)}); got {joint}."
                )
        pairs = [[joints.index(end) for end in pair] for pair in pairwise(each.corners)]
        found += pairs
        owner += [m] * len(pairs)
    return np.array(found, dtype=int).reshape(-1, 2), np.array(owner, dtype=int)


def supported_joints(
    given: Mapping[str, Any], joints: Sequence[str]
) -> Iterable[tuple[int, str, Any]]:
    """Number and name of each supported joint, and what is said of its support."""
    for joint, support in given.items():
        if joint not in joints:
            raise InputError(f"`supports` must be at joints ({', '.join(joints)}); got {joint}.")
        yield joints.index(joint), joint, support


def position_of_joint(name: Any, joints: Sequence[str]) -> int:
    """Place of a joint in the list; an unknown one is refused."""
    if name not in joints:
        raise InputError(
            f"`joint` must be one of {', '.join(joints)}; got {name!r}."
            f"{suggestion(str(name), joints)}"
        )
    return joints.index(name)


def check_parameter_names(names: Sequence[str]) -> None:
    """Refuse names of loads and actuators that are no words, or used twice, and their absence."""
    if not names:
        raise InputError("`loads` or `actuators` must name a parameter; got none.")
    for i, name in enumerate(names):
        if not name.isidentifier() or name in names[:i]:
            raise InputError(
                "`loads` and `actuators` must have different names of letters, digits and "
                f"underscores; got {name!r}."
            )


def length_limits(
    rests: Float[np.ndarray, " edges"], rates: Float[np.ndarray, " edges"]
) -> tuple[float, float]:
    """Values between which a parameter that changes lengths leaves all of them positive."""
    moved = rates != 0.0
    limits = -rests[moved] / rates[moved]
    lower = float(limits[limits < 0.0].max(initial=-np.inf))
    return lower, float(limits[limits > 0.0].min(initial=np.inf))


def direction_of_mechanism(moves: Float[np.ndarray, "joints space"]) -> tuple[int, str]:
    """The first of the joints that move most, and along which unit vector, as text.

    Equal movements are compared after rounding: which of them is the largest must not depend on the
    last digits of an eigenvector.
    """
    sizes = np.abs(moves).max(axis=1)
    at = int(np.argmax(np.round(sizes / sizes.max(), 6)))
    along = np.round(moves[at] / np.linalg.norm(moves[at]), 6)
    along = along * np.sign(along[np.argmax(np.abs(along))])
    return at, ", ".join(f"{x:.3g}" for x in along + 0.0)


def vector(given: Sequence[float], counts: Sequence[int], what: str) -> list[float]:
    """Numbers, as many as one of `counts`; more or fewer are refused."""
    if len(given) not in counts:
        many = " or ".join(map(str, counts))
        raise InputError(f"`{what}` must be {many} finite numbers; got {given!r}.")
    return [float(x) for x in given]


def walk_along(ends: Int[np.ndarray, "edges 2"], joints: int) -> Int[np.ndarray, " steps"]:
    """Joints in the order of a walk along all edges, some of which it passes twice.

    It begins at joint 0 and stays in the part of the network that it can reach.
    """
    joined: list[list[int]] = [[] for _ in range(joints)]
    for first, second in ends.tolist():
        joined[first].append(second)
        joined[second].append(first)
    steps, way, useful = [0], [0], 0
    seen, walked = {0}, set()
    while way:
        here = way[-1]
        there = next((j for j in joined[here] if frozenset((here, j)) not in walked), None)
        if there is None:
            way.pop()
            steps += way[-1:]
            continue
        walked.add(frozenset((here, there)))
        steps.append(there)
        useful = len(steps)
        if there in seen:
            steps.append(here)
        else:
            seen.add(there)
            way.append(there)
    return np.array(steps[:useful])
