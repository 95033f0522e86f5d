"""Errors that a caller can cause. Numerical failures are values with a status, never exceptions.

Packages that extras install are loaded on first use, with such an error where one is missing.
"""

import difflib
from collections.abc import Sequence
from importlib import import_module
from typing import Any


class EquimorphError(Exception):
    """Base of all errors raised by equimorph."""


class InputError(EquimorphError, ValueError):
    """The caller's mistake: what is wrong, which value was given, what is allowed."""


class MissingError(InputError, AttributeError):
    """A property that an object does not have, like stability in space without stiffnesses.

    As an `AttributeError` it leaves `hasattr` and tools that list attributes at work.
    """


class EndlessError(InputError):
    """A set with states without end over a point, which constraints must bound."""


class CancelledError(EquimorphError):
    """Raised by a progress sink to cancel a computation; lifts of many states keep what is done."""


class LostWorkersError(EquimorphError):
    """A cluster lost the workers that computed a chunk, more often than its scheduler allows."""


def suggestion(written: str, allowed: Sequence[str]) -> str:
    """Sentence to end a message with when an allowed name is close to what was written, or nothing.

    Examples
    --------
    >>> suggestion("intervalls", ["box", "intervals"])
    ' Did you mean intervals?'
    >>> suggestion("x", ["box", "intervals"])
    ''
    """
    known = {name.lower(): name for name in allowed}
    close = difflib.get_close_matches(written.lower(), known, n=1)
    return f" Did you mean {known[close[0]]}?" if close else ""


def load_package(module: str, extra: str, what: str, otherwise: str = "") -> Any:
    """Load a package that an extra of this one installs.

    Parameters
    ----------
    module, extra
        Its name, and that of the extra.
    what
        What needs it, for the message.
    otherwise
        What one may do instead.

    Raises
    ------
    MissingError
        If it is not installed, with the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        raise MissingError(
            f"`{what}` must have the package {name}; got none. Run: pip install "
            f'"equimorph[{extra}]"{otherwise}.'
        ) from error
