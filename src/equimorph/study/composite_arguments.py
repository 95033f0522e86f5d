"""Arguments of tasks that a study writes in several keys: ways, objectives, grids, options."""

import re
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema

from equimorph.errors import InputError
from equimorph.model import Grid, Rates, Schedule, position
from equimorph.structures import State, Structure
from equimorph.study.arguments import Argument, StateArgument
from equimorph.study.data_files import ScheduleName
from equimorph.study.fields import (
    Interval,
    Intervals,
    Positive,
    Step,
    is_number,
    requirement,
    two,
)
from equimorph.study.lookup import (
    Ground,
    Later,
    at_key,
    check_parameters,
    check_point,
    check_value,
    check_values,
    descriptor_at,
)
from equimorph.study.states import StateSection
from equimorph.tasks.maps.actuator_map import unloaded_base
from equimorph.tasks.planning.objectives import least, peak
from equimorph.tasks.robustness.error_model import ErringStructure, Errors
from equimorph.tasks.start import check_schedule
from equimorph.tasks.verification.schedule_check import first_state

OBJECTIVES = ("length", "travel", "work", "clearance", "time")
"""What a route may have least of."""
EXTREME = re.compile(r"(?P<which>peak|least)\((?P<descriptor>.+)\)")
"""A descriptor whose largest value is kept low, or least value high."""


def _first_state(schedule: Schedule, key: str) -> Later:
    """State in which a schedule from a file begins."""

    def find(ground: Ground) -> State:
        with at_key(key):
            return first_state(schedule, ground.structure)

    return Later(find)


