"""Compiled kernels that stay true to their sources: numba's compiler, with files kept by our rules.

numba's own cache looks only at the file that a kernel stands in, so that after a change a kernel
would go on with old copies of those that it calls; and processes that compile the same kernel at
the same time can mix up its files. Here a kernel is compiled anew when its file or one that this
file imports kernels from has changed, and processes wait for each other.

See docs/decisions.md, "Compiled kernels are cached by content".
"""

import fcntl
import hashlib
import pickle
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.compiler_lock import global_compiler_lock

from equimorph.linalg.part_libraries import PartCacheImpl, PartCompiler

_HERE = Path(__file__).resolve()
_ROOT = _HERE.parents[2]
SHARED = (_HERE, _HERE.with_name("part_libraries.py"), _HERE.with_name("simd.py"))
"""Files with code that goes into every kernel."""
IMPORTED = re.compile(r"^from (equimorph(?:\.\w+)+) import", re.MULTILINE)
"""How a file of kernels names one whose kernels it calls."""
CHECK = 32
"""Bytes of the checksum before compiled code: damaged code would crash the process."""

LEAN: dict[str, Any] = {"no_cfunc_wrapper": True}
PART: dict[str, Any] = {**LEAN, "no_cpython_wrapper": True, "pipeline_class": PartCompiler}
"""Options of kernels that are called from Python or by kernels, not from C; of their parts."""

AWAITED: set[str] = set()
"""Names of kernels that another process compiles while this one does without them."""


def njit(**options: Any) -> Callable[[Any], Any]:
    """Compile a function when it is first called with arguments of new types, and keep the code.

    What other kernels call is its `part`, which is kept for itself.
    """

    def compiled(function: Any) -> Any:
        dispatcher = _keep(numba.njit(**options, **LEAN)(function), _KernelCache)
        part = cache(lambda: _keep(template(**options)(function), _PartCache))
        # of a literal number the compiler would make another copy of the kernel
        dispatcher.get_call_template = lambda args, names: part().get_call_template(
            [types.unliteral(each) for each in args], names
        )
        dispatcher.get_overload = lambda signature: part().get_overload(signature)
        dispatcher.part = part
        return dispatcher

    return compiled


def template(**options: Any) -> Callable[[Any], Any]:
    """Compile a function as a part of the kernels that give it other kernels as arguments.

    Only the code of those kernels is kept.
    """
    return numba.njit(**options, **PART)  # type: ignore[no-any-return]


def _keep(dispatcher: Any, kind: Any) -> Any:
    """Let a kernel keep its code on disk."""
    dispatcher._cache = kind(dispatcher.py_func)
    dispatcher.compile = _alone(dispatcher)
    return dispatcher


def _alone(dispatcher: Any) -> Callable[[Any], Any]:
    """Compiling a kernel and keeping its code, or reading it, while no other process does.

    Who waits here compiles callers of the kernel: processes never wait for each other in a circle.
    """
    compile_here, overloads = dispatcher.compile, dispatcher.overloads

    def compile_alone(signature: Any) -> Any:
        if signature in overloads:
            return compile_here(signature)
        with global_compiler_lock, dispatcher._cache.lock(wait=True):
            return compile_here(signature)

    return compile_alone


def kept_signatures(kernel: Any) -> list[Any]:
    """Types of arguments for which code of a kernel from the present sources is on disk."""
    return [key[0] for key in kernel._cache._cache_file._load_index()]


def is_awaited(kernel: Any) -> bool:
    """Whether another process still compiles a kernel that this one can do without."""
    if not AWAITED:
        return False
    name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
    if name in AWAITED and kept_signatures(kernel):
        AWAITED.remove(name)
    return name in AWAITED


def is_being_compiled(kernel: Any) -> bool:
    """Whether another process compiles a kernel at this moment."""
    try:
        with kernel._cache.lock(wait=False):
            return False
    except BlockingIOError:
        return True


def sources(path: Path) -> set[Path]:
    """Every file with code that goes into the kernels of one file."""
    found: set[Path] = set()
    open_ends = [path.resolve(), *SHARED]
    while open_ends:
        each = open_ends.pop()
        if each not in found:
            found.add(each)
            open_ends += _imports(each)
    return found


@cache
def _imports(path: Path) -> list[Path]:
    names = IMPORTED.findall(path.read_text())
    return [_ROOT.joinpath(*name.split(".")).with_suffix(".py") for name in names]


@cache
def digest(path: Path) -> str:
    """Digest of all code that goes into the kernels of one file."""
    contents = [each.read_bytes() for each in sorted(sources(path))]
    return hashlib.sha256(b"".join(contents)).hexdigest()


class _KernelCache(FunctionCache):
    """Compiled code of one kernel, valid while the sources that go into it stay as they are."""

    ending = ""
    """Of the names of its files."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = digest(Path(function.__code__.co_filename))
        self._base = self._impl.filename_base + self.ending
        self._cache_file = _KernelFiles(self.cache_path, self._base, stamp)

    @contextmanager
    def lock(self, *, wait: bool) -> Iterator[None]:
        """Keep other processes from this kernel; a BlockingIOError if one has it and none waits."""
        with Path(self.cache_path, f"{self._base}.lock").open("w") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            yield


class _PartCache(_KernelCache):
    """Code of a kernel for those that call it."""

    _impl_class = PartCacheImpl  # type: ignore[assignment]
    ending = ".part"


class _KernelFiles(IndexDataCacheFile):
    """Index and data of one kernel."""

    def _load_index(self) -> Any:
        """Return the index; an empty one if the file is damaged, so that all is compiled anew."""
        try:
            return super()._load_index()
        except Exception:  # bytes that are no index can lead to anything
            return {}

    def _load_data(self, name: str) -> Any:
        """Return compiled code; an OSError, as of a missing file, if the file is damaged."""
        content = Path(self._data_path(name)).read_bytes()
        if hashlib.sha256(content[CHECK:]).digest() != content[:CHECK]:
            raise OSError(f"{name} is damaged")
        return pickle.loads(content[CHECK:])

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(content).digest() + content)
