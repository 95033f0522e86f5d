"""Errors that a caller can cause. Numerical failures are values with a status, never exceptions."""


class EquimorphError(Exception):
    """Base of all errors raised by equimorph."""


class InputError(EquimorphError, ValueError):
    """The caller's mistake: what is wrong, which value was given, what is allowed."""
