"""What printed kernels call: powers of two and the parts of a float, as plain Python and as compiled bit operations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload, register_jitable

TINY = 2.0**-1022
RAISE = 2.0**54
LIMIT = 2000.0


def power_of_two(k: Any) -> Any:
    """2^k for a whole number k from -1022 to 1023."""
    return math.ldexp(1.0, int(k))


def bits_of(a: Any) -> Any:
    """The bits of a float64 as a whole number."""
    return int(np.float64(a).view(np.int64))


def float_of(bits: Any) -> Any:
    """The float64 of some bits."""
    return float(np.int64(bits).view(np.float64))


@intrinsic
def _to_bits(typingctx: Any, a: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), build


@intrinsic
def _from_bits(typingctx: Any, a: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.int64), build


@overload(bits_of, inline="always")
def _bits_of(a: Any) -> Any:
    def compiled(a: Any) -> Any:
        return _to_bits(np.float64(a))  # type: ignore[call-arg]

    return compiled


@overload(float_of, inline="always")
def _float_of(bits: Any) -> Any:
    def compiled(bits: Any) -> Any:
        return _from_bits(np.int64(bits))  # type: ignore[call-arg]

    return compiled


@overload(power_of_two, inline="always")
def _power_of_two(k: Any) -> Any:
    def compiled(k: Any) -> Any:
        return _from_bits(np.int64((np.int64(k) + 1023) << 52))  # type: ignore[call-arg]

    return compiled


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


def select(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`: one instruction, never a branch, so that loops stay vectors."""
    return a if condition else b


@intrinsic
def _select(typingctx: Any, condition: Any, a: Any, b: Any) -> Any:
    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        condition, a, b = arguments
        return builder.select(builder.trunc(condition, ir.IntType(1)) if condition.type.width > 1 else condition, a, b)

    return a(types.boolean, a, a), build


@overload(select, inline="always")
def _compiled_select(condition: Any, a: Any, b: Any) -> Any:
    def compiled(condition: Any, a: Any, b: Any) -> Any:
        return _select(condition, a, b)  # type: ignore[call-arg]  # Numba gives the context

    return compiled
