"""Structures of a study file."""

from typing import Annotated, Any, Literal, Union

from pydantic import AfterValidator, Field, field_validator

from equimorph.study.fields import LARGEST, Interval, Number, Section, is_number, requirement
from equimorph.study.forms import (
    CrossSection,
    EndInSpace,
    EndOfRod,
    Formula,
    LoadShape,
    Profile,
    Quantity,
    Stiffness,
    Term,
    UnitSystem,
)


class StructureSection(Section):
    """A structure; its `kind` is a key of `equimorph.structures.KINDS`."""

    kind: str


class RodSection(StructureSection):
    """A planar rod: by default a curved one between two rotary actuators; see `equimorph.Rod`."""

    kind: Literal["rod"]
    load: LoadShape | None = None
    ends: Annotated[list[EndOfRod], Field(min_length=2, max_length=2)] | None = None
    stiffness: Profile | None = None
    curvature: Profile | None = None
    axial: Profile | None = None
    loads: dict[str, Term] | None = None
    actuators: dict[str, Term] | None = None
    coordinates: dict[str, dict[str, Number]] | None = None
    rise: Quantity | None = None
    EI: Quantity | None = None
    length: Quantity | None = None
    units: UnitSystem | None = None
    torsion: Profile | None = None
    lateral: Profile | None = None
    section: CrossSection | None = None
    mass: Stiffness | None = None
    span: Stiffness | None = None
    elements: int | None = Field(default=None, ge=2, le=1000)
    degree: int | None = Field(default=None, ge=3, le=16)

    @field_validator("span")
    @classmethod
    def _within_reach(cls, span: Any, info: Any) -> Any:
        longest = info.data.get("length") or 1.0
        texts = isinstance(span, str) or isinstance(longest, str)
        if span is not None and not texts and info.data.get("axial") is None and not span < longest:
            raise requirement(f"be less than {longest:g}")
        return span


class SpatialRodSection(StructureSection):
    """A rod in space; see `equimorph.SpatialRod`."""

    kind: Literal["spatial rod"]
    load: LoadShape | None = None
    torsion: Profile | None = None
    lateral: Profile | None = None
    section: CrossSection | None = None
    ends: Annotated[list[EndInSpace], Field(min_length=2, max_length=2)] | None = None
    stiffness: Profile | None = None
    curvature: Profile | None = None
    side_curvature: Profile | None = None
    natural_twist: Profile | None = None
    axial: Profile | None = None
    shear: Profile | None = None
    loads: dict[str, Term] | None = None
    actuators: dict[str, Term] | None = None
    coordinates: dict[str, dict[str, Number]] | None = None
    span: Quantity | None = None
    rise: Quantity | None = None
    sideways: Quantity | None = None
    phase: bool | None = None
    EI: Quantity | None = None
    length: Quantity | None = None
    units: UnitSystem | None = None
    mass: Stiffness | None = None
    elements: int | None = Field(default=None, ge=2, le=1000)
    degree: int | None = Field(default=None, ge=3, le=16)


class SpringSection(StructureSection):
    """The constrained spring."""

    kind: Literal["spring"]
    stiffness: float = Field(default=1.0, gt=0, le=LARGEST)
    mass: float = Field(default=1.0, gt=0, le=LARGEST)


class UnknownSection(Section):
    """An unknown of an energy; see `equimorph.Unknown`."""

    name: str
    natural: Formula = 0.0
    guesses: Interval | None = None
    lower: Number | None = None
    upper: Number | None = None
    mass: float = Field(default=1.0, gt=0, le=LARGEST)
    unit: str = "1"


class ParameterSection(Section):
    """A parameter of an energy; see `equimorph.Parameter`."""

    name: str
    unit: str = "1"
    scale: float = Field(default=1.0, gt=0, le=LARGEST)
    role: Literal["actuator", "load", "fixed"] = "actuator"
    default: Number | None = None
    lower: Number | None = None
    upper: Number | None = None


class DrawnSupportSection(Section):
    """A support on a point of the line that is drawn; see `equimorph.EnergyStructure`."""

    point: int = Field(ge=0)
    kind: Literal["pin", "clamp", "roller", "sleeve", "grip", "spring", "coil"] = "pin"
    angle: Number = 0.0


class DrawnForceSection(Section):
    """A force on a point of the line that is drawn."""

    point: int = Field(ge=0)
    force: list[Formula] = Field(min_length=2, max_length=2)


class EnergySection(StructureSection):
    """A structure given by its energy; see `equimorph.EnergyStructure`."""

    kind: Literal["energy"]
    energy: Formula
    unknowns: list[UnknownSection] = Field(min_length=1)
    parameters: list[ParameterSection]
    constraints: list[Formula] = Field(default_factory=list)
    definitions: dict[str, Formula] = Field(default_factory=dict)
    descriptors: dict[str, Formula] = Field(default_factory=dict)
    draw: list[Annotated[list[Formula], Field(min_length=2, max_length=2)]] = Field(
        default_factory=list
    )
    mass: list[Formula | list[Formula]] = Field(default_factory=list)
    supports: list[DrawnSupportSection] = Field(default_factory=list)
    forces: list[DrawnForceSection] = Field(default_factory=list)


