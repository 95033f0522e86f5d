"""Vectors of `LANES` doubles, and bundles of them, as types inside compiled kernels.

The compiler cannot prove that the arrays of a kernel do not overlap, so it leaves loops over lanes
scalar; explicit vectors make one instruction serve them. Work arrays have a last axis of
length `LANES` and are read and written by row: ``load(array, row)`` where `row` counts along the
flattened leading axes. A *bundle* is 2, 4 or 8 consecutive rows handled as one value: independent
chains of operations that hide each other's latency.
"""

import operator

import numpy as np
from llvmlite import ir
from llvmlite.binding import get_host_cpu_features
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from equimorph.linalg.compiled import njit

LANES = 8 if get_host_cpu_features().get("avx512f") else 4
"""Lanes of a vector: doubles in one register of the processor, so that bundles stay in these."""
_FLAGS = ("contract",)
_INDEX = ir.IntType(32)


class Bundle(types.Type):
    """Numba type of `rows` vectors of doubles in one vector."""

    def __init__(self, rows: int) -> None:
        self.rows = rows
        super().__init__(name=f"Bundle{rows}")


_BUNDLES = {rows: Bundle(rows) for rows in (1, 2, 4, 8)}
float64s = _BUNDLES[1]


def _vector(rows, entry=None):
    return ir.VectorType(entry or ir.DoubleType(), LANES * rows)


@register_model(Bundle)
class _BundleModel(models.PrimitiveModel):
    def __init__(self, manager, front_end_type):
        super().__init__(manager, front_end_type, _vector(front_end_type.rows))


def _register(function, instruction):
    cases = [signature(bundle, bundle, bundle) for bundle in _BUNDLES.values()]
    infer_global(function)(type(f"Vector{instruction}", (ConcreteTemplate,), {"cases": cases}))

    def lower(context, builder, sig, args):
        return getattr(builder, instruction)(*args, flags=_FLAGS)

    for bundle in _BUNDLES.values():
        lower_builtin(function, bundle, bundle)(lower)


for _function, _inplace, _instruction in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    _register(_function, _instruction)
    _register(_inplace, _instruction)


# --- memory -------------------------------------------------------------------------------------


def _pointer(context, builder, array_type, array, offset, vector):
    data = cgutils.create_struct_proxy(array_type)(context, builder, value=array).data
    return builder.bitcast(builder.gep(data, [offset]), vector.as_pointer())


def _loader(rows):
    @intrinsic
    def load_rows(typing_context, array, row):
        """Consecutive rows from `row` of a C-ordered array with vectors on its last axis."""
        sig = _BUNDLES[rows](array, types.intp)

        def generate(context, builder, sig, args):
            offset = builder.mul(args[1], ir.Constant(args[1].type, LANES))
            pointer = _pointer(context, builder, sig.args[0], args[0], offset, _vector(rows))
            return builder.load(pointer, align=8)

        return sig, generate

    return load_rows


load, load2, load4, load8 = (_loader(rows) for rows in (1, 2, 4, 8))


@intrinsic
def store(typing_context, array, row, value):
    """Write `value`, a vector or a bundle, into the rows of an array from `row` on."""
    sig = types.void(array, types.intp, value)

    def generate(context, builder, sig, args):
        offset = builder.mul(args[1], ir.Constant(args[1].type, LANES))
        kind = _vector(sig.args[2].rows)
        pointer = _pointer(context, builder, sig.args[0], args[0], offset, kind)
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return sig, generate


@intrinsic
def entry(typing_context, array, position):
    """Number at a flat position of a C-ordered array."""
    sig = types.float64(array, types.intp)

    def generate(context, builder, sig, args):
        place = _pointer(context, builder, sig.args[0], args[0], args[1], ir.DoubleType())
        return builder.load(place)

    return sig, generate


@intrinsic
def set_entry(typing_context, array, position, number):
    """Write a number at a flat position of a C-ordered array."""
    sig = types.void(array, types.intp, types.float64)

    def generate(context, builder, sig, args):
        place = _pointer(context, builder, sig.args[0], args[0], args[1], ir.DoubleType())
        builder.store(args[2], place)
        return context.get_dummy_value()

    return sig, generate


