"""Questions of a study file: shapes, motions, what is reached, what was measured."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from equimorph.study.expressions import LARGEST
from equimorph.study.sections.data import DataFile
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import (
    ComparisonText,
    Number,
    Point,
    TaskSection,
    requirement,
)


class ShapeSection(TaskSection):
    """All states whose descriptors have given values; see `equimorph.solve_shape`."""

    targets: dict[str, Number] = Field(min_length=1)
    start: StateSection | None = None
    rank: Literal["route", "energy", "margin"] | None = None
    within: list[ComparisonText] = Field(default_factory=list)


class TrackSection(TaskSection):
    """A motion of descriptors, and of loads, that actuators follow; see `equimorph.track`."""

    start: StateSection
    targets: list[Annotated[dict[str, Number], Field(min_length=1)]] = Field(min_length=1)
    actuators: list[str] = Field(min_length=1)
    beyond: bool = False
    within: list[ComparisonText] = Field(default_factory=list)


class ReachSection(TaskSection):
    """What a state leads to; see `equimorph.reachable` and `equimorph.attainable`."""

    start: StateSection
    descriptors: list[str] = Field(min_length=1)
    kind: Literal["reachable", "attainable"] = "reachable"
    targets: list[list[Number]] = Field(default_factory=list)
    accuracy: float | None = Field(default=None, gt=0, le=LARGEST)
    within: list[ComparisonText] = Field(default_factory=list)

    @model_validator(mode="after")
    def _as_many(self) -> "ReachSection":
        if self.kind == "attainable" and self.accuracy is not None:
            raise requirement("give an accuracy to reachable sets only")
        if any(len(target) != len(self.descriptors) for target in self.targets):
            raise requirement("give each target one value for each of its descriptors")
        return self


class EstimateSection(TaskSection):
    """Branch and load of a measured structure; see `equimorph.estimate_state`."""

    measured: dict[str, Number] = Field(min_length=1)
    errors: dict[str, Annotated[float, Field(gt=0, le=LARGEST)]] = Field(min_length=1)
    confidence: float = Field(default=0.95, gt=0.5, lt=1.0)


class CalibrationSection(TaskSection):
    """Unknown parameters or data from measured points of shapes; see `equimorph.calibrate`."""

    data: DataFile
    unknown: dict[str, Literal["value", "offset", "gain", "data"]] = Field(min_length=1)
    at: Point = Field(default_factory=dict)
    sigma: float | None = Field(default=None, gt=0, le=LARGEST)

    @property
    def needs_set(self) -> bool:
        """It begins with natural states."""
        return False
