"""A Numba number type that holds eight numbers, one value for each of eight fibers, or eight in a row of a field:
kernels read like scalar code, and every operation is one vector instruction (or two or four on narrower machines).

Arrays that kernels work on have the lanes last and contiguous: shape (rows, LANES).

Formulas without loops or branches are plain Python functions marked `@arithmetic`. A kernel that calls one is
compiled with its instructions in place: the function is run once on symbols, whose operators write them. Numba
so has neither to infer, nor to compile, nor to inline them, which would take most of the time of compiling.
Everybody else calls the same function with numbers or NumPy arrays.
"""

import inspect
import math
import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import PrimitiveModel
from numba.extending import intrinsic, lower_builtin, register_model, type_callable
from numpy.typing import NDArray

LANES = 8
LINE = 64  # bytes of a line of the cache: an instruction that crosses its border takes twice as long
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


def _splat(builder, scalar):
    nothing = ir.Constant(ir.VectorType(scalar.type, LANES), ir.Undefined)
    vector = builder.insert_element(nothing, scalar, ir.Constant(ir.IntType(32), 0))
    zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), None)
    return builder.shuffle_vector(vector, nothing, zeros)


class _Symbol:
    """A value of lanes in a kernel that is being compiled; its operators write instructions at builder's place.

    Without a builder nothing is written: so the shape of a function's result is found.
    """

    def __init__(self, builder, value):
        self.builder, self.value = builder, value

    def _of(self, number):
        """number (a symbol, or the same constant in every lane) as a vector."""
        if isinstance(number, _Symbol):
            return number.value
        return ir.Constant(_VECTOR, [float(number)] * LANES)

    def _write(self, instruction, *operands, **options):
        if self.builder is None:
            return self
        operands = [self._of(number) for number in operands]
        return _Symbol(self.builder, getattr(self.builder, instruction)(*operands, **options))

    def __add__(self, other):
        return self._write("fadd", self, other, flags=_FUSE)

    def __radd__(self, other):
        return self._write("fadd", other, self, flags=_FUSE)

    def __sub__(self, other):
        return self._write("fsub", self, other, flags=_FUSE)

    def __rsub__(self, other):
        return self._write("fsub", other, self, flags=_FUSE)

    def __mul__(self, other):
        return self._write("fmul", self, other, flags=_FUSE)

    def __rmul__(self, other):
        return self._write("fmul", other, self, flags=_FUSE)

    def __truediv__(self, other):
        return self._write("fdiv", self, other, flags=_FUSE)

    def __rtruediv__(self, other):
        return self._write("fdiv", other, self, flags=_FUSE)

    def __neg__(self):
        return -1.0 * self

    def sqrt(self):
        """Square root in every lane."""
        if self.builder is None:
            return self
        function = cgutils.get_or_insert_function(
            self.builder.module, ir.FunctionType(_VECTOR, [_VECTOR]), f"llvm.sqrt.v{LANES}f64"
        )
        return _Symbol(self.builder, self.builder.call(function, [self.value]))

    def select_less(self, left, right, then, otherwise):
        """then in the lanes where left < right, else otherwise."""
        if self.builder is None:
            return self
        less = self.builder.fcmp_ordered("<", self._of(left), self._of(right))
        return _Symbol(self.builder, self.builder.select(less, self._of(then), self._of(otherwise)))


def _symbols(builder, kind, value):
    """An argument of a kernel's call as symbols: of lanes, a number (the same in all lanes), or tuples of these."""
    if isinstance(kind, types.BaseTuple):
        parts = [None] * len(kind) if builder is None else cgutils.unpack_tuple(builder, value)
        return tuple(_symbols(builder, k, part) for k, part in zip(kind, parts, strict=True))
    if isinstance(kind, types.Float) and builder is not None:
        value = _splat(builder, value)
    elif not isinstance(kind, LanesType | types.Float):
        raise TypeError(f"arithmetic of lanes takes lanes and floats, not {kind}")
    return _Symbol(builder, value)


def _kind(result):
    """Numba type of the result of a function of symbols."""
    if isinstance(result, tuple):
        return types.BaseTuple.from_types([_kind(part) for part in result])
    return lanes


def _values(context, builder, kind, result):
    if isinstance(result, tuple):
        parts = [_values(context, builder, k, part) for k, part in zip(kind, result, strict=True)]
        return context.make_tuple(builder, kind, parts)
    return _Symbol(builder, None)._of(result)


def arithmetic(function):
    """function, such that kernels can call it too: with lanes, floats and tuples of them."""

    def typer(*kinds):
        return _kind(function(*(_symbols(None, kind, None) for kind in kinds)))

    typer.__signature__ = inspect.signature(function)
    type_callable(function)(lambda context: typer)

    @lower_builtin(function, types.VarArg(types.Any))
    def lower(context, builder, signature, arguments):
        given = zip(signature.args, arguments, strict=True)
        result = function(*(_symbols(builder, kind, value) for kind, value in given))
        return _values(context, builder, signature.return_type, result)

    return function


