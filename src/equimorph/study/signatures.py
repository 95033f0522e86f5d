"""From the signature of a task to the keys of its section, by the types of its parameters.

Types are those of the public face: `State`, `Descriptor`, ``Sequence[Constraint]`` and so on, see
`SORTS`. A number or a word is taken as it is written; what it may be follows from its type, or from
its name where that means the same in all tasks, see `MEANINGS`.

See docs/decisions.md, "Keys of a study come from signatures".
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import Field

from equimorph.charts import Rule
from equimorph.manifold import EquilibriumSet
from equimorph.model import (
    Box,
    Constraint,
    Descriptor,
    Grid,
    Journal,
    Progress,
    Rates,
    Schedule,
    Workers,
)
from equimorph.structures import State, States, Structure
from equimorph.study import arguments as given, composite_arguments as composite
from equimorph.study.arguments import Argument
from equimorph.study.fields import (
    ComparisonText,
    Interval,
    NotNegative,
    Number,
    Point,
    Positive,
    Seed,
    Step,
)
from equimorph.study.lookup import RuleSection
from equimorph.study.states import NaturalSection, StateSection
from equimorph.tasks.robustness.error_model import Errors

MEANINGS: Mapping[str, Any] = {
    "margin": NotNegative,
    "accuracy": Positive,
    "bound": Positive,
    "most": Positive,
    "reach": Positive,
    "snap_price": Positive,
    "tolerance": Positive,
    "rate": Positive,
    "duration": Positive,
    "sampling": Positive,
    "step": Positive,
    "hold": Positive,
    "links": Annotated[int, Field(ge=2, le=1000)],
    "confidence": Annotated[float, Field(gt=0.5, lt=1.0)],
    "seed": Seed,
    "checks": Annotated[int, Field(ge=0, le=1000)],
    "count": Annotated[int, Field(ge=2, le=20)],
    "tiles": list[Annotated[int, Field(ge=1, le=1000)]],
    "limit": Annotated[int, Field(ge=1, le=100_000_000)],
    "samples": Annotated[int, Field(ge=2, le=1000)],
    "trials": Annotated[int, Field(ge=1, le=100_000)],
    "lifts": Annotated[int, Field(ge=1, le=10_000_000)],
    "batch": Annotated[int, Field(ge=1, le=100_000)],
    "sizes": list[Positive],
    "errors": dict[str, Positive],
    "could_measure": dict[str, Positive],
    "offsets": dict[str, Positive],
    "spreads": dict[str, Positive],
    "tolerances": dict[str, Positive],
    "survive": dict[str, Positive],
}
"""What values may be, of parameters whose names mean the same in all tasks."""
SUPPLIED = (EquilibriumSet, Structure, Progress, Journal, Workers)
"""Types of what a study has anyway."""
MONITOR = "monitor"
"""Descriptors that a schedule records: the study gives the one that distinguishes states."""


@dataclass(frozen=True)
class Form:
    """Type of a parameter: its alternatives, without None."""

    name: str
    kinds: tuple[Any, ...]

    def is_any(self, *kinds: Any) -> bool:
        """Whether one of some types is an alternative."""
        return any(each in kinds for each in self.kinds)

    def sequence_of(self, *inner: Any) -> bool:
        """Whether it may be a sequence of some types."""
        return set(inner) <= set(self._inner(Sequence))

    def mapping_of(self, *inner: Any) -> bool:
        """Whether it may be a mapping of some types."""
        return set(inner) <= set(self._inner(Mapping, dict))

    @property
    def has_ranges(self) -> bool:
        """Whether it may be a mapping to pairs of numbers."""
        mappings = [each for each in self.kinds if get_origin(each) is Mapping]
        return any(get_origin(get_args(each)[1]) is tuple for each in mappings)

    @property
    def lists_points(self) -> bool:
        """Whether it may be a sequence of mappings."""
        return any(get_origin(each) is Mapping for each in self._inner(Sequence))

    @property
    def options(self) -> type | None:
        """Dataclass of options."""
        found = (each for each in self.kinds if isinstance(each, type) and is_dataclass(each))
        return next(found, None)

    @property
    def plain(self) -> Any:
        """How a number or a word is written; None for anything else."""
        if self.name in MEANINGS:
            return MEANINGS[self.name]
        if self._inner(Sequence):
            return list[Number]
        words = (each for each in self.kinds if get_origin(each) is Literal)
        numbers = (Number if each is float else each for each in self.kinds if each in PLAIN)
        return next(words, next(numbers, None))

    def _inner(self, *origins: Any) -> list[Any]:
        """Types inside the alternatives that are collections: of entries, or of keys."""
        inside = [get_args(each)[0] for each in self.kinds if get_origin(each) in origins]
        return [kind for each in inside for kind in alternatives(each)]


PLAIN = (bool, int, float)
Make = Callable[..., Argument]


class Made(NamedTuple):
    """How an argument is made, and what is written for it."""

    make: Make
    written: Any


SORTS: tuple[tuple[Callable[[Form], bool], Make, Any], ...] = (
    (lambda form: form.is_any(State, States), given.StateArgument, StateSection),
    (lambda form: form.is_any(Schedule), composite.WayArgument, None),
    (lambda form: form.kinds == (Rates,), composite.RatesArgument, None),
    (lambda form: form.is_any(Rates), composite.ObjectiveArgument, composite.Objective),
    (lambda form: form.is_any(Errors), composite.ErrorsArgument, None),
    (lambda form: form.is_any(Descriptor), given.DescriptorArgument, str),
    (lambda form: form.is_any(Box), given.BoxArgument, dict[str, Interval]),
    (lambda form: form.is_any(Grid), composite.GridArgument, None),
    (lambda form: form.is_any(Rule), given.RuleArgument, RuleSection),
    (lambda form: form.has_ranges, given.ActuatorsArgument, list[str]),
    (lambda form: form.mapping_of(Any), given.LegsArgument, list[Step]),
    (lambda form: form.mapping_of(Descriptor), given.ValuesArgument, Point),
    (lambda form: form.mapping_of(str), given.ParametersArgument, Point),
    (lambda form: form.sequence_of(Descriptor, str), given.CoordinatesArgument, list[str]),
    (lambda form: form.sequence_of(Descriptor), given.DescriptorsArgument, list[str]),
    (lambda form: form.sequence_of(Constraint), given.WithinArgument, list[ComparisonText]),
    (lambda form: form.lists_points, given.WayPointsArgument, list[Step]),
    (lambda form: form.sequence_of(str), given.ParametersArgument, list[str]),
    (lambda form: form.is_any(str), given.ParametersArgument, str),
)
"""Which class of arguments stands for which types, the first that fits, and how it is written."""
ELSEWHERE: Mapping[Any, Made] = {
    composite.GridArgument: Made(composite.ActuatorGridArgument, None),
    given.WayPointsArgument: Made(given.PointsArgument, list[Step]),
}
"""What stands for them in tasks that do not take the set."""


def arguments_of(
    task: Callable[..., Any],
    names: Mapping[str, str] | None = None,
    left_out: Iterable[str] = (),
    *,
    natural: bool = False,
) -> list[Argument]:
    """Return the arguments of a task, a function or a class of results, that a study gives.

    `names` are keys of arguments that are called otherwise in studies; no key gives those left out.
    `natural`: whether states come from natural ones instead of the set.

    Raises `TypeError` for a parameter of a type that a study cannot write.
    """
    parameters = inspect.signature(task).parameters
    forms = {name: Form(name, alternatives(each.annotation)) for name, each in parameters.items()}
    other: dict[Any, Made] = {}
    if not any(form.is_any(EquilibriumSet) for form in forms.values()):
        other |= ELSEWHERE
    if any(form.is_any(Schedule) for form in forms.values()):
        other |= {given.StateArgument: Made(composite.WayStartArgument, StateSection)}
    if natural:
        other |= {given.StateArgument: Made(given.NaturalArgument, NaturalSection)}
    found = []
    for name, form in forms.items():
        if name == MONITOR or name in left_out or form.is_any(*SUPPLIED):
            continue
        key, default = (names or {}).get(name, name), parameters[name].default
        made = _argument(form, key, default, other)
        if made is None:
            raise TypeError(
                f"`{name}` of {task.__name__} must have a type that a study can write, or be left "
                f"out; got {parameters[name].annotation}."
            )
        found.append(made)
    return found


def _argument(form: Form, key: str, default: Any, other: Mapping[Any, Made]) -> Argument | None:
    """Return the argument of a form; None where a study cannot write it."""
    for fits, make, written in SORTS:
        if fits(form):
            make, written = other.get(make, (make, MEANINGS.get(form.name, written)))  # noqa: PLW2901
            return make(form.name, key, written, default)
    if form.options is not None:
        parts = _parts(form.options)
        return composite.OptionsArgument(form.name, key, form.options, default, parts=parts)
    return None if form.plain is None else Argument(form.name, key, form.plain, default)


def _parts(options: type) -> tuple[Argument, ...]:
    """Fields of a dataclass of options, as arguments."""
    made = (
        Argument(each.name, each.name, Form(each.name, alternatives(each.type)).plain, each.default)
        for each in fields(options)
    )
    return tuple(each for each in made if each.written is not None)


def alternatives(annotation: Any) -> tuple[Any, ...]:
    """Types that a value may have, without None."""
    if get_origin(annotation) in (Union, UnionType):
        return tuple(kind for each in get_args(annotation) for kind in alternatives(each))
    if get_origin(annotation) is Annotated:
        return alternatives(get_args(annotation)[0])
    return () if annotation is NoneType else (annotation,)
