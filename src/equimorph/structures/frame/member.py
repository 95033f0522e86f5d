"""Members of a frame, and supports of its joints, as their user describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from jaxtyping import Float

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_notes import TWO_NAMES, positive_quantity
from equimorph.errors import InputError
from equimorph.structures.network import built
from equimorph.structures.unit_system import Quantity, UnitSystem

QUANTITIES = {
    "EI": "force·length²",
    "EA": "force",
    "curvature": "1/length",
    "weight": "force/length",
}
"""What each number of a member measures."""
SLENDER = 0.5
"""Largest radius of gyration √(EI/EA) of a member, relative to its length."""


@check_arguments
@dataclass(frozen=True)
class Member:
    """An elastic rod between two joints, straight or a circular arc where it is free of stress.

    Numbers are in the units of the frame; texts like "0.3 N m^2" are converted to these.

    Parameters
    ----------
    ends
        Names of its two joints, start and end.
    EI
        Bending stiffness, in units of force · length²; positive.
    EA
        Axial stiffness, in units of force; None: inextensible.
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
    """

    ends: Annotated[Sequence[str], TWO_NAMES]
    EI: Quantity = 1.0
    EA: Quantity | None = None
    curvature: Quantity = 0.0
    hinges: Sequence[str] = ()
    weight: Quantity | None = None
    mass: Quantity | None = None

    def __post_init__(self) -> None:
        """Check the hinges."""
        strange = [end for end in self.hinges if end not in self.ends]
        if strange or len(set(self.hinges)) < len(self.hinges):
            raise InputError(
                f"`hinges` of member {self.name} must name one or both of its ends, each once; "
                f"got {self.hinges!r}."
            )

    @property
    def name(self) -> str:
        """Its joints, joined: A-B."""
        return "-".join(self.ends)

    def measured(self, system: UnitSystem) -> "Member":
        """The same member with its numbers in a system of units."""
        return system.measured(self, QUANTITIES, f"member {self.name}")

    def length(self, chord: float) -> float:
        """Length of the arc over a chord; InputError if no slender arc fits."""
        half = 0.5 * abs(float(self.curvature)) * chord
        if half >= 1.0:
            raise InputError(
                f"`curvature` of member {self.name} must be less than 2 over the distance of its "
                f"joints, {2.0 / chord:.6g}, a half circle; got {self.curvature!r}."
            )
        length = chord if half == 0.0 else chord * float(np.arcsin(half)) / half
        gyration = 0.0 if self.EA is None else float(np.sqrt(float(self.EI) / float(self.EA)))
        if gyration > SLENDER * length:
            raise InputError(
                f"`EI` and `EA` of member {self.name} must be those of a slender rod in one system "
                f"of units; got a radius of gyration of {gyration:.3g} and a "
                f"length of {length:.3g}."
            )
        return length

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = {key: value for key, value in asdict(self).items() if value is not None}
        return {**given, "ends": list(self.ends), "hinges": list(self.hinges)}


MemberSpec = Annotated[
    Member | Annotated[Sequence[str], TWO_NAMES] | Mapping[str, Any],
    "members, pairs of different joints, or data of members",
]


def member_of(given: MemberSpec) -> Member:
    """Member from a `Member`, its data, or the names of its ends."""
    return built(Member, given, "members")


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

    Parameters
    ----------
    joint
        Name of the joint, for messages.
    given
        "fixed", "pinned", the axes that a roller holds ("x", "y", "xy"), or a table from axes
        ("x", "y", "angle") to "held" or a spring's stiffness.
    system
        Units of the stiffnesses.
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
