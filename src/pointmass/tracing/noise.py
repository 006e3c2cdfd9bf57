"""Gradient noise: a smooth random field of space and time, for laws, formulas and columns alike.

Perlin, Improving noise (SIGGRAPH 2002), with gradients from a hash in place of a table: whole numbers of 32 bits, which
vector lanes compute side by side. The field is C2, and its derivatives of any order are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cache, reduce
from itertools import product
from math import sqrt
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from pointmass.errors import number, whole_number
from pointmass.tracing.elementary import polynomial
from pointmass.tracing.functions import Number, floor, where
from pointmass.tracing.program import Function, Primitive, Program, Symbol
from pointmass.tracing.trace import Traced, trace

PERIOD = 2.0**24  # cells after which the lattice repeats: float32 knows no whole numbers beyond
FADE = Polynomial([0, 0, 0, 10, -15, 6])  # s(u): its first and second derivatives vanish at 0 and 1
PRIMES = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D)  # of x, y, z; those of xxHash
PRIME_OF_TIME, PRIME_OF_COMPONENT = 0x27D4EB2F, 0x165667B1
BITS = 10  # of each of the three numbers of a gradient
LEVELS = 2**BITS
OFFSETS = (0.37, 0.71, 0.23)  # from octave to octave, so that they do not all vanish at the same places
Cell = tuple[Symbol, Symbol, Number]  # the lattice points before and after a place, and where it is between them


def noise(
    x: Number, y: Number, z: Number, t: Number | None = None, *, seed: Number = 0, octaves: int = 1, gain: float = 0.5
) -> Number:
    """Gradient noise at a place and time: mean 0 and root mean square 1, in features of size 1.

    Each lattice point has a random gradient, which is another one after a time of 1 and changes smoothly in between, at
    a moment of its own, so that the field does not pulse.

    Parameters
    ----------
    x, y, z : place, in cells: divide by the size of the features.
    t : time, in lifetimes of a gradient; without it the field stands still.
    seed : whole numbers give independent fields.
    octaves : fields added up, each of features half as large as the one before.
    gain : amplitude of an octave relative to the one before.

    Notes
    -----
    Perlin, Improving noise (2002). It repeats after 2^24 cells.

    Examples
    --------
    >>> @pm.unary_force
    ... def gusts(x, v, m, t, strength=1.0):
    ...     return strength * pm.noise(x[0] / 2, x[1] / 2, x[2] / 2, t, octaves=3), 0.0, 0.0
    """
    octaves = whole_number("octaves of noise", octaves, at_least=1)
    gain = number("gain of noise", gain, at_least=0)
    places = [x, y, z] if t is None else [x, y, z, t]
    total: Number = 0.0
    for k in range(octaves):
        scaled = [2.0**k * p + k * o for p, o in zip(places, (*OFFSETS, 0.0), strict=False)]
        total = total + gain**k * single(scaled, seed + 65536.0 * k)
    return total / sqrt(sum(gain ** (2 * k) for k in range(octaves)))


def single(places: Sequence[Number], seed: Number, component: int = 0) -> Number:
    """One octave at x, y, z and perhaps t; components are independent fields that share the work."""
    return _call(noise_of(component, (0,) * len(places)), [*places, floor(seed)])


def draw(key: Number, index: Number, seed: Number, component: int = 0) -> Number:
    """A random number of mean 0 and variance 1, nearly normal (a sum of three), for whole numbers `index` and `seed`.

    Parameters
    ----------
    key : in [0, 1), such as the particle attribute `chance`: who draws.
    """
    return _call(draw_of(component), [key, floor(index), floor(seed)])


def _call(primitive: Primitive, arguments: Sequence[Number]) -> Number:
    """A primitive as a node of a program where an argument is a symbol, else its value."""
    for argument in arguments:
        if isinstance(argument, Symbol):
            nodes = [argument.lift(a) for a in arguments]
            return Symbol(argument.program, argument.program.call(primitive, *nodes))
    return primitive.columns(*arguments)


class Noise(Function):
    """One component of the noise at (x, y, z, seed) or (x, y, z, t, seed), or a derivative of it.

    Parameters
    ----------
    component : which of independent fields.
    orders : how often it is differentiated along x, y, z, and t where there is one.
    """

    def __init__(self, component: int, orders: tuple[int, ...]) -> None:
        self.component = component
        self.orders = orders

    @property
    def family(self) -> Hashable:
        return "noise", len(self.orders)

    def together(self, members: tuple[Noise, ...]) -> Traced:
        return _traced_noise(members)

    def inlined(self, *arguments: Symbol) -> Number:
        return _values((self,), arguments[:3], arguments[3:-1], arguments[-1])[0]

    def derivative(self, argument: int) -> Primitive:
        """The seed is rounded down, and its derivative is never asked for."""
        return noise_of(self.component, tuple(o + (k == argument) for k, o in enumerate(self.orders)))


@cache
def noise_of(component: int, orders: tuple[int, ...]) -> Noise:
    """The primitive, the same whenever it is asked for."""
    return Noise(component, orders)


class Draw(Function):
    """A random number at (key, index, seed).

    Parameters
    ----------
    component : which of independent numbers.
    """

    family = "draw"

    def __init__(self, component: int) -> None:
        self.component = component

    def together(self, members: tuple[Draw, ...]) -> Traced:
        return _traced_draws(members)

    def inlined(self, *arguments: Symbol) -> Number:
        return _draws((self,), *arguments)[0]


@cache
def draw_of(component: int) -> Draw:
    """The primitive, the same whenever it is asked for."""
    return Draw(component)


@cache
def _traced_noise(primitives: tuple[Noise, ...]) -> Traced:
    """Several components and derivatives as one program; all with time, or all without."""
    names = "xyzt"[: len(primitives[0].orders)]
    arguments = dict.fromkeys([*names, "seed"], "scalar")
    return trace(lambda *a: _values(primitives, a[:3], a[3:-1], a[-1]), arguments, len(primitives), "noise")


@cache
def _traced_draws(members: tuple[Draw, ...]) -> Traced:
    arguments = dict.fromkeys(("key", "index", "seed"), "scalar")
    return trace(lambda *a: _draws(members, *a), arguments, len(members), "draw")


def mean_square(orders: Sequence[int], timed: bool) -> float:
    """Mean square of a derivative along x, y, z of the noise over all places and times, in closed form."""
    return _mean_square(orders, timed) / _mean_square((0, 0, 0), timed)


# ----------------------------------------------------------------------------------------------------- whole numbers


class Whole(Primitive):
    """An operation on whole numbers of 32 bits, all of them words without sign.

    Products and sums are of 64 bits until they are cut, so that nothing overflows in plain Python; where each is cut at
    once, the compiler keeps to 32, and twice as many lanes.

    Attributes
    ----------
    text : the operation in a kernel, with {0}, {1} for operands and {real} for the precision.
    """

    def __init__(self, function: Callable[..., Any], text: str) -> None:
        self.function = function
        self.text = text

    def columns(self, *arguments: Any) -> Any:
        return self.function(*arguments)

    def __call__(self, *arguments: Symbol) -> Symbol:
        program: Program = arguments[0].program
        return Symbol(program, program.call(self, *(a.node for a in arguments)))


def mixed(h: Any) -> Any:
    """A hash of 32 bits to 32 bits (Wellons, Hash Prospector, 2018: lowbias32); what `h` has beyond is cut off."""
    h = np.uint32(h)
    h = np.uint32(np.uint64(h ^ (h >> np.uint32(16))) * np.uint64(0x21F0AAAD))
    h = np.uint32(np.uint64(h ^ (h >> np.uint32(15))) * np.uint64(0x735A2D97))
    return np.uint32(h ^ (h >> np.uint32(15)))


@cache
def _times(prime: int) -> Whole:
    return Whole(lambda i: np.uint32(np.uint64(i) * np.uint64(prime)), f"np.uint32({{0}} * np.uint64({prime}))")


@cache
def _plus(constant: int) -> Whole:
    return Whole(lambda h: np.uint32(h + np.uint64(constant)), f"np.uint32({{0}} + np.uint64({constant}))")


@cache
def _number(shift: int, bits: int) -> Whole:
    """Some bits of a hash as a float; the second operand says of which precision."""
    keep = 2**bits - 1
    return Whole(
        lambda h, like: ((h >> np.uint32(shift)) & np.uint32(keep)).astype(np.int32).astype(like.dtype),
        f"{{real}}(np.int32(({{0}} >> np.uint32({shift})) & np.uint32({keep})))",
    )


@cache
def _level(shift: int) -> Whole:
    """A number of a gradient, around 0, from ten bits of a hash.

    Kernels put them into those of a float32 from 1024 to 2048, which takes no conversion.
    """
    middle = 0.5 * (LEVELS - 1)
    low = 23 - BITS  # bit of the float32 where they go
    move = f"<< np.uint32({low - shift})" if shift <= low else f">> np.uint32({shift - low})"
    part = f"({{0}} {move}) & np.uint32({(LEVELS - 1) << low})"
    start = np.float32(LEVELS).view(np.uint32)
    return Whole(
        lambda h, like: _number(shift, BITS).function(h, like) - like.dtype.type(middle),
        f"({{real}}(np.uint32(({part}) | np.uint32({start})).view(np.float32)) - {{real}}({LEVELS + middle}))",
    )


WHOLE = Whole(lambda a: a.astype(np.int32).astype(np.uint32), "np.uint32(np.int32({0}))")
AFTER = Whole(
    lambda i: (i + np.uint32(1)) & np.uint32(0xFFFFFF), "np.uint32(({0} + np.uint32(1)) & np.uint32(0xFFFFFF))"
)
SUM = Whole(lambda a, b: np.uint32(np.uint64(a) + b), "np.uint32(np.uint64({0}) + {1})")
MIXED = Whole(mixed, "mixed({0})")


# ------------------------------------------------------------------------------------------------------- the program


def _values(primitives: Sequence[Noise], place: Any, time: Any, seed: Symbol) -> list[Number]:
    """Sum over the corners of the cell of the products of their gradients and the distances from them, faded."""
    cells = [_cell(a) for a in place]
    base = MIXED(_plus(PRIME_OF_COMPONENT)(_cell(seed)[0]))
    found: dict[tuple[int, int], dict[tuple[int, ...], list[Number]]] = {}
    hashes = {}
    for corner in product((0, 1), repeat=3):
        ends = (_times(prime)(cell[side]) for prime, cell, side in zip(PRIMES, cells, corner, strict=True))
        hashes[corner] = SUM(MIXED(reduce(SUM, [*ends, base])), base)
    for p in primitives:
        key = (p.component, p.orders[3] if time else 0)
        if key not in found:
            found[key] = {c: _gradient(h, *key, time, place[0]) for c, h in hashes.items()}
    return [_faded(found[p.component, p.orders[3] if time else 0], cells, p.orders, bool(time)) for p in primitives]


def _draws(members: Sequence[Draw], key: Symbol, index: Symbol, seed: Symbol) -> list[Number]:
    base = MIXED(_plus(PRIME_OF_COMPONENT)(_cell(seed)[0]))
    who = MIXED(SUM(_times(PRIMES[0])(_cell(PERIOD * key)[0]), base))
    when = SUM(SUM(who, base), _times(PRIME_OF_TIME)(_cell(index)[0]))
    result = []
    for member in members:
        h = MIXED(_plus(PRIME_OF_COMPONENT * (member.component + 1) % 2**32)(when))
        a, b, c = (_number(BITS * k, BITS)(h, key) for k in range(3))
        result.append(((a + b + c) - 1.5 * (LEVELS - 1)) * (1.0 / sqrt((LEVELS**2 - 1) / 4)))
    return result


def _cell(a: Symbol) -> Cell:
    whole = floor(a)
    index = whole - PERIOD * floor(whole * (1.0 / PERIOD))
    before = WHOLE(where(index >= 0.0, index, 0.0))  # NaN and infinity have none; they show in the part between
    return before, AFTER(before), a - whole


def _gradient(h: Symbol, component: int, order: int, time: Sequence[Symbol], like: Symbol) -> list[Number]:
    """The gradient of a lattice point, or a derivative of it in time: three whole numbers around 0."""
    own = _plus(PRIME_OF_COMPONENT * (component + 1) % 2**32)(h)
    levels = [_level(BITS * k) for k in range(3)]
    if not time:
        last = MIXED(own)
        return [level(last, like) for level in levels]
    moment = _number(8, 24)(h, like) * 2.0**-24
    before, after, part = _cell(time[0] + moment)
    first, second = (MIXED(SUM(own, _times(PRIME_OF_TIME)(k))) for k in (before, after))
    s = _power_series(FADE.deriv(order), part) if order else _power_series(FADE, part)
    result = []
    for level in levels:
        a = level(first, like)
        change = s * (level(second, like) - a)
        result.append(change if order else a + change)
    return result


def _faded(gradients: Any, cells: Sequence[Cell], orders: Sequence[int], timed: bool) -> Number:
    """The sum over the corners, axis by axis."""
    # For each axis and end: the fade, and the fade times the distance from the end.
    fades = [[_ends(cell[2], end, order) for end in (0, 1)] for cell, order in zip(cells, orders, strict=False)]
    (x0, x1), (y0, y1), (z0, z1) = fades

    def along_x(j: int, k: int) -> tuple[Number, Number, Number]:
        a, b = gradients[0, j, k], gradients[1, j, k]
        return x0[1] * a[0] + x1[1] * b[0], x0[0] * a[1] + x1[0] * b[1], x0[0] * a[2] + x1[0] * b[2]

    def along_y(k: int) -> tuple[Number, Number]:
        (ax, ay, az), (bx, by, bz) = along_x(0, k), along_x(1, k)
        return (y0[0] * ax + y0[1] * ay) + (y1[0] * bx + y1[1] * by), y0[0] * az + y1[0] * bz

    (a, az), (b, bz) = along_y(0), along_y(1)
    total = (z0[0] * a + z0[1] * az) + (z1[0] * b + z1[1] * bz)
    return total * (1.0 / sqrt(_mean_square((0, 0, 0), timed)))


def _ends(u: Number, end: int, order: int) -> tuple[Number, Number]:
    """Derivatives of the fade of an end, and of its product with the distance from the end."""

    def fade(k: int) -> Number:
        s = _power_series(FADE.deriv(k), u)
        return s if end else (-s if k else 1.0 - s)

    product = fade(order) * (u - float(end))
    return fade(order), product + order * fade(order - 1) if order else product


def _power_series(f: Polynomial, u: Number) -> Number:
    coefficients = f.trim().coef.tolist()
    low = next((k for k, c in enumerate(coefficients) if c), len(coefficients) - 1)
    rest = polynomial(coefficients[low:], u)
    return reduce(lambda a, b: a * b, [u] * low) * rest if low else rest


def _mean_square(orders: Sequence[int], timed: bool) -> float:
    """Mean square of a derivative, for gradients of whole numbers."""
    ends = [[1 - FADE, FADE], [(1 - FADE) * Polynomial([0, 1]), FADE * Polynomial([-1, 1])]]

    def square(kind: int, order: int) -> float:
        parts = [f.deriv(order) if order else f for f in ends[kind]]
        return float(sum((p * p).integ()(1.0) for p in parts))

    variance = (LEVELS**2 - 1) / 12
    total = sum(np.prod([square(int(a == b), orders[b]) for b in range(3)]) for a in range(3))
    return float(variance * total * (square(0, 0) if timed else 1.0))
