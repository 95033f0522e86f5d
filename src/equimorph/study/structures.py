"""Structures of a study file: their keys are the arguments of the structures.

Defaults follow from the signature of each structure, or part of one; tables say in which form the
value of each key is written. Values are checked here as far as their form goes; names and units are
known to the structure. The JSON schema beside each check is what editors are told.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Literal, Union

from pydantic import (
    AfterValidator,
    Field,
    WithJsonSchema,
    create_model,
)

from equimorph.model import Parameter
from equimorph.structures import KINDS, Bar, Member, SpatialMember, Unknown
from equimorph.structures.rod.ends import WORDS as ENDS
from equimorph.structures.rod.sections import SECTIONS as CROSS_SECTIONS
from equimorph.structures.rod.terms import TERMS
from equimorph.structures.spatial.ends import WORDS as SPATIAL_ENDS
from equimorph.study.fields import (
    LARGEST,
    Interval,
    Number,
    Positive,
    Section,
    is_number,
    is_table,
    requirement,
)

PLANAR_KEYS = ("angle", "x", "y", "slide")
"""Keys of an end of a rod in the plane."""
SPATIAL_KEYS = ("rotation", "x", "y", "z")
"""Keys of an end of a rod in space."""


_NUMBER = {"type": "number", "minimum": -LARGEST, "maximum": LARGEST}
_TEXT = {"type": "string"}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
_TABLE = {"type": "array", "items": _ROW, "minItems": 2}
_NUMBER_OR_TEXT = {"anyOf": [_NUMBER, _TEXT]}
_FORCE = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 3}
_FORCE_OR_CHAIN = {"anyOf": [_FORCE, {"type": "array", "items": _TEXT, "minItems": 2}]}
_WORDS = {"type": "object", "additionalProperties": _NUMBER_OR_TEXT}
_ONE_TERM = {"type": "object", "properties": {"term": {"enum": list(TERMS)}}, "required": ["term"]}
_ONE_OR_MORE_TERMS = {"anyOf": [_ONE_TERM, {"type": "array", "items": _ONE_TERM}]}
_SECTION = {**_WORDS, "properties": {"kind": {"enum": list(CROSS_SECTIONS)}}, "required": ["kind"]}


def checked(fits: Callable[[Any], bool], words: str) -> AfterValidator:
    """Check values; one requirement for all forms of a value makes one readable line."""

    def check(given: Any) -> Any:
        if not fits(given):
            raise requirement(words)
        return given

    return AfterValidator(check)


def _is_plain(value: Any) -> bool:
    """Whether it is a number or a text."""
    return isinstance(value, str) or is_number(value)


def _are_plain(table: Any) -> bool:
    return isinstance(table, dict) and all(map(_is_plain, table.values()))


def _end_of(words: Iterable[str], keys: tuple[str, ...]) -> Any:
    """Form of an end of a rod: a word, or a table of some keys."""

    def fits(given: Any) -> bool:
        return isinstance(given, str) or (_are_plain(given) and set(given) <= set(keys))

    example = f'{{ {keys[0]} = "free", x = "held", y = 2.0 }}'
    check = checked(fits, f'be a word like "clamped", or a table like {example}')
    table = {"properties": dict.fromkeys(keys, _NUMBER_OR_TEXT), "additionalProperties": False}
    schema = {"anyOf": [{"enum": list(words)}, {"type": "object", **table}]}
    return Annotated[Any, check, WithJsonSchema(schema)]


def _are_terms(given: Any) -> bool:
    """Whether they are data of numbers, texts and lists; the rod itself knows their keys."""

    def plain(value: Any) -> bool:
        return all(map(plain, value)) if isinstance(value, list) else _is_plain(value)

    terms = given if isinstance(given, list) else [given]
    return all(isinstance(term, dict) and all(map(plain, term.values())) for term in terms)


def _is_load_on_frame(given: Any) -> bool:
    entries = given if isinstance(given, list) and len(given) > 1 else [None]
    return all(map(is_number, entries)) or all(isinstance(each, str) for each in entries)


def _is_support_in_space(given: Any) -> bool:
    parts = given.values() if isinstance(given, dict) else ()
    fine = parts and all(isinstance(x, list) or _is_plain(x) for x in parts)
    return isinstance(given, str) or bool(fine)


LoadShape = Annotated[
    Any,
    checked(
        lambda given: given in ("uniform", "left-half") or is_table(given),
        f'be "uniform", "left-half" or a table [[s, Q], ...] of finite numbers up to {LARGEST:g}',
    ),
    WithJsonSchema({"anyOf": [{"enum": ["uniform", "left-half"]}, _TABLE]}),
]
Formula = Annotated[
    Any,
    checked(_is_plain, f"be a formula in quotes, or a finite number up to {LARGEST:g}"),
    WithJsonSchema(_NUMBER_OR_TEXT),
]
Quantity = Annotated[
    Any,
    checked(_is_plain, f'be a number up to {LARGEST:g}, or a text with its unit like "2 N m^2"'),
    WithJsonSchema(_NUMBER_OR_TEXT),
]
Stiffness = Annotated[
    Quantity, checked(lambda given: not is_number(given) or given > 0, "be greater than 0")
]
UnitSystem = Annotated[dict[str, str], Field(min_length=2, max_length=2)]
Profile = Annotated[
    Any,
    checked(
        lambda given: _is_plain(given) or is_table(given),
        f"be a number up to {LARGEST:g}, a table [[s, f], ...] of such, or a text with its unit",
    ),
    WithJsonSchema({"anyOf": [_NUMBER, _TEXT, _TABLE]}),
]
Term = Annotated[
    Any,
    checked(
        _are_terms,
        'be a table like { term = "point force", s = 0.5 }, or a list of such tables, of '
        f"texts and numbers up to {LARGEST:g}",
    ),
    WithJsonSchema(_ONE_OR_MORE_TERMS),
]
CrossSection = Annotated[
    Any,
    checked(
        lambda given: _are_plain(given) and isinstance(given.get("kind"), str),
        'be a table like { kind = "strip", width = "20 mm", thickness = "0.5 mm", '
        'E = "210 GPa", nu = 0.3 }',
    ),
    WithJsonSchema(_SECTION),
]
EndOfRod = _end_of(ENDS, PLANAR_KEYS)
EndInSpace = _end_of(SPATIAL_ENDS, SPATIAL_KEYS)
Support = Annotated[
    Any,
    checked(
        lambda given: isinstance(given, str) or bool(given and _are_plain(given)),
        'be "fixed", "pinned", axes to hold like "y", or a table like { x = "held", angle = 2.0 }',
    ),
]
LoadOnFrame = Annotated[
    Any,
    checked(_is_load_on_frame, 'be numbers like [0, -1], or joints under pressure like ["A", "B"]'),
    WithJsonSchema(_FORCE_OR_CHAIN),
]
SupportInSpace = Annotated[
    Any,
    checked(
        _is_support_in_space,
        'be "fixed", "pinned", axes to hold like "xz", or a table like '
        '{ line = [1, 0, 0], rotation = "held" }',
    ),
]


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


def by_name(form: Any, least: int = 0) -> Any:
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
    {
        **{"name": str, "natural": Formula, "guesses": Interval, **LIMITS, "mass": Positive},
        **{"unit": str, "period": (Positive | None, None)},
    },
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
    **dict.fromkeys(("loads", "actuators"), by_name(Term)),
    "coordinates": by_name(by_name(Number)),
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
        **dict.fromkeys(("definitions", "descriptors"), by_name(Formula)),
        "mass": list[Formula | list[Formula]],
        **{"supports": list[DrawnSupportSection], "forces": list[DrawnForceSection]},
        "coercive": bool,
    },
    "truss": {
        **{"joints": by_name(many(Quantity, 2, 3), 2), "bars": many(BarSection)},
        **{"supports": by_name(str), "loads": by_name(by_name(Vector))},
        **{"actuators": by_name(by_name(Number)), "masses": by_name(Stiffness)},
        **{"units": UnitSystem, "strain": Literal["engineering", "green"]},
    },
    "frame": {
        **{"joints": by_name(many(Quantity, 2, 2), 2), "members": many(MemberSection)},
        **{"supports": by_name(Support), "loads": by_name(by_name(LoadOnFrame))},
        **{"actuators": by_name(EffectSection), **RESOLUTION},
    },
    "spatial frame": {
        **{"joints": by_name(many(Quantity, 3, 3), 2), "members": many(SpatialMemberSection)},
        **{"supports": by_name(SupportInSpace), "loads": by_name(by_name(InSpace))},
        **{"actuators": by_name(SpatialEffectSection), **RESOLUTION},
    },
}
"""Forms of the arguments of each kind of structure."""


class StructureSection(Section):
    """A structure; its `kind` is a key of `equimorph.structures.KINDS`."""

    kind: str


def section_of(kind: str) -> type[StructureSection]:
    """Section of a kind of structure."""
    made = KINDS[kind]
    name, doc = made.__name__.removesuffix("Structure"), words_of(made)
    keys: dict[str, Any] = {"kind": (Literal[kind], ...), **keys_of(made, FORMS[kind])}
    section: type[StructureSection] = create_model(
        f"{name}Section", __base__=StructureSection, __doc__=doc, **keys
    )
    return section


SECTIONS = {kind: section_of(kind) for kind in KINDS}
"""Sections of all structures by their kinds."""
ANY_STRUCTURE: Any = Annotated[Union[tuple(SECTIONS.values())], Field(discriminator="kind")]  # noqa: UP007  # of these
