"""How the arguments of a task are written in a study: by the types in its signature.

Each argument gives one key or several to the section of the task, and makes of their values what
the task takes: descriptors of texts, states of points, grids of boxes. `Argument` is the plain
case, a number or a word that the task takes as it is written.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, get_args, get_origin

from pydantic import AfterValidator, Field

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.model import Box, Grid, Rates, Schedule, names_of, position
from equimorph.structures import State, Structure
from equimorph.study.data_files import ScheduleName
from equimorph.study.fields import (
    Count,
    Interval,
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
    constraints_of,
    descriptor_at,
    descriptors_of,
)
from equimorph.study.rules import RuleSection, rule_of
from equimorph.study.states import (
    ChosenState,
    NaturalSection,
    NaturalState,
    StateSection,
    check_natural,
    check_state,
)
from equimorph.tasks import unloaded_base
from equimorph.tasks.verification import first_state

REQUIRED = inspect.Parameter.empty
Intervals = Annotated[list[Count], Field(min_length=2, max_length=2)]
OBJECTIVES = ("length", "travel", "work", "clearance", "time")
"""What a route may have least of."""


@dataclass(frozen=True)
class Argument:
    """An argument of a task, written as the value of one key.

    Parameters
    ----------
    name
        Of the parameter of the task.
    key
        Of the section.
    written
        Type of the value in the file.
    default
        Of the signature; `REQUIRED` without one.
    """

    name: str
    key: str
    written: Any
    default: Any = REQUIRED

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Keys with types and defaults, as pydantic takes them."""
        return {self.key: field_of(self.written, self.default)}

    def check(self, section: Any) -> None:
        """Refuse values of several keys that do not go together."""

    def needs_set(self, section: Any) -> bool:
        """Whether it can only be found on the set of the study."""
        del section
        return False

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Return what the task takes, or a `Later`; `InputError` names the key of what is wrong."""
        value = getattr(section, self.key)
        return None if value is None else self.found(ground, value, f"{place}.{self.key}")

    def found(self, ground: Ground, value: Any, key: str) -> Any:
        """Return what a value stands for."""
        del ground, key
        return tuple(value) if isinstance(value, list) else value


def field_of(written: Any, default: Any) -> tuple[Any, Any]:
    """Return type and default of a key; what must be given, or may be left out, is not empty."""
    sized = get_origin(_plain(written)) in (list, dict)
    if default is REQUIRED:
        return (Annotated[written, Field(min_length=1)] if sized else written), ...
    if default is None:
        listed = get_origin(_plain(written)) is list
        return (Annotated[written, Field(min_length=1)] if listed else written) | None, None
    if isinstance(default, tuple):
        return written, Field(default_factory=partial(list, default))
    return written, default


def _plain(written: Any) -> Any:
    """Type without its annotations."""
    return get_args(written)[0] if get_origin(written) is Annotated else written


class StateArgument(Argument):
    """A stable state, chosen on the set."""

    def needs_set(self, section: Any) -> bool:
        """It is chosen there, if it is given."""
        return getattr(section, self.key) is not None

    def found(self, ground: Ground, value: StateSection, key: str) -> Any:
        """Look up what it is chosen by."""
        check_state(ground, value, key)
        return ChosenState(value, key)


class NaturalArgument(Argument):
    """A state without a set."""

    def found(self, ground: Ground, value: NaturalSection, key: str) -> Any:
        """Look up where it comes from."""
        check_natural(ground, value, key)
        return NaturalState(value, key)


@dataclass(frozen=True)
class _FirstState(Later):
    """State in which a schedule from a file begins."""

    schedule: Schedule
    key: str

    def on(self, ground: Ground, eset: EquilibriumSet | None) -> State:
        del eset
        with at_key(self.key):
            return first_state(self.schedule, ground.structure)


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
            return _FirstState(section.schedule.schedule, f"{place}.schedule")
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
        names = names_of(ground.structure.parameters)
        if section.schedule is None:
            for i, step in enumerate(section.steps):
                check_values(ground.structure, step, f"{place}.steps[{i}]")
            return section.steps
        schedule = section.schedule.schedule
        if schedule.names != names:
            raise InputError(
                f"`{place}.schedule` must give the parameters {', '.join(names)}; "
                f"got {', '.join(schedule.names)}."
            )
        return schedule


class DescriptorArgument(Argument):
    """A descriptor by its name."""

    def found(self, ground: Ground, value: str, key: str) -> Any:
        """Look it up."""
        return descriptor_at(ground.structure, value, key)


class DescriptorsArgument(Argument):
    """Descriptors by their names."""

    def found(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look them up."""
        texts = enumerate(value)
        return tuple(descriptor_at(ground.structure, text, f"{key}[{i}]") for i, text in texts)