def _operator(function, arguments):
    """Let kernels write function, one of Python's operators, between lanes, or lanes and numbers."""
    numbers = (LanesType, types.Float)

    def typer(*kinds):
        if any(isinstance(kind, LanesType) for kind in kinds) and all(isinstance(k, numbers) for k in kinds):
            return lanes

    typer.__signature__ = inspect.Signature(
        [inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in "ab"[:arguments]]
    )
    type_callable(function)(lambda context: typer)

    def lower(context, builder, signature, values):
        given = zip(signature.args, values, strict=True)
        return function(*(_symbols(builder, kind, value) for kind, value in given)).value

    pairs = [(lanes,)] if arguments == 1 else [(lanes, lanes), (lanes, types.Float), (types.Float, lanes)]
    for kinds in pairs:
        lower_builtin(function, *kinds)(lower)


for _function in (operator.add, operator.sub, operator.mul, operator.truediv):
    _operator(_function, 2)
_operator(operator.neg, 1)


@arithmetic
def splat(number):
    """The same number in every lane."""
    return number


@arithmetic
def sqrt(value):
    """Square root in every lane."""
    return value.sqrt() if isinstance(value, _Symbol) else np.sqrt(value)


@arithmetic
def select_less(left, right, then, otherwise):
    """then in the lanes where left < right, else otherwise."""
    for symbol in (left, right, then, otherwise):
        if isinstance(symbol, _Symbol):
            return symbol.select_less(left, right, then, otherwise)
    return np.where(np.less(left, right), then, otherwise)


@arithmetic
def larger(left, right):
    """The larger number in every lane; the right one where either is NaN."""
    return select_less(right, left, left, right)


@arithmetic
def smaller(left, right):
    """The smaller number in every lane; the right one where either is NaN."""
    return select_less(left, right, left, right)


# arrays of lanes, and of tuples of so many lanes


def blank(*shape: int) -> NDArray:
    """Zeros (*shape, LANES), every row of lanes in one line of the cache."""
    size = math.prod(shape) * LANES
    room = np.zeros(size + LINE // 8)
    first = -room.ctypes.data % LINE // 8
    return room[first : first + size].reshape(*shape, LANES)


def _pointers(context, builder, array_type, array, i, count):
    """Where the rows of tuple i of an array of tuples of count lanes are."""
    data = context.make_array(array_type)(context, builder, array).data
    first = builder.mul(i, ir.Constant(i.type, count * LANES))
    for c in range(count):
        at = builder.add(first, ir.Constant(i.type, c * LANES))
        yield builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())


def _load(count):
    @intrinsic
    def load(typingctx, array, i):
        kind = lanes if count == 1 else types.UniTuple(lanes, count)

        def codegen(context, builder, signature, args):
            values = [builder.load(at, align=8) for at in _pointers(context, builder, array, *args, count)]
            return values[0] if count == 1 else context.make_tuple(builder, kind, values)

        return kind(array, types.intp), codegen

    return load


def _store(count):
    @intrinsic
    def store(typingctx, array, i, value):
        kind = lanes if count == 1 else types.UniTuple(lanes, count)

        def codegen(context, builder, signature, args):
            values = [args[2]] if count == 1 else cgutils.unpack_tuple(builder, args[2], count)
            places = _pointers(context, builder, array, *args[:2], count)
            for at, part in zip(places, values, strict=True):
                builder.store(part, at, align=8)
            return context.get_dummy_value()

        return types.void(array, types.intp, kind), codegen

    return store


# row i of a C-contiguous (rows, LANES) array, and element i of arrays of vectors and matrices (3, 6, 9 rows each)
load, load3, load6, load9 = _load(1), _load(3), _load(6), _load(9)
store, store3, store6, store9 = _store(1), _store(3), _store(6), _store(9)


@intrinsic
def load_part(typingctx, array, at, first, last):
    """Lanes first to last − 1 from the places at + first, … of an array as it lies in memory, of either precision; 0
    in the other lanes, of whose places nothing is read."""

    kind = ir.DoubleType() if array.dtype == types.float64 else ir.FloatType()
    name = f"llvm.masked.load.v{LANES}f{array.dtype.bitwidth}.p0"

    def codegen(context, builder, signature, args):
        array_, at, first, last = args
        data = context.make_array(array)(context, builder, array_).data
        vector = ir.VectorType(kind, LANES)
        place = builder.bitcast(builder.gep(data, [at]), vector.as_pointer())
        numbers = ir.Constant(ir.VectorType(at.type, LANES), list(range(LANES)))
        wanted = builder.and_(
            builder.icmp_signed(">=", numbers, _splat(builder, first)),
            builder.icmp_signed("<", numbers, _splat(builder, last)),
        )
        align, none = ir.Constant(ir.IntType(32), array.dtype.bitwidth // 8), ir.Constant(vector, None)
        function = ir.FunctionType(vector, [place.type, align.type, wanted.type, vector])
        call = cgutils.get_or_insert_function(builder.module, function, name)
        value = builder.call(call, [place, align, wanted, none])
        return value if kind == ir.DoubleType() else builder.fpext(value, _VECTOR)

    return lanes(array, types.intp, types.intp, types.intp), codegen


# three-vectors are tuples of three lane numbers


@arithmetic
def zero3():
    """The zero vector."""
    return 0.0, 0.0, 0.0


@arithmetic
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@arithmetic
def subtract(a, b):
    """a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@arithmetic
def scale(c, a):
    """c a, c a number or lanes."""
    return c * a[0], c * a[1], c * a[2]


@arithmetic
def add_scaled(a, c, b):
    """a + c b."""
    return a[0] + c * b[0], a[1] + c * b[1], a[2] + c * b[2]


@arithmetic
def dot(a, b):
    """a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@arithmetic
def cross(a, b):
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
