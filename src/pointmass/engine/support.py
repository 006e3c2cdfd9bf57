"""What printed kernels call: powers of two and the parts of a float, as plain Python and as compiled bit operations."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.typing.templates import infer, infer_global, make_intrinsic_template
from numba.extending import register_jitable

from pointmass.engine.threads import LINE
from pointmass.tracing import noise

TINY = 2.0**-1022
RAISE = 2.0**54
LIMIT = 2000.0


def compiled_as(function: Any) -> Callable[[Any], Any]:
    """That compiled code builds a call of a plain function itself, from types to instructions as with `intrinsic`.

    An overload that calls an intrinsic does the same, but Numba would put its body into each caller first, and search
    all of the caller for what that leaves over.
    """

    def registered(define: Any) -> Any:
        template = make_intrinsic_template(function, define, function.__name__)  # type: ignore[no-untyped-call]
        infer(template)  # type: ignore[no-untyped-call]
        infer_global(function, types.Function(template))  # type: ignore[no-untyped-call]
        return define

    return registered


def power_of_two(k: Any) -> Any:
    """2^k for a whole number k from -1022 to 1023."""
    return math.ldexp(1.0, int(k))


def bits_of(a: Any) -> Any:
    """The bits of a float64 as a whole number."""
    return int(np.float64(a).view(np.int64))


def float_of(bits: Any) -> Any:
    """The float64 of some bits."""
    return float(np.int64(bits).view(np.float64))


@compiled_as(bits_of)
def _bits_of(typing: Any, a: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), build


@compiled_as(float_of)
def _float_of(typing: Any, bits: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), build


@compiled_as(power_of_two)
def _power_of_two(typing: Any, k: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.IntType(64)
        return builder.bitcast(builder.shl(builder.add(arguments[0], number(1023)), number(52)), ir.DoubleType())

    return types.float64(types.int64), build


@register_jitable
def scaled(a: Any, k: Any) -> Any:
    """a 2^k, rounded once, for |a| around 1 and a whole number k: as np.ldexp."""
    whole = min(max(k, -LIMIT), LIMIT)
    half = np.floor(0.5 * whole)
    return type(a)(np.float64(a) * power_of_two(half) * power_of_two(whole - half))


@register_jitable
def significand(a: Any) -> Any:
    """f in [1/2, 1) with a = f 2^e: as np.frexp. 0, inf and NaN stay."""
    wide = np.float64(a)
    tiny = abs(wide) < TINY
    bits = bits_of(wide * RAISE if tiny else wide)
    special = wide == 0.0 or not abs(wide) < np.inf
    return type(a)(wide if special else float_of((bits & ~0x7FF0000000000000) | 0x3FE0000000000000))


@register_jitable
def exponent(a: Any) -> Any:
    """e with a = f 2^e, f in [1/2, 1); 0 for 0, inf and NaN."""
    wide = np.float64(a)
    tiny = abs(wide) < TINY
    bits = bits_of(wide * RAISE if tiny else wide)
    special = wide == 0.0 or not abs(wide) < np.inf
    e = ((bits >> 52) & 0x7FF) - 1022 - (54 if tiny else 0)
    return type(a)(0 if special else e)


mixed = register_jitable(noise.mixed)


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`: one instruction, never a branch, so that loops stay vectors."""
    return a if condition else b


@compiled_as(select)
def _select(typing: Any, condition: Any, a: Any, b: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        condition, a, b = arguments
        return builder.select(builder.trunc(condition, ir.IntType(1)) if condition.type.width > 1 else condition, a, b)

    return a(types.boolean, a, a), build


def columns(target: Any, o: Any, width: int, source: Any, rows: Any, q: Any, step: int) -> None:
    """Turn the first six numbers of eight records of eight into columns.

    Records are those of the rows[q], rows[q + step], ... of `source`. Columns go to `target` at o, o + width, ...
    """
    for j in range(8):
        record = 8 * int(rows[int(q) + j * step])
        for c in range(6):
            target[int(o) + c * width + j] = source[record + c]


def more_columns(target: Any, o: Any, width: int, source: Any, rows: Any, q: Any, step: int) -> None:
    """The same of the first seven numbers."""
    columns(target, o, width, source, rows, q, step)
    for j in range(8):
        target[int(o) + 6 * width + j] = source[8 * int(rows[int(q) + j * step]) + 6]


def put_back(target: Any, rows: Any, q: Any, step: int, source: Any, o: Any, width: int) -> None:
    """The way back for the first four numbers: columns of `source` into records of `target`."""
    for j in range(8):
        record = 8 * int(rows[int(q) + j * step])
        for c in range(4):
            target[record + c] = source[int(o) + c * width + j]


def added(target: Any, o: Any, source: Any, q: Any) -> None:
    """Add four numbers of `source` at q to those of `target` at o."""
    target[int(o) : int(o) + 4] += source[int(q) : int(q) + 4]


def subtracted(target: Any, o: Any, source: Any, q: Any) -> None:
    """Subtract four numbers of `source` at q from those of `target` at o."""
    target[int(o) : int(o) + 4] -= source[int(q) : int(q) + 4]


def streamed(target: Any, o: Any, source: Any) -> None:
    """Copy LINE bytes of numbers of `source` from o on to the same place of `target`, which nobody reads soon."""
    count = LINE // target.itemsize
    target[int(o) : int(o) + count] = source[int(o) : int(o) + count]


def _vector(context: Any, builder: Any, kind: Any, array: Any, index: Any, count: int) -> tuple[Any, int]:
    """Where some numbers of an array are, as a vector, and on what multiple of bytes they lie at least."""
    number = context.get_data_type(kind.dtype)
    place = builder.gep(context.make_array(kind)(context, builder, array).data, [index])
    return builder.bitcast(place, ir.VectorType(number, count).as_pointer()), context.get_abi_sizeof(number)


def _interleaved(builder: Any, a: Any, b: Any, size: int, high: bool) -> Any:
    """Groups of `size` numbers from two vectors of eight by turns: every other group, from the first or the second."""
    low = range(size * high, 8, 2 * size)
    mask = [8 * other + begin + k for begin in low for other in (0, 1) for k in range(size)]
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), 8), mask))


