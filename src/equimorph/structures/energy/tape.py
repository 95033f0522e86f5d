"""Tapes of CasADi expressions on many lanes: values, all derivatives of an energy, enclosures."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.errors import InputError, load_package
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
from equimorph.linalg.lanes import over_lanes
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.energy.kernels import OPERATIONS, run_lanes

ROUGH = frozenset({
    "fabs", "fmin", "fmax", "lt", "le", "if_else_zero", "sign", "not", "and", "or", "eq", "ne",
})  # fmt: skip
"""Operations that are not twice differentiable."""
PLAIN = {
    "assign": 1, "add": 2, "sub": 2, "mul": 2, "div": 2, "neg": 1, "sq": 1, "twice": 1, "inv": 1,
    "sin": 1, "cos": 1, "sqrt": 1, "exp": 1,
}  # fmt: skip
"""Numbers of operands of the operations that programs in certificates may hold."""
LARGEST_POWER = 20
"""Largest exponent that they multiply out."""
_SAME = {"const": "constant", "constpow": "pow"}


def casadi() -> Any:
    """CasADi, an optional package of 280 MB; see `load_package`."""
    return load_package("casadi", "energy", "EnergyStructure")


@lru_cache(maxsize=1)
def _names() -> dict[int, str]:
    """Operations by CasADi's numbers, which may change from release to release."""
    ca = casadi()
    codes = {getattr(ca, key): key[3:].lower() for key in dir(ca) if key.startswith("OP_")}
    return {code: _SAME.get(name, name) for code, name in codes.items()}


def instructions(function: Any) -> Iterator[tuple[str, tuple[int, ...], int, float]]:
    """Operation, places read, place written and constant of each instruction of an SX function."""
    names = _names()
    for k in range(function.n_instructions()):
        code = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        name = names[code]
        constant = function.instruction_constant(k) if name == "constant" else 0.0
        yield name, tuple(inputs), outputs[1] if name == "output" else outputs[0], constant


@dataclass(frozen=True, eq=False)
class Tape:
    """Outputs as functions of inputs, lane by lane.

    Rows of `code` are (operation, first place, second place, place written).
    """

    code: Int[np.ndarray, "instructions 4"]
    constants: Float[np.ndarray, " constants"]
    slots: int
    outputs: int

    def __call__(self, *inputs: Float[np.ndarray, "lanes _"]) -> Float[np.ndarray, "lanes outputs"]:
        """Outputs of all lanes; inputs are joined side by side."""
        x = np.ascontiguousarray(np.concatenate(inputs, axis=1), dtype=float)
        result = np.empty((len(x), self.outputs))
        if len(x) and self.outputs:
            over_lanes(run_lanes, (self.code, self.constants, self.slots), [x], [result])
        return result

    def instructions(self) -> list[list[Any]] | None:
        """What leads to the output, in plain words and numbers; None for unusual functions.

        Each instruction has its operation and its operands: the number of an instruction before,
        of a variable, or a constant.
        """
        last: dict[int, int] = {}
        steps: list[list[Any]] = []
        for code, first, second, place in self.code.tolist():
            name = OPERATIONS[code]
            if name == "output":
                steps.append(["assign", last[first]])
                continue
            operands = [last[each] for each in (first, second) if each in last]
            if name == "input":
                step = ["variable", first]
            elif name == "constant":
                step = ["constant", float(self.constants[first])]
            elif name == "pow":
                *before, step = _power(len(steps), operands[0], steps[operands[-1]])
                steps += before
            else:
                step = [name, *operands[: PLAIN.get(name, 0)]]
            if len(step) < 2:
                return None
            last[place] = len(steps)
            steps.append(step)
        return steps


def _power(place: int, factor: int, exponent: list[Any]) -> list[list[Any]]:
    """Instructions from a place on that multiply a whole power out; an empty one for others."""
    if exponent not in [["constant", float(n)] for n in range(2, LARGEST_POWER + 1)]:
        return [[]]
    more = [["mul", place + k, factor] for k in range(int(exponent[1]) - 2)]
    return [["sq", factor], *more]


