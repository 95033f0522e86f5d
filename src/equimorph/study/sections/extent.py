"""What part of an equilibrium set a study speaks of, and which of its states."""

from typing import Annotated, Any

from pydantic import AfterValidator, Field, model_validator

from equimorph.study.sections.fields import (
    ComparisonText,
    Count,
    Interval,
    Point,
    Section,
    one,
    requirement,
)


def _one_to_three(table: dict[str, Any]) -> dict[str, Any]:
    if not 1 <= len(table) <= 3:
        raise requirement("span one, two or three free parameters")
    return table


class SetSection(Section):
    """The part of the equilibrium set that is wanted."""

    box: Annotated[dict[str, Interval], AfterValidator(_one_to_three)]
    fixed: Point = Field(default_factory=dict)
    within: list[ComparisonText] = Field(default_factory=list)
    intervals: list[Count] | None = None

    @model_validator(mode="after")
    def _one_each(self) -> "SetSection":
        if self.intervals is not None and len(self.intervals) != len(self.box):
            raise requirement("give one number of intervals for each parameter of its box")
        return self


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
