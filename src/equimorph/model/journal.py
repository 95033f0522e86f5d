"""Sinks and workers that long computations are given; and what files leave out.

A deterministic computation asks the same questions in the same order each time. It hands each
answer to a journal; begun again with that journal, it is given the answers back. What depends on a
function of the user is identified by what the function does.

See docs/decisions.md, "Workers are shaped like map".
"""

import functools
import hashlib
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from types import (
    BuiltinFunctionType,
    CodeType,
    FunctionType,
    MappingProxyType,
    MethodType,
    ModuleType,
)
from typing import Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np

from equimorph.arrays import Shaped
from equimorph.columns import Columns
from equimorph.errors import InputError
from equimorph.model.descriptor import Descriptor

PARTS = 32
"""Chunks of a batch, unless they became too small or too large."""
LEAST, MOST = 512, 16384
"""Rows of a chunk: so many that it takes longer than its journey, so few that it fits anywhere."""

Rows = TypeVar("Rows", bound=Columns)
Found = TypeVar("Found", bound=Columns)


@runtime_checkable
class Workers(Protocol):
    """Computes a function on chunks: in other processes, or on other machines.

    A `concurrent.futures.ProcessPoolExecutor` is one, `cluster.dask` makes one of a client of Dask.
    Functions, chunks and results go through pickles. Every row is computed alone, so that results
    have the same bits with any workers and with none.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> import equimorph as em
    >>> isinstance(ThreadPoolExecutor(2), em.Workers)
    True
    """

    def map(self, function: Callable[[Any], Any], chunks: Iterable[Any], /) -> Iterator[Any]:
        """Return the results of a function on chunks, in the order of the chunks.

        What is not yet computed when the iterator is closed is dropped.
        """


