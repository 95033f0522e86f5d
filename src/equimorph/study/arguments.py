"""How arguments of tasks are written in a study, as the value of one key.

Each argument gives keys to the section of the task, and makes of their values what the task takes:
descriptors of texts, states of points. `Argument` is the plain case, a number or a word that the
task takes as it is written; `composite_arguments` holds those with several keys.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, get_args, get_origin

from pydantic import Field

from equimorph.errors import InputError
from equimorph.model import Box, names_of
from equimorph.study.lookup import (
    Ground,
    Later,
    RuleSection,
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
        return None if value is None else self.interpret(ground, value, f"{place}.{self.key}")

    def interpret(self, ground: Ground, value: Any, key: str) -> Any:
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

    def interpret(self, ground: Ground, value: StateSection, key: str) -> Any:
        """Look up what it is chosen by."""
        check_state(ground, value, key)
        return Later(lambda found: choose_state(found, value, key))


class NaturalArgument(Argument):
    """A state without a set."""

    def interpret(self, ground: Ground, value: NaturalSection, key: str) -> Any:
        """Look up where it comes from."""
        check_natural(ground, value, key)
        return Later(lambda found: lift_state(found, value, key))


class DescriptorArgument(Argument):
    """A descriptor by its name."""

    def interpret(self, ground: Ground, value: str, key: str) -> Any:
        """Look it up."""
        return descriptor_at(ground, value, key)


class DescriptorsArgument(Argument):
    """Descriptors by their names."""

    def interpret(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look them up."""
        texts = enumerate(value)
        return tuple(descriptor_at(ground, text, f"{key}[{i}]") for i, text in texts)


class CoordinatesArgument(Argument):
    """Descriptors or parameters by their names."""

    def interpret(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look the descriptors up."""
        names = names_of(ground.structure.parameters)
        return tuple(
            text if text in names else descriptor_at(ground, text, f"{key}[{i}]")
            for i, text in enumerate(value)
        )


class ValuesArgument(Argument):
    """Values of descriptors."""

    def interpret(self, ground: Ground, value: Mapping[str, float], key: str) -> Any:
        """Look the descriptors up."""
        return descriptors_of(ground, value, key)


class WithinArgument(Argument):
    """Constraints as texts."""

    def interpret(self, ground: Ground, value: Sequence[str], key: str) -> Any:
        """Look their descriptors up."""
        return constraints_of(ground, value, key)


class ParametersArgument(Argument):
    """Names of parameters, or values by such names."""

    def interpret(self, ground: Ground, value: Any, key: str) -> Any:
        """Check the names."""
        check_parameters(ground.structure, [value] if isinstance(value, str) else value, key)
        return value


class BoxArgument(Argument):
    """A box of parameters."""

    def interpret(self, ground: Ground, value: Mapping[str, list[float]], key: str) -> Any:
        """Check the names."""
        check_parameters(ground.structure, value, key)
        with at_key(key):
            return Box(**{name: (bounds[0], bounds[1]) for name, bounds in value.items()})


class PointsArgument(Argument):
    """Parameters that change step by step."""

    def interpret(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Check names and values."""
        for i, step in enumerate(value):
            check_values(ground.structure, step, f"{key}[{i}]")
        return value


class WayPointsArgument(Argument):
    """Points of the set through which a way leads."""

    def interpret(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Refuse points outside the box."""
        for i, corner in enumerate(value):
            check_point(ground.box, corner, f"{key}[{i}]", whole=False)
        return value


class LegsArgument(Argument):
    """Targets and loads that move leg by leg: what is no parameter is a descriptor."""

    def interpret(self, ground: Ground, value: Sequence[dict[str, float]], key: str) -> Any:
        """Look the descriptors up."""
        names = names_of(ground.structure.parameters)
        return [
            {
                (text if text in names else descriptor_at(ground, text, f"{key}[{i}]")): x
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


class RuleArgument(Argument):
    """A rule that prefers one of the states over a point."""

    def interpret(self, ground: Ground, value: RuleSection, key: str) -> Any:
        """Look up its descriptor or parameter."""
        return rule_of(ground, value, key)
