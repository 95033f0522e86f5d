"""Study files: what a user may write, checked before anything is computed.

A study is data only. It names a structure and the questions: a part of its equilibrium set, with
equilibria at points and questions on it, like routes between states, or maps over actuators, or
both. Types are strict and unknown keys are refused.

The section of the set follows from the signature of `equilibrium_set`.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, ValidationError, create_model, model_validator

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.manifold import INTERVALS, equilibrium_set
from equimorph.model import Box, Constraint, parameter_vector
from equimorph.structures import Structure
from equimorph.study.complaint import Findings, complaint, cut
from equimorph.study.data_files import FOLDER
from equimorph.study.fields import ComparisonText, Count, Interval, Point, Section, requirement
from equimorph.study.kinds import KINDS
from equimorph.study.lookup import Extent, Ground, at_key, check_value, constraints_of
from equimorph.study.signatures import arguments_of
from equimorph.study.structures import ANY_STRUCTURE, StructureSection

_PLACE = re.compile(r"(.*) \(at line (\d+), column (\d+)\)")
# How to write what was probably meant, by the beginning of what Python's parser finds.
_REMEDIES = {
    "Invalid value": "Text stands in quotes, decimals have a point, true and false no capitals.",
    "Cannot overwrite a value": "Give each key once.",
    "Cannot declare": "Begin each section once; a list has double brackets, [[route]], each time.",
    "Expected '=' after a key": "Write key = value; decimals have a point, tables { }.",
    "Expected newline": "Write one value; text stands in quotes, decimals have a point.",
    "Unclosed": "Close what this line, or one above, has opened.",
    "Unterminated": "Close the text with another quote.",
    'Expected "': "Close the text with another quote.",
    "Illegal character": "Close the text with another quote.",
}
WRITTEN = ("box", "fixed", "within", "intervals")
"""Arguments of sets with hand-written keys below; the remaining ones are options, by type."""
OPTIONS = arguments_of(equilibrium_set, left_out=WRITTEN)


def _one_to_three(table: dict[str, Any]) -> dict[str, Any]:
    if not 1 <= len(table) <= 3:
        raise requirement("span one, two or three free parameters")
    return table


class _Extent(Section):
    """The part of the equilibrium set to compute."""

    box: Annotated[dict[str, Interval], AfterValidator(_one_to_three)]
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)
    intervals: list[Count] | None = None

    @model_validator(mode="after")
    def _one_each(self) -> "_Extent":
        for key in ("intervals", "tiles"):
            numbers = getattr(self, key)
            if numbers is not None and len(numbers) != len(self.box):
                raise requirement(f"give one number of {key} for each parameter of its box")
        return self


_options: dict[str, Any] = {key: each for one in OPTIONS for key, each in one.keys().items()}
SetSection: type[Any] = create_model("SetSection", __base__=_Extent, **_options)
"""Section on the set; see `equimorph.equilibrium_set`."""


class PointSection(Section):
    """A point of the parameter space whose equilibria are computed."""

    at: Point = Field(min_length=1)


class Study(Section):
    """A whole study file."""

    title: str | None = None
    structure: StructureSection
    equilibrium_set: Any = None
    equilibria: list[PointSection] = Field(default_factory=list)

    @property
    def tasks(self) -> dict[str, list[Any]]:
        """Questions by the names of their tables."""
        return {kind.table: getattr(self, kind.table) for kind in KINDS}

    @model_validator(mode="after")
    def _names_differ(self) -> "Study":
        for table, sections in self.tasks.items():
            if len({each.name for each in sections}) < len(sections):
                raise requirement(f"give every {table} a different name")
        return self

    @model_validator(mode="after")
    def _files_differ(self) -> "Study":
        owners: dict[str, str] = {}
        for kind in KINDS:
            table = kind.table
            for each in self.tasks[table]:
                for stem in kind.stems(each):
                    if stem in owners:
                        raise requirement(
                            f"give its {table} {each.name} a name without the files of the "
                            f"{owners[stem]} ({stem})"
                        )
                    owners[stem] = f"{table} {each.name}"
        return self

    @model_validator(mode="after")
    def _asks_for_something(self) -> "Study":
        asked = [(kind, each) for kind in KINDS for each in self.tasks[kind.table]]
        if self.equilibrium_set is None:
            if self.equilibria or any(kind.needs_set(each) for kind, each in asked):
                raise requirement("have a [set] to which its equilibria and questions belong")
            if not asked:
                raise requirement(
                    "ask for something: a [set], or one of the tables that need "
                    "none, like [[map]], [[strongest]], [[calibration]] and [[sampled_route]]"
                )
        return self


_tables: dict[str, Any] = {
    kind.table: (list[kind.section], Field(default_factory=list))  # type: ignore[name-defined]
    for kind in KINDS
}
_tables["structure"] = (ANY_STRUCTURE, ...)
_tables["equilibrium_set"] = (SetSection | None, Field(default=None, alias="set"))
STUDY: type[Study] = create_model("Study", __base__=Study, **_tables)
"""A study with a table for each kind of question."""


@check_arguments
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


@check_arguments
def parse_study(text: str, name: str, folder: Path | None = None) -> Study:
    """Check the text of a study file.

    Parameters
    ----------
    text
        Content of the file.
    name
        Name of the file, for messages.
    folder
        Where files lie that the study names, schedules or data; None: where the process is.

    Raises
    ------
    InputError
        If `text` is no TOML or holds keys or values that are not allowed.
    """
    content = parse_toml(text, name)
    try:
        return _validate(content, folder)
    except ValidationError as error:
        raise complaint(error, STUDY, name) from error


@dataclass(frozen=True)
class SoundPart:
    """The tables of a wrong study that are right by themselves."""

    study: Study
    """Made of these tables."""
    places: Mapping[str, Sequence[int]]
    """Numbers of its entries in the lists of the file, by the names of the lists."""


def sound_part(text: str, error: ValidationError, folder: Path | None = None) -> SoundPart | None:
    """Return what remains of a study, TOML, without the tables in which pydantic found mistakes.

    None if the structure is wrong, or what remains is no study. Files that it names lie in a
    folder.
    """
    broken = {_table_of(finding["loc"]) for finding in error.errors(include_url=False)}
    kept: dict[str, Any] = {}
    places: dict[str, list[int]] = {}
    for table, content in tomllib.loads(text).items():
        if (table,) not in broken:
            kept[table] = content
            if isinstance(content, list):
                places[table] = [i for i in range(len(content)) if (table, i) not in broken]
                kept[table] = [content[i] for i in places[table]]
    try:
        return SoundPart(_validate(kept, folder), places)
    except ValidationError:
        return None


def _table_of(location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Table of the file, or entry of a list of tables, in which a location lies."""
    listed = len(location) > 1 and isinstance(location[1], int)
    return location[: 2 if listed else 1]


