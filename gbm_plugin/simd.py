"""Numba number types that hold a line of the cache, one value for each of eight fibers, or eight in a row of a field:
kernels read like scalar code, and every operation is one vector instruction (or two or four on narrower machines).

Arrays that kernels work on have the lanes last and contiguous: shape (rows, LANES), with LANES = 8 in double
precision, and (rows, 16) in single.

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
from numpy.typing import DTypeLike, NDArray

LINE = 64  # bytes of a line of the cache: an instruction that crosses its border takes twice as long
LANES = LINE // 8
_FUSE = ("contract",)  # multiply and add may become one instruction; NaN and signed zero keep their meaning


class LanesType(types.Type):
    """Numba type of one number of type `real` per lane."""

    def __init__(self, real: types.Float):
        self.real, self.count = real, LINE * 8 // real.bitwidth
        self.vector = ir.VectorType(ir.DoubleType() if real.bitwidth == 64 else ir.FloatType(), self.count)
        super().__init__(name=f"lanes{self.count}")


lanes, lanes_single = LanesType(types.float64), LanesType(types.float32)
_OF = {kind.real: kind for kind in (lanes, lanes_single)}


@register_model(LanesType)
class _LanesModel(PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, fe_type.vector)


def _splat(builder, scalar, vector):
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, _places([0] * vector.count))


def _places(numbers):
    return ir.Constant(ir.VectorType(ir.IntType(32), len(numbers)), list(numbers))


class _Symbol:
    """A value of lanes in a kernel that is being compiled; its operators write instructions at builder's place.

    Without a builder nothing is written: so the shape of a function's result is found.
    """

    def __init__(self, builder, value, kind):
        self.builder, self.value, self.kind = builder, value, kind

    def _of(self, number):
        """number (a symbol, or the same constant in every lane) as a vector."""
        if isinstance(number, _Symbol):
            return number.value
        return ir.Constant(self.kind.vector, [float(number)] * self.kind.count)

    def _new(self, value):
        return _Symbol(self.builder, value, self.kind)

    def _write(self, instruction, *operands, **options):
        if self.builder is None:
            return self
        operands = [self._of(number) for number in operands]
        return self._new(getattr(self.builder, instruction)(*operands, **options))

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
        name = f"llvm.sqrt.v{self.kind.count}f{self.kind.real.bitwidth}"
        form = ir.FunctionType(self.kind.vector, [self.kind.vector])
        function = cgutils.get_or_insert_function(self.builder.module, form, name)
        return self._new(self.builder.call(function, [self.value]))

    def select_less(self, left, right, then, otherwise):
        """then in the lanes where left < right, else otherwise."""
        if self.builder is None:
            return self
        less = self.builder.fcmp_ordered("<", self._of(left), self._of(right))
        return self._new(self.builder.select(less, self._of(then), self._of(otherwise)))


def _kind_of(kinds):
    """The type of lanes among the types of a call's arguments; that of double precision where there is none."""
    for kind in kinds:
        found = _kind_of(kind) if isinstance(kind, types.BaseTuple) else kind
        if found is lanes_single:
            return lanes_single
    return lanes


def _symbols(context, builder, kind, value, wanted):
    """An argument of a kernel's call as symbols: of lanes, a number (the same in all lanes), or tuples of these."""
    if isinstance(kind, types.BaseTuple):
        parts = [None] * len(kind) if builder is None else cgutils.unpack_tuple(builder, value)
        return tuple(_symbols(context, builder, k, part, wanted) for k, part in zip(kind, parts, strict=True))
    if isinstance(kind, types.Float) and builder is not None:
        value = _splat(builder, context.cast(builder, value, kind, wanted.real), wanted.vector)
    elif not isinstance(kind, LanesType | types.Float):
        raise TypeError(f"arithmetic of lanes takes lanes and floats, not {kind}")
    return _Symbol(builder, value, wanted)


def _type_of(result, wanted):
    """Numba type of the result of a function of symbols."""
    if isinstance(result, tuple):
        return types.BaseTuple.from_types([_type_of(part, wanted) for part in result])
    return wanted


def _values(context, builder, kind, result, wanted):
    if isinstance(result, tuple):
        parts = [_values(context, builder, k, part, wanted) for k, part in zip(kind, result, strict=True)]
        return context.make_tuple(builder, kind, parts)
    return _Symbol(builder, None, wanted)._of(result)


