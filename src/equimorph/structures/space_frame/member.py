"""Members of a frame in space, and supports of its joints, as their user describes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_notes import (
    SEVERAL_NAMES,
    SPACE_DIRECTION,
    THREE_QUANTITIES,
    positive_quantity,
)
from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures.frame.any_network import AnyMember
from equimorph.structures.network import check_hinges
from equimorph.structures.rod.sections import CrossSection, SectionProperties
from equimorph.structures.unit_system import Quantity, UnitSystem

BALL = "ball"
"""Hinge that transmits forces only."""
ROUND_TORSION = 1.0 / 1.3
"""GJ over EI of a round section whose Poisson's ratio is 0.3."""
UPRIGHT = 1e-6
"""Sine of the angle between a chord and z below which the normal is drawn along x."""

Direction = Annotated[Sequence[float], SPACE_DIRECTION]
Hinge = Annotated[str, one_of(BALL)] | Direction
Hinges = Annotated[
    Mapping[str, Hinge] | Sequence[str],
    "names of joints, or 'ball' or the axis of a hinge (x, y, z) by joint",
]


@check_arguments
@dataclass(frozen=True)
class SpatialMember(AnyMember):
    """An elastic rod through two or more joints, free of stress as drawn.

    It is drawn straight from joint to joint, or in arcs towards its normal, and passes through
    the joints between its ends without interruption. Numbers are in the units of the frame; texts
    like "0.3 N m^2" are converted to these.

    Parameters
    ----------
    joints
        Names of the joints that it connects, in order.
    section
        A `Strip`, `Round`, `Tube` or `OwnSection` in place of EI, EI_out, GJ, EA and weight.
    EI
        Stiffness against bending about the binormal b, in the plane of the normal; 1 by default.
    EI_out
        Stiffness against bending about the normal n; as EI by default.
    GJ
        Stiffness against twist; EI/1.3 by default, as of round rods with Poisson's ratio 0.3.
    EA
        Axial stiffness, in units of force; None: that of the section, or inextensible.
    inextensible
        Whether the axial stiffness of the section is left out.
    normal
        Direction that the normal n is turned to as far as it is across the member: strips are thin
        along it. By default upwards, along z, and for members along z it is x.
    curvature
        Curvature of the arcs as drawn, towards the normal; 0: straight.
    strains
        Twist, and curvatures about n and b, that it has free of stress in addition to those as
        drawn: they stress it from the beginning.
    length
        Length free of stress, in place of that as drawn.
    hinges
        Joints to which it is hinged, by ball joints; or by joint "ball" or the axis (x, y, z) as
        drawn of a hinge that transmits all but the couple about this axis.
    weight
        Weight per length, for loads on "weight", or a text like "0.1 kg/m"; None: the section's.
    mass
        In kg, or as a text; None: that of its weight in a frame with units. Cross-sections have no
        rotary inertia.
    """

    from_section: ClassVar[tuple[str, ...]] = ("EI", "EI_out", "GJ", "EA", "weight")
    through: ClassVar[str] = "joints"
    quantities: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("EI", "EI_out", "GJ"), "force·length²"),
        **{"EA": "force", "curvature": "1/length", "length": "length", "weight": "force/length"},
    }
    joints: Annotated[Sequence[str], SEVERAL_NAMES]
    section: CrossSection | Mapping[str, Any] | None = None
    EI: Quantity | None = None
    EI_out: Quantity | None = None
    GJ: Quantity | None = None
    EA: Quantity | None = None
    inextensible: bool = False
    normal: Direction | None = None
    curvature: Quantity = 0.0
    strains: Annotated[Sequence[Quantity], THREE_QUANTITIES] = (0.0, 0.0, 0.0)
    length: Quantity | None = None
    hinges: Hinges = ()
    weight: Quantity | None = None
    mass: Quantity | None = None

    def __post_init__(self) -> None:
        """Check the hinges, and that nothing is said twice."""
        check_hinges(self, self.hinges, "some of its joints")
        self.check_section()

    def hinge(self, joint: str) -> str | tuple[float, ...] | None:
        """What connects it to a joint: None if rigidly joined, "ball", or the axis of a hinge."""
        if joint not in self.hinges:
            return None
        if not isinstance(self.hinges, Mapping):
            return BALL
        given = self.hinges[joint]
        return given if isinstance(given, str) else tuple(float(x) for x in given)

    def measured(self, system: UnitSystem) -> "SpatialMember":
        """The same member with its numbers in a system of units."""
        found = super().measured(system)
        strains = system.numbers(self.strains, "1/length", f"strains of member {self.name}")
        return replace(found, strains=tuple(float(x) for x in strains))

    def bending_and_twist(self, section: SectionProperties | None) -> tuple[float, float, float]:
        """GJ, EI_out and EI."""
        if section is not None:
            return section.GJ, section.EI_out, section.EI
        plane = 1.0 if self.EI is None else float(self.EI)
        aside = plane if self.EI_out is None else float(self.EI_out)
        twist = ROUND_TORSION * plane if self.GJ is None else float(self.GJ)
        return twist, aside, plane

    def axes(self, chord: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
        """Tangent, normal and binormal, as columns, in the middle of a piece as drawn."""
        tangent = chord / np.linalg.norm(chord)
        wish = np.array([0.0, 0.0, 1.0] if self.normal is None else self.normal, dtype=float)
        wish = wish / np.linalg.norm(wish)
        across = wish - (wish @ tangent) * tangent
        if np.linalg.norm(across) < UPRIGHT:
            if self.normal is not None:
                raise InputError(
                    f"`normal` of member {self.name} must not lie along it; got {self.normal!r}."
                )
            across = np.array([1.0, 0.0, 0.0]) - tangent[0] * tangent
        normal = across / np.linalg.norm(across)
        return np.stack([tangent, normal, np.cross(tangent, normal)], axis=1)

    def data(self) -> dict[str, Any]:
        """Return what it is made from."""
        given = super().data() | {"strains": list(self.strains)}
        if self.normal is not None:
            given["normal"] = [float(x) for x in self.normal]
        hinged = {joint: self.hinge(joint) for joint in self.hinges}
        given["hinges"] = {
            joint: list(each) if isinstance(each, tuple) else each for joint, each in hinged.items()
        }
        return given


SpatialMemberSpec = Annotated[
    SpatialMember | Annotated[Sequence[str], SEVERAL_NAMES] | Mapping[str, Any],
    "members, sequences of different joints, or data of members",
]


AXES = ("x", "y", "z")
HELD, FREE = "held", "free"
WORDS: dict[str, dict[str, Any]] = {
    "fixed": {**dict.fromkeys(AXES, HELD), "rotation": HELD},
    "pinned": dict.fromkeys(AXES, HELD),
}
KEYS = (*AXES, "plane", "line", "rotation")

SpatialSupportSpec = (
    str
    | Annotated[
        Mapping[
            Annotated[str, one_of(*KEYS)],
            Annotated[str, one_of(HELD)]
            | Annotated[float | str, positive_quantity]
            | Annotated[Sequence[float], SPACE_DIRECTION],
        ],
        "tables",
    ]
)


@dataclass(frozen=True, eq=False)
class SpatialSupport:
    """What holds a joint."""

    directions: Float[np.ndarray, "held 3"]
    """Orthonormal directions along which it holds the place."""
    stiffness: Float[np.ndarray, " held"]
    """Of each of them; ∞ where it holds."""
    rotation: str | tuple[float, float, float]
    """How it turns: "free", "held", or the axis about which alone the joint turns."""
    data: Mapping[str, Any]
    """What it is made from, as plain data."""

    @property
    def holds_rotation(self) -> bool:
        """Whether it holds the rotation, all of it or but for one axis."""
        return self.rotation != FREE

    def holds(self, direction: Float[np.ndarray, "3"]) -> bool:
        """Whether a move along a direction is held or sprung, and nothing across it."""
        rest = direction - self.directions.T @ (self.directions @ direction)
        return bool(np.linalg.norm(rest) < 1e-12)


NO_SUPPORT = SpatialSupport(np.zeros((0, 3)), np.zeros(0), FREE, {})


def spatial_support(joint: str, given: SpatialSupportSpec, system: UnitSystem) -> SpatialSupport:
    """Support from "fixed", "pinned", axes to hold ("x", "yz"), or a table.

    Refused for words without meaning, or a table that holds nothing or says things twice.
    """
    table: Mapping[str, Any] = given if isinstance(given, Mapping) else _table_of_word(given)
    places = [key for key in table if key != "rotation"]
    mixed = len(places) > 1 and ("plane" in places or "line" in places)
    if not table or not set(table) <= set(KEYS) or mixed:
        raise InputError(
            f"`supports.{joint}` must be fixed, pinned, axes to hold (x, yz, xyz), or a table of "
            "rotation and either x, y, z, or plane (its normal), or line (its direction); got "
            f"{given!r}."
        )
    directions, stiffness = np.zeros((0, 3)), []
    data: dict[str, Any] = {}
    for key in places:
        value, what = table[key], f"supports.{joint}.{key}"
        if key in AXES:
            stiff = np.inf if value == HELD else system.number(value, "force/length", what)
            if not isinstance(stiff, int | float):
                raise InputError(
                    f"`{what}` must be 'held' or the stiffness of a spring; got {value!r}."
                )
            directions = np.concatenate([directions, np.eye(3)[[AXES.index(key)]]])
            stiffness.append(float(stiff))
            data[key] = HELD if value == HELD else float(stiff)
            continue
        unit = _unit(value, what)
        data[key] = [float(x) for x in value]
        held = unit[None] if key == "plane" else _across(unit)
        directions = np.concatenate([directions, held])
        stiffness += [np.inf] * len(held)
    rotation = _rotation(table.get("rotation", FREE), f"supports.{joint}.rotation")
    if rotation != FREE:
        data["rotation"] = rotation if isinstance(rotation, str) else list(table["rotation"])
    return SpatialSupport(directions, np.array(stiffness), rotation, data)


def _table_of_word(given: str) -> Mapping[str, Any]:
    if given in WORDS:
        return WORDS[given]
    fine = set(given) <= set(AXES) and len(set(given)) == len(given)
    return dict.fromkeys(given, HELD) if fine else {}


def _unit(value: Any, what: str) -> Float[np.ndarray, "3"]:
    if isinstance(value, str | int | float):
        raise InputError(f"`{what}` must be a direction (x, y, z); got {value!r}.")
    found = np.array(value, dtype=float)
    return np.asarray(found / np.linalg.norm(found))


def _across(unit: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2 3"]:
    """Two orthonormal directions across a line."""
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(unit, first)])


def _rotation(value: Any, what: str) -> str | tuple[float, float, float]:
    if value in (HELD, FREE):
        return str(value)
    x, y, z = _unit(value, what).tolist()
    return x, y, z
