"""Structures of a study file: their keys are the arguments of the structures.

Defaults follow from the signature of each structure, or part of one; tables say in which form the
value of each key is written.
"""

import inspect
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Union

from pydantic import Field, ValidationInfo, create_model, field_validator

from equimorph.model import Parameter
from equimorph.structures import KINDS, Bar, Member, SpatialMember, Unknown
from equimorph.study.fields import Interval, Number, Positive, Section, is_number, requirement
from equimorph.study.forms import (
    CrossSection,
    EndInSpace,
    EndOfRod,
    Formula,
    LoadShape,
    Profile,
    Quantity,
    Stiffness,
    Support,
    SupportInSpace,
    Term,
    UnitSystem,
)

Forms = Mapping[str, Any]
"""Form of the value of each key; with its default, where that is not the one of the signature."""
EMPTY = inspect.Parameter.empty


def keys_of(made: Callable[..., Any], forms: Forms) -> dict[str, Any]:
    """Form and default of each key; a default that is no number, text or flag is left out."""
    keys: dict[str, Any] = {}
    for key, form in forms.items():
        default = inspect.signature(made).parameters[key].default
        plain = isinstance(default, str | bool) or is_number(default)
        if isinstance(form, tuple):
            keys[key] = form
        elif default is EMPTY or plain:
            keys[key] = (form, ... if default is EMPTY else default)
        else:
            keys[key] = (form | None, None)
    return keys


PARTS: dict[type[Section], Callable[..., Any]] = {}
"""Sections of parts of structures, and what is made from them."""


def part_of(made: Callable[..., Any], forms: Forms) -> Any:
    """Section of a part of a structure."""
    name, keys = f"{made.__name__}Section", keys_of(made, forms)
    section: type[Section] = create_model(name, __base__=Section, __doc__=words_of(made), **keys)
    PARTS[section] = made
    return section


def words_of(made: Callable[..., Any]) -> str:
    """First line of a docstring."""
    return (inspect.getdoc(made) or "").splitlines()[0]


def many(form: Any, least: int = 1, most: int | None = None) -> Any:
    """A list."""
    return Annotated[list[form], Field(min_length=least, max_length=most)]


def named(form: Any, least: int = 0) -> Any:
    """Values by name."""
    return Annotated[dict[str, form], Field(min_length=least)] if least else dict[str, form]


Vector = Annotated[list[Number], Field(min_length=2, max_length=3)]
InPlane = Annotated[list[Number], Field(min_length=2, max_length=2)]
InSpace = Annotated[list[Number], Field(min_length=3, max_length=3)]


class DrawnSupportSection(Section):
    """A support on a point of the line that is drawn; see `equimorph.EnergyStructure`."""

    point: int = Field(ge=0)
    kind: Literal["pin", "clamp", "roller", "sleeve", "grip", "spring", "coil"] = "pin"
    angle: Number = 0.0


class DrawnForceSection(Section):
    """A force on a point of the line that is drawn."""

    point: int = Field(ge=0)
    force: list[Formula] = Field(min_length=2, max_length=2)


class EffectSection(Section):
    """What an actuator of a frame does, per unit of its parameter."""

    curvature: dict[str, Number] | None = None
    length: dict[str, Number] | None = None
    move: dict[str, InPlane] | None = None
    turn: dict[str, Number] | None = None


class SpatialEffectSection(Section):
    """What an actuator of a frame in space does, per unit of its parameter."""

    curvature: dict[str, InSpace] | None = None
    length: dict[str, Number] | None = None
    move: dict[str, InSpace] | None = None
    turn: dict[str, InSpace] | None = None


NAMES = many(str, 2, 2)
BarSection = part_of(Bar, {"ends": NAMES, **dict.fromkeys(("EA", "EI", "rest", "mass"), Stiffness)})
MemberSection = part_of(
    Member,
    {
        "ends": NAMES,
        **dict.fromkeys(("EI", "EA", "weight", "mass"), Stiffness),
        **{"section": CrossSection, "inextensible": bool, "curvature": Quantity},
        "hinges": (list[str], Field(default_factory=list)),
    },
)
SpatialMemberSection = part_of(
    SpatialMember,
    {
        **{"joints": many(str, 2), "section": CrossSection, "inextensible": bool},
        **dict.fromkeys(("EI", "EI_out", "GJ", "EA", "length", "weight", "mass"), Stiffness),
        **{"normal": InSpace, "curvature": Quantity, "strains": many(Quantity, 3, 3)},
        "hinges": (
            list[str] | dict[str, Literal["ball"] | InSpace], Field(default_factory=list),
        ),
    },
)  # fmt: skip
LIMITS = {"lower": (Number | None, None), "upper": (Number | None, None)}
UnknownSection = part_of(
    Unknown,
    {"name": str, "natural": Formula, "guesses": Interval, **LIMITS, "mass": Positive, "unit": str},
)
ParameterSection = part_of(
    Parameter,
    {
        **{"name": str, "unit": (str, "1"), "scale": (Positive, 1.0), "default": Number, **LIMITS},
        "role": (Literal["actuator", "load", "fixed"], "actuator"),
    },
)

