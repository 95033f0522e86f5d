"""CasADi expressions as tapes of instructions that run on many lanes at a time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from equimorph.errors import InputError
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.energy.kernels import OPERATIONS, run_lanes

ROUGH = frozenset({
    "fabs", "fmin", "fmax", "lt", "le", "if_else_zero", "sign", "not", "and", "or", "eq", "ne",
})  # fmt: skip
"""Operations that are not twice differentiable."""
_SAME = {"const": "constant", "constpow": "pow"}


def casadi() -> Any:
    """CasADi, an optional package of 280 MB, loaded on first use.

    Raises
    ------
    InputError
        If it is not installed.
    """
    try:
        import casadi as package  # noqa: PLC0415  # optional and heavy
    except ImportError:
        raise InputError(
            "`EnergyStructure` must have the package casadi; got none. "
            "Install it: pip install 'equimorph[energy]'."
        ) from None
    return package


@lru_cache(maxsize=1)
def _names() -> dict[int, str]:
    """Operations by CasADi's own numbers, which may change from release to release."""
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


def tape(inputs: Sequence[Any], outputs: Any) -> Tape:
    """Tape of a column of expressions in columns of symbols.

    Raises
    ------
    InputError
        If the expressions hold an operation that tapes do not know.
    """
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
