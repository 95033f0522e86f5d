"""The network of a frame: joints, members, hinges and supports, as their user describes them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_notes import TWO_NAMES, positive_quantity
from equimorph.arrays import Bool, Float
from equimorph.errors import InputError
from equimorph.structures.frame.any_network import PRESSURE, WEIGHT, AnyFrameNetwork, AnyMember
from equimorph.structures.network import (
    Joints,
    check_hinges,
    edges_between,
    places_of_joints,
    supported_joints,
)
from equimorph.structures.rod.sections import CrossSection, SectionProperties
from equimorph.structures.unit_system import Quantity, UnitSystem


@check_arguments
@dataclass(frozen=True)
class Member(AnyMember):
    """An elastic rod between two joints, straight or a circular arc where it is free of stress.

    Numbers are in the units of the frame; texts like "0.3 N m^2" are converted to these.

    Parameters
    ----------
    ends
        Names of its two joints, start and end.
    EI
        Bending stiffness, in units of force · length²; 1 by default.
    EA
        Axial stiffness, in units of force; None: that of the section, or inextensible.
    curvature
        Curvature of the arc, in units of 1/length; positive turns left on the way from start to
        end. 0: straight.
    hinges
        Names of those of its ends that transmit no moment.
    weight
        Weight per length, for loads on "weight", or a text like "0.1 kg/m"; None: without.
    mass
        In kg, or as a text; None: that of its weight in a frame with units. In a frame without
        units it is a number in any system to which the units of force, length and time belong.
    section
        A `Strip`, `Round`, `Tube` or `OwnSection` in place of EI, EA and weight.
    inextensible
        Whether the axial stiffness of the section is left out.
    """

    from_section: ClassVar[tuple[str, ...]] = ("EI", "EA", "weight")
    quantities: ClassVar[Mapping[str, str]] = {
        "EI": "force·length²",
        "EA": "force",
        "curvature": "1/length",
        "weight": "force/length",
    }
    ends: Annotated[Sequence[str], TWO_NAMES]
    EI: Quantity | None = None
    EA: Quantity | None = None
    curvature: Quantity = 0.0
    hinges: Sequence[str] = ()
    weight: Quantity | None = None
    mass: Quantity | None = None
    section: CrossSection | Mapping[str, Any] | None = None
    inextensible: bool = False

    def __post_init__(self) -> None:
        """Check the hinges, and that nothing is said twice; EI is 1 if nothing says what it is."""
        check_hinges(self, self.hinges, "one or both of its ends")
        self.check_section()
        if self.section is None and self.EI is None:
            object.__setattr__(self, "EI", 1.0)

    def bending_and_twist(self, section: SectionProperties | None) -> tuple[float]:
        """EI."""
        return (float(self.EI if section is None else section.EI),)  # type: ignore[arg-type]  # set above

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        return {**super().data(), "hinges": list(self.hinges)}


MemberSpec = Annotated[
    Member | Annotated[Sequence[str], TWO_NAMES] | Mapping[str, Any],
    "members, pairs of different joints, or data of members",
]

AXES = ("x", "y", "angle")
Stiffness = Annotated[float | str, positive_quantity]
WORDS = {"fixed": AXES, "pinned": ("x", "y")}
HELD = "held"
SPRINGS = {"x": "force/length", "y": "force/length", "angle": "force·length"}
"""What the stiffnesses of springs measure."""


SupportSpec = (
    str
    | Annotated[
        Mapping[
            Annotated[str, one_of("x", "y", "angle")], Annotated[str, one_of("held")] | Stiffness
        ],
        "tables",
    ]
)


def stiffnesses(joint: str, given: SupportSpec, system: UnitSystem) -> Float[np.ndarray, "3"]:
    """Stiffness of a support against moves in x, in y and against turning; ∞ where it holds.

    A support is "fixed", "pinned", the axes that a roller holds ("x", "y", "xy"), or a table from
    axes ("x", "y", "angle") to "held" or a spring's stiffness. The joint is named in messages.
    """
    table: Mapping[str, Any] = {}
    if not isinstance(given, str):
        table = given
    else:
        axes = WORDS.get(given, tuple(given))
        table = dict.fromkeys(axes, HELD)
        if len(table) < len(axes):
            table = {}
    if not table or not set(table) <= set(AXES):
        raise InputError(
            f"`supports.{joint}` must be fixed, pinned, axes to hold (x, y or xy), or a table of "
            f"x, y, angle; got {given!r}."
        )
    values = np.zeros(3)
    for axis, value in table.items():
        what = f"supports.{joint}.{axis}"
        stiff = np.inf if value == HELD else system.number(value, SPRINGS[axis], what)
        values[AXES.index(axis)] = stiff
    return values


def support_data(values: Float[np.ndarray, "3"]) -> dict[str, Any]:
    """Return the table from which the stiffnesses come."""
    pairs = zip(AXES, values.tolist(), strict=True)
    return {axis: HELD if np.isinf(value) else value for axis, value in pairs if value > 0.0}


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
    def turning_places(self) -> int:
        """Joints."""
        return len(self.joints)

    def place_of_turn(self, joint: str) -> int:
        """Joint that a support turns; InputError if it does not."""
        return self.support_place(joint, "angle")[0]

    def check_move(self, joint: str, move: Float[np.ndarray, "2"], what: str) -> None:
        """Refuse a move of a support along an axis that it neither holds nor springs."""
        for axis in np.flatnonzero(move):
            self.support_place(joint, AXES[axis])

    def has_rigid_member(self, joint: int) -> bool:
        """Whether a member is rigidly joined to a joint."""
        return bool(self.rigid[joint])

    def press(self, joints: Sequence[str], what: str) -> Float[np.ndarray, " pieces"]:
        """Signs of the members along a chain; InputError where pressure has no potential."""
        names, signs = list(joints), np.zeros(len(self.edge_names))
        inner = names[1:] if names[:1] == names[-1:] else names
        if len(names) < 2 or len(set(inner)) < len(inner):
            raise InputError(
                f"`{what}` must be joints of a chain in their order, each once unless it closes; "
                f"got {joints!r}."
            )
        for pair in pairwise(names):
            at, sign = self.place_of_edge("-".join(map(str, pair)))
            if self.made[at].EA is not None:
                raise InputError(
                    f"`{what}` must act on inextensible members; got {self.edge_names[at]}, which "
                    "has EA: pressure on a stretching axis is not modelled."
                )
            signs[at] = sign
        if names[0] != names[-1]:
            self._check_ends_of_chain((names[0], names[-1]), what)
        return signs

    def _check_ends_of_chain(self, ends: tuple[str, str], what: str) -> None:
        moves = [np.flatnonzero(np.isfinite(self.supports[self.joint(end), :2])) for end in ends]
        for end, some in zip(ends, moves, strict=True):
            if len(some) > 1:
                raise InputError(
                    f"`{what}` must close, or end where supports leave one direction at most; got "
                    f"{end}, which moves in x and y: pressure is a follower load there, without a "
                    "potential. Close the chain, or hold x or y."
                )
        both = set(moves[0].tolist()) & set(moves[1].tolist())
        if both:
            raise InputError(
                f"`{what}` must not end at two joints that both move along {AXES[min(both)]}; got "
                f"{' and '.join(ends)}. Close the chain, or hold one of them."
            )

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

    Refused for joints without place or members, members between unknown or equal joints, arcs that
    do not reach, unknown supports, or joints that are not connected to the rest.
    """
    names, places = places_of_joints(joints, system, (2,), reserved=(WEIGHT, PRESSURE))
    made = tuple(Member.read(each).measured(system) for each in members)
    ends, _ = edges_between(made, names)
    held = np.zeros((len(names), 3))
    for at, joint, given in supported_joints(supports, names):
        held[at] = stiffnesses(joint, given, system)
    stiff = tuple(each.stiffness(system) for each in made)
    result = FrameNetwork(names, places, ends, made, stiff, held)
    result.check()
    assert result.lengths.all()  # arcs that do not reach are refused here
    _check_angles(result)
    for axis, stiff in zip(AXES, held.T[:2], strict=False):
        if not stiff.any():
            raise InputError(
                f"`frame` must not be a mechanism; nothing holds it in {axis}. Add a support."
            )
    return result


def _check_angles(made: FrameNetwork) -> None:
    for joint, rigid, stiff in zip(made.joints, made.rigid, made.supports[:, 2], strict=True):
        if stiff and not rigid:
            raise InputError(
                f"`supports.{joint}` must not hold an angle where every member is hinged; got "
                "one that does. Leave out a hinge, or hold x and y only."
            )
