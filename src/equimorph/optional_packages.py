"""Packages that extras install, loaded on first use."""

from importlib import import_module
from typing import Any

from equimorph.errors import MissingError


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
