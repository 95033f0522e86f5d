"""Study files: what a user may write, checked before anything is computed.

A study is data only. It names a structure and what is wanted: a part of its equilibrium set, with
equilibria at points and routes between states, or maps over actuators, or both. Types are strict
and unknown keys are refused.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from equimorph.errors import InputError
from equimorph.study.complaint import complaint
from equimorph.study.expressions import LARGEST, parse_comparison
from equimorph.study.names import PLANE, STABLE_PLANE
from equimorph.study.syntax import parse_toml


def _requirement(text: str) -> PydanticCustomError:
    """Refuse a value; `text` completes the sentence "`key` must ..."."""
    return PydanticCustomError("requirement", text.replace("{", "{{").replace("}", "}}"))


def _increasing(bounds: list[float]) -> list[float]:
    if not bounds[0] < bounds[1]:
        raise _requirement("be [lower, upper] with lower < upper")
    return bounds


def _two(table: dict[str, Any]) -> dict[str, Any]:
    if len(table) != 2:
        raise _requirement("span exactly two free parameters")
    return table


def _one(table: dict[str, Any]) -> dict[str, Any]:
    if len(table) != 1:
        raise _requirement("hold exactly one descriptor with its value")
    return table


def _unused(name: str) -> str:
    """Refuse names under which files of the set are stored."""
    if f"{name}-plane" in (STABLE_PLANE, PLANE):
        raise _requirement("be another name: figures of the set begin with it")
    return name


def _comparison(text: str) -> str:
    try:
        parse_comparison(text)
    except InputError as error:
        raise _requirement("read like max_curvature <= 20 or height(0.5) >= 0") from error
    return text


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) <= LARGEST


def _is_table(value: Any) -> bool:
    """Whether it is a table of at least two rows of two numbers."""
    rows = value if isinstance(value, list) else []
    return len(rows) >= 2 and all(
        isinstance(row, list) and len(row) == 2 and all(map(_is_number, row)) for row in rows
    )


def _load(shape: Any) -> Any:
    """Check a load shape; one requirement for all forms makes one readable line."""
    if shape not in ("uniform", "left-half") and not _is_table(shape):
        raise _requirement(
            'be "uniform", "left-half" or a table [[s, Q], ...] of finite numbers '
            f"up to {LARGEST:g}"
        )
    return shape


def _profile(shape: Any) -> Any:
    if not (_is_number(shape) or _is_table(shape) or isinstance(shape, str)):
        raise _requirement(
            f"be a number up to {LARGEST:g}, a table [[s, f], ...] of such, or a text with its unit"
        )
    return shape


def _end(given: Any) -> Any:
    table = isinstance(given, dict) and set(given) <= {"angle", "x", "y"}
    parts = given.values() if table else [given]
    if not all(isinstance(part, str) or (table and _is_number(part)) for part in parts):
        raise _requirement(
            'be a word like "clamped", or a table like { angle = "free", x = "held", y = 2.0 }'
        )
    return given


def _terms(given: Any) -> Any:
    """Check that terms are data of numbers, texts and lists; the rod itself knows their keys."""

    def plain(value: Any) -> bool:
        if isinstance(value, list):
            return all(map(plain, value))
        return isinstance(value, str) or _is_number(value)

    for term in given if isinstance(given, list) else [given]:
        if not (isinstance(term, dict) and all(map(plain, term.values()))):
            raise _requirement(
                'be a table like { term = "point force", s = 0.5 }, or a list of such tables, of '
                f"texts and numbers up to {LARGEST:g}"
            )
    return given


def _formula(given: Any) -> Any:
    if not (isinstance(given, str) or (type(given) in (int, float) and abs(given) <= LARGEST)):
        raise _requirement(f"be a formula in quotes, or a finite number up to {LARGEST:g}")
    return given


def _quantity(given: Any) -> Any:
    """Check its form; whether a unit fits is known to the structure."""
    if not (_is_number(given) or isinstance(given, str)):
        raise _requirement(f'be a number up to {LARGEST:g}, or a text with its unit like "2 N m^2"')
    return given


def _stiff(given: Any) -> Any:
    if _is_number(given) and not given > 0:
        raise _requirement("be greater than 0")
    return _quantity(given)


Formula = Annotated[Any, AfterValidator(_formula)]
Quantity = Annotated[Any, AfterValidator(_quantity)]
Stiffness = Annotated[Any, AfterValidator(_stiff)]
UnitSystem = Annotated[dict[str, str], Field(min_length=2, max_length=2)]
Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Interval = Annotated[list[Number], Field(min_length=2, max_length=2), AfterValidator(_increasing)]
Point = dict[str, Number]
ComparisonText = Annotated[str, AfterValidator(_comparison)]


class _Section(BaseModel):
    """A table of the file: strict types, finite numbers, no unknown keys."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


