"""Quasi-static shape control of soft, morphing structures.

Names are loaded when they are first used, so that importing the package costs nothing. The stub
`__init__.pyi` in this folder is the one list of them, read here and by type checkers.
"""

import sys
import warnings
from operator import attrgetter

import lazy_loader

__version__ = "0.2.0"

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

RENAMED = {
    "combined": "function_of",
    "held_over": "stable_over",
    "highest": "charts.highest",
    "lowest": "charts.lowest",
    "nearest": "charts.nearest",
}
"""Earlier names, kept for one release, and what they are called now."""


def __getattr__(name: str) -> object:
    if name not in RENAMED:
        return _load(name)
    new = RENAMED[name]
    told = f"`equimorph.{name}` is `equimorph.{new}` now; the old name goes with the next release."
    warnings.warn(told, DeprecationWarning, stacklevel=2)
    return attrgetter(new)(sys.modules[__name__])
