"""Errors that a caller can cause. Numerical failures are values with a status, never exceptions."""

import difflib
from collections.abc import Sequence


class EquimorphError(Exception):
    """Base of all errors raised by equimorph."""


class InputError(EquimorphError, ValueError):
    """The caller's mistake: what is wrong, which value was given, what is allowed."""


class MissingError(InputError, AttributeError):
    """A property that an object does not have, like stability in space without stiffnesses.

    As an `AttributeError` it leaves `hasattr` and tools that list attributes at work.
    """


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