class BarSection(Section):
    """A bar of a truss; see `equimorph.Bar`."""

    ends: list[str] = Field(min_length=2, max_length=2)
    EA: Stiffness = 1.0
    EI: Stiffness | None = None
    rest: Stiffness | None = None
    mass: Stiffness | None = None


Vector = Annotated[list[Number], Field(min_length=2, max_length=3)]
Place = Annotated[list[Quantity], Field(min_length=2, max_length=3)]


class TrussSection(StructureSection):
    """Bars between joints; see `equimorph.Truss`."""

    kind: Literal["truss"]
    joints: dict[str, Place] = Field(min_length=2)
    bars: list[BarSection] = Field(min_length=1)
    supports: dict[str, str]
    loads: dict[str, dict[str, Vector]] = Field(default_factory=dict)
    actuators: dict[str, dict[str, Number]] = Field(default_factory=dict)
    strain: Literal["engineering", "green"] = "engineering"
    masses: dict[str, Stiffness] = Field(default_factory=dict)
    units: UnitSystem | None = None


def _support(given: Any) -> Any:
    table = given if isinstance(given, dict) else {}
    fine = table and all(isinstance(value, str) or is_number(value) for value in table.values())
    if not (isinstance(given, str) or fine):
        raise requirement(
            'be "fixed", "pinned", axes to hold like "y", or a table like '
            '{ x = "held", angle = 2.0 }'
        )
    return given


class MemberSection(Section):
    """A member of a frame; see `equimorph.Member`."""

    ends: list[str] = Field(min_length=2, max_length=2)
    EI: Stiffness = 1.0
    EA: Stiffness | None = None
    curvature: Quantity = 0.0
    hinges: list[str] = Field(default_factory=list)
    weight: Stiffness | None = None
    mass: Stiffness | None = None


Plane = Annotated[list[Number], Field(min_length=2, max_length=2)]


class EffectSection(Section):
    """What an actuator of a frame does, per unit of its parameter."""

    curvature: dict[str, Number] | None = None
    length: dict[str, Number] | None = None
    move: dict[str, Plane] | None = None
    turn: dict[str, Number] | None = None


class FrameSection(StructureSection):
    """Rods between joints; see `equimorph.Frame`."""

    kind: Literal["frame"]
    joints: dict[str, Annotated[list[Quantity], Field(min_length=2, max_length=2)]] = Field(
        min_length=2
    )
    members: list[MemberSection] = Field(min_length=1)
    supports: dict[str, Annotated[Any, AfterValidator(_support)]]
    loads: dict[str, dict[str, Vector]] = Field(default_factory=dict)
    actuators: dict[str, EffectSection] = Field(default_factory=dict)
    elements: int = Field(default=2, ge=1, le=1000)
    degree: int = Field(default=8, ge=3, le=16)
    units: UnitSystem | None = None


Space = Annotated[list[Number], Field(min_length=3, max_length=3)]
PlaceInSpace = Annotated[list[Quantity], Field(min_length=3, max_length=3)]


class SpatialMemberSection(Section):
    """A member of a frame in space; see `equimorph.SpatialMember`."""

    joints: list[str] = Field(min_length=2)
    section: CrossSection | None = None
    EI: Stiffness | None = None
    EI_out: Stiffness | None = None
    GJ: Stiffness | None = None
    EA: Stiffness | None = None
    inextensible: bool = False
    normal: Space | None = None
    curvature: Quantity = 0.0
    strains: PlaceInSpace | None = None
    length: Stiffness | None = None
    hinges: list[str] | dict[str, Literal["ball"] | Space] = Field(default_factory=list)
    weight: Stiffness | None = None


class SpatialEffectSection(Section):
    """What an actuator of a frame in space does, per unit of its parameter."""

    curvature: dict[str, Space] | None = None
    length: dict[str, Number] | None = None
    move: dict[str, Space] | None = None
    turn: dict[str, Space] | None = None


def _support_in_space(given: Any) -> Any:
    table = given if isinstance(given, dict) else {}
    fine = table and all(isinstance(x, str | list) or is_number(x) for x in table.values())
    if not (isinstance(given, str) or fine):
        raise requirement(
            'be "fixed", "pinned", axes to hold like "xz", or a table like '
            '{ line = [1, 0, 0], rotation = "held" }'
        )
    return given


class SpatialFrameSection(StructureSection):
    """Rods between joints in space; see `equimorph.SpatialFrame`."""

    kind: Literal["spatial frame"]
    joints: dict[str, PlaceInSpace] = Field(min_length=2)
    members: list[SpatialMemberSection] = Field(min_length=1)
    supports: dict[str, Annotated[Any, AfterValidator(_support_in_space)]]
    loads: dict[str, dict[str, Space]] = Field(default_factory=dict)
    actuators: dict[str, SpatialEffectSection] = Field(default_factory=dict)
    elements: int = Field(default=2, ge=1, le=1000)
    degree: int = Field(default=6, ge=3, le=16)
    units: UnitSystem | None = None


ANY_STRUCTURE: Any = Annotated[
    Union[tuple(StructureSection.__subclasses__())],  # noqa: UP007  # of the classes above
    Field(discriminator="kind"),
]
"""Sections of all structures, distinguished by their kinds."""
