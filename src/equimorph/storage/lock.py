"""One process at a time: a lock on a file, which the system takes back when its holder dies."""

import fcntl
import os
import socket
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from equimorph.errors import InputError


@contextmanager
def locked(path: Path, what: str) -> Generator[None]:
    """Hold the lock on a file while the block lasts.

    The file stays where it is and names its last holder. There is no stale lock: the system frees
    it with the process, however that ends.

    Parameters
    ----------
    path
        The file; made if it does not exist.
    what
        What is being locked, for the message.

    Raises
    ------
    InputError
        If another process, or another place in this one, holds the lock.
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
