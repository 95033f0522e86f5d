"""Writing files so that a reader finds the old one or the new one, never half of one."""

import os
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from equimorph.errors import InputError


@contextmanager
def replacing(path: Path) -> Generator[Path]:
    """Give a temporary path in the folder of `path`, and move it there when the block succeeds.

    Raises
    ------
    InputError
        If the folder cannot be written.
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
        partial.replace(path)
    except OSError as error:
        raise _unwritable(path, error) from error
    finally:
        partial.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> Path:
    """Write a text file in one step."""
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")
    return path


def read_text(path: Path) -> str:
    """Read a text file.

    Raises
    ------
    InputError
        If it cannot be read as UTF-8 text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"`{path}` must be a text file; got bytes that are no text.") from error
    except OSError as error:
        raise InputError(
            f"`{path}` must be a file that can be read; got: {error.strerror}."
        ) from error


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"`{path}` must be a place that can be written; got: {error.strerror}.")
