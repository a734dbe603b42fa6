"""Numbers of several vehicles side by side: one value of compiled code, one register of a
processor's vector unit.

A function written for single numbers is compiled a second time for values of this kind, as a C++
template is: arrays of them are indexed and sliced, records have them as fields, and each operation
rounds like the one of single numbers. Comparisons differ: they have an answer for each lane. So
code for both uses ``choose``, ``all_of`` and ``any_of`` in place of ``if``.
"""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing import signature
from numba.core.typing.templates import ConcreteTemplate, infer_global
from numba.extending import intrinsic, overload

# lanes in a register of the processor, 512 or 256 bits of doubles; machine code on disk is kept for
# each kind of processor
WIDTH = 8 if binding.get_host_cpu_features().get("avx512f", False) else 4

_ALIGNMENT = 8 * WIDTH
_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_TRUTHS = ir.VectorType(ir.IntType(1), WIDTH)


class _Lanes(types.Type):
    """``WIDTH`` doubles, or truth values of a comparison: a register of numbers of one type."""

    bitwidth = 64 * WIDTH  # doubles alone lie in memory

    def __init__(self, name: str, single: Any) -> None:
        self.single = single
        super().__init__(name=f"{name}{WIDTH}")

    def can_convert_from(self, _context: Any, other: Any) -> Any:
        return Conversion.safe if isinstance(other, self.single) else None

    def unify(self, _context: Any, other: Any) -> Any:
        return self if isinstance(other, self.single) else None


LANES, ANSWERS = _Lanes("lanes", types.Number), _Lanes("answers", types.Boolean)
_REGISTERS = {LANES: _VECTOR, ANSWERS: _TRUTHS}


@register_default(_Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, kind: Any) -> None:
        super().__init__(dmm, kind, _REGISTERS[kind])


def _splat(builder: Any, value: Any, kind: Any) -> Any:
    first = builder.insert_element(
        ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0)
    )
    return builder.shuffle_vector(
        first,
        ir.Constant(kind, ir.Undefined),
        ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH),
    )