def tape(inputs: Sequence[Any], outputs: Any) -> Tape:
    """Tape of a column of expressions in columns of symbols; unknown operations are refused."""
    ca = casadi()
    column = ca.densify(ca.vec(outputs))
    function = ca.Function("tape", [ca.vertcat(*inputs)], [column], {"cse": True})
    code: list[tuple[int, int, int, int]] = []
    constants: list[float] = []
    for name, read, place, constant in instructions(function):
        if name not in OPERATIONS:
            raise InputError(f"`energy` must be made of known functions; got {name}.")
        first, second = (*read, *read, 0, 0)[:2]
        if name == "input":
            first = read[1]
        elif name == "constant":
            first = len(constants)
            constants.append(constant)
        code.append((OPERATIONS.index(name), first, second, place))
    table = np.array(code, dtype=np.int64).reshape(-1, 4)
    return Tape(table, np.array(constants, dtype=float), function.sz_w(), column.numel())


def rough_operations(outputs: Any, symbols: Any) -> list[str]:
    """Names of the operations in expressions that are not twice differentiable."""
    ca = casadi()
    found = {name for name, *_ in instructions(ca.Function("probe", [symbols], [outputs]))}
    return sorted(found & ROUGH)


class Derivatives:
    """L = E + λ·c and its derivatives, as tapes made on first use.

    Parameters
    ----------
    u, p
        Columns of symbols.
    energy, constraints
        Graphs of E and of each c in them.
    """

    def __init__(self, u: Any, p: Any, energy: Any, constraints: Sequence[Any]) -> None:
        ca = casadi()
        multipliers = ca.SX.sym("multiplier", len(constraints))
        self._z, self._p, self._energy = ca.vertcat(u, multipliers), p, energy
        gaps = ca.vertcat(ca.SX(0, 1), *constraints)
        self._lagrangian = energy + ca.dot(multipliers, gaps)
        self._force = ca.gradient(self._lagrangian, self._z)
        self._dp = ca.SX.sym("dp", p.numel())
        self._entries, self.layout = self._triangle(len(constraints))

    def _triangle(self, multipliers: int) -> tuple[Any, SparseLayout]:
        """Entries of the lower triangle of F_z, the diagonal complete, and their layout."""
        ca, size = casadi(), self._z.numel()
        lower = ca.tril(ca.jacobian(self._force, self._z))
        rows, columns = (np.array(each, dtype=int) for each in lower.sparsity().get_triplet())
        missing = np.setdiff1d(np.arange(size), rows[rows == columns])
        entries = ca.vertcat(*lower.nonzeros(), ca.SX.zeros(len(missing)))
        rows, columns = (np.concatenate([each, missing]) for each in (rows, columns))
        return entries, SparseLayout(rows, columns, size, multipliers)

    def tape(self, expressions: Any) -> Tape:
        """Tape of expressions in (z, p)."""
        return tape((self._z, self._p), expressions)

    @cached_property
    def energy(self) -> Tape:
        """E(z, p)."""
        return self.tape(self._energy)

    @cached_property
    def lagrangian(self) -> Tape:
        """L(z, p)."""
        return self.tape(self._lagrangian)

    @cached_property
    def residual(self) -> Tape:
        """F(z, p)."""
        return self.tape(self._force)

    @cached_property
    def matrix(self) -> Tape:
        """Entries of F_z at (z, p)."""
        return self.tape(self._entries)

    @cached_property
    def effort(self) -> Tape:
        """∂L/∂p at (z, p)."""
        return self.tape(casadi().gradient(self._lagrangian, self._p))

    @cached_property
    def _column(self) -> Any:
        return casadi().jtimes(self._force, self._p, self._dp)

    @cached_property
    def column(self) -> Tape:
        """F_p·dp at (z, p, dp)."""
        return tape((self._z, self._p, self._dp), self._column)

    @cached_property
    def columns(self) -> Tape:
        """F_p at (z, p), column by column."""
        return self.tape(casadi().jacobian(self._force, self._p))

    @cached_property
    def step(self) -> Tape:
        """F, F_p·dp and the entries of F_z at (z, p, dp)."""
        outputs = casadi().vertcat(self._force, self._column, self._entries)
        return tape((self._z, self._p, self._dp), outputs)

    @cached_property
    def second(self) -> Tape:
        """D²F[v, w] at (z, p, v_z, v_p, w_z, w_p)."""
        ca = casadi()
        place = ca.vertcat(self._z, self._p)
        v, w = ca.SX.sym("v", place.numel()), ca.SX.sym("w", place.numel())
        once = ca.jtimes(self._force, place, v)
        return tape((place, v, w), ca.jtimes(once, place, w))


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
