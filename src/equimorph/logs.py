"""Logs of the package: it tells what it does to those who ask, and never prints.

Messages go to loggers below ``equimorph``. Without a handler they are dropped; programs see them by
``logging.basicConfig(level=logging.INFO)``, users of the command line by ``--verbose``.
"""

import logging

PACKAGE = "equimorph"
"""Name of the logger of the whole package."""

logging.getLogger(PACKAGE).addHandler(logging.NullHandler())


def log_of(module: str) -> logging.Logger:
    """Return the logger of a module of the package, by its ``__name__``."""
    return logging.getLogger(module)
