"""Checks of the arguments of public functions, in one way for all.

`check_arguments` reads from the signature what each argument may be (see `argument_kinds`), and
refuses anything else with one line: what, which value, what is allowed. Arguments that belong to a
structure must all belong to the same one. Whether names and values have a meaning for a structure
is checked by its parameters, see `model.parameter`.
"""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property, wraps
from numbers import Real
from operator import attrgetter
from types import NoneType
from typing import Any, TypeVar, get_type_hints

import numpy as np

from equimorph.argument_kinds import (
    ANYTHING,
    Kind,
    convert_value,
    is_listed,
    is_mapping,
    kind_of,
    short,
)
from equimorph.errors import InputError, suggestion

Thing = TypeVar("Thing", bound=Callable[..., Any])

OWNERS: Mapping[str, Callable[[Any], Any]] = {
    "Structure": lambda structure: structure,
    **{name: attrgetter("structure") for name in ("State", "States", "FoundStates")},
    **{name: attrgetter("structure") for name in ("EquilibriumSet", "LimitLoadMap")},
    **{name: attrgetter("structure") for name in ("ActuatorMap", "CurvatureMap")},
    **{name: attrgetter("eset.structure") for name in ("Chart", "Atlas", "Components")},
    **{name: attrgetter("state.structure") for name in ("LimitLoad", "Event", "Location")},
    "StateEstimate": attrgetter("states.structure"),
    "Path": attrgetter("states.structure"),
    "Lifts": attrgetter("states.structure"),
    "Reach": attrgetter("whole.structure"),
}
"""How the structure is found to which objects of a class belong, by the name of the class."""
DESCRIBED = frozenset(("Descriptor", "Constraint", "Extreme"))
"""Classes whose objects describe one structure, by its signature."""
CHECKED = "_arguments_are_checked"
"""Attribute of functions whose arguments are checked, and of what wraps them."""
REMEDIES: Mapping[str, tuple[type, str]] = {
    "schedule": (NoneType, "A refused route has no schedule: its `why` says what stopped it."),
    "EquilibriumSet.at": (list, "Use `over` for many points."),
    "EI": (Real, "Cables, which do not bend and go slack instead of pushing, are not covered."),
}
"""What is often given by mistake, and what to do instead, by argument or by function."""


def check_arguments(thing: Thing) -> Thing:
    """Check the arguments of a function, or of the constructor of a class, by its signature.

    Raises
    ------
    InputError
        On calls, for the first argument that is not of its kind or belongs to another structure.

    Examples
    --------
    >>> @check_arguments
    ... def twice(seed: int) -> int:
    ...     return 2 * seed
    >>> twice(2)
    4
    >>> twice("2")
    Traceback (most recent call last):
    equimorph.errors.InputError: `seed` must be a whole number >= 0; got '2'.
    """
    if inspect.isclass(thing):
        made: Any = thing
        made.__init__ = _wrap_with_checks(made.__init__)
        return thing
    return _wrap_with_checks(thing)  # type: ignore[return-value]


def _wrap_with_checks(function: Callable[..., Any]) -> Callable[..., Any]:
    entry = Entry(function)

    @wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        args, kwargs = entry.admit(args, kwargs)
        return function(*args, **kwargs)

    setattr(wrapper, CHECKED, True)
    return wrapper