RESOLUTION = {
    "elements": Annotated[int, Field(ge=1, le=1000)],
    "degree": Annotated[int, Field(ge=3, le=16)],
    "units": UnitSystem,
}
ROD = {
    "load": LoadShape,
    **dict.fromkeys(("stiffness", "curvature", "axial", "torsion", "lateral"), Profile),
    **dict.fromkeys(("loads", "actuators"), named(Term)),
    "coordinates": named(named(Number)),
    **dict.fromkeys(("rise", "EI", "length"), Quantity),
    **{"section": CrossSection, "mass": Stiffness, **RESOLUTION},
    "elements": Annotated[int, Field(ge=2, le=1000)],
}
FORMS: Mapping[str, Forms] = {
    "rod": {**ROD, "ends": many(EndOfRod, 2, 2), "span": Stiffness},
    "spatial rod": {
        **ROD,
        "ends": many(EndInSpace, 2, 2),
        **dict.fromkeys(("side_curvature", "natural_twist", "shear"), Profile),
        **{"span": Quantity, "sideways": Quantity, "phase": bool},
    },
    "spring": {"stiffness": Positive, "mass": Positive},
    "energy": {
        **{
            "energy": Formula,
            "unknowns": many(UnknownSection),
            "parameters": many(ParameterSection, 0),
        },
        **{"constraints": list[Formula], "draw": many(many(Formula, 2, 2), 0)},
        **dict.fromkeys(("definitions", "descriptors"), named(Formula)),
        "mass": list[Formula | list[Formula]],
        **{"supports": list[DrawnSupportSection], "forces": list[DrawnForceSection]},
        "coercive": bool,
    },
    "truss": {
        **{"joints": named(many(Quantity, 2, 3), 2), "bars": many(BarSection)},
        **{"supports": named(str), "loads": named(named(Vector))},
        **{"actuators": named(named(Number)), "masses": named(Stiffness), "units": UnitSystem},
        "strain": Literal["engineering", "green"],
    },
    "frame": {
        **{"joints": named(many(Quantity, 2, 2), 2), "members": many(MemberSection)},
        **{"supports": named(Support), "loads": named(named(Vector))},
        **{"actuators": named(EffectSection), **RESOLUTION},
    },
    "spatial frame": {
        **{"joints": named(many(Quantity, 3, 3), 2), "members": many(SpatialMemberSection)},
        **{"supports": named(SupportInSpace), "loads": named(named(InSpace))},
        **{"actuators": named(SpatialEffectSection), **RESOLUTION},
    },
}
"""Forms of the arguments of each kind of structure."""


class StructureSection(Section):
    """A structure; its `kind` is a key of `equimorph.structures.KINDS`."""

    kind: str


def _check_reach(span: Any, info: ValidationInfo) -> Any:
    """Refuse a span that is as long as an inextensible rod."""
    longest = info.data.get("length") or 1.0
    texts = isinstance(span, str) or isinstance(longest, str)
    if span is not None and not texts and info.data.get("axial") is None and not span < longest:
        raise requirement(f"be less than {longest:g}")
    return span


def section_of(kind: str) -> type[StructureSection]:
    """Section of a kind of structure."""
    made = KINDS[kind]
    name, doc = made.__name__.removesuffix("Structure"), words_of(made)
    keys: dict[str, Any] = {"kind": (Literal[kind], ...), **keys_of(made, FORMS[kind])}
    hooks: Any = {"_within_reach": field_validator("span")(_check_reach)} if kind == "rod" else {}
    section: type[StructureSection] = create_model(
        f"{name}Section", __base__=StructureSection, __doc__=doc, __validators__=hooks, **keys
    )
    return section


SECTIONS = {kind: section_of(kind) for kind in KINDS}
"""Sections of all structures by their kinds."""
ANY_STRUCTURE: Any = Annotated[Union[tuple(SECTIONS.values())], Field(discriminator="kind")]  # noqa: UP007  # of these