Profile = Annotated[Any, AfterValidator(_profile)]
Term = Annotated[Any, AfterValidator(_terms)]
EndOfRod = Annotated[Any, AfterValidator(_end)]


class RodSection(_Section):
    """A planar rod: by default a curved one between two rotary actuators; see `equimorph.Rod`."""

    kind: Literal["rod"]
    load: Annotated[Any, AfterValidator(_load)] | None = None
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
    span: Stiffness | None = None
    elements: int | None = Field(default=None, ge=2, le=1000)
    degree: int | None = Field(default=None, ge=3, le=16)

    @field_validator("span")
    @classmethod
    def _within_reach(cls, span: Any, info: Any) -> Any:
        longest = info.data.get("length") or 1.0
        texts = isinstance(span, str) or isinstance(longest, str)
        if span is not None and not texts and info.data.get("axial") is None and not span < longest:
            raise _requirement(f"be less than {longest:g}")
        return span


class SpringSection(_Section):
    """The constrained spring."""

    kind: Literal["spring"]
    stiffness: float = Field(default=1.0, gt=0, le=LARGEST)


class UnknownSection(_Section):
    """An unknown of an energy; see `equimorph.Unknown`."""

    name: str
    natural: Formula = 0.0
    guesses: Interval | None = None
    lower: Number | None = None
    upper: Number | None = None
    mass: float = Field(default=1.0, gt=0, le=LARGEST)
    unit: str = "1"


class ParameterSection(_Section):
    """A parameter of an energy; see `equimorph.Parameter`."""

    name: str
    unit: str = "1"
    scale: float = Field(default=1.0, gt=0, le=LARGEST)
    role: Literal["actuator", "load", "fixed"] = "actuator"
    default: Number | None = None
    lower: Number | None = None
    upper: Number | None = None


class EnergySection(_Section):
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


class BarSection(_Section):
    """A bar of a truss; see `equimorph.Bar`."""

    ends: list[str] = Field(min_length=2, max_length=2)
    EA: Stiffness = 1.0
    EI: Stiffness | None = None
    rest: Stiffness | None = None


Vector = Annotated[list[Number], Field(min_length=2, max_length=3)]
Place = Annotated[list[Quantity], Field(min_length=2, max_length=3)]


class TrussSection(_Section):
    """Bars between joints; see `equimorph.Truss`."""

    kind: Literal["truss"]
    joints: dict[str, Place] = Field(min_length=2)
    bars: list[BarSection] = Field(min_length=1)
    supports: dict[str, str]
    loads: dict[str, dict[str, Vector]] = Field(default_factory=dict)
    actuators: dict[str, dict[str, Number]] = Field(default_factory=dict)
    strain: Literal["engineering", "green"] = "engineering"
    units: UnitSystem | None = None


def _support(given: Any) -> Any:
    table = given if isinstance(given, dict) else {}
    fine = table and all(isinstance(value, str) or _is_number(value) for value in table.values())
    if not (isinstance(given, str) or fine):
        raise _requirement(
            'be "fixed", "pinned", axes to hold like "y", or a table like '
            '{ x = "held", angle = 2.0 }'
        )
    return given


class MemberSection(_Section):
    """A member of a frame; see `equimorph.Member`."""

    ends: list[str] = Field(min_length=2, max_length=2)
    EI: Stiffness = 1.0
    EA: Stiffness | None = None
    curvature: Quantity = 0.0
    hinges: list[str] = Field(default_factory=list)
    weight: Stiffness | None = None


Plane = Annotated[list[Number], Field(min_length=2, max_length=2)]


