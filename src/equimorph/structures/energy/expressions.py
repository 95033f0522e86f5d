"""Expressions as text and as CasADi graphs, and the way from one to the other.

Text is data: it is read with Python's grammar, and nothing of it is executed.
"""

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from equimorph.argument_kinds import Kind, is_listed, is_number
from equimorph.argument_vocabulary import FINITE
from equimorph.errors import InputError
from equimorph.structures.energy.tape import casadi, instructions

CONSTANTS = {"pi": math.pi}
FUNCTIONS = (
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh",
    "atanh", "exp", "log", "sqrt", "log1p", "expm1", "hypot", "erf", "fabs", "sign", "fmin",
    "fmax", "if_else",
)  # fmt: skip


def _is_graph(value: Any) -> bool:
    return type(value).__module__.startswith("casadi")


def _is_formula(value: Any) -> bool:
    number = is_number(value) and FINITE.holds(value)
    return isinstance(value, str) or number or _is_graph(value)


FORMULA = Kind(
    "a formula as text, a number or a casadi.SX expression", "formulas, as texts or numbers",
    _is_formula,
)  # fmt: skip
POINT = Kind(
    "two formulas [x, y]",
    "points of two formulas [x, y]",
    lambda value: is_listed(value) and len(value) == 2 and all(map(_is_formula, value)),
)
SYMBOLS = Kind("symbols of casadi.SX", "symbols of casadi.SX", _is_graph)
_UNARY: dict[type, Callable[[Any], Any]] = {ast.UAdd: lambda a: a, ast.USub: lambda a: -a}
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
_COMPARED: dict[type, Callable[[Any, Any], Any]] = {
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
}


def expression(given: Any, names: Mapping[str, Any], what: str) -> Any:
    """Scalar CasADi expression of a text, a number or an expression.

    What is no scalar, and text that is no formula in `names`, is refused; `what` names the
    argument.
    """
    ca = casadi()
    if isinstance(given, str):
        return _read(given, names, what)
    try:
        value = ca.SX(given)
    except (TypeError, NotImplementedError):
        raise InputError(
            f"`{what}` must be a formula as text, a number or a casadi.SX expression; got "
            f"{type(given).__name__}."
        ) from None
    if value.numel() != 1:
        raise InputError(f"`{what}` must be one scalar; got an expression of shape {value.shape}.")
    return value


def _read(text: str, names: Mapping[str, Any], what: str) -> Any:
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise InputError(f"`{what}` must be a formula; got {_short(text)}.") from None
    try:
        return casadi().SX(_value(tree, names))
    except _UnreadableError as error:
        raise InputError(f"`{what}` must be a formula in {error}; got {_short(text)}.") from None
    except ArithmeticError:
        raise InputError(
            f"`{what}` must be a formula of finite numbers; got {_short(text)}."
        ) from None
    except RecursionError:
        raise InputError(
            f"`{what}` must be a shorter formula; got {_short(text)}. Give parts of it names in "
            "`definitions`."
        ) from None


class _UnreadableError(Exception):
    """What a formula must be made of."""


def _value(node: ast.expr, names: Mapping[str, Any]) -> Any:
    reader = _READERS.get(type(node))
    value = None if reader is None else reader(node, names)
    if value is None:
        raise _UnreadableError(
            f"numbers, names, + - * / **, comparisons and the functions {', '.join(FUNCTIONS)}, "
            f"not in {_short(ast.unparse(node))}"
        )
    return value


def _number(node: Any, names: Mapping[str, Any]) -> Any:
    return float(node.value) if type(node.value) in (int, float) else None


def _name(node: Any, names: Mapping[str, Any]) -> Any:
    if node.id in names:
        return names[node.id]
    if node.id in CONSTANTS:
        return CONSTANTS[node.id]
    known = ", ".join(names) or "no names"
    raise _UnreadableError(f"{known}, not in the unknown symbol {node.id}")


def _unary(node: Any, names: Mapping[str, Any]) -> Any:
    operation = _UNARY.get(type(node.op))
    return None if operation is None else operation(_value(node.operand, names))


def _binary(node: Any, names: Mapping[str, Any]) -> Any:
    operation = _BINARY.get(type(node.op))
    if operation is None:
        return None
    value = operation(_value(node.left, names), _value(node.right, names))
    if isinstance(value, complex):
        raise _UnreadableError(f"real numbers, not in {_short(ast.unparse(node))}")
    return value


def _comparison(node: Any, names: Mapping[str, Any]) -> Any:
    operation = _COMPARED.get(type(node.ops[0]))
    if operation is None or len(node.ops) > 1:
        return None
    return operation(casadi().SX(_value(node.left, names)), _value(node.comparators[0], names))


def _call(node: Any, names: Mapping[str, Any]) -> Any:
    if not (isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS) or node.keywords:
        return None
    return _function_value(node.func.id, [_value(each, names) for each in node.args])


_READERS: dict[type, Callable[[Any, Mapping[str, Any]], Any]] = {
    ast.Constant: _number,
    ast.Name: _name,
    ast.UnaryOp: _unary,
    ast.BinOp: _binary,
    ast.Compare: _comparison,
    ast.Call: _call,
}


def _function_value(name: str, arguments: list[Any]) -> Any:
    ca = casadi()
    count = {"atan2": 2, "hypot": 2, "fmin": 2, "fmax": 2, "if_else": 3}.get(name, 1)
    if len(arguments) != count:
        raise _UnreadableError(f"functions of the right number of arguments ({name} has {count})")
    return getattr(ca, name)(*(ca.SX(each) for each in arguments))


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


_SIGNS = {"add": "+", "sub": "-", "mul": "*", "div": "/", "pow": "**", "lt": "<", "le": "<="}
_FORMS = {
    "assign": "{0}", "neg": "-{0}", "sq": "{0}*{0}", "twice": "2*{0}", "inv": "1/{0}",
    "if_else_zero": "if_else({0}, {1}, 0)", "not": "if_else({0}, 0, 1)",
}  # fmt: skip


def write_formulas(
    expressions: Sequence[Any], symbols: Sequence[Any]
) -> tuple[dict[str, str], list[str]]:
    """Definitions of named parts in their order, and expressions in terms of them.

    The inverse of `expression`: reading the definitions one after the other and then the
    expressions gives the same graph, with the same numbers bit for bit.
    """
    ca = casadi()
    names = [symbol.name() for symbol in symbols]
    prefix = "part"
    while any(name.startswith(prefix) for name in names):
        prefix += "_"
    function = ca.Function("written", [ca.vertcat(*symbols)], [ca.vertcat(*expressions)])
    definitions: dict[str, str] = {}
    work: dict[int, str] = {}
    out = ["0"] * len(expressions)
    for name, inputs, place, constant in instructions(function):
        if name == "output":
            out[place] = work[inputs[0]]
        elif name == "input":
            work[place] = names[inputs[1]]
        elif name == "constant":
            work[place] = f"({constant!r})" if constant < 0.0 else repr(constant)
        else:
            definitions[f"{prefix}{len(definitions)}"] = _operation(name, [work[i] for i in inputs])
            work[place] = f"{prefix}{len(definitions) - 1}"
    return definitions, out


def _operation(name: str, operands: list[str]) -> str:
    if name in _SIGNS:
        return f"{operands[0]} {_SIGNS[name]} {operands[1]}"
    if name in _FORMS:
        return _FORMS[name].format(*operands)
    if name in FUNCTIONS:
        return f"{name}({', '.join(operands)})"
    raise InputError(f"`energy` must be made of {', '.join(FUNCTIONS)} to be written; got {name}.")