class WayStartArgument(StateArgument):
    """State in which a way begins: that of its schedule, or one of the set."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give it where no schedule does."""
        return {self.key: (StateSection | None, None)}

    def needs_set(self, section: Any) -> bool:
        """It is chosen there, unless a schedule brings it along."""
        return section.schedule is None

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Look up what it is chosen by; a schedule brings its first state along."""
        if section.schedule is not None:
            return _first_state(section.schedule.schedule, f"{place}.schedule")
        return super().look_up(ground, section, place)


class WayArgument(Argument):
    """A schedule from a file, or steps."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give the schedule, or the steps."""
        return {
            "schedule": (ScheduleName | None, None),
            "steps": (Annotated[list[Step], Field(min_length=1)] | None, None),
        }

    def check(self, section: Any) -> None:
        """One of both, steps with a start."""
        from_file = section.schedule is not None
        if from_file in (section.steps is not None, section.start is not None):
            raise requirement("give a schedule, or a start with its steps")

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Check names and values."""
        if section.schedule is None:
            for i, step in enumerate(section.steps):
                check_values(ground.structure, step, f"{place}.steps[{i}]")
            return section.steps
        schedule = section.schedule.schedule
        check_schedule(schedule, ground.structure, f"{place}.schedule")
        return schedule


class ObjectiveArgument(Argument):
    """What a route should have least of: a term or weights of terms, with rates for time.

    Or a descriptor, whose largest value on the way is kept low, or least value high.
    """

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give the objective, and the rates that time needs."""
        rates = Annotated[dict[str, Positive], Field(min_length=1)] | None
        return {self.key: (self.written, self.default), "rates": (rates, None)}

    def check(self, section: Any) -> None:
        """Time has rates, and nothing else has."""
        if ("time" in _terms(getattr(section, self.key))) != (section.rates is not None):
            raise requirement(
                "give the largest rates where its objective counts time, and only there"
            )

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Weights with terms."""
        check_parameters(ground.structure, section.rates or (), f"{place}.rates")
        given = getattr(section, self.key)
        if isinstance(given, str) and (extreme := EXTREME.fullmatch(given)):
            descriptor = descriptor_at(ground, extreme["descriptor"], f"{place}.{self.key}")
            return peak(descriptor) if extreme["which"] == "peak" else least(descriptor)
        terms = _terms(given)
        return [
            (weight, Rates(section.rates or {}) if name == "time" else name)
            for name, weight in terms.items()
        ]


class ErrorsArgument(Argument):
    """Errors that a way has to survive, and with which probability, if not all of a box."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give the sizes, and the probability."""
        share = Annotated[float, Field(gt=0.0, lt=1.0)] | None
        return {self.key: (self.written | None, None), "probability": (share, None)}

    def check(self, section: Any) -> None:
        """A probability is one of some errors."""
        if section.probability is not None and getattr(section, self.key) is None:
            raise requirement(f"give {self.key} beside a probability")

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Check names."""
        sizes = getattr(section, self.key)
        if sizes is None:
            return None
        with at_key(f"{place}.{self.key}"):
            errors = Errors(sizes, section.probability)
            return ErringStructure(ground.structure, errors).errors


class RatesArgument(Argument):
    """Largest rates and, if wished, accelerations and jerks, by parameter."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give the limits."""
        limits = Annotated[dict[str, Positive], Field(min_length=1)]
        more: tuple[Any, Any] = (dict[str, Positive], {})
        return {self.key: (limits, ...), "accelerations": more, "jerks": more}

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Check names."""
        limits = {key: getattr(section, key) for key in self.keys()}
        for key, each in limits.items():
            check_parameters(ground.structure, each, f"{place}.{key}")
        with at_key(place):
            return Rates(*limits.values())


def _terms(given: Any) -> dict[str, float]:
    return {given: 1.0} if isinstance(given, str) else dict(given)


def _objective(given: Any) -> Any:
    """Check a term, or weights of terms; one requirement for both makes one readable line."""
    if isinstance(given, str) and EXTREME.fullmatch(given):
        return given
    terms = _terms(given) if isinstance(given, dict | str) else {}
    known = terms and set(terms) <= set(OBJECTIVES)
    if not (known and all(is_number(weight) and weight > 0 for weight in terms.values())):
        raise requirement(
            f"be one of {', '.join(OBJECTIVES)}, positive weights of these like "
            "{ length = 1.0, work = 0.2 }, or peak(descriptor) or least(descriptor)"
        )
    return given


_WEIGHTS = {"type": "object", "propertyNames": {"enum": list(OBJECTIVES)}}
_WEIGHTS |= {"additionalProperties": {"type": "number", "exclusiveMinimum": 0}}
Objective = Annotated[
    Any,
    AfterValidator(_objective),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": list(OBJECTIVES)},
                _WEIGHTS,
                {"type": "string", "pattern": r"^(peak|least)\(.+\)$"},
            ]
        }
    ),
]


class GridArgument(Argument):
    """A grid over the two free parameters of the set: by default over all of its box."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Box and intervals."""
        box = Annotated[dict[str, Interval], AfterValidator(two)]
        return {
            "box": (box | None, None),
            "intervals": (Intervals, Field(default_factory=lambda: [100, 100])),
        }

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Refuse corners outside the box of the set."""
        box = ground.box
        if len(box.names) != 2:
            raise InputError(
                f"`{place}` needs a set over two parameters; got one over {len(box.names)}."
            )
        sides = dict(zip(box.names, zip(box.lower, box.upper, strict=True), strict=True))
        for end in (0, 1) if section.box else ():
            corner = {name: bounds[end] for name, bounds in section.box.items()}
            check_point(box, corner, f"{place}.box")
        counted = zip(box.names, section.intervals, strict=True)
        sides |= section.box or {}
        return Grid(**{name: (*map(float, sides[name]), count) for name, count in counted})


class ActuatorGridArgument(Argument):
    """A grid of two actuators, over which a load grows from the natural states: without a set."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Box and intervals."""
        return {
            "box": (Annotated[dict[str, Interval], AfterValidator(two)], ...),
            "intervals": (Intervals, ...),
        }

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Refuse corners without meaning, and a load that is bounded where it begins."""
        structure = ground.structure
        with at_key(place):
            for name, bounds in section.box.items():
                for corner in bounds:
                    check_value(structure, name, corner)
            sides = zip(section.box.items(), section.intervals, strict=True)
            grid = Grid(**{name: (*bounds, count) for (name, bounds), count in sides})
            low = unloaded_load(structure, section, grid)
            if not low < section.bound:
                raise InputError(
                    f"`bound` must exceed {section.load} = {low:g}; got {section.bound}."
                )
        return grid


def unloaded_load(structure: Structure, section: Any, grid: Grid) -> float:
    """Value of the load in the natural states."""
    base = unloaded_base(structure, grid, section.load, section.fixed or {})
    return float(base[position(structure.parameters, section.load)])


@dataclass(frozen=True)
class OptionsArgument(Argument):
    """Options of a computation, each under a separate key; `written` is their class."""

    parts: tuple[Argument, ...] = ()

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Keys of all options."""
        return {key: given for each in self.parts for key, given in each.keys().items()}

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Build the options."""
        with at_key(place):
            return self.written(**{x.name: x.look_up(ground, section, place) for x in self.parts})
