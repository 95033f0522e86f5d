"""How arguments of tasks are written in a study, as the value of one key.

Each argument gives keys to the section of the task, and makes of their values what the task takes:
descriptors of texts, states of points. `Argument` is the plain case, a number or a word that the
task takes as it is written; `composite_arguments` holds those with several keys.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, get_args, get_origin

from pydantic import Field

from equimorph.errors import InputError
from equimorph.model import Box, Descriptor, names_of
from equimorph.study.lookup import (
    Ground,
    Later,
    at_key,
    check_parameters,
    check_point,
    check_values,
    constraints_of,
    descriptor_at,
    descriptors_of,
    rule_of,
)
from equimorph.study.states import (
    NaturalSection,
    StateSection,
    check_natural,
    check_state,
    choose_state,
    lift_state,
)

REQUIRED = inspect.Parameter.empty
Read = Callable[[Ground, Any, str], Any]
"""Of the value, at the key that messages name."""


@dataclass(frozen=True)
class Argument:
    """An argument of a task, written as the value of one key."""

    name: str
    """Of the parameter of the task."""
    key: str
    """Of the section."""
    written: Any
    """Type of the value in the file."""
    default: Any = REQUIRED
    """Of the signature; `REQUIRED` without one."""
    read: Read | None = None
    """Makes of a value what it stands for; None: the value itself."""

    def keys(self) -> dict[str, tuple[Any, Any]]:
        """Keys with types and defaults, as pydantic takes them."""
        return {self.key: field_of(self.written, self.default)}

    def check(self, section: Any) -> None:
        """Refuse values of several keys that do not go together."""

    def needs_set(self, section: Any) -> bool:
        """Whether it can only be found on the set of the study."""
        return False

    def look_up(self, ground: Ground, section: Any, place: str) -> Any:
        """Return what the task takes, or a `Later`; `InputError` names the key of what is wrong."""
        value = getattr(section, self.key)
        return None if value is None else self.interpret(ground, value, f"{place}.{self.key}")

    def interpret(self, ground: Ground, value: Any, key: str) -> Any:
        """Return what a value stands for: itself, if nothing reads it."""
        if self.read is not None:
            return self.read(ground, value, key)
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

    def interpret(self, ground: Ground, value: StateSection, key: str) -> Any:
        """Look up what it is chosen by."""
        check_state(ground, value, key)
        return Later(lambda found: choose_state(found, value, key))


def reading(read: Read) -> Callable[..., Argument]:
    """Arguments whose values a function reads."""
    return partial(Argument, read=read)


def _natural(ground: Ground, value: NaturalSection, key: str) -> Later:
    check_natural(ground, value, key)
    return Later(lambda found: lift_state(found, value, key))


NaturalArgument = reading(_natural)
"""A state without a set."""


def _descriptors(ground: Ground, value: Sequence[str], key: str) -> tuple[Descriptor, ...]:
    return tuple(descriptor_at(ground, text, f"{key}[{i}]") for i, text in enumerate(value))


def _coordinates(ground: Ground, value: Sequence[str], key: str) -> tuple[str | Descriptor, ...]:
    names = names_of(ground.structure.parameters)
    return tuple(
        text if text in names else descriptor_at(ground, text, f"{key}[{i}]")
        for i, text in enumerate(value)
    )


DescriptorArgument = reading(descriptor_at)
DescriptorsArgument = reading(_descriptors)
CoordinatesArgument = reading(_coordinates)
"""Descriptors, or parameters, by their names."""
ValuesArgument = reading(descriptors_of)
WithinArgument = reading(constraints_of)
RuleArgument = reading(rule_of)


def _parameters(ground: Ground, value: Any, key: str) -> Any:
    check_parameters(ground.structure, [value] if isinstance(value, str) else value, key)
    return value


ParametersArgument = reading(_parameters)
"""Names of parameters, or values by such names."""


def _box(ground: Ground, value: Mapping[str, list[float]], key: str) -> Box:
    check_parameters(ground.structure, value, key)
    with at_key(key):
        return Box(**{name: (bounds[0], bounds[1]) for name, bounds in value.items()})


BoxArgument = reading(_box)


def _points(ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
    for i, step in enumerate(value):
        check_values(ground.structure, step, f"{key}[{i}]")
    return value


PointsArgument = reading(_points)
"""Parameters that change step by step."""


def _points_of_set(ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
    for i, corner in enumerate(value):
        check_point(ground.box, corner, f"{key}[{i}]", whole=False)
    return value


WayPointsArgument = reading(_points_of_set)
"""Points of the set, inside its box, through which a way leads."""


def _legs(ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
    names = names_of(ground.structure.parameters)
    return [
        {
            (text if text in names else descriptor_at(ground, text, f"{key}[{i}]")): x
            for text, x in leg.items()
        }
        for i, leg in enumerate(value)
    ]


LegsArgument = reading(_legs)
"""Targets and loads that move leg by leg: what is no parameter is a descriptor."""


class ActuatorsArgument(Argument):
    """Free parameters of the set that may be chosen, within the sides of its box."""

    def needs_set(self, section: Any) -> bool:
        """The box is that of the set."""
        return True

    def interpret(self, ground: Ground, value: Sequence[str], key: str) -> Any:
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
