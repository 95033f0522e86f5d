"""Faults at chosen operations on files: a disk that fills up, a process that dies."""

import builtins
import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

CHANGING = ("mkdir", "replace", "fsync", "ftruncate", "pwrite", "unlink")
"""Functions of `os` through which the package changes folders and files."""


class Operations:
    """Counts writes and other changes below a folder; calls `fault` at number `at` and after.

    The write at which the fault happens is half done.
    """

    def __init__(self, folder: Path, at: int, fault: Callable[[], None]):
        self._folder, self._at, self._fault = str(folder), at, fault
        self.count = 0

    def happens(self) -> bool:
        """Count one more operation; whether the fault happens there."""
        self.count += 1
        return self.count > self._at

    def install(self, patch: pytest.MonkeyPatch) -> "Operations":
        """Watch files that Python opens for writing, and changes through `os`."""
        genuine_open = io.open

        def open_watched(file: Any, mode: str = "r", *args: Any, **options: Any) -> Any:
            opened = genuine_open(file, mode, *args, **options)
            ours = isinstance(file, str | os.PathLike) and str(file).startswith(self._folder)
            return WatchedFile(opened, self) if ours and set(mode) & set("wxa+") else opened

        for module in (io, builtins):
            patch.setattr(module, "open", open_watched)
        for name in CHANGING:
            patch.setattr(os, name, self._watched(getattr(os, name)))
        return self

    def fault(self) -> None:
        """Let the fault happen."""
        self._fault()

    def _watched(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def watched(*args: Any, **options: Any) -> Any:
            # removing needs no room
            if self.happens() and function.__name__ != "unlink":
                self.fault()
            return function(*args, **options)

        return watched


class WatchedFile:
    """A file whose writes are counted. Without a descriptor, so that nobody writes past it."""

    def __init__(self, file: Any, operations: Operations):
        self._file, self._operations = file, operations

    def __getattr__(self, name: str) -> Any:
        if name == "fileno":
            raise AttributeError(name)
        return getattr(self._file, name)

    def __enter__(self) -> "WatchedFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, data: Any) -> int:
        if self._operations.happens():
            self._file.write(data[: len(data) // 2])
            self._file.flush()
            self._operations.fault()
        return int(self._file.write(data))