def cut_rows(count: int, workers: Workers | None) -> list[slice]:
    """Return the chunks into which a batch is cut: all of it where nobody else computes."""
    if workers is None or count == 0:
        return [slice(0, count)]
    size = min(MOST, max(LEAST, -(-count // PARTS)))
    return [slice(first, first + size) for first in range(0, count, size)]


Chunk = TypeVar("Chunk")
Result = TypeVar("Result")


def map_chunks(
    function: Callable[[Chunk], Result], chunks: Iterable[Chunk], workers: Workers | None
) -> Generator[Result]:
    """Results of a function on chunks in their order, of workers if there are any.

    When the iterator is closed, what is not yet computed is dropped.
    """
    results = map(function, chunks) if workers is None else workers.map(function, chunks)
    try:
        yield from results
    finally:
        getattr(results, "close", lambda: None)()


def map_rows(
    function: Callable[[Rows], Found],
    rows: Rows,
    cuts: Sequence[slice],
    workers: Workers | None,
    finished: Callable[[int], None] = lambda _: None,
) -> Found:
    """Compute a function of a batch, chunk by chunk where there are workers.

    Parameters
    ----------
    function
        It treats rows independently, and goes through a pickle where there are workers.
    rows
        The batch.
    cuts
        Its chunks, of `cut_rows`.
    workers
        Who computes them; None: this process.
    finished
        Called with the number of finished chunks; what it raises cancels the others.
    """
    chunks = (rows.take(cut) for cut in cuts)
    found: list[Found] = []
    for done, each in enumerate(map_chunks(function, chunks, workers), 1):
        found.append(each)
        finished(done)
    joined: Found = type(found[0]).concatenate(found)
    return joined


Findings: TypeAlias = tuple[Shaped[np.ndarray, "..."], ...]
"""Arrays of numbers that a step has found."""


@runtime_checkable
class Journal(Protocol):
    """Keeps what the steps of a computation find, and gives it back in the same order."""

    def begin(self, question: str) -> None:
        """Begin at the first step of the computation that answers a question.

        Raises
        ------
        InputError
            If the journal is that of another question.
        """

    def recall(self, step: str) -> Findings | None:
        """Findings of the next step, if they are kept; from the first that is not, none are."""

    def keep(self, step: str, found: Findings) -> None:
        """Keep the findings of a step that was not recalled."""


def recall_or_compute(journal: Journal, step: str, compute: Callable[[], Findings]) -> Findings:
    """Findings of a step: from the journal, else computed and kept there."""
    found = journal.recall(step)
    if found is None:
        found = compute()
        journal.keep(step, found)
    return found


@runtime_checkable
class Progress(Protocol):
    """Receives the progress of a computation."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Take note that `done` of `total` units (unknown if None) of `stage` are finished."""


class Silent:
    """The sink that ignores everything."""

    def report(self, stage: str, done: int, total: int | None) -> None:
        """Do nothing."""


NOT_KEPT: Mapping[str, bool] = MappingProxyType({"kept": False})
"""Metadata of a dataclass's field that files leave out; it needs a default."""


PLUMBING = frozenset(
    ("__dict__", "__weakref__", "__module__", "__qualname__", "__doc__", "__annotations__",
     "__firstlineno__", "__static_attributes__", "__dataclass_fields__", "__dataclass_params__")
)  # fmt: skip
"""What Python puts into every class."""


def content_of_function(function: Callable[..., Any], name: str) -> str:
    """Fingerprint of all that a function computes with.

    Parameters
    ----------
    function
        A function, method, partial, or object of data with a ``__call__``.
    name
        Of what is identified, for the message.

    Raises
    ------
    InputError
        If it holds something without known content, like an open file.

    Examples
    --------
    >>> half, third = (lambda x, k=k: x / k for k in (2, 3))
    >>> content_of_function(half, "half") == content_of_function(third, "third")
    False
    """
    return hashlib.sha256(repr(_Contents(name).of(function)).encode()).hexdigest()


def content_of_descriptor(descriptor: Descriptor) -> str:
    """Fingerprint of a descriptor that a user made; see `content_of_function`."""
    return content_of_function(descriptor.function, descriptor.name)


class _Contents:
    """Contents of values as nested tuples of texts; repeated values are described once."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._met: dict[int, int] = {}
        self._alive: list[Any] = []  # an id stands for one object only while that lives

    def of(self, value: Any) -> Any:
        if value is None or isinstance(value, bool | int | float | complex | str | bytes):
            return type(value).__name__, repr(value)
        if value is Ellipsis or isinstance(value, range | slice | np.dtype):
            return "constant", repr(value)
        if id(value) in self._met:
            return "again", self._met[id(value)]
        self._met[id(value)] = len(self._met)
        self._alive.append(value)
        return self._inside(value)

    @functools.singledispatchmethod
    def _inside(self, value: Any) -> Any:
        """Contents of values that are no plain data: by their identity, code or state."""
        if callable(getattr(value, "identity", None)):  # structures say what they are
            return "identity", type(value).__name__, self.of(value.identity())
        if callable(getattr(value, "serialize", None)):  # symbolic functions, too
            return "serialised", type(value).__name__, value.serialize()
        wrapped = getattr(value, "py_func", None) or getattr(value, "__wrapped__", None)
        if wrapped is not None:  # compiled, or decorated
            return "wrapped", type(value).__qualname__, self.of(wrapped)
        return self._fields(value)

    def _fields(self, value: Any) -> Any:
        """Contents of an object by its fields, and the methods of its class."""
        kind = type(value)
        if is_dataclass(kind):
            inside = {each.name: getattr(value, each.name) for each in fields(kind)}
        elif isinstance(getattr(value, "__dict__", None), dict) and _is_written_here(kind):
            inside = vars(value)
        else:
            raise InputError(
                f"`{self._name}` must be computed from numbers, texts, arrays and functions of "
                "them, by which a journal tells it from others of its name; got "
                f"{_article(kind.__name__)}. Compute without a journal."
            )
        return "object", kind.__qualname__, self._methods(kind), self.of(inside)

    @_inside.register
    def _(self, value: np.ndarray | np.generic) -> Any:
        return self._array(np.asarray(value))

    @_inside.register(tuple)
    @_inside.register(list)
    def _(self, value: Any) -> Any:
        return type(value).__name__, *map(self.of, value)

    @_inside.register(set)
    @_inside.register(frozenset)
    def _(self, value: Any) -> Any:
        return "set", *sorted(repr(_Contents(self._name).of(each)) for each in value)

    @_inside.register(Mapping)
    def _(self, value: Any) -> Any:
        return "mapping", *((self.of(key), self.of(each)) for key, each in value.items())

    @_inside.register
    def _(self, value: ModuleType) -> Any:
        return "module", value.__name__, _release(value.__name__)

    @_inside.register
    def _(self, value: type) -> Any:
        return "class", _module_of(value), value.__qualname__, self._methods(value)

    @_inside.register
    def _(self, value: MethodType) -> Any:
        return "method", self.of(value.__func__), self.of(value.__self__)

    @_inside.register(functools.partial)
    def _(self, value: Any) -> Any:
        return "partial", *map(self.of, (value.func, value.args, value.keywords))

    @_inside.register
    def _(self, value: BuiltinFunctionType | np.ufunc) -> Any:
        name = getattr(value, "__qualname__", value.__name__)
        return "built in", _module_of(value), name, self.of(_owner_of(value))

    def _array(self, array: Any) -> Any:
        if array.dtype.kind == "O":
            return "objects", array.shape, *map(self.of, array.ravel().tolist())
        check = hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
        return "array", array.dtype.str, array.shape, check

    def _methods(self, kind: type) -> Any:
        """What classes define, those below too, unless a release stands for them."""
        if not _is_written_here(kind):
            return _release(kind.__module__)
        return tuple(
            (name, self.of(getattr(each, "__func__", getattr(each, "fget", each))))
            for base in kind.__mro__ if _is_written_here(base)
            for name, each in vars(base).items() if name not in PLUMBING
        )  # fmt: skip

    @_inside.register
    def _function(self, function: FunctionType) -> Any:
        release = _release(function.__module__)
        closed = [self.of(cell.cell_contents) for cell in function.__closure__ or () if _full(cell)]
        given = self.of(function.__defaults__), self.of(function.__kwdefaults__)
        if release is not None:
            return "function", function.__module__, function.__qualname__, release, closed, given
        code = function.__code__
        named = [(name, self._global_content(name, function, code)) for name in _names(code)]
        return "function", self._code(code), named, closed, given

    def _global_content(self, name: str, function: FunctionType, code: CodeType) -> Any:
        """Global that a function names, with the attributes of modules that it may take."""
        if name not in function.__globals__:
            return None
        value = function.__globals__[name]
        if not isinstance(value, ModuleType) or _release(value.__name__) is not None:
            return self.of(value)
        taken = [each for each in _names(code) if each in vars(value)]
        return "module", value.__name__, *((each, self.of(vars(value)[each])) for each in taken)

    def _code(self, code: CodeType) -> Any:
        constants = [
            self._code(each) if isinstance(each, CodeType) else self.of(each)
            for each in code.co_consts
        ]
        return code.co_code.hex(), constants, code.co_names, code.co_varnames, code.co_freevars


def _names(code: CodeType) -> list[str]:
    """Names that code uses, and code inside it."""
    inner = [name for each in code.co_consts if isinstance(each, CodeType) for name in _names(each)]
    return sorted({*code.co_names, *inner})


def _release(module: str | None) -> str | None:
    """Release that stands for the content of a module; None for modules that a user may edit."""
    top = (module or "").partition(".")[0]
    if top in sys.stdlib_module_names and top != "__main__":
        return sys.version
    if top == "equimorph" or "site-packages" in (
        getattr(sys.modules.get(top), "__file__", "") or ""
    ):
        return str(getattr(sys.modules.get(top), "__version__", "")) or None
    return None


def _is_written_here(kind: type) -> bool:
    return _release(kind.__module__) is None


def _module_of(value: Any) -> str:
    module = getattr(value, "__module__", None) or type(value).__module__
    return f"{module} {_release(module)}"


def _owner_of(value: Any) -> Any:
    """Object of a method that is built in, like that of a list; nothing for functions."""
    owner = getattr(value, "__self__", None)
    return None if isinstance(owner, ModuleType) else owner


def _full(cell: Any) -> bool:
    try:
        cell.cell_contents  # noqa: B018  # raises if the cell is empty
    except ValueError:
        return False
    return True


def _article(word: str) -> str:
    return f"an {word}" if word[:1] in "aeiouAEIOU" else f"a {word}"
