"""Pickles and copies of objects that hold functions: the call that made them is kept and repeated.

See docs/decisions.md, "Pickles keep the call that made an object".
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import wraps
from operator import is_
from types import FunctionType
from typing import Any, Self, TypeVar

from equimorph.errors import InputError

Maker = TypeVar("Maker", bound=Callable[..., Any])


@dataclass(frozen=True)
class Call:
    """A function or class, and the arguments that it is called with."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    named: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self) -> Any:
        """Repeat the call."""
        return self.function(*self.arguments, **self.named)


class Rebuilt:
    """Base of objects that never change: pickles keep the call that made them, copies are they."""

    made_by: Call | None = None
    """What `remember_call` remembers."""

    @property
    def origin_call(self) -> Call:
        """The call that makes an equal object: the remembered one, or that of its class."""
        return self.made_by or Call(type(self), _field_values(self))

    def __reduce__(self) -> tuple[Call, tuple[()]]:
        """Return what a pickle keeps.

        Raises
        ------
        InputError
            If the object is made of a function that another process cannot import.
        """
        call = self.origin_call
        for each in _functions_in((*call.arguments, call.named)):
            if "<" in each.__qualname__:
                raise InputError(
                    f"`{getattr(self, 'name', type(self).__name__)}` must be made of functions "
                    "that stand at the top of a module, to be pickled; got "
                    f"{each.__qualname__} of {each.__module__}."
                )
        return call, ()

    def __copy__(self) -> Self:
        """Return the object itself."""
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return the object itself."""
        return self


def remember_call(maker: Maker) -> Maker:
    """Let the object that a function, method or property makes remember this call.

    Above a function, this decorator is the first one.

    Parameters
    ----------
    maker
        It returns an object whose class derives from `Rebuilt`.
    """
    name, member = maker.__name__, "." in maker.__qualname__

    @wraps(maker)
    def wrapper(*arguments: Any, **named: Any) -> Any:
        made = maker(*arguments, **named)
        call = Call(_ask, (name, *arguments), named) if member else Call(wrapper, arguments, named)
        object.__setattr__(made, "made_by", call)
        return made

    return wrapper  # type: ignore[return-value]


def _ask(name: str, owner: Any, *arguments: Any, **named: Any) -> Any:
    """Value of a property of an object, or what its method returns."""
    member = getattr(owner, name)
    return member if isinstance(member, Rebuilt) else member(*arguments, **named)


def _functions_in(value: Any) -> Iterator[FunctionType]:
    """Functions in plain data and records of any depth."""
    if isinstance(value, FunctionType):
        yield value
    elif isinstance(value, Mapping):
        yield from _functions_in(tuple(value.values()))
    elif isinstance(value, tuple | list):
        for each in value:
            yield from _functions_in(each)
    elif is_dataclass(value) and not isinstance(value, Rebuilt):
        yield from _functions_in(_field_values(value))


def _field_values(record: Any) -> tuple[Any, ...]:
    """Arguments by which a dataclass was made."""
    return tuple(getattr(record, each.name) for each in fields(record))


def remake(value: Any, swap: Callable[[Any], Any]) -> Any:
    """The same object by the calls that made it, with arguments swapped: for another structure.

    Parameters
    ----------
    value
        An object that remembers its call, or lists, mappings and records of such.
    swap
        Returns what takes the place of an argument, or the argument itself.
    """
    swapped = swap(value)
    if swapped is not value:
        return swapped
    if isinstance(value, Rebuilt):
        call = value.origin_call
        arguments, named = (remake(each, swap) for each in (call.arguments, call.named))
        same = arguments is call.arguments and named is call.named
        return value if same else Call(call.function, arguments, named)()
    if isinstance(value, Mapping):
        again = {key: remake(each, swap) for key, each in value.items()}
        return value if all(again[key] is value[key] for key in again) else again
    if isinstance(value, tuple | list):
        parts = [remake(each, swap) for each in value]
        return value if all(map(is_, parts, value)) else type(value)(parts)
    if is_dataclass(value) and not isinstance(value, type):
        parts = [remake(each, swap) for each in _field_values(value)]
        return value if all(map(is_, parts, _field_values(value))) else type(value)(*parts)
    return value