def _validate(content: Mapping[str, Any], folder: Path | None) -> Study:
    return STUDY.model_validate(content, context={FOLDER: folder or Path()})


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Read TOML of a named file.

    Refused if the text is malformed: with the line and what stands there.
    """
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"{name}: the study must not nest lists or tables so deep.") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: {_sentence(str(error), text)}") from error
    except ValueError as error:
        raise InputError(f"{name}: numbers must be readable; got one of many digits.") from error


def _sentence(finding: str, text: str) -> str:
    remedy = next((hint for start, hint in _REMEDIES.items() if finding.startswith(start)), "")
    place = _PLACE.fullmatch(finding)
    if place is None:
        return f"the file must be valid TOML; got an error: {finding}. {remedy}".rstrip()
    # The parser counts what \n ends.
    line = text.replace("\r\n", "\n").split("\n")[int(place[2]) - 1].strip()
    return (
        f"line {place[2]} must be valid TOML; got {cut(line) or 'nothing'} "
        f"({place[1]}, at column {place[3]}). {remedy}".rstrip()
    )


def extent_of_set(structure: Structure, wanted: Any) -> Extent:
    """Look up the names of the section on the set."""
    findings, constraints = Findings(), tuple[Constraint, ...]()
    with at_key("set.box"):
        box = Box(**{name: (bounds[0], bounds[1]) for name, bounds in wanted.box.items()})
    for name, corner in zip(box.names * 2, [*box.lower, *box.upper], strict=True):
        with findings.collect(), at_key("set.box"):
            check_value(structure, name, corner)
    with findings.collect():
        _check_fixed(structure, box, wanted.fixed)
    with findings.collect():
        constraints = _bounds(structure, wanted.within)
    findings.refuse()
    options = {each.name: getattr(wanted, each.key) for each in OPTIONS}
    return Extent(box, wanted.fixed, constraints, _intervals(wanted), options)


def _check_fixed(structure: Structure, box: Box, fixed: Mapping[str, float]) -> None:
    both = sorted(set(box.names) & set(fixed))
    if both:
        raise InputError(
            f"`set.fixed` must not name free parameters of `set.box`; got {', '.join(both)}."
        )
    with at_key("set.fixed"):
        for name, value in fixed.items():
            check_value(structure, name, value)
        middle = dict(zip(box.names, 0.5 * (box.lower + box.upper), strict=True))
        vector = parameter_vector(structure.parameters, {**middle, **fixed})
    assert np.isfinite(vector).all()


def _intervals(wanted: Any) -> tuple[int, ...]:
    """Intervals of the grid; what a study leaves out takes the library's default."""
    return tuple(wanted.intervals or INTERVALS[len(wanted.box)])


def _bounds(structure: Structure, texts: Sequence[str]) -> tuple[Constraint, ...]:
    """Constraints of the set; structures with equilibria without end need a bound."""
    constraints = constraints_of(Ground(structure, None), texts, "set.within")
    if missing := structure.missing_bound(constraints):
        told = ", ".join(texts) or "nothing"
        raise InputError(
            f"`set.within` must bound the {missing.split()[0]} of this structure, which has "
            f'equilibria without end; got {told}. Add "{missing}".'
        )
    return constraints
