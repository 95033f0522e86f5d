"""What part of an equilibrium set a study speaks of, and which of its states."""

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from equimorph.study.sections.fields import (
    ComparisonText,
    Interval,
    Intervals,
    Point,
    Section,
    one,
    requirement,
    two,
)


class SetSection(Section):
    """The part of the equilibrium set that is wanted."""

    box: Annotated[dict[str, Interval], AfterValidator(two)]
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)
    intervals: Intervals | None = None


class PointSection(Section):
    """A point of the parameter space whose equilibria are wanted."""

    at: Point = Field(min_length=1)


class StateSection(Section):
    """One stable equilibrium over a point, chosen by a descriptor where there are several."""

    at: Point = Field(min_length=1)
    highest: str | None = None
    lowest: str | None = None
    near: Annotated[Point, AfterValidator(one)] | None = None

    @model_validator(mode="after")
    def _one_choice(self) -> "StateSection":
        if sum(choice is not None for choice in (self.highest, self.lowest, self.near)) > 1:
            raise requirement("choose by one of highest, lowest, near")
        return self
