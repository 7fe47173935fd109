"""A Numba number type that holds one value for each of eight fibers: kernels read like scalar code, and every
operation is one vector instruction (or two or four on narrower machines).

Arrays that kernels work on have the lanes last and contiguous: shape (rows, LANES).
"""

import operator

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.datamodel import PrimitiveModel
from numba.extending import intrinsic, overload, register_model

LANES = 8
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_FUSE = ("contract",)  # multiply and add may become one instruction; NaN and signed zero keep their meaning


class LanesType(types.Type):
    """Numba type of one float64 per lane."""

    def __init__(self):
        super().__init__(name=f"lanes{LANES}")


lanes = LanesType()


@register_model(LanesType)
class _LanesModel(PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, _VECTOR)


def _row_pointer(context, builder, array_type, array, row):
    data = context.make_array(array_type)(context, builder, array).data
    offset = builder.mul(row, ir.Constant(row.type, LANES))
    return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())


@intrinsic
def load(typingctx, array, row):
    """The lanes in one row of a C-contiguous (rows, LANES) array."""

    def codegen(context, builder, signature, args):
        pointer = _row_pointer(context, builder, signature.args[0], *args)
        return builder.load(pointer, align=8)

    return lanes(array, types.intp), codegen


@intrinsic
def store(typingctx, array, row, value):
    """Write the lanes of one row of a C-contiguous (rows, LANES) array."""

    def codegen(context, builder, signature, args):
        pointer = _row_pointer(context, builder, signature.args[0], *args[:2])
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, lanes), codegen


def _splat(builder, scalar):
    vector = builder.insert_element(
        ir.Constant(_VECTOR, ir.Undefined), scalar, ir.Constant(ir.IntType(32), 0)
    )
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), None)
    return builder.shuffle_vector(vector, ir.Constant(_VECTOR, ir.Undefined), zeros)


@intrinsic
def splat(typingctx, scalar):
    """The same number in every lane."""

    def codegen(context, builder, signature, args):
        return _splat(builder, args[0])

    return lanes(types.float64), codegen


def _binary(symbol, instruction):
    @intrinsic
    def call(typingctx, left, right):
        def codegen(context, builder, signature, args):
            left, right = (
                value if isinstance(kind, LanesType) else _splat(builder, value)
                for kind, value in zip(signature.args, args, strict=True)
            )
            return getattr(builder, instruction)(left, right, flags=_FUSE)

        kinds = [kind if isinstance(kind, LanesType) else types.float64 for kind in (left, right)]
        return lanes(*kinds), codegen

    @overload(symbol)
    def implementation(left, right):
        if isinstance(left, LanesType) or isinstance(right, LanesType):
            return lambda left, right: call(left, right)


_binary(operator.add, "fadd")
_binary(operator.sub, "fsub")
_binary(operator.mul, "fmul")
_binary(operator.truediv, "fdiv")


@overload(operator.neg)
def _negative(value):
    if isinstance(value, LanesType):
        return lambda value: -1.0 * value


@intrinsic
def sqrt(typingctx, value):
    """Square root in every lane."""

    def codegen(context, builder, signature, args):
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR]), f"llvm.sqrt.v{LANES}f64"
        )
        return builder.call(function, args)

    return lanes(lanes), codegen


def _chosen(comparison):
    def codegen(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered(comparison, *args), *args)

    return lanes(lanes, lanes), codegen


@intrinsic
def larger(typingctx, left, right):
    """The larger number in every lane; the right one where either is NaN."""
    return _chosen(">")


@intrinsic
def smaller(typingctx, left, right):
    """The smaller number in every lane; the right one where either is NaN."""
    return _chosen("<")


@intrinsic
def select_less(typingctx, left, right, then, otherwise):
    """then in the lanes where left < right, else otherwise."""

    def codegen(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered("<", args[0], args[1]), args[2], args[3])

    return lanes(lanes, lanes, lanes, lanes), codegen


# three-vectors are tuples of three lane numbers


@njit(forceinline=True)
def load3(array, i):
    """Vector i of an array of vectors, rows 3 i … 3 i + 2."""
    return load(array, 3 * i), load(array, 3 * i + 1), load(array, 3 * i + 2)


@njit(forceinline=True)
def store3(array, i, v):
    """Write vector i of an array of vectors."""
    store(array, 3 * i, v[0])
    store(array, 3 * i + 1, v[1])
    store(array, 3 * i + 2, v[2])


@njit(forceinline=True)
def zero3():
    """The zero vector."""
    return splat(0.0), splat(0.0), splat(0.0)


@njit(forceinline=True)
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(forceinline=True)
def subtract(a, b):
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(forceinline=True)
def scale(c, a):
    """c a, c a number or lanes."""
    return c * a[0], c * a[1], c * a[2]


@njit(forceinline=True)
def add_scaled(a, c, b):
    """a + c b."""
    return a[0] + c * b[0], a[1] + c * b[1], a[2] + c * b[2]


@njit(forceinline=True)
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def cross(a, b):
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
