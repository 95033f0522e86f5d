"""Enclosures of what tapes compute, by interval arithmetic on many lanes.

Every result is widened by rounding errors outward, so that it encloses the exact values
[MooreKearfottCloud2009]_.
"""

from collections.abc import Callable

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Values
from equimorph.structures.energy.kernels import OPERATIONS
from equimorph.structures.energy.tape import Tape

Interval = tuple[Values, Values]

TURN = 2.0 * np.pi
ULPS = 4
"""Units in the last place by which library functions may be wrong, and more than they are."""

RISING: dict[str, Callable[[Values], Values]] = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "asin": np.arcsin, "atan": np.arctan,
    "sinh": np.sinh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh,
    "atanh": np.arctanh, "log1p": np.log1p, "expm1": np.expm1,
}  # fmt: skip
FALLING: dict[str, Callable[[Values], Values]] = {"acos": np.arccos}
KNOWN = frozenset({
    "input", "constant", "output", "assign", "add", "sub", "mul", "div", "neg", "sq", "twice",
    "inv", "sin", "cos", "tan", "pow", "cosh", *RISING, *FALLING,
})  # fmt: skip


def can_enclose(tape: Tape) -> bool:
    """Whether all operations of a tape are known here."""
    return {OPERATIONS[int(code)] for code in np.unique(tape.code[:, 0])} <= KNOWN


def enclosure(
    tape: Tape, low: Float[np.ndarray, "lanes inputs"], high: Float[np.ndarray, "lanes inputs"]
) -> tuple[Float[np.ndarray, "lanes outputs"], Float[np.ndarray, "lanes outputs"]]:
    """Bounds of the outputs for all inputs between two bounds; infinite where none are known."""
    lanes = len(low)
    work: dict[int, Interval] = {}
    out_low, out_high = np.empty((2, lanes, tape.outputs))
    with np.errstate(all="ignore"):
        for code, first, second, place in tape.code.tolist():
            name = OPERATIONS[code]
            if name == "input":
                work[place] = low[:, first], high[:, first]
            elif name == "constant":
                value = np.full(lanes, tape.constants[first])
                work[place] = value, value
            elif name == "output":
                out_low[:, place], out_high[:, place] = work[first]
            else:
                work[place] = _operation(name, work[first], work.get(second, work[first]))
    unknown = np.isnan(out_low) | np.isnan(out_high)
    return np.where(unknown, -np.inf, out_low), np.where(unknown, np.inf, out_high)


def _operation(name: str, a: Interval, b: Interval) -> Interval:
    if name == "assign":
        return a
    if name in RISING:
        return _wider((RISING[name](a[0]), RISING[name](a[1])))
    if name in FALLING:
        return _wider((FALLING[name](a[1]), FALLING[name](a[0])))
    return _wider(OPERATIONS_OF_TWO[name](a, b))


def _wider(a: Interval) -> Interval:
    low, high = a
    room = ULPS * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    return low - room, high + room


def _negative(a: Interval) -> Interval:
    return -a[1], -a[0]


def _product(a: Interval, b: Interval) -> Interval:
    corners = np.stack([x * y for x in a for y in b])
    # 0 · ∞ counts as 0: the factor that is not bounded takes finite values only
    corners = np.nan_to_num(corners, nan=0.0, posinf=np.inf, neginf=-np.inf)
    return corners.min(axis=0), corners.max(axis=0)


def _square(a: Interval) -> Interval:
    low, high = np.abs(a[0]), np.abs(a[1])
    inside = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.where(inside, 0.0, np.minimum(low, high) ** 2), np.maximum(low, high) ** 2


def _inverse(a: Interval) -> Interval:
    through = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.where(through, -np.inf, 1.0 / a[1]), np.where(through, np.inf, 1.0 / a[0])


def _cosine(a: Interval) -> Interval:
    """Extremes at multiples of π inside, else at the ends."""
    ends = np.cos(a[0]), np.cos(a[1])
    top = np.floor(a[1] / TURN) >= np.ceil(a[0] / TURN)
    bottom = np.floor((a[1] - np.pi) / TURN) >= np.ceil((a[0] - np.pi) / TURN)
    low = np.where(bottom, -1.0, np.minimum(*ends))
    return low, np.where(top, 1.0, np.maximum(*ends))


def _sine(a: Interval) -> Interval:
    return _cosine(_wider((a[0] - 0.5 * np.pi, a[1] - 0.5 * np.pi)))


def _tangent(a: Interval) -> Interval:
    """Rising between poles."""
    pole = np.floor(a[1] / np.pi + 0.5) > np.floor(a[0] / np.pi + 0.5)
    low, high = np.tan(a[0]), np.tan(a[1])
    return np.where(pole, -np.inf, low), np.where(pole, np.inf, high)


def _even_growth(a: Interval) -> Interval:
    """Hyperbolic cosine."""
    size = np.maximum(np.abs(a[0]), np.abs(a[1]))
    least = np.minimum(np.abs(a[0]), np.abs(a[1]))
    inside = (a[0] <= 0.0) & (a[1] >= 0.0)
    return np.cosh(np.where(inside, 0.0, least)), np.cosh(size)


def _power(a: Interval, b: Interval) -> Interval:
    """Power with a constant exponent; unbounded for a variable one."""
    n = b[0]
    whole, odd = n == np.round(n), np.mod(n, 2.0) == 1.0
    low, high = a[0] ** n, a[1] ** n
    out = np.minimum(low, high), np.maximum(low, high)
    through = (a[0] <= 0.0) & (a[1] >= 0.0)
    even = through & whole & ~odd & (n > 0.0)
    least = np.where(even, 0.0, out[0])
    known = (b[0] == b[1]) & np.where(whole, (n > 0.0) | ~through, a[0] > 0.0)
    return np.where(known, least, -np.inf), np.where(known, out[1], np.inf)


OPERATIONS_OF_TWO: dict[str, Callable[[Interval, Interval], Interval]] = {
    "add": lambda a, b: (a[0] + b[0], a[1] + b[1]),
    "sub": lambda a, b: (a[0] - b[1], a[1] - b[0]),
    "mul": _product,
    "div": lambda a, b: _product(a, _wider(_inverse(b))),
    "neg": lambda a, _: _negative(a),
    "sq": lambda a, _: _square(a),
    "twice": lambda a, _: (2.0 * a[0], 2.0 * a[1]),
    "inv": lambda a, _: _inverse(a),
    "sin": lambda a, _: _sine(a),
    "cos": lambda a, _: _cosine(a),
    "tan": lambda a, _: _tangent(a),
    "cosh": lambda a, _: _even_growth(a),
    "pow": _power,
}