class CoordinatesArgument(Argument):
    """Descriptors or parameters by their names."""

    def found(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look the descriptors up."""
        names = names_of(ground.structure.parameters)
        return tuple(
            text if text in names else descriptor_at(ground.structure, text, f"{key}[{i}]")
            for i, text in enumerate(value)
        )


class ValuesArgument(Argument):
    """Values of descriptors."""

    def found(self, ground: Ground, value: Mapping[str, float], key: str) -> Any:
        """Look the descriptors up."""
        return descriptors_of(ground.structure, value, key)


class WithinArgument(Argument):
    """Constraints as texts."""

    def found(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look their descriptors up."""
        return constraints_of(ground.structure, value, key)


class ParametersArgument(Argument):
    """Names of parameters, or values by such names."""

    def found(self, ground: Ground, value: Any, key: str) -> Any:
        """Check the names."""
        check_parameters(ground.structure, [value] if isinstance(value, str) else value, key)
        return value


class BoxArgument(Argument):
    """A box of parameters."""

    def found(self, ground: Ground, value: Mapping[str, list[float]], key: str) -> Any:
        """Check the names."""
        check_parameters(ground.structure, value, key)
        with at_key(key):
            return Box(**{name: (bounds[0], bounds[1]) for name, bounds in value.items()})


class PointsArgument(Argument):
    """Parameters that change step by step."""

    def found(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Check names and values."""
        for i, step in enumerate(value):
            check_values(ground.structure, step, f"{key}[{i}]")
        return value


class WayPointsArgument(Argument):
    """Points of the set through which a way leads."""

    def found(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Refuse points outside the box."""
        for i, corner in enumerate(value):
            check_point(ground.box, corner, f"{key}[{i}]", whole=False)
        return value


class LegsArgument(Argument):
    """Targets and loads that move leg by leg: what is no parameter is a descriptor."""

    def found(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Look the descriptors up."""
        names = names_of(ground.structure.parameters)
        return [
            {
                (text if text in names else descriptor_at(ground.structure, text, f"{key}[{i}]")): x
                for text, x in leg.items()
            }
            for i, leg in enumerate(value)
        ]


class ActuatorsArgument(Argument):
    """Free parameters of the set that may be chosen, within the sides of its box."""

    def needs_set(self, section: Any) -> bool:
        """The box is that of the set."""
        del section
        return True

    def found(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Refuse parameters that the set does not free."""
        box = ground.box
        sides = zip(box.names, box.lower.tolist(), box.upper.tolist(), strict=True)
        limits = {name: (low, high) for name, low, high in sides}
        unknown = [name for name in value if name not in limits]
        if unknown:
            raise InputError(
                f"`{key}` must be free parameters of the set ({', '.join(limits)}); "
                f"got {', '.join(unknown)}."
            )
        return {name: limits[name] for name in value}


class ObjectiveArgument(Argument):
    """What a route should have least of: a term or weights of terms, with rates for time."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Give the objective, and the rates that time needs."""
        rates = Annotated[dict[str, Positive], Field(min_length=1)] | None
        return {self.key: (self.written, self.default), "rates": (rates, None)}

    def check(self, section: Any) -> None:
        """Time has rates, and nothing else has."""
        if ("time" in _terms(getattr(section, self.key))) != (section.rates is not None):
            raise requirement("give the largest rates where its objective counts time, only there")

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Weights with terms."""
        check_parameters(ground.structure, section.rates or (), f"{place}.rates")
        terms = _terms(getattr(section, self.key))
        return [
            (weight, Rates(section.rates or {}) if name == "time" else name)
            for name, weight in terms.items()
        ]


def _terms(given: Any) -> dict[str, float]:
    return {given: 1.0} if isinstance(given, str) else dict(given)


def _objective(given: Any) -> Any:
    """Check a term, or weights of terms; one requirement for both makes one readable line."""
    terms = _terms(given) if isinstance(given, dict | str) else {}
    known = terms and set(terms) <= set(OBJECTIVES)
    if not (known and all(is_number(weight) and weight > 0 for weight in terms.values())):
        raise requirement(
            f"be one of {', '.join(OBJECTIVES)}, or positive weights of these like "
            "{ length = 1.0, work = 0.2 }"
        )
    return given


Objective = Annotated[Any, AfterValidator(_objective)]


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
                f"`{place}` must be asked of a set over two parameters; got one over "
                f"{len(box.names)}."
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


class RuleArgument(Argument):
    """A rule that prefers one of the states over a point."""

    def found(self, ground: Ground, value: RuleSection, key: str) -> Any:
        """Look up its descriptor or parameter."""
        return rule_of(ground, value, key)


@dataclass(frozen=True)
class OptionsArgument(Argument):
    """Options of a computation, each under a key of its own; `written` is their class."""

    parts: tuple[Argument, ...] = ()

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Keys of all options."""
        return {key: given for each in self.parts for key, given in each.keys().items()}

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Build the options."""
        with at_key(place):
            return self.written(**{x.name: x.look_up(ground, section, place) for x in self.parts})