def _record(context: Any, builder: Any, kind: Any, array: Any, row: Any, count: int) -> tuple[Any, int]:
    """Where the first numbers of a record of eight are."""
    first = builder.mul(builder.sext(row, ir.IntType(64)), ir.IntType(64)(8))
    return _vector(context, builder, kind, array, first, count)


def _turn(function: Any, count: int) -> None:
    """Eight records into so many columns."""

    @compiled_as(function)
    def turned(typing: Any, target: Any, o: Any, width: Any, source: Any, rows: Any, q: Any, step: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            target, o, width, source, rows, q, step = arguments
            kinds = dict(zip(("target", "source", "rows"), (signature.args[k] for k in (0, 3, 4)), strict=True))
            places = context.make_array(kinds["rows"])(context, builder, rows).data
            vectors = []
            for j in range(8):
                row = builder.load(builder.gep(places, [builder.add(q, builder.mul(step, step.type(j)))]))
                place, align = _record(context, builder, kinds["source"], source, row, 8)
                vectors.append(builder.load(place, align=align))
            for size in (1, 2, 4):  # the halves of blocks of 2 size x 2 size numbers change places
                other = list(vectors)
                for a in range(8):
                    if not a & size:
                        other[a], other[a + size] = (
                            _interleaved(builder, vectors[a], vectors[a + size], size, high) for high in (False, True)
                        )
                vectors = other
            for c in range(count):
                at = builder.add(o, builder.mul(width, width.type(c)))
                place, align = _vector(context, builder, kinds["target"], target, at, 8)
                builder.store(vectors[c], place, align=align)
            return context.get_dummy_value()

        number = types.uintp
        return types.void(target, number, number, source, rows, number, number), build


_turn(columns, 6)
_turn(more_columns, 7)


@compiled_as(put_back)
def _put_back(typing: Any, target: Any, rows: Any, q: Any, step: Any, source: Any, o: Any, width: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, rows, q, step, source, o, width = arguments
        places = context.make_array(signature.args[1])(context, builder, rows).data
        vectors = []
        for c in range(4):
            at = builder.add(o, builder.mul(width, width.type(c)))
            place, align = _vector(context, builder, signature.args[4], source, at, 8)
            vectors.append(builder.load(place, align=align))
        for j in range(8):
            first, second = (_picked(builder, vectors[c], vectors[c + 1], (j, 8 + j)) for c in (0, 2))
            row = builder.load(builder.gep(places, [builder.add(q, builder.mul(step, step.type(j)))]))
            place, align = _record(context, builder, signature.args[0], target, row, 4)
            builder.store(_picked(builder, first, second, (0, 1, 2, 3)), place, align=align)
        return context.get_dummy_value()

    number = types.uintp
    return types.void(target, rows, number, number, source, number, number), build


def _picked(builder: Any, a: Any, b: Any, which: tuple[int, ...]) -> Any:
    """Some of the numbers of two vectors, one after the other."""
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(which)), list(which)))


def _change(function: Any, operation: str) -> None:
    @compiled_as(function)
    def changed(typing: Any, target: Any, o: Any, source: Any, q: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            target, o, source, q = arguments
            mine, align = _vector(context, builder, signature.args[0], target, o, 4)
            more, _ = _vector(context, builder, signature.args[2], source, q, 4)
            result = getattr(builder, operation)(builder.load(mine, align=align), builder.load(more, align=align))
            builder.store(result, mine, align=align)
            return context.get_dummy_value()

        return types.void(target, types.uintp, source, types.uintp), build


_change(added, "fadd")
_change(subtracted, "fsub")


@compiled_as(streamed)
def _streamed(typing: Any, target: Any, o: Any, source: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, o, source = arguments
        kind = signature.args[0]
        count = LINE // context.get_abi_sizeof(context.get_data_type(kind.dtype))
        place, align = _vector(context, builder, kind, target, o, count)
        there, _ = _vector(context, builder, signature.args[2], source, o, count)
        line = builder.load(there, align=align)
        number = ir.IntType(64)
        beyond = builder.and_(builder.ptrtoint(place, number), number(LINE - 1))
        with builder.if_else(builder.icmp_unsigned("==", beyond, number(0))) as (whole, parts):
            with whole:  # past the caches; the locks by which threads hand over work order it
                store = builder.store(line, place, align=LINE)
                store.set_metadata("nontemporal", builder.module.add_metadata([ir.IntType(32)(1)]))
            with parts:
                builder.store(line, place, align=align)
        return context.get_dummy_value()

    return types.void(target, types.uintp, source), build
