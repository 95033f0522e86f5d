"""A vector of eight doubles as a type inside compiled kernels.

The compiler cannot prove that the arrays of a kernel do not overlap, so it leaves loops over lanes
scalar; explicit vectors make one instruction serve eight lanes. Arrays that hold blocks of lanes
have a last axis of length 8 and are read and written by row: ``load(array, row)`` where `row`
counts along the flattened leading axes.
"""

import operator

from llvmlite import ir
from numba import njit
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 8


class Float64x8(types.Type):
    """Numba type of eight doubles in one vector."""

    def __init__(self) -> None:
        super().__init__(name="Float64x8")


float64x8 = Float64x8()
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FLAGS = ("contract",)


@register_model(Float64x8)
class _Float64x8Model(models.PrimitiveModel):
    def __init__(self, manager, front_end_type):
        super().__init__(manager, front_end_type, _VECTOR)


class _BinaryTemplate(ConcreteTemplate):
    cases = [signature(float64x8, float64x8, float64x8)]


def _register(function, instruction):
    infer_global(function)(type(f"Vector{instruction}", (_BinaryTemplate,), {}))

    @lower_builtin(function, float64x8, float64x8)
    def lower(context, builder, sig, args):
        return getattr(builder, instruction)(*args, flags=_FLAGS)


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _register(_function, _instruction)
    _inplace = getattr(operator, "i" + _function.__name__.strip("_"), None)
    if _inplace is not None:
        _register(_inplace, _instruction)


def _row_pointer(context, builder, array_type, array, row):
    data = cgutils.create_struct_proxy(array_type)(context, builder, value=array).data
    offset = builder.mul(row, ir.Constant(row.type, LANES))
    return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())


@intrinsic
def load(typing_context, array, row):
    """Row `row` of a C-ordered array whose last axis has eight entries."""
    sig = float64x8(array, types.intp)

    def generate(context, builder, sig, args):
        pointer = _row_pointer(context, builder, sig.args[0], args[0], args[1])
        return builder.load(pointer, align=8)

    return sig, generate


@intrinsic
def store(typing_context, array, row, value):
    """Write `value` into row `row` of a C-ordered array whose last axis has eight entries."""
    sig = types.void(array, types.intp, float64x8)

    def generate(context, builder, sig, args):
        pointer = _row_pointer(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return sig, generate


@intrinsic
def spread(typing_context, number):
    """Return the same number in all eight lanes."""
    sig = float64x8(types.float64)

    def generate(context, builder, sig, args):
        index = ir.IntType(32)
        first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), args[0], index(0))
        mask = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), mask)

    return sig, generate


def _unary(name):
    @intrinsic
    def function(typing_context, value):
        sig = float64x8(float64x8)

        def generate(context, builder, sig, args):
            kind = ir.FunctionType(_VECTOR, [_VECTOR])
            called = cgutils.get_or_insert_function(
                builder.module, kind, f"llvm.{name}.v{LANES}f64"
            )
            return builder.call(called, [args[0]])

        return sig, generate

    return function


absolute = _unary("fabs")
nearest = _unary("nearbyint")


@intrinsic
def choose_bit(typing_context, number, bit, chosen, other):
    """Lane by lane `chosen` where the integer-valued `number` has `bit` set, else `other`."""
    sig = float64x8(float64x8, types.int64, float64x8, float64x8)

    def generate(context, builder, sig, args):
        whole = ir.VectorType(ir.IntType(64), LANES)
        first = builder.insert_element(
            ir.Constant(whole, ir.Undefined), args[1], ir.IntType(32)(0)
        )
        mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        bits = builder.shuffle_vector(first, ir.Constant(whole, ir.Undefined), mask)
        masked = builder.and_(builder.fptosi(args[0], whole), bits)
        flag = builder.icmp_signed("!=", masked, ir.Constant(whole, [0] * LANES))
        return builder.select(flag, args[2], args[3])

    return sig, generate


@njit(nogil=True, cache=True, fastmath={"contract"})
def sincos(angle):
    """Sine and cosine of eight angles, |angle| < 1e5, to about one unit in the last place.

    Reduction by π/2 in three parts (Cody and Waite) and the minimax polynomials on [−π/4, π/4] of
    the freely distributable mathematics library FDLIBM (k_sin.c, k_cos.c).
    """
    turns = nearest(angle * spread(0.6366197723675814))
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
    sine = x + x * w * s
    c = spread(-1.13596475577881948265e-11)
    c = c * w + spread(2.08757232129817482790e-09)
    c = c * w + spread(-2.75573143513906633035e-07)
    c = c * w + spread(2.48015872894767294178e-05)
    c = c * w + spread(-1.38888888888741095749e-03)
    c = c * w + spread(4.16666666666666019037e-02)
    cosine = spread(1.0) - spread(0.5) * w + w * w * c
    sin_value = choose_bit(turns, 1, cosine, sine)
    cos_value = choose_bit(turns, 1, sine, cosine)
    zero = spread(0.0)
    sin_value = choose_bit(turns, 2, zero - sin_value, sin_value)
    cos_value = choose_bit(turns + spread(1.0), 2, zero - cos_value, cos_value)
    return sin_value, cos_value
