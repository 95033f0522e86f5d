"""Members of a frame, and supports of its joints, as their user describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_notes import TWO_NAMES, positive_quantity
from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.structures.network import Edge, arc_length, check_hinges
from equimorph.structures.unit_system import Quantity, UnitSystem


@check_arguments
@dataclass(frozen=True)
class Member(Edge):
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

    edge: ClassVar[str] = "member"
    quantities: ClassVar[Mapping[str, str]] = {
        "EI": "force·length²",
        "EA": "force",
        "curvature": "1/length",
        "weight": "force/length",
    }
    ends: Annotated[Sequence[str], TWO_NAMES]
    EI: Quantity = 1.0
    EA: Quantity | None = None
    curvature: Quantity = 0.0
    hinges: Sequence[str] = ()
    weight: Quantity | None = None
    mass: Quantity | None = None

    def __post_init__(self) -> None:
        """Check the hinges."""
        check_hinges(self, self.hinges, "one or both of its ends")

    def length(self, chord: float) -> float:
        """Length of the arc over a chord; InputError if no slender arc fits."""
        gyration = 0.0 if self.EA is None else float(np.sqrt(float(self.EI) / float(self.EA)))
        return arc_length(self, float(self.curvature), chord, gyration)

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