def arithmetic(function):
    """function, such that kernels can call it too: with lanes, floats and tuples of them."""

    def typer(*kinds):
        wanted = _kind_of(kinds)
        return _type_of(function(*(_symbols(None, None, kind, None, wanted) for kind in kinds)), wanted)

    typer.__signature__ = inspect.signature(function)
    type_callable(function)(lambda context: typer)

    @lower_builtin(function, types.VarArg(types.Any))
    def lower(context, builder, signature, arguments):
        wanted = _kind_of(signature.args)
        given = zip(signature.args, arguments, strict=True)
        result = function(*(_symbols(context, builder, kind, value, wanted) for kind, value in given))
        return _values(context, builder, signature.return_type, result, wanted)

    return function


def _operator(function, arguments):
    """Let kernels write function, one of Python's operators, between lanes, or lanes and numbers."""
    numbers = (LanesType, types.Float)

    def typer(*kinds):
        if any(isinstance(kind, LanesType) for kind in kinds) and all(isinstance(k, numbers) for k in kinds):
            return _kind_of(kinds)

    typer.__signature__ = inspect.Signature(
        [inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in "ab"[:arguments]]
    )
    type_callable(function)(lambda context: typer)

    def lower(context, builder, signature, values):
        given = zip(signature.args, values, strict=True)
        wanted = _kind_of(signature.args)
        return function(*(_symbols(context, builder, kind, value, wanted) for kind, value in given)).value

    for kind in _OF.values():
        pairs = [(kind,)] if arguments == 1 else [(kind, kind), (kind, types.Float), (types.Float, kind)]
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


def blank(*shape: int, kind: DTypeLike = float) -> NDArray:
    """Zeros (*shape, LANES), (*shape, 16) of single precision, every row of lanes in one line of the cache."""
    count = LINE // np.dtype(kind).itemsize
    size = math.prod(shape) * count
    room = np.zeros(size + count, kind)
    first = -room.ctypes.data % LINE // room.itemsize
    return room[first : first + size].reshape(*shape, count)


def _pointers(context, builder, array_type, array, i, count):
    """Where the rows of tuple i of an array of tuples of count lanes are."""
    data = context.make_array(array_type)(context, builder, array).data
    kind = _OF[array_type.dtype]
    first = builder.mul(i, ir.Constant(i.type, count * kind.count))
    for c in range(count):
        at = builder.add(first, ir.Constant(i.type, c * kind.count))
        yield builder.bitcast(builder.gep(data, [at]), kind.vector.as_pointer())


def _load(count):
    @intrinsic
    def load(typingctx, array, i):
        kind = _OF[array.dtype] if count == 1 else types.UniTuple(_OF[array.dtype], count)

        def codegen(context, builder, signature, args):
            values = [builder.load(at, align=8) for at in _pointers(context, builder, array, *args, count)]
            return values[0] if count == 1 else context.make_tuple(builder, kind, values)

        return kind(array, types.intp), codegen

    return load


def _store(count):
    @intrinsic
    def store(typingctx, array, i, value):
        kind = _OF[array.dtype] if count == 1 else types.UniTuple(_OF[array.dtype], count)

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


