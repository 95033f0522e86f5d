"""Checks of types and array shapes at run time: beartype, with integers accepted as floats.

Whether a call passes depends on types, dtypes and shapes only (on values too where the annotations
name literals), and so a function checks each combination once: a call that looks like one that
passed is not checked again. Checks are built at the first call of a function, not at its import.
Functions without arrays and literals in their annotations are left to the static type checker.
"""

import sys
from collections import deque
from collections.abc import Callable, Hashable, Iterator, KeysView, Mapping, Sequence, ValuesView
from contextlib import contextmanager
from dataclasses import is_dataclass
from functools import cached_property, partial, wraps
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from inspect import isclass
from itertools import islice
from pathlib import Path
from threading import local
from types import FunctionType, MappingProxyType, ModuleType
from typing import Any

import jaxtyping
import numpy as np
from beartype import BeartypeConf, beartype
from jaxtyping import config, install_import_hook, jaxtyped

COMPILED = ("kernels", "simd")
# Entries of a long container that are looked at; beartype looks at one.
LOOKED_AT = 100
MARK = "__checks_shapes__"

check = beartype(conf=BeartypeConf(is_pep484_tower=True))


def install() -> None:
    """Check all functions and dataclasses of the package, imported from now on."""
    jaxtyping.jaxtyped = checked  # the name that the hook puts above each function
    install_import_hook("equimorph", "typecheck.check")
    sys.meta_path.insert(0, PlainCompiledModules())


def compile_share(source: Path, number: int, count: int) -> None:
    """Keep the byte code with checks of every `count`-th module, from one on, executing none.

    Processes that start together would each compile all: they read what the others keep.
    """
    for file in sorted(source.rglob("*.py"))[number::count]:
        parts = file.relative_to(source.parent).with_suffix("").parts
        package = file.name == "__init__.py"
        name = ".".join(parts[:-1] if package else parts)
        where = [str(file.parents[1] if package else file.parent)]
        finders = (each.find_spec(name, where, None) for each in sys.meta_path)
        loader: Any = next(spec for spec in finders if spec is not None).loader
        with_checks = loader.get_code

        def keep(name: str, get_code: Callable[[str], Any] = with_checks) -> Any:
            get_code(name)
            return compile("", name, "exec")

        loader.get_code = keep
        loader.exec_module(ModuleType(name))


@contextmanager
def unchecked() -> Iterator[None]:
    """Leave out the checks, where a wrong argument must reach the package's own error."""
    before = config.jaxtyping_disable
    config.update("jaxtyping_disable", True)
    try:
        yield
    finally:
        config.update("jaxtyping_disable", before)


