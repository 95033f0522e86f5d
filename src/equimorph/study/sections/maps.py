"""Questions of a study file on maps over two actuators."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from equimorph.study.expressions import LARGEST
from equimorph.study.sections.fields import (
    ComparisonText,
    Interval,
    Intervals,
    Number,
    Point,
    TaskSection,
    requirement,
    two,
)


class ActuatorGridSection(TaskSection):
    """What is computed at every setting of two actuators, from the natural states on."""

    box: Annotated[dict[str, Interval], AfterValidator(two)]
    intervals: Intervals
    load: str
    bound: float = Field(default=100.0, gt=0, le=LARGEST)
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)

    @property
    def needs_set(self) -> bool:
        """It begins with natural states."""
        return False


class MapSection(ActuatorGridSection):
    """A map; see `equimorph.limit_load_map` and `equimorph.curvature_map`."""

    kind: Literal["limit_load_map", "curvature_map"]
    at: Number | None = None
    descriptor: str | None = None

    @model_validator(mode="after")
    def _level(self) -> "MapSection":
        if (self.kind == "curvature_map") != (self.at is not None):
            raise requirement("give the load `at` in a curvature_map, and only there")
        if self.kind == "limit_load_map" and self.descriptor is not None:
            raise requirement("give a descriptor in a curvature_map only")
        return self


class StrongestSection(ActuatorGridSection):
    """Settings that carry most, also if they are off; see `equimorph.strongest`."""

    offsets: dict[str, Annotated[float, Field(gt=0, le=LARGEST)]] = Field(default_factory=dict)
