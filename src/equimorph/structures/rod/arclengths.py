"""Arclengths of rods in names of descriptors, and those at which shapes are drawn."""

import numpy as np

from equimorph.arrays import Float
from equimorph.errors import InputError

FRACTIONS = (3, 6, 7, 9, 11, 12)
"""Denominators of arclengths that descriptors write as fractions."""

Arclengths = Float[np.ndarray, " points"]


def read_fraction(text: str) -> float:
    """Number written like ``0.5`` or ``1/3``."""
    try:
        above, _, below = text.partition("/")
        return float(above) / float(below or 1.0)
    except (ValueError, ZeroDivisionError):
        raise InputError(f"`s` must be a number or a fraction like 1/3; got {text!r}.") from None


def read_end(text: str) -> int | str:
    """End 0 or 1 of a rod; another text as it is, which is refused."""
    return int(text) if text in ("0", "1") else text


def name_at(name: str, s: float) -> str:
    """Name at an arclength, from which the arclength is read back exactly: ``height(1/3)``."""
    nice = (f"{s:.6g}", *(f"{round(s * below)}/{below}" for below in FRACTIONS))
    exact = (text for text in nice if read_fraction(text) == s)
    return f"{name}({next(exact, repr(s))})"


def arclengths(s: Arclengths | None) -> Arclengths:
    """The given arclengths, by default 101 equidistant ones."""
    return np.linspace(0.0, 1.0, 101) if s is None else np.asarray(s, dtype=float)
