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

_HERE = Path(__file__).resolve()
_ROOT = _HERE.parents[2]
SHARED = (_HERE, _HERE.with_name("simd.py"))
"""Files with code that goes into every kernel."""
IMPORTED = re.compile(r"^from (equimorph(?:\.\w+)+) import", re.MULTILINE)
"""How a file of kernels names one whose kernels it calls."""
CHECK = 32
"""Bytes of the checksum before compiled code: damaged code would crash the process."""


def njit(**options: Any) -> Callable[[Any], Any]:
    """Compile a function when it is first called with arguments of new types, and keep the code.

    Parameters
    ----------
    options
        Those of `numba.njit`.
    """

    def compiled(function: Any) -> Any:
        dispatcher = numba.njit(**options)(function)
        dispatcher._cache = _KernelCache(function)
        # of a literal number the compiler would make another copy of the kernel
        resolve = dispatcher.get_call_template
        dispatcher.get_call_template = lambda args, names: resolve(
            [types.unliteral(each) for each in args], names
        )
        return dispatcher

    return compiled


def is_kept(kernel: Any) -> bool:
    """Whether compiled code of a kernel is on disk, made from the present sources.

    Parameters
    ----------
    kernel
        A function that `njit` of this module returned.
    """
    return bool(kernel._cache.has_code())


def sources(path: Path) -> set[Path]:
    """Every file with code that goes into the kernels of one file.

    Parameters
    ----------
    path
        The file that the kernels stand in.
    """
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
    """Digest of all code that goes into the kernels of one file.

    Parameters
    ----------
    path
        The file that the kernels stand in.
    """
    contents = [each.read_bytes() for each in sorted(sources(path))]
    return hashlib.sha256(b"".join(contents)).hexdigest()


class _KernelCache(FunctionCache):
    """Compiled code of one kernel, valid while the sources that go into it stay as they are."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = digest(Path(function.__code__.co_filename))
        self._cache_file = _LockedFiles(self.cache_path, self._impl.filename_base, stamp)

    def has_code(self) -> bool:
        """Whether there is code for any types."""
        return bool(self._cache_file._load_index())


class _LockedFiles(IndexDataCacheFile):
    """Index and data of one kernel, for one process at a time."""

    def load(self, key: Any) -> Any:
        with self._lock():
            return super().load(key)

    def save(self, key: Any, data: Any) -> None:
        with self._lock():
            super().save(key, data)

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

    @contextmanager
    def _lock(self) -> Iterator[None]:
        with Path(self._cache_path, "kernels.lock").open("w") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
