"""Compiled evaluation of instruction tapes, a vector of lanes at a time."""

import math

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER, read_lanes, write_lanes
from equimorph.linalg.simd import (
    LANES,
    absolute,
    entry,
    larger,
    load,
    set_entry,
    sincos,
    smaller,
    spread,
    square_root,
    store,
    where_less,
    work_rows,
)

OPERATIONS = (
    "input", "constant", "output", "assign", "add", "sub", "mul", "div", "neg", "sq", "twice",
    "inv", "sin", "cos", "tan", "sqrt", "fabs", "fmin", "fmax", "lt", "le", "if_else_zero",
    "pow", "exp", "log", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh",
    "acosh", "atanh", "log1p", "expm1", "hypot", "erf", "sign", "not", "and", "or", "eq", "ne",
)  # fmt: skip
"""Operations by number. From "pow" (22) on, lanes are computed one by one."""


@njit(**INNER)
def one_lane(code, a, b):  # noqa: PLR0911  # one value per operation
    if code == 22:
        return math.pow(a, b)
    if code == 23:
        return math.exp(a)
    if code == 24:
        return math.log(a) if a > 0.0 else (-math.inf if a == 0.0 else math.nan)
    if code == 25:
        return math.asin(a) if abs(a) <= 1.0 else math.nan
    if code == 26:
        return math.acos(a) if abs(a) <= 1.0 else math.nan
    if code == 27:
        return math.atan(a)
    if code == 28:
        return math.atan2(a, b)
    if code == 29:
        return math.sinh(a)
    if code == 30:
        return math.cosh(a)
    if code == 31:
        return math.tanh(a)
    if code == 32:
        return math.asinh(a)
    if code == 33:
        return math.acosh(a) if a >= 1.0 else math.nan
    if code == 34:
        return math.atanh(a) if abs(a) < 1.0 else math.nan
    if code == 35:
        return math.log1p(a) if a > -1.0 else math.nan
    if code == 36:
        return math.expm1(a)
    if code == 37:
        return math.hypot(a, b)
    if code == 38:
        return math.erf(a)
    if code == 39:
        return (a > 0.0) * 1.0 - (a < 0.0) * 1.0
    if code == 40:
        return 1.0 * (a == 0.0)
    if code == 41:
        return 1.0 * (a != 0.0 and b != 0.0)
    if code == 42:
        return 1.0 * (a != 0.0 or b != 0.0)
    if code == 43:
        return 1.0 * (a == b)
    return 1.0 * (a != b)


@njit(**INNER)
def quickly(code, a, b):  # noqa: PLR0911  # one value per operation
    """Operations on all lanes of a vector at once."""
    zero, one = spread(0.0), spread(1.0)
    if code == 4:
        return a + b
    if code == 5:
        return a - b
    if code == 6:
        return a * b
    if code == 7:
        return a / b
    if code == 8:
        return zero - a
    if code == 9:
        return a * a
    if code == 10:
        return a + a
    if code == 11:
        return one / a
    if code == 12:
        return sincos(a)[0]
    if code == 13:
        return sincos(a)[1]
    if code == 14:
        sine, cosine = sincos(a)
        return sine / cosine
    if code == 15:
        return square_root(a)
    if code == 16:
        return absolute(a)
    if code == 17:
        return smaller(a, b)
    if code == 18:
        return larger(a, b)
    if code == 19:
        return where_less(a, b, one, zero)
    if code == 20:
        return where_less(b, a, zero, one)
    if code == 21:
        return where_less(zero, absolute(a), b, zero)
    return a


@njit(**INNER)
def run(tape, constants, x, work, result):
    """Run a tape (operation, first, second, place): x, work and result have rows of lanes."""
    for i in range(len(tape)):
        code, first, second, place = tape[i, 0], tape[i, 1], tape[i, 2], tape[i, 3]
        if code == 0:
            store(work, place, load(x, first))
        elif code == 1:
            store(work, place, spread(constants[first]))
        elif code == 2:
            store(result, place, load(work, first))
        elif code < 22:
            store(work, place, quickly(code, load(work, first), load(work, second)))
        else:
            for k in range(LANES):
                a, b = entry(work, first * LANES + k), entry(work, second * LANES + k)
                set_entry(work, place * LANES + k, one_lane(code, a, b))


@njit(**FLAGS)
def run_lanes(tape, constants, slots, inputs, outputs):
    """Run a tape on all lanes: inputs (lanes, inputs), outputs (lanes, outputs)."""
    lanes, count = inputs.shape
    length = outputs.shape[1]
    x, work, result = work_rows(count), work_rows(slots), work_rows(length)
    for block in range(0, lanes, LANES):
        lane = min(block, lanes - LANES)
        read_lanes(inputs, lane * count, count, count, x, 0, 1)
        run(tape, constants, x, work, result)
        write_lanes(result, 0, 1, outputs, lane * length, length, length)
