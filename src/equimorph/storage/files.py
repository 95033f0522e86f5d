"""Files that a reader finds old or new, never half-written, and locks on them."""

import csv
import fcntl
import hashlib
import io
import json
import os
import shutil
import socket
import tempfile
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from equimorph.errors import InputError

FINGERPRINT = 32
"""Hexadecimal digits of a fingerprint."""


@contextmanager
def replacing(path: Path) -> Generator[Path]:
    """Give a temporary path in the folder of `path`, and move it there when the block succeeds.

    Refused if the folder cannot be written, or is full.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
        os.close(handle)
        # mkstemp makes files private; results are as readable as any other new file.
        os.chmod(name, 0o666 & ~_umask())
    except OSError as error:
        raise _unwritable(path, error) from error
    partial = Path(name)
    try:
        yield partial
        move_whole(partial, path)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def move_whole(source: Path, target: Path) -> None:
    """Move a finished file within a file system so that a power cut leaves the old or the new one.

    Its content reaches the disk before its name does.
    """
    _synchronise(source)
    source.replace(target)
    _synchronise(target.parent)


def link_file(source: Path, target: Path) -> None:
    """Give a file a second name; a copy where the file system has no links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a file in one step."""
    with replacing(path) as partial:
        partial.write_bytes(content)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a text file in one step."""
    return write_bytes(path, text.encode("utf-8"))


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Return a table as text: entries with commas between them, a line for each row."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def write_csv(path: Path, rows: Iterable[Iterable[object]]) -> Path:
    """Write a table of texts and numbers in one step."""
    return write_text(path, csv_text(rows))


def read_text(path: Path) -> str:
    """Read a UTF-8 text file; one that cannot be read is refused."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"`{path}` must be a text file; got bytes that are no text.") from error
    except OSError as error:
        raise InputError(
            f"`{path}` must be a file that can be read; got: {error.strerror}."
        ) from error


def checksum(content: bytes) -> str:
    """SHA-256 of a file's content."""
    return hashlib.sha256(content).hexdigest()


def fingerprint(content: Any) -> str:
    """Fingerprint of plain data; the order of keys does not count.

    Examples
    --------
    >>> fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    True
    """
    text = json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()[:FINGERPRINT]


@contextmanager
def lock_file(path: Path, what: str) -> Generator[None]:
    """Hold the lock on a file while the block lasts: one process at a time.

    The file stays where it is and names its last holder. There is no stale lock: the system
    releases it with the process, however that ends.

    `path`: the file; made if it does not exist. `what`: what is being locked, for the message.
    Raises `InputError` if another process, or another place in this one, holds the lock.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            holder = os.pread(handle, 200, 0).decode("utf-8", "replace").strip()
            raise InputError(
                f"`{what}` must not be in use by another run; got one that {holder or 'just began'}"
                " is writing to. Wait for it, or choose another one with --out."
            ) from error
        os.ftruncate(handle, 0)
        os.pwrite(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode(), 0)
        yield
    finally:
        os.close(handle)


def _synchronise(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(
        f"`{path}` must be a place that can be written; got: {error.strerror or error}."
    )
