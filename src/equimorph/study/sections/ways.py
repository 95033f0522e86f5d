"""Ways that a study gives from outside: schedule files, or steps from a state."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PlainSerializer, PlainValidator, model_validator

from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import read_schedule
from equimorph.study.expressions import LARGEST
from equimorph.study.fingerprint import fingerprint
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import ComparisonText, Point, TaskSection, requirement

FOLDER = "folder"
"""In the context of validation: the folder from which names of files count."""


@dataclass(frozen=True, eq=False)
class ScheduleFile:
    """A schedule that was read from its files.

    Parameters
    ----------
    name
        Of the table, as the study gives it.
    schedule
        What it holds.
    """

    name: str
    schedule: Schedule

    @property
    def fingerprint(self) -> str:
        """Of all that the file says: an edited file is another question."""
        mine = self.schedule
        return fingerprint(
            {
                "names": mine.names,
                "values": mine.values.tolist(),
                "way_points": mine.way_points.tolist(),
                "start": mine.start,
            }
        )


def _read(value: Any, info: Any) -> ScheduleFile:
    if not isinstance(value, str):
        raise requirement("be the name of a schedule's .csv file, in quotes")
    folder = Path((info.context or {}).get(FOLDER, "."))
    try:
        return ScheduleFile(value, read_schedule(folder / value))
    except (InputError, ValueError) as error:
        raise requirement(f"be the table of a schedule that can be read: {error}") from error


ScheduleName = Annotated[
    ScheduleFile,
    PlainValidator(_read),
    PlainSerializer(lambda file: {"schedule": file.fingerprint}),
]


class WaySection(TaskSection):
    """A schedule from a file, or steps from a state of the set."""

    schedule: ScheduleName | None = None
    start: StateSection | None = None
    steps: list[Annotated[Point, Field(min_length=1)]] | None = Field(default=None, min_length=1)
    within: list[ComparisonText] = Field(default_factory=list)

    @property
    def needs_set(self) -> bool:
        """A schedule brings its first state along."""
        return self.schedule is None

    @model_validator(mode="after")
    def _one_way(self) -> "WaySection":
        from_file = self.schedule is not None
        if from_file in (self.steps is not None, self.start is not None):
            raise requirement("give a schedule, or a start with its steps")
        return self


class VerifySection(WaySection):
    """A schedule that is to be checked; see `equimorph.verify`."""

    margin: float = Field(default=0.0, ge=0, le=LARGEST)
    proof: bool = False


class TrialsSection(WaySection):
    """A schedule executed by imperfect structures; see `equimorph.random_trials`."""

    spreads: dict[str, Annotated[float, Field(gt=0, le=LARGEST)]] = Field(min_length=1)
    trials: Annotated[int, Field(ge=1, le=100_000)] = 200
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0
