"""Journals in files: a computation that is cancelled or killed goes on from what it had found.

The file names the question and holds one entry a step, each with a checksum. It only grows, so that
a process that dies at any moment leaves whole entries and at most one that is not.
"""

import fcntl
import io
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.model import Findings
from equimorph.storage.files import checksum

MARK = b"equimorph journal 1\n"
LENGTH, DIGEST = 16, 64
"""Hexadecimal digits before each entry: of its length, and of its checksum."""


@check_arguments
@contextmanager
def open_journal(path: Path | str, *, replace: bool = False) -> Generator["JournalFile"]:
    """Open a journal while the block lasts; its file is made when it is first written to.

    What is damaged or was left half-written at the end of the file is dropped, and computed again.
    The file grows with the computation (by about 1 kB for each vertex of a set, 3 kB if refined);
    remove it when the result is stored.

    Parameters
    ----------
    path
        Of the file.
    replace
        Overwrite the journal of another computation, which is refused otherwise.

    Raises
    ------
    InputError
        By computations that use the journal, if the file is no journal or that of another
        computation, is in use, or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import equimorph as em
    >>> spring, box = em.Spring(), em.Box(x_l=(0.5, 1.3))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for _ in range(2):  # the second time all is there already
    ...         with em.storage.open_journal(f"{folder}/spring.journal") as journal:
    ...             eset = em.equilibrium_set(spring, box, intervals=(20,), journal=journal)
    >>> eset.audit.clean
    True
    """
    journal = JournalFile(Path(path), replace)
    try:
        yield journal
    finally:
        journal.close()


class JournalFile:
    """A `model.Journal` in a file, opened when a computation begins."""

    def __init__(self, path: Path, replace: bool) -> None:
        self.path = path
        self._replace = replace
        self._file: BinaryIO | None = None
        self._replaying = False

    def close(self) -> None:
        """Close the file; another computation may then use it."""
        if self._file is not None:
            self._file.close()
        self._file = None

    def begin(self, question: str) -> None:
        """Go to the first entry of a journal of this question.

        Refused if the file is no journal or that of another question, is in use, or cannot be
        written.
        """
        head = MARK + checksum(question.encode()).encode() + b"\n"
        with self._writable():
            file = self._file = self._file or _open_privately(self.path)
            file.seek(0)
            found = file.read(len(head))
            if found != head:
                self._refuse_other(found, head)
                self._cut(0)
                file.write(head)
                file.flush()
        self._replaying = True

    def recall(self, step: str) -> Findings | None:
        """Findings of the next entry if it is that of a step; what is kept then takes its place."""
        if not self._replaying:
            return None
        file = self._open
        with self._writable():
            start = file.tell()
            entry = _entry(file)
            if entry is not None and entry[0] == step:
                return entry[1]
            file.seek(start)
        self._replaying = False
        return None

    def keep(self, step: str, found: Findings) -> None:
        """Write an entry."""
        content = io.BytesIO()
        for array in (np.array(step), *found):
            np.lib.format.write_array(content, np.asarray(array), allow_pickle=False)
        body = content.getvalue()
        with self._writable():
            self._open.truncate()
            self._open.write(f"{len(body):0{LENGTH}x}{checksum(body)}".encode() + body)
            self._open.flush()

    @property
    def _open(self) -> BinaryIO:
        assert self._file is not None, "a computation begins its journal"
        return self._file

    def _cut(self, at: int) -> None:
        """Drop everything from a place on, and stand there."""
        self._open.seek(at)
        self._open.truncate()

    def _refuse_other(self, found: bytes, head: bytes) -> None:
        ours = found.startswith(MARK)
        unfinished = len(found) < len(head) and (ours or MARK.startswith(found))
        if unfinished or (ours and self._replace):
            return  # new, ended before its head was written, or given up
        other = "that of another computation" if ours else "another kind of file"
        self.close()
        raise InputError(
            f"`journal` must be that of this very computation; got {self.path}, {other}. "
            "Remove it, or choose another path."
        )

    @contextmanager
    def _writable(self) -> Generator[None]:
        try:
            yield
        except BlockingIOError as error:
            raise InputError(
                f"`journal` must not be in use by another computation; got {self.path}. "
                "Wait for it, or choose another path."
            ) from error
        except OSError as error:
            raise InputError(
                f"`journal` must be a file that can be written; got {self.path}: "
                f"{error.strerror or error}."
            ) from error


def _open_privately(path: Path) -> BinaryIO:
    """File to be read and written, ours alone."""
    file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise
    return file


def _entry(file: BinaryIO) -> tuple[str, Findings] | None:
    """Step and findings of the next entry; None at the end of the file, or of its intact part."""
    head = file.read(LENGTH + DIGEST)
    try:
        length = int(head[:LENGTH], 16)
    except ValueError:
        return None
    left = os.fstat(file.fileno()).st_size - file.tell()
    body = file.read(length) if 0 <= length <= left else b""
    if checksum(body).encode() != head[LENGTH:]:
        return None
    content, arrays = io.BytesIO(body), []
    while content.tell() < len(body):
        arrays.append(np.lib.format.read_array(content, allow_pickle=False))
    return str(arrays[0]), tuple(arrays[1:])
