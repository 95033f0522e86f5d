"""Questions of a study file on ways between states."""

from typing import Annotated, Any

from pydantic import AfterValidator, Field, model_validator

from equimorph.model import Rates
from equimorph.study.expressions import LARGEST
from equimorph.study.names import PLANE, STABLE_PLANE, route_name
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import (
    ComparisonText,
    Interval,
    Name,
    Point,
    Section,
    TaskSection,
    is_number,
    requirement,
)
from equimorph.tasks.planning.objectives import Term, Wish

TERMS = ("length", "travel", "work", "clearance", "time")
"""What a route may have least of."""
Positive = Annotated[float, Field(gt=0, le=LARGEST)]


def _objective(given: Any) -> Any:
    """Check a term, or weights of terms; one requirement for both makes one readable line."""
    terms = given if isinstance(given, dict) else {given: 1.0} if isinstance(given, str) else {}
    known = terms and set(terms) <= set(TERMS)
    if not (known and all(is_number(weight) and weight > 0 for weight in terms.values())):
        raise requirement(
            f"be one of {', '.join(TERMS)}, or positive weights of these like "
            "{ length = 1.0, work = 0.2 }"
        )
    return given


def _unused(name: str) -> str:
    """Refuse names under which files of the set are stored."""
    if f"{name}-plane" in (STABLE_PLANE, PLANE):
        raise requirement("be another name: figures of the set begin with it")
    return name


class PlannedSection(TaskSection):
    """What a way that is planned has to obey, and what it should have least of."""

    within: list[ComparisonText] = Field(default_factory=list)
    margin: float = Field(default=0.0, ge=0, le=LARGEST)
    objective: Annotated[Any, AfterValidator(_objective)] = "length"
    rates: dict[str, Positive] | None = Field(default=None, min_length=1)

    @property
    def wish(self) -> Wish:
        """The objective as `equimorph.plan` takes it."""
        terms = {self.objective: 1.0} if isinstance(self.objective, str) else self.objective
        return [(weight, self._term(name)) for name, weight in terms.items()]

    def _term(self, name: Any) -> Term:
        return Rates(self.rates or {}) if name == "time" else name

    @model_validator(mode="after")
    def _rates_with_time(self) -> "PlannedSection":
        timed = "time" in ([self.objective] if isinstance(self.objective, str) else self.objective)
        if timed != (self.rates is not None):
            raise requirement("give the largest rates where its objective counts time, only there")
        return self


class NaturalSection(Section):
    """A state without a set: the natural one at some parameters, and steps from there."""

    at: Point = Field(default_factory=dict)
    steps: list[Annotated[Point, Field(min_length=1)]] = Field(default_factory=list)


class SampledRouteSection(PlannedSection):
    """A route for many actuators, where no set can be computed; see `equimorph.plan_sampled`."""

    start: NaturalSection
    goal: NaturalSection | None = None
    actuators: Annotated[dict[str, Interval], Field(min_length=1)]
    loads: list[Annotated[Point, Field(min_length=1)]] = Field(default_factory=list)
    lifts: Annotated[int, Field(ge=1, le=10_000_000)] = 40_000
    reach: Positive = 0.5
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0

    @property
    def needs_set(self) -> bool:
        """It begins with natural states."""
        return False

    @model_validator(mode="after")
    def _ends_somewhere(self) -> "SampledRouteSection":
        if self.goal is None and not self.loads:
            raise requirement("give a goal, or loads under the last of which it ends")
        return self


class RouteSection(PlannedSection):
    """A route between two states, along way-points or planned freely; see `equimorph.plan`."""

    name: Annotated[Name, AfterValidator(_unused)]
    start: StateSection
    goal: StateSection
    via: list[Annotated[Point, Field(min_length=1)]] | None = Field(default=None, min_length=1)
    snap_price: Positive | None = None
    alternatives: Annotated[int, Field(ge=2, le=20)] | None = None
    smooth: Positive | None = None

    def stems(self, table: str) -> list[str]:
        """Names of all its routes."""
        return [route_name(self.name, k + 1) for k in range(self.alternatives or 1)]

    @model_validator(mode="after")
    def _go_together(self) -> "RouteSection":
        given = ("via", "snap_price", "alternatives")
        both = [key for key in given if getattr(self, key) is not None]
        if len(both) > 1:
            raise requirement(f"give one of {', '.join(given)} (not {' and '.join(both)})")
        if self.smooth is not None and self.snap_price is not None:
            raise requirement("give one of smooth, snap_price: routes that snap have corners")
        return self