def _masked(builder, name, vector, result, place, mask, *before, after=()):
    """A call of llvm.masked.<name> for the lanes of a mask, of numbers that need not lie in one line."""
    bits = 64 if vector.element == ir.DoubleType() else 32
    arguments = [*before, place, ir.Constant(ir.IntType(32), bits // 8), mask, *after]
    form = ir.FunctionType(result, [argument.type for argument in arguments])
    name = f"llvm.masked.{name}.v{vector.count}f{bits}.p0"
    return builder.call(cgutils.get_or_insert_function(builder.module, form, name), arguments)


def _masked_load(builder, vector, place, mask):
    """0 in the other lanes, of whose places nothing is read."""
    return _masked(builder, "load", vector, vector, place, mask, after=[ir.Constant(vector, None)])


def _masked_store(builder, value, place, mask):
    return _masked(builder, "store", value.type, ir.VoidType(), place, mask, value)


@intrinsic
def load_part(typingctx, array, at, first, last):
    """Lanes first to last − 1 from the places at + first, … of an array as it lies in memory, of either precision; 0
    in the other lanes, of whose places nothing is read."""

    kind = ir.DoubleType() if array.dtype == types.float64 else ir.FloatType()
    numbers_type, vector = ir.VectorType(ir.IntType(64), LANES), ir.VectorType(kind, LANES)

    def codegen(context, builder, signature, args):
        array_, at, first, last = args
        data = context.make_array(array)(context, builder, array_).data
        place = builder.bitcast(builder.gep(data, [at]), vector.as_pointer())
        numbers = ir.Constant(numbers_type, list(range(LANES)))
        wanted = builder.and_(
            builder.icmp_signed(">=", numbers, _splat(builder, first, numbers_type)),
            builder.icmp_signed("<", numbers, _splat(builder, last, numbers_type)),
        )
        value = _masked_load(builder, vector, place, wanted)
        return value if kind == ir.DoubleType() else builder.fpext(value, lanes.vector)

    return lanes(array, types.intp, types.intp, types.intp), codegen


def _prefetch(write):
    @intrinsic
    def prefetch(typingctx, array, i):
        def codegen(context, builder, signature, args):
            place = next(_pointers(context, builder, signature.args[0], *args, 1))
            line = builder.bitcast(place, ir.IntType(8).as_pointer())
            number = ir.IntType(32)
            how = [number(int(write)), number(2), number(1)]  # into the second level, of data
            form = ir.FunctionType(ir.VoidType(), [line.type, *3 * [number]])
            function = cgutils.get_or_insert_function(builder.module, form, "llvm.prefetch.p0")
            builder.call(function, [line, *how])
            return context.get_dummy_value()

        return types.void(array, types.intp), codegen

    return prefetch


# have row i of an array of lanes brought near, to be read or to be written soon
prefetch, prefetch_to_write = _prefetch(False), _prefetch(True)


@intrinsic
def transpose(typingctx, source, first, step, target, into, stride):
    """As many rows of lanes as there are lanes, from row `first` of source on, every `step`: their lanes become rows of
    target, from `into` on, every `stride`."""
    kind = _OF[source.dtype]

    def codegen(context, builder, signature, args):
        def at(which, start, step):
            array, first, step = (args[i] for i in (which, start, step))
            for r in range(kind.count):
                row = builder.add(first, builder.mul(step, ir.Constant(step.type, r)))
                yield from _pointers(context, builder, signature.args[which], array, row, 1)

        rows = [builder.load(place, align=LINE // kind.count) for place in at(0, 1, 2)]
        every, bit = range(kind.count), 1
        while bit < kind.count:  # rows and lanes change places, a binary digit of their numbers at a time
            swapped = list(rows)
            for r in every:
                if not r & bit:
                    low, high = rows[r], rows[r | bit]
                    evens = [kind.count + (s ^ bit) if s & bit else s for s in every]
                    odds = [kind.count + s if s & bit else s | bit for s in every]
                    swapped[r] = builder.shuffle_vector(low, high, _places(evens))
                    swapped[r | bit] = builder.shuffle_vector(low, high, _places(odds))
            rows, bit = swapped, 2 * bit
        for place, row in zip(at(3, 4, 5), rows, strict=True):
            builder.store(row, place, align=LINE // kind.count)
        return context.get_dummy_value()

    return types.void(source, types.intp, types.intp, target, types.intp, types.intp), codegen


# so many complex numbers of a C-contiguous array, from its element i on, as their real and imaginary parts in lanes


def _some(context, builder, array_type, array, i, count):
    """For the two rows of lanes that hold complex numbers from element i on: where they are, and in which lanes."""
    kind = _OF[array_type.dtype.underlying_float]
    data = context.make_array(array_type)(context, builder, array).data
    first = builder.bitcast(builder.gep(data, [i]), kind.vector.as_pointer())
    numbers = ir.VectorType(i.type, kind.count)
    last = _splat(builder, builder.shl(count, ir.Constant(count.type, 1)), numbers)
    for row in range(2):
        lanes_of_row = ir.Constant(numbers, [row * kind.count + s for s in range(kind.count)])
        place = builder.gep(first, [ir.Constant(ir.IntType(32), row)])
        yield place, builder.icmp_signed("<", lanes_of_row, last)


@intrinsic
def load_complex(typingctx, array, i, count):
    """Real and imaginary parts of `count` numbers, no more than there are lanes; 0 in the other lanes."""
    kind = _OF[array.dtype.underlying_float]

    def codegen(context, builder, signature, args):
        low, high = (
            _masked_load(builder, kind.vector, place, mask)
            for place, mask in _some(context, builder, signature.args[0], *args)
        )
        parts = [
            builder.shuffle_vector(low, high, _places(range(part, 2 * kind.count, 2))) for part in (0, 1)
        ]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(kind, 2)(array, types.intp, types.intp), codegen


@intrinsic
def store_complex(typingctx, array, i, count, value):
    """The opposite of `load_complex`; value: real and imaginary parts."""
    kind = _OF[array.dtype.underlying_float]

    def codegen(context, builder, signature, args):
        re, im = cgutils.unpack_tuple(builder, args[3], 2)
        for row, (place, mask) in enumerate(_some(context, builder, signature.args[0], *args[:3])):
            lanes_of_row = range(row * kind.count // 2, (row + 1) * kind.count // 2)
            numbers = _places([kind.count * part + s for s in lanes_of_row for part in (0, 1)])
            values = builder.shuffle_vector(re, im, numbers)
            _masked_store(builder, values, place, mask)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, types.UniTuple(kind, 2)), codegen


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