@njit(nogil=True)
def work_rows(rows):
    """Uninitialised array (rows, lanes) on a cache line: no vector straddles two of them."""
    raw = np.empty(rows * LANES + 8)
    skip = (-(np.int64(raw.ctypes.data) >> 3)) & 7
    return raw[skip : skip + rows * LANES].reshape(rows, LANES)


@intrinsic
def transpose(typing_context, source, start, source_step, target, stop, target_step):
    """Transpose a square of numbers: `LANES` runs, `step` apart, from and to flat positions."""
    where = (types.intp, types.intp)
    sig = types.void(source, *where, target, *where)

    def generate(context, builder, sig, args):
        def place(at, start, step, k):
            shift = builder.mul(step, ir.Constant(step.type, k))
            offset = builder.add(start, shift)
            return _pointer(context, builder, sig.args[at], args[at], offset, _vector(1))

        rows = [builder.load(place(0, args[1], args[2], k), align=8) for k in range(LANES)]
        for width in (1, 2, 4)[: LANES.bit_length() - 1]:  # exchange off-diagonal blocks
            low = [i + (LANES - width if i & width else 0) for i in range(LANES)]
            high = [i + (LANES if i & width else width) for i in range(LANES)]
            for k in range(LANES):
                if not k & width:
                    a, b = rows[k], rows[k + width]
                    rows[k] = builder.shuffle_vector(a, b, _mask(low))
                    rows[k + width] = builder.shuffle_vector(a, b, _mask(high))
        for k, row in enumerate(rows):
            builder.store(row, place(3, args[4], args[5], k), align=8)
        return context.get_dummy_value()

    return sig, generate


# --- lanes --------------------------------------------------------------------------------------


def _mask(entries):
    return ir.Constant(ir.VectorType(_INDEX, len(entries)), entries)


@intrinsic
def spread(typing_context, number):
    """Return the same number in all lanes."""
    sig = float64s(types.float64)

    def generate(context, builder, sig, args):
        none = ir.Constant(_vector(1), ir.Undefined)
        first = builder.insert_element(none, args[0], _INDEX(0))
        return builder.shuffle_vector(first, none, _mask([0] * LANES))

    return sig, generate


def _repeater(rows):
    @intrinsic
    def repeat_rows(typing_context, value):
        """Return the same vector in all rows of a bundle."""
        sig = _BUNDLES[rows](float64s)

        def generate(context, builder, sig, args):
            none = ir.Constant(_vector(1), ir.Undefined)
            return builder.shuffle_vector(args[0], none, _mask([*range(LANES)] * rows))

        return sig, generate

    return repeat_rows


repeat2, repeat4, repeat8 = (_repeater(rows) for rows in (2, 4, 8))


@intrinsic(prefer_literal=True)
def row_of(typing_context, bundle, row):
    """Return one row (a literal number) of a bundle."""
    sig = float64s(bundle, row)

    def generate(context, builder, sig, args):
        none = ir.Constant(args[0].type, ir.Undefined)
        first = sig.args[1].literal_value * LANES
        return builder.shuffle_vector(args[0], none, _mask([*range(first, first + LANES)]))

    return sig, generate


@intrinsic
def stack2(typing_context, first, second):
    """Return two vectors as the rows of a bundle."""
    sig = _BUNDLES[2](float64s, float64s)

    def generate(context, builder, sig, args):
        return builder.shuffle_vector(args[0], args[1], _mask([*range(2 * LANES)]))

    return sig, generate


def _function(name, count):
    @intrinsic
    def unary(typing_context, value):
        return _call(name, value)

    @intrinsic
    def binary(typing_context, first, second):
        return _call(name, first, second)

    return unary if count == 1 else binary


def _call(name, *operands):
    sig = operands[0](*operands)

    def generate(context, builder, sig, args):
        kind = ir.FunctionType(args[0].type, [args[0].type] * len(args))
        full = f"llvm.{name}.v{args[0].type.count}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, full), args)

    return sig, generate


absolute, square_root = _function("fabs", 1), _function("sqrt", 1)
smaller, larger = _function("minimum", 2), _function("maximum", 2)  # NaN if one of them is


