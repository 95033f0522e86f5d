"""Determinants as m and e of m·2^e: those of structures with many unknowns are no floats.

Kernels keep products of pivots within 2^±256 and count the powers of two (`kernels.balance`): e is
0 while m would do. What is compared is of one structure, and so of one size: determinants in units
of the power of two of one of them are numbers again.

See docs/decisions.md, "Determinants are m·2^e".
"""

import numpy as np

from equimorph.arrays import Determinants, Float


def no_determinants(lanes: int) -> Determinants:
    """Determinants that are not at hand."""
    out = np.zeros((lanes, 2))
    out[:, 0] = np.nan
    return out


def clear_overflows(determinants: Determinants) -> None:
    """Write nan, in place, where a pivot was no number or beyond all of them."""
    finite = np.isfinite(determinants)
    if not finite.all():
        determinants[~finite.all(axis=1)] = np.nan, 0.0


def in_units(
    determinants: Float[np.ndarray, "... 2"], exponent: Float[np.ndarray, "..."] | float
) -> Float[np.ndarray, "..."]:
    """Determinants over powers of two with these exponents."""
    power = np.maximum(np.minimum(determinants[..., 1] - exponent, POWERS), -POWERS).astype(int)
    with np.errstate(over="ignore", under="ignore"):
        return np.asarray(np.ldexp(determinants[..., 0], power))


POWERS = 10_000
"""Powers of two beyond those between the smallest and the largest number."""