class EffectSection(_Section):
    """What an actuator of a frame does, per unit of its parameter."""

    curvature: dict[str, Number] | None = None
    length: dict[str, Number] | None = None
    move: dict[str, Plane] | None = None
    turn: dict[str, Number] | None = None


class FrameSection(_Section):
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


class SetSection(_Section):
    """The part of the equilibrium set that is wanted."""

    box: Annotated[dict[str, Interval], AfterValidator(_two)]
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)
    intervals: list[Annotated[int, Field(ge=2, le=int(LARGEST))]] | None = Field(
        default=None, min_length=2, max_length=2
    )


class PointSection(_Section):
    """A point of the parameter space whose equilibria are wanted."""

    at: Point = Field(min_length=1)


class StateSection(_Section):
    """One stable equilibrium over a point, chosen by a descriptor where there are several."""

    at: Point = Field(min_length=1)
    highest: str | None = None
    lowest: str | None = None
    near: Annotated[Point, AfterValidator(_one)] | None = None

    @model_validator(mode="after")
    def _one_choice(self) -> "StateSection":
        if sum(choice is not None for choice in (self.highest, self.lowest, self.near)) > 1:
            raise _requirement("choose by one of highest, lowest, near")
        return self


class RouteSection(_Section):
    """A route between two states, along way-points or planned freely."""

    name: Annotated[
        str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=80), AfterValidator(_unused)
    ]
    start: StateSection
    goal: StateSection
    via: list[Annotated[Point, Field(min_length=1)]] | None = Field(default=None, min_length=1)
    within: list[ComparisonText] = Field(default_factory=list)
    margin: float = Field(default=0.0, ge=0, le=LARGEST)


class MapSection(_Section):
    """A map over two actuators, from the natural states of their settings on."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$", max_length=80)
    kind: Literal["limit_load_map", "curvature_map"]
    box: Annotated[dict[str, Interval], AfterValidator(_two)]
    intervals: list[Annotated[int, Field(ge=2, le=int(LARGEST))]] = Field(
        min_length=2, max_length=2
    )
    load: str
    at: Number | None = None
    descriptor: str | None = None
    bound: float = Field(default=100.0, gt=0, le=LARGEST)
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)

    @model_validator(mode="after")
    def _level(self) -> "MapSection":
        if (self.kind == "curvature_map") != (self.at is not None):
            raise _requirement("give the load `at` in a curvature_map, and only there")
        if self.kind == "limit_load_map" and self.descriptor is not None:
            raise _requirement("give a descriptor in a curvature_map only")
        return self


StructureSection = Annotated[
    RodSection | SpringSection | EnergySection | TrussSection | FrameSection,
    Field(discriminator="kind"),
]


class Study(_Section):
    """A whole study file."""

    title: str | None = None
    structure: StructureSection
    equilibrium_set: SetSection | None = Field(default=None, alias="set")
    equilibria: list[PointSection] = Field(default_factory=list)
    routes: list[RouteSection] = Field(default_factory=list, alias="route")
    maps: list[MapSection] = Field(default_factory=list, alias="map")

    @model_validator(mode="after")
    def _names_differ(self) -> "Study":
        names = [route.name for route in self.routes]
        if len(set(names)) < len(names):
            raise _requirement("give every route a name of its own")
        if len({each.name for each in self.maps}) < len(self.maps):
            raise _requirement("give every map a name of its own")
        return self

    @model_validator(mode="after")
    def _asks_for_something(self) -> "Study":
        if self.equilibrium_set is None:
            if self.equilibria or self.routes:
                raise _requirement("have a [set] in which its equilibria and routes are")
            if not self.maps:
                raise _requirement("ask for something: a [set] or a [[map]]")
        return self


def read_study_text(path: Path) -> str:
    """Read a study file, unchecked.

    Raises
    ------
    InputError
        If the file is missing or no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")  # some editors begin files with a mark
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError(f"`study file` must be a readable file; got {path}: {reason}.") from error


def parse_study(text: str, name: str) -> Study:
    """Check the text of a study file.

    Parameters
    ----------
    text
        Content of the file.
    name
        Name of the file, for messages.

    Raises
    ------
    InputError
        If `text` is no TOML or holds a key or value that is not allowed.
    """
    content = parse_toml(text, name)
    try:
        return Study.model_validate(content)
    except ValidationError as error:
        raise complaint(error, Study, name) from error