@lower_cast(types.Number, _Lanes)
@lower_cast(types.Boolean, _Lanes)
def _to_lanes(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    single = types.float64 if wanted == LANES else types.boolean
    return _splat(builder, context.cast(builder, value, given, single), _REGISTERS[wanted])


def _define(
    function: Any, result: Any, operands: tuple[Any, ...], generate: Callable[..., Any]
) -> None:
    """Give a function of Python a meaning for lanes."""
    template = type(
        f"_{getattr(function, '__name__', 'lanes')}",
        (ConcreteTemplate,),
        {"cases": [signature(result, *operands)]},
    )
    infer_global(function)(template)

    @lower_builtin(function, *operands)
    def lower(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return generate(builder, *arguments)


for _name, _method in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _operator in (_name, f"i{_name}"):
        _define(
            getattr(operator, _operator),
            LANES,
            (LANES, LANES),
            lambda builder, a, b, method=_method: getattr(builder, method)(a, b),
        )
for _name, _sign in (("lt", "<"), ("le", "<="), ("gt", ">"), ("ge", ">="), ("eq", "==")):
    _define(
        getattr(operator, _name),
        ANSWERS,
        (LANES, LANES),
        lambda builder, a, b, sign=_sign: builder.fcmp_ordered(sign, a, b),
    )
_define(operator.and_, ANSWERS, (ANSWERS, ANSWERS), lambda builder, a, b: builder.and_(a, b))
_define(operator.or_, ANSWERS, (ANSWERS, ANSWERS), lambda builder, a, b: builder.or_(a, b))
_define(
    operator.neg,
    LANES,
    (LANES,),
    lambda builder, a: builder.fsub(ir.Constant(_VECTOR, [-0.0] * WIDTH), a),
)


for _function, _name in ((math.sqrt, "sqrt"), (math.floor, "floor"), (abs, "fabs")):
    _define(
        _function,
        LANES,
        (LANES,),
        lambda builder, a, name=f"llvm.{_name}.v{WIDTH}f64": builder.call(
            cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(_VECTOR, [_VECTOR]), name
            ),
            [a],
        ),
    )


def _of_library(name: str) -> Callable[..., Any]:
    """Return the generator of a function of C's library lane by lane: rare, and with the digits of
    single numbers.
    """

    def generate(builder: Any, *given: Any) -> Any:
        one = ir.DoubleType()
        kind = ir.FunctionType(one, [one] * len(given))
        function, out = cgutils.get_or_insert_function(builder.module, kind, name), given[0]
        for lane in range(WIDTH):
            place = ir.Constant(ir.IntType(32), lane)
            numbers = [builder.extract_element(values, place) for values in given]
            out = builder.insert_element(out, builder.call(function, numbers), place)
        return out

    return generate


_define(math.cos, LANES, (LANES,), _of_library("llvm.cos.f64"))
_define(math.sin, LANES, (LANES,), _of_library("llvm.sin.f64"))
_define(math.atan2, LANES, (LANES, LANES), _of_library("atan2"))
# finite: smaller than infinity in size; NaN is not
_define(
    math.isfinite,
    ANSWERS,
    (LANES,),
    lambda builder, a: builder.and_(
        builder.fcmp_ordered("<", a, ir.Constant(_VECTOR, [math.inf] * WIDTH)),
        builder.fcmp_ordered(">", a, ir.Constant(_VECTOR, [-math.inf] * WIDTH)),
    ),
)
# as numba orders single numbers
_extremes: tuple[tuple[Any, str], ...] = ((max, ">"), (min, "<"))
for _extreme, _sign in _extremes:
    _define(
        _extreme,
        LANES,
        (LANES, LANES),
        lambda builder, a, b, sign=_sign: builder.select(builder.fcmp_ordered(sign, b, a), b, a),
    )


def choose(condition: Any, a: Any, b: Any) -> Any:
    """Return ``a`` where the condition holds, else ``b``."""
    return a if condition else b


def opposite(condition: Any) -> Any:
    """Return whether a condition does not hold, for each lane."""
    return not condition


def all_of(condition: Any) -> bool:
    """Return whether a condition holds in all lanes."""
    return bool(condition)


def any_of(condition: Any) -> bool:
    """Return whether a condition holds in any lane."""
    return bool(condition)


_BITS = ir.IntType(WIDTH)
# with single numbers each runs as in Python
for _question in (choose, opposite, all_of, any_of):
    overload(_question, strict=False)(
        lambda *given, question=_question: None if ANSWERS in given else question
    )
for _kind in (LANES, ANSWERS):
    _define(choose, _kind, (ANSWERS, _kind, _kind), lambda builder, *given: builder.select(*given))
_define(opposite, ANSWERS, (ANSWERS,), lambda builder, a: builder.not_(a))
for _question, _sign, _least in ((all_of, "==", -1), (any_of, "!=", 0)):
    _define(
        _question,
        types.boolean,
        (ANSWERS,),
        lambda builder, a, sign=_sign, least=_least: builder.icmp_signed(
            sign, builder.bitcast(a, _BITS), _BITS(least)
        ),
    )


def first_column(numbers: Any, i: int) -> int:
    """Return the column from which on row ``i`` of a symmetric sum, of the size of ``numbers``
    (n, n), is worked out.

    With single numbers whole rows are computed, good for a vector unit. Lanes fill the unit anyway;
    below the diagonal are the numbers from above, bit for bit.
    """
    return 0


_BEYOND = 1 << 62  # a constant: compilers see then: no row of single numbers lies there


def first_below(numbers: Any, i: int) -> int:
    """Return the row from which on what was worked out in row ``i`` is to be put into column ``i``
    as well; with single numbers beyond the last.
    """
    return _BEYOND


overload(first_column, strict=False)(
    lambda numbers, i: (lambda numbers, i: i) if numbers.dtype == LANES else first_column
)
overload(first_below, strict=False)(
    lambda numbers, i: (lambda numbers, i: i + 1) if numbers.dtype == LANES else first_below
)


def lanes_by(singly: Callable[..., Any], lanes: Callable[..., Any]) -> Callable[..., Any]:
    """Return what compiled code calls one of two compiled functions of a record and a step in s by:
    ``singly`` for a record of single numbers, ``lanes`` for one with lanes.

    They do the same in another order of memory.
    """

    def call(f: Any, dt: Any) -> Any:
        return singly(f, dt)

    @overload(call, strict=False)
    def _call(f: Any, dt: Any) -> Any:
        if isinstance(f, _LaneRecord):
            return lambda f, dt: lanes(f, dt)
        return lambda f, dt: singly(f, dt)

    return call


def corners(table: Any, i: Any, j: Any) -> Any:
    """Return what stands in ``table`` (n, m), contiguous, at (i, j), (i, j + 1), (i + 1, j) and
    (i + 1, j + 1); i and j are whole numbers as floats, each lane's own, and inside of it.
    """
    k, m = int(i), int(j)
    return table[k, m], table[k, m + 1], table[k + 1, m], table[k + 1, m + 1]


@intrinsic
def _corners_in_lanes(_context: Any, table: Any, i: Any, j: Any) -> Any:
    def generate(context: Any, builder: Any, given: Any, arguments: Any) -> Any:
        array = context.make_array(given.args[0])(context, builder, arguments[0])
        columns = cgutils.unpack_tuple(builder, array.shape, 2)[1]
        width = _splat(builder, builder.sitofp(columns, ir.DoubleType()), _VECTOR)
        first = builder.fptosi(
            builder.fadd(builder.fmul(arguments[1], width), arguments[2]),
            ir.VectorType(columns.type, WIDTH),
        )
        out = [ir.Constant(_VECTOR, ir.Undefined)] * 4
        for lane in map(ir.IntType(32), range(WIDTH)):
            above = builder.extract_element(first, lane)
            for row, start in enumerate((above, builder.add(above, columns))):
                for side in range(2):
                    where = builder.gep(array.data, [builder.add(start, columns.type(side))])
                    corner = 2 * row + side
                    out[corner] = builder.insert_element(out[corner], builder.load(where), lane)
        return cgutils.pack_array(builder, out)

    return types.UniTuple(LANES, 4)(table, i, j), generate


overload(corners, strict=False)(
    lambda table, i, j: (
        (lambda table, i, j: _corners_in_lanes(table, i, j)) if LANES in (i, j) else corners
    )
)


class _LaneRecord(types.Record):
    """A record with some fields in lanes."""

    @property
    def dtype(self) -> np.dtype:
        """Type of the memory, as far as numba asks."""
        return np.dtype((np.void, self.size))


register_default(_LaneRecord)(models.RecordModel)


class LaneRecord:
    """Layout of a record like one of single numbers, with some of its fields in lanes.

    Args:
        single: the structured type of single numbers.
        lanes: names of the fields in lanes; the last axis has their ``WIDTH`` numbers.
        shared: names of the fields with single numbers, for all lanes.
        nested: layouts of the fields with records of lanes.
    """

    def __init__(
        self,
        single: np.dtype,
        lanes: Sequence[str],
        shared: Sequence[str] = (),
        nested: Mapping[str, "LaneRecord"] | None = None,
    ) -> None:
        self.dtype: np.dtype
        self.record: Any
        self._lanes, self._shared, self._nested = tuple(lanes), tuple(shared), dict(nested or {})
        nested = self._nested
        forms: dict[str, Any] = {}
        fields, offset = [], 0
        # lanes first: their addresses must be multiples of their size
        for name in (*nested, *lanes, *shared):
            kind = single[name]
            if name in nested:
                form, element = nested[name].dtype, nested[name].record
            elif name in lanes:
                form, element = np.dtype((np.float64, (*kind.shape, WIDTH))), LANES
            else:
                form, element = kind, from_dtype(kind.base)
            whole = types.NestedArray(element, kind.shape) if kind.shape else element
            fields.append((name, {"type": whole, "offset": offset}))
            forms[name] = (form, offset)
            offset += form.itemsize
        size = -(-offset // _ALIGNMENT) * _ALIGNMENT
        self.dtype = np.dtype(
            {
                "names": list(forms),
                "formats": [form for form, _ in forms.values()],
                "offsets": [where for _, where in forms.values()],
                "itemsize": size,
            }
        )
        self.record = record = _LaneRecord(fields, size, True)

        @intrinsic
        def at(_context: Any, address: Any) -> Any:
            def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
                return builder.inttoptr(arguments[0], context.get_value_type(record))

            return record(types.int64), generate

        self.at = at  # for compiled code: the record at an address

    def zeros(self, count: int) -> np.ndarray:
        """Return ``count`` records (count,) of zeros, where lanes may be loaded."""
        size = count * self.dtype.itemsize
        room = np.zeros(size + _ALIGNMENT, np.uint8)
        first = -room.ctypes.data % _ALIGNMENT
        return room[first : first + size].view(self.dtype)

    def write(self, records: Any, which: Any, lanes: Any, single: Any) -> None:
        """Write the numbers of a ``single`` record into some lanes of ``records[which]``."""
        for name in self._lanes:
            records[name][which][..., lanes] = np.asarray(single[name])[..., np.newaxis]
        for name, layout in self._nested.items():
            layout.write(records[name], which, lanes, single[name])

    def share(self, records: Any, single: Any) -> None:
        """Write the shared fields of a ``single`` record into all ``records``."""
        for name in self._shared:
            records[name] = single[name]
        for name, layout in self._nested.items():
            layout.share(records[name], single[name])

    def offset(self, *names: str) -> int:
        """Return how many bytes from a record's start a field lies, or a nested record's field."""
        first: int = self.dtype.fields[names[0]][1]  # type: ignore[index]
        return first + (self._nested[names[0]].offset(*names[1:]) if names[1:] else 0)

    def columns(self, records: np.ndarray) -> np.ndarray:
        """Return records (n,) as numbers (n, m, WIDTH): one lane in a column, beside some of the
        shared ones.
        """
        return records.view(np.float64).reshape(len(records), -1, WIDTH)

    def like(self, records: np.ndarray) -> np.ndarray:
        """Return a copy of records (n,) where lanes may be loaded; NumPy's own
        copies lie anywhere.
        """
        copy = self.zeros(len(records))
        copy[...] = records
        return copy
