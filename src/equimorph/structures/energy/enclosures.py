"""Enclosures of what tapes compute, by interval arithmetic on many lanes."""

from collections.abc import Callable

import numpy as np

from equimorph.linalg.intervals import (
    Interval,
    cosine,
    even_growth,
    falling,
    inverse,
    power,
    rising,
    sine,
    square,
    tangent,
)
from equimorph.structures.energy.kernels import OPERATIONS
from equimorph.structures.energy.tape import Tape

RISING = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "asin": np.arcsin, "atan": np.arctan,
    "sinh": np.sinh, "tanh": np.tanh, "asinh": np.arcsinh, "acosh": np.arccosh,
    "atanh": np.arctanh, "log1p": np.log1p, "expm1": np.expm1,
}  # fmt: skip
OPERATIONS_OF_TWO: dict[str, Callable[[Interval, Interval], Interval]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a, _: -a,
    "assign": lambda a, _: a,
    "sq": lambda a, _: square(a),
    "twice": lambda a, _: 2.0 * a,
    "inv": lambda a, _: inverse(a),
    "sin": lambda a, _: sine(a),
    "cos": lambda a, _: cosine(a),
    "tan": lambda a, _: tangent(a),
    "cosh": lambda a, _: even_growth(a),
    "acos": lambda a, _: falling(np.arccos, a),
    "pow": power,
}
KNOWN = frozenset({"input", "constant", "output", *OPERATIONS_OF_TWO, *RISING})


def can_enclose(tape: Tape) -> bool:
    """Whether all operations of a tape are known here."""
    return {OPERATIONS[int(code)] for code in np.unique(tape.code[:, 0])} <= KNOWN


def enclosure(tape: Tape, inputs: Interval) -> Interval:
    """Bounds of the outputs over boxes of inputs (lanes, inputs); infinite where none are known."""
    lanes = inputs.shape[0]
    work: dict[int, Interval] = {}
    low, high = np.empty((2, lanes, tape.outputs))
    with np.errstate(all="ignore"):
        for code, first, second, place in tape.code.tolist():
            name = OPERATIONS[code]
            if name == "input":
                work[place] = inputs[:, first]
            elif name == "constant":
                work[place] = Interval.at(np.full(lanes, tape.constants[first]))
            elif name == "output":
                low[:, place], high[:, place] = work[first].low, work[first].high
            elif name in RISING:
                work[place] = rising(RISING[name], work[first])
            else:
                work[place] = OPERATIONS_OF_TWO[name](work[first], work.get(second, work[first]))
    return Interval(low, high)
