"""Study files: what a user may write, checked before anything is computed.

A study is data only. It names a structure and what is wanted: a part of its equilibrium set, with
equilibria at points and questions on it, like routes between states, or maps over actuators, or
both. Types are strict and unknown keys are refused.
"""

from pathlib import Path

from pydantic import Field, ValidationError, model_validator

from equimorph.errors import InputError
from equimorph.study.complaint import complaint
from equimorph.study.sections.best import FollowSection, LandscapeSection, OptimumSection
from equimorph.study.sections.extent import PointSection, SetSection
from equimorph.study.sections.fields import Section, TaskSection, requirement
from equimorph.study.sections.maps import MapSection, StrongestSection
from equimorph.study.sections.robustness import (
    ImperfectionSection,
    RoomSection,
    SensitivitySection,
    SnapGraphSection,
    SnapSection,
)
from equimorph.study.sections.routes import RouteSection, SampledRouteSection
from equimorph.study.sections.structures import StructureSection
from equimorph.study.sections.tasks import (
    CalibrationSection,
    EstimateSection,
    ReachSection,
    ShapeSection,
    TrackSection,
)
from equimorph.study.sections.ways import FOLDER, TrialsSection, VerifySection
from equimorph.study.syntax import parse_toml


class Study(Section):
    """A whole study file."""

    title: str | None = None
    structure: StructureSection
    equilibrium_set: SetSection | None = Field(default=None, alias="set")
    equilibria: list[PointSection] = Field(default_factory=list)
    routes: list[RouteSection] = Field(default_factory=list, alias="route")
    shapes: list[ShapeSection] = Field(default_factory=list, alias="shape")
    optima: list[OptimumSection] = Field(default_factory=list, alias="optimum")
    landscapes: list[LandscapeSection] = Field(default_factory=list, alias="landscape")
    tracks: list[TrackSection] = Field(default_factory=list, alias="track")
    followed: list[FollowSection] = Field(default_factory=list, alias="follow")
    sampled: list[SampledRouteSection] = Field(default_factory=list, alias="sampled_route")
    reaches: list[ReachSection] = Field(default_factory=list, alias="reach")
    checks: list[VerifySection] = Field(default_factory=list, alias="verify")
    sensitivities: list[SensitivitySection] = Field(default_factory=list, alias="sensitivity")
    imperfections: list[ImperfectionSection] = Field(default_factory=list, alias="imperfection")
    rooms: list[RoomSection] = Field(default_factory=list, alias="room")
    snaps: list[SnapSection] = Field(default_factory=list, alias="snap")
    snap_graphs: list[SnapGraphSection] = Field(default_factory=list, alias="snap_graph")
    trials: list[TrialsSection] = Field(default_factory=list, alias="trials")
    estimates: list[EstimateSection] = Field(default_factory=list, alias="estimate")
    calibrations: list[CalibrationSection] = Field(default_factory=list, alias="calibration")
    maps: list[MapSection] = Field(default_factory=list, alias="map")
    strongest: list[StrongestSection] = Field(default_factory=list, alias="strongest")

    @property
    def tasks(self) -> dict[str, list[TaskSection]]:
        """Questions by the name of their tables."""
        fields = type(self).model_fields.items()
        tables = {each.alias: getattr(self, name) for name, each in fields if each.alias}
        return {alias: given for alias, given in tables.items() if isinstance(given, list)}

    @model_validator(mode="after")
    def _names_differ(self) -> "Study":
        for table, sections in self.tasks.items():
            if len({each.name for each in sections}) < len(sections):
                raise requirement(f"give every {table} a name of its own")
        return self

    @model_validator(mode="after")
    def _files_differ(self) -> "Study":
        owners: dict[str, str] = {}
        for table, sections in self.tasks.items():
            for each in sections:
                for stem in each.stems(table):
                    if stem in owners:
                        raise requirement(
                            f"give its {table} {each.name} a name without the files of the "
                            f"{owners[stem]} ({stem})"
                        )
                    owners[stem] = f"{table} {each.name}"
        return self

    @model_validator(mode="after")
    def _asks_for_something(self) -> "Study":
        asked = [section for sections in self.tasks.values() for section in sections]
        if self.equilibrium_set is None:
            if self.equilibria or any(section.needs_set for section in asked):
                raise requirement("have a [set] to which its equilibria and questions belong")
            if not asked:
                raise requirement(
                    "ask for something: a [set], or one of the tables that need "
                    "none, like [[map]], [[strongest]], [[calibration]] and [[sampled_route]]"
                )
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
        If `text` is no TOML or holds a key or value that is not allowed.
    """
    content = parse_toml(text, name)
    try:
        return Study.model_validate(content, context={FOLDER: folder or Path()})
    except ValidationError as error:
        raise complaint(error, Study, name) from error