@intrinsic
def where_less(typing_context, a, b, chosen, other):
    """Lane by lane `chosen` where a < b, else `other`."""
    sig = float64s(float64s, float64s, float64s, float64s)

    def generate(context, builder, sig, args):
        return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[2], args[3])

    return sig, generate


@intrinsic
def lanes_less(typing_context, a, b):
    """Bit k of the result tells whether a < b in lane k."""
    sig = types.int64(float64s, float64s)

    def generate(context, builder, sig, args):
        flags = builder.fcmp_ordered("<", args[0], args[1])
        return builder.zext(builder.bitcast(flags, ir.IntType(LANES)), ir.IntType(64))

    return sig, generate


@intrinsic
def _quarter(typing_context, shifted, sine, cosine):
    """(sin, cos) of x + nπ/2 from those of x; n sits in the lowest bits of `shifted`."""
    sig = types.UniTuple(float64s, 2)(float64s, float64s, float64s)

    def generate(context, builder, sig, args):
        whole = _vector(1, ir.IntType(64))

        def number(value):
            return ir.Constant(whole, [value] * LANES)

        def flipped(value, turns):
            sign = builder.shl(builder.and_(turns, number(2)), number(62))
            bits = builder.xor(builder.bitcast(value, whole), sign)
            return builder.bitcast(bits, _vector(1))

        turns = builder.bitcast(args[0], whole)
        odd = builder.icmp_signed("!=", builder.and_(turns, number(1)), number(0))
        first = flipped(builder.select(odd, args[2], args[1]), turns)
        second = builder.select(odd, args[1], args[2])
        second = flipped(second, builder.add(turns, number(1)))
        return context.make_tuple(builder, sig.return_type, (first, second))

    return sig, generate


@njit(nogil=True, fastmath={"contract"}, _nrt=False)
def sincos(angle):
    """Sine and cosine of a vector of angles, |angle| < 1e5, to about one unit in the last place.

    Reduction by π/2 in three parts (Cody and Waite) and the minimax polynomials on [−π/4, π/4] of
    the freely distributable mathematics library FDLIBM (k_sin.c, k_cos.c). Adding 1.5 · 2⁵² rounds
    to a whole number and leaves it in the lowest bits.
    """
    magic = spread(6755399441055744.0)
    shifted = angle * spread(0.6366197723675814) + magic
    turns = shifted - magic
    x = angle - turns * spread(1.5707963267341256)
    x = x - turns * spread(6.077100506303966e-11)
    x = x - turns * spread(2.0222662487959506e-21)
    w = x * x
    s = spread(1.58969099521155010221e-10)
    s = s * w + spread(-2.50507602534068634195e-08)
    s = s * w + spread(2.75573137070700676789e-06)
    s = s * w + spread(-1.98412698298579493134e-04)
    s = s * w + spread(8.33333333332248946124e-03)
    s = s * w + spread(-1.66666666666666324348e-01)
    c = spread(-1.13596475577881948265e-11)
    c = c * w + spread(2.08757232129817482790e-09)
    c = c * w + spread(-2.75573143513906633035e-07)
    c = c * w + spread(2.48015872894767294178e-05)
    c = c * w + spread(-1.38888888888741095749e-03)
    c = c * w + spread(4.16666666666666019037e-02)
    cosine = spread(1.0) - spread(0.5) * w + w * w * c
    return _quarter(shifted, x + x * w * s, cosine)


@intrinsic
def prefetch(typing_context, array, position):
    """Ask for the cache line of a flat position of a C-ordered array ahead of its use."""
    sig = types.void(array, types.intp)

    def generate(context, builder, sig, args):
        place = _pointer(context, builder, sig.args[0], args[0], args[1], ir.IntType(8))
        kind = ir.FunctionType(ir.VoidType(), [place.type, *[_INDEX] * 3])
        full = "llvm.prefetch.p0i8" if not place.type.is_opaque else "llvm.prefetch.p0"
        function = cgutils.get_or_insert_function(builder.module, kind, full)
        builder.call(function, [place, _INDEX(0), _INDEX(3), _INDEX(1)])
        return context.get_dummy_value()

    return sig, generate