class Entry:
    """What a function admits; its signature is read at the first call."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._admitted: set[tuple[object, ...]] = set()

    def admit(  # noqa: C901  # one loop for each way in which Python passes arguments
        self, args: tuple[Any, ...], kwargs: dict[str, Any]
    ) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Return the arguments, some converted to the form that the function works with."""
        kinds, names = self._kinds, self._names
        given = (len(args), *kwargs)
        if given not in self._admitted:
            self._check_names(args, kwargs)
            self._admitted.add(given)
        changed: dict[str, Any] = {}
        for name, value in zip(names, args, strict=False):
            if not kinds[name].fits(value):
                changed[name] = self._convert(kinds[name], name, value, args)
        for value in args[len(names) :]:
            if not self._rest.fits(value):
                self._convert(self._rest, self._rest_name, value, args)
        for name, value in kwargs.items():
            kind = kinds.get(name, self._other)
            if not kind.fits(value):
                changed[name] = self._convert(kind, name, value, args)
        if changed:
            first = [changed.pop(name, value) for name, value in zip(names, args, strict=False)]
            args, kwargs = (*first, *args[len(names) :]), {**kwargs, **changed}
        if len(self._owning) + len(self._described) > 1:
            self._check_structures({**dict(zip(names, args, strict=False)), **kwargs})
        return args, kwargs

    def _check_names(self, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Refuse names that are no arguments, too many values, and calls without what is needed."""
        kinds, first = self._kinds, len(args)
        unknown = [] if self._other_name else [name for name in kwargs if name not in kinds]
        missing = [name for name in self._needed if name not in self._names[:first]]
        missing = [name for name in missing if name not in kwargs] if missing else missing
        surplus = first > len(self._names) and not self._rest_name
        twice = [name for name in self._names[:first] if name in kwargs] if kwargs else []
        if not (unknown or missing or surplus or twice):
            return
        made = self._function.__name__ == "__init__"
        name = type(args[0]).__name__ if made and args else self._function.__name__
        known = [each for each in kinds if each != "self"]
        allowed = f"`{name}` must have arguments among {', '.join(known) or 'none'}"
        if unknown:
            close = suggestion(unknown[0], known)
            raise InputError(f"{allowed}; got {', '.join(unknown)}.{close}")
        if missing:
            raise InputError(f"`{name}` must have the argument {missing[0]}; got none.")
        if twice:
            raise InputError(
                f"`{name}` must have each argument once; got {twice[0]} by place and by name."
            )
        raise InputError(f"{allowed}; got {first - ('self' in kinds)} without names.")

    @cached_property
    def _parameters(self) -> Mapping[str, inspect.Parameter]:
        return inspect.signature(self._function).parameters

    @cached_property
    def _hints(self) -> Mapping[str, Any]:
        bare = inspect.unwrap(self._function)
        try:
            return get_type_hints(bare, include_extras=True)
        except (NameError, TypeError):  # names that only type checkers see
            return {**getattr(bare, "__annotations__", {})}

    def _kind(self, name: str) -> Kind:
        annotation = self._hints.get(name, Any)
        return ANYTHING if isinstance(annotation, str) else kind_of(annotation, name)

    def _of(self, *kinds: Any) -> list[str]:
        return [name for name, each in self._parameters.items() if each.kind in kinds]

    @cached_property
    def _names(self) -> list[str]:
        return self._of(inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)

    @cached_property
    def _kinds(self) -> Mapping[str, Kind]:
        return {name: self._kind(name) for name in [*self._names, *self._of(KEYWORD)]}

    @cached_property
    def _needed(self) -> list[str]:
        """Arguments without default."""
        given = self._parameters
        return [name for name in self._kinds if given[name].default is inspect.Parameter.empty]

    @cached_property
    def _rest_name(self) -> str:
        return next(iter(self._of(inspect.Parameter.VAR_POSITIONAL)), "")

    @cached_property
    def _rest(self) -> Kind:
        return self._kind(self._rest_name)

    @cached_property
    def _other_name(self) -> str:
        return next(iter(self._of(inspect.Parameter.VAR_KEYWORD)), "")

    @cached_property
    def _other(self) -> Kind:
        return self._kind(self._other_name)

    @cached_property
    def _owning(self) -> list[str]:
        """Arguments that belong to a structure, and the object whose method is called."""
        known, made = OWNERS.keys(), self._function.__name__ == "__init__"
        return [
            name for name, each in self._kinds.items()
            if each.holds & known or (name == "self" and not made)
        ]  # fmt: skip

    @cached_property
    def _described(self) -> list[str]:
        """Arguments that describe a structure."""
        return [name for name, kind in self._kinds.items() if kind.holds & DESCRIBED]

    def _convert(self, kind: Kind, name: str, value: Any, args: tuple[Any, ...]) -> Any:
        try:
            return convert_value(kind, value)
        except (TypeError, ValueError, OverflowError):
            pass
        named = [{name: value}] if name not in self._kinds else _mappings(value) * kind.by_name
        owners = [each for key, each in zip(self._names, args, strict=False) if key in self._owning]
        said = _complaint_of_parameters(named, owners)
        said = said or f"`{name}` must be {kind.words}; got {kind.refused(value)}."
        raise InputError(f"{said}{self._remedy(name, value)}")

    def _remedy(self, name: str, value: Any) -> str:
        """What to do instead, as a sentence, for what is often given by mistake."""
        where = name if name in self._kinds else self._function.__qualname__
        wrong, remedy = REMEDIES.get(where, (str, ""))
        return f" {remedy}" if isinstance(value, wrong) and remedy else ""

    def _check_structures(self, given: Mapping[str, Any]) -> None:
        """Refuse arguments that belong to another structure than the first that belongs to one."""
        homes = [(name, home) for name in self._owning for home in structures_in(given.get(name))]
        if not homes:
            return
        first, home = homes[0]
        for name, other in homes[1:]:
            if other is not home and other.signature != home.signature:
                where = "it" if first == "self" else f"`{first}`"
                raise InputError(
                    f"`{name}` must be of the same structure as {where}, {short(home)}; got one "
                    f"of {short(other)}."
                )
        for name in self._described:
            for descriptor in descriptors_in(given.get(name)):
                if descriptor.origin is not None and descriptor.origin != home.signature:
                    raise InputError(
                        f"`{name}` must describe the structure {short(home)}; got "
                        f"{descriptor.name} of another one."
                    )


KEYWORD = inspect.Parameter.KEYWORD_ONLY


def structure_of(value: Any) -> Any:
    """Structure to which an object belongs; None if it belongs to none."""
    kind: Any = type(value)
    find = _finder(kind)
    return None if find is None else find(value)


@cache
def _finder(kind: Any) -> Callable[[Any], Any] | None:
    """How the structure of objects of a type is found."""
    ours = (each for each in kind.__mro__ if each.__module__.startswith("equimorph."))
    return next((OWNERS[each.__name__] for each in ours if each.__name__ in OWNERS), None)


def structures_in(value: Any) -> Iterator[Any]:
    """Structures to which an argument belongs: an object, or the entries of a list."""
    for each in value if type(value) in (list, tuple) else (value,):
        structure = structure_of(each)
        if structure is not None:
            yield structure


def descriptors_in(value: Any) -> Iterator[Any]:
    """Descriptors in an argument: alone, in constraints and extremes, in lists or as keys."""
    for each in value if is_mapping(value) or is_listed(value) else (value,):
        if type(each).__name__ in DESCRIBED:
            yield getattr(each, "descriptor", each)


def _mappings(value: Any) -> list[Mapping[Any, Any]]:
    """Values by name in an argument: alone or in a list."""
    listed = isinstance(value, Sequence) and not isinstance(value, str)
    return [each for each in (value if listed else [value]) if isinstance(each, Mapping)]


def _complaint_of_parameters(named: Sequence[Mapping[Any, Any]], given: Sequence[Any]) -> str:
    """What the parameters of the first structure among the arguments say of their values."""
    structures = (each for each in map(structure_of, given) if each is not None)
    for parameter in getattr(next(structures, None), "parameters", ()):
        for values in named:
            value = values.get(parameter.name)
            if value is not None and not isinstance(value, np.ndarray):
                try:
                    parameter.check(value)
                except InputError as refused:
                    return str(refused)
    return ""