class PlainCompiledModules(MetaPathFinder):
    """Keeps the hook away from modules that numba compiles: it can compile bare functions only."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.startswith("equimorph.") and fullname.endswith(COMPILED):
            return PathFinder.find_spec(fullname, path, target)
        return None


def checked(thing: Any = None, *, typechecker: Callable[..., Any] = check) -> Any:
    """`jaxtyping.jaxtyped`, which checks each combination of types and shapes once."""
    if thing is None:
        return partial(checked, typechecker=typechecker)
    if isinstance(thing, FunctionType):
        return _check_each_form_once(thing) if _depends_on_values(thing) else thing
    if isclass(thing):
        made = thing.__init__
        if is_dataclass(thing) and not hasattr(made, MARK) and _depends_on_values(made):
            thing.__init__ = _check_each_form_once(made)
        return thing
    return jaxtyped(thing, typechecker=typechecker)


def _depends_on_values(function: Callable[..., Any]) -> bool:
    """Whether annotations name dtypes, shapes or literals, which no static checker verifies."""
    return "jaxtyping." in (told := str(function.__annotations__)) or "Literal" in told


def _check_each_form_once(function: FunctionType) -> Callable[..., Any]:
    memory = _Memory(function)

    @wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        if config.jaxtyping_disable:
            return function(*args, **kwargs)
        return memory.call(args, kwargs)

    setattr(wrapper, MARK, True)
    return wrapper


class _Memory:
    """What passed of a function's arguments and results."""

    def __init__(self, function: FunctionType) -> None:
        self._function = function
        self._form = _form_with_values if "Literal" in str(function.__annotations__) else form
        self._known = _known(function)

    def identity(self) -> str:
        """For those who tell functions by what they close over: checks change nothing."""
        return ""

    def call(self, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        __tracebackhide__ = True
        of, known = self._form, self._known
        given = (*map(of, args), *kwargs, *map(of, kwargs.values()))
        results = known.passed.get(given)
        if results is None:
            result = known.check(self._function, args, kwargs)
            known.passed[given] = {of(result)}
            return result
        result = self._function(*args, **kwargs)
        if of(result) not in results:
            # together with the arguments that it was made of, without a second call
            known.check(lambda *_, **__: result, args, kwargs)
            results.add(of(result))
        return result


class _Pending(local):
    """Calls that a thread is about to make, the last first; paths are followed in several."""

    def __init__(self) -> None:
        self.calls: list[Callable[..., Any]] = []


class _Known:
    """Check of a function's annotations, and which forms of arguments with which results passed."""

    def __init__(self, function: FunctionType) -> None:
        self.passed: dict[Hashable, set[Hashable]] = {}
        self._function = function
        self._own = _Pending()

    @cached_property
    def _checked(self) -> Callable[..., Any]:
        @wraps(self._function)
        def call(*args: Any, **kwargs: Any) -> Any:
            __tracebackhide__ = True
            return self._own.calls.pop()(*args, **kwargs)

        return jaxtyped(check(call), typechecker=None)

    def check(self, call: Callable[..., Any], args: Any, kwargs: Any) -> Any:
        """Call something with the function's annotations; raise if these are not obeyed."""
        __tracebackhide__ = True
        calls = self._own.calls
        before = len(calls)
        calls.append(call)
        try:
            return self._checked(*args, **kwargs)
        finally:
            del calls[before:]  # arguments that do not pass leave the call undone


def _known(function: FunctionType) -> _Known:
    """What is known of a function, and shared by the closures that one makes again and again."""
    if function.__closure__ is None:
        return _Known(function)
    key = (function.__code__, *function.__annotations__.items())
    return CLOSURES.setdefault(key, _Known(function))


def form(value: Any) -> Hashable:
    """All that decides whether a value passes, other than literals."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype, value.shape
    return FORMS.get(kind, _other_form)(value)


def _form_with_values(value: Any) -> Hashable:
    if isinstance(value, str | int | None):
        return type(value), value
    return form(value)


def _container_form(values: Any) -> Hashable:
    some = islice(values, 0, None, 1 + len(values) // LOOKED_AT)
    return type(values), frozenset(map(form, some))


def _mapping_form(values: Mapping[Any, Any]) -> Hashable:
    return type(values), _container_form(values.keys()), _container_form(values.values())


def _tuple_form(values: tuple[Any, ...]) -> Hashable:
    if len(values) > LOOKED_AT:
        return _container_form(values)
    return type(values), *map(form, values)


def _other_form(value: Any) -> Hashable:
    """Remember how values of this type are looked at: open files that are mappings, by it only."""
    kind = type(value)
    if issubclass(kind, np.ndarray):
        FORMS[kind] = lambda array: (kind, array.dtype, array.shape)
    elif issubclass(kind, tuple):
        FORMS[kind] = _tuple_form
    elif issubclass(kind, dict | MappingProxyType):
        FORMS[kind] = _mapping_form
    elif issubclass(kind, list | set | frozenset | deque | KeysView | ValuesView):
        FORMS[kind] = _container_form
    elif issubclass(kind, type):
        FORMS[kind] = lambda thing: thing
    else:
        FORMS[kind] = type
    return FORMS[kind](value)


FORMS: dict[type, Callable[[Any], Hashable]] = {}
CLOSURES: dict[Hashable, _Known] = {}
