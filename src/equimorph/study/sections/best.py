"""Questions of a study file on what is best: at one place, everywhere, and while loads move."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from equimorph.study.expressions import LARGEST
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import (
    ComparisonText,
    Interval,
    Intervals,
    Number,
    TaskSection,
    two,
)


class ObjectiveSection(TaskSection):
    """What is to be least or largest."""

    objective: str
    sense: Literal["min", "max"] = "min"
    within: list[ComparisonText] = Field(default_factory=list)


class OptimumSection(ObjectiveSection):
    """The best stable states; see `equimorph.optimise`."""

    start: StateSection | None = None
    margin: float = Field(default=0.0, ge=0, le=LARGEST)


class LandscapeSection(ObjectiveSection):
    """The best stable state at every setting; see `equimorph.landscape`."""

    start: StateSection | None = None
    box: Annotated[dict[str, Interval], AfterValidator(two)] | None = None
    intervals: Intervals = Field(default_factory=lambda: [100, 100])


class FollowSection(ObjectiveSection):
    """The best state while loads and targets move; see `equimorph.follow_optimum`."""

    start: StateSection
    targets: list[Annotated[dict[str, Number], Field(min_length=1)]] = Field(min_length=1)
    actuators: list[str] = Field(min_length=1)
    margin: float = Field(default=0.0, ge=0, le=LARGEST)
