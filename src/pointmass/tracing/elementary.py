"""sin, cos, exp, log, pow and atan2 as straight-line programs of +, *, floor and where.

Each reduces its argument to a small interval and sums a series there. The text is used twice: on arrays, and on symbols
when a program is printed, so that columns and compiled kernels round alike. Errors are one or two units in the last
place (`pow`: relative 1e-16 times |b log a|).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pointmass.tracing.functions import Number, absolute, floor, maximum, minimum, operation, where

# pi/2 in four parts whose products with a whole number are exact, in float32 as in float64 (Cody & Waite 1980)
HALF_PI = (1.5703125, 0.0004837512969970703, 7.549533620476723e-08, 2.563344151594519e-12)
LOG_2 = (0.693145751953125, 1.4286068203094173e-06)
SIN = [(-1.0) ** n / math.factorial(2 * n + 1) for n in range(9)]
COS = [(-1.0) ** n / math.factorial(2 * n) for n in range(9)]
EXP = [1.0 / math.factorial(n) for n in range(14)]
LOG = [2.0 / (2 * n + 1) for n in range(11)]
ATAN = [(-1.0) ** n / (2 * n + 1) for n in range(10)]


def polynomial(coefficients: Sequence[float], z: Number) -> Number:
    """Horner's rule, lowest coefficient first."""
    result = coefficients[-1]
    for c in reversed(coefficients[:-1]):
        result = result * z + c
    return result


def _quadrant(a: Number) -> tuple[Number, Number, Number]:
    """sin and cos of the part of `a` within pi/4 of a multiple k of pi/2, and k modulo 4."""
    k = floor(a * (2.0 / math.pi) + 0.5)
    r = (((a - k * HALF_PI[0]) - k * HALF_PI[1]) - k * HALF_PI[2]) - k * HALF_PI[3]
    z = r * r
    return r + r * (z * polynomial(SIN[1:], z)), polynomial(COS, z), k - 4.0 * floor(k * 0.25)


def _within_one(value: Number) -> Number:
    """An angle too large to be reduced gives any number, but not one beyond 1."""
    return minimum(maximum(value, -1.0), 1.0)


def sin(a: Number) -> Number:
    """Sine."""
    s, c, q = _quadrant(a)
    value = _within_one(where((q == 1.0) | (q == 3.0), c, s))
    return where(q >= 2.0, -value, value)


def cos(a: Number) -> Number:
    """Cosine."""
    s, c, q = _quadrant(a)
    value = _within_one(where((q == 1.0) | (q == 3.0), s, c))
    return where((q == 1.0) | (q == 2.0), -value, value)


def exp(a: Number) -> Number:
    """Exponential: 2^k e^r with |r| <= log(2)/2."""
    inside = minimum(maximum(a, -750.0), 710.0)
    k = floor(inside * (1.0 / math.log(2.0)) + 0.5)
    r = (inside - k * LOG_2[0]) - k * LOG_2[1]
    a_number = absolute(a) >= 0.0  # not NaN, which has no whole part
    return where(a_number, operation("ldexp", polynomial(EXP, r), where(a_number, k, 0.0)), a)


def log(a: Number) -> Number:
    """Logarithm: k log 2 + 2 artanh(s), s = (f - 1)/(f + 1), f in [sqrt(1/2), sqrt(2))."""
    f, k = operation("significand", a), operation("exponent", a)
    low = f < math.sqrt(0.5)
    f, k = where(low, 2.0 * f, f), where(low, k - 1.0, k)
    s = (f - 1.0) / (f + 1.0)
    z = s * s
    series = s * LOG[0] + s * (z * polynomial(LOG[1:], z))
    value = k * LOG_2[0] + (series + k * LOG_2[1])
    value = where(a == math.inf, math.inf, value)
    return where(a > 0.0, value, where(a == 0.0, -math.inf, math.nan))


def pow(a: Number, b: Number) -> Number:
    """exp(b log |a|), with a sign where a < 0 and b is whole."""
    value = exp(b * log(absolute(a)))
    sign = where(b == 2.0 * floor(0.5 * b), 1.0, where(b == floor(b), -1.0, math.nan))
    value = where(a < 0.0, sign * value, value)
    value = where(a == 0.0, where(b > 0.0, 0.0, math.inf), value)
    return where(b == 0.0, 1.0, value)


def atan2(y: Number, x: Number) -> Number:
    """Angle of (x, y): the ratio in [0, 1] is reduced by the nearest quarter."""
    ay, ax = absolute(y), absolute(x)
    big, small = maximum(ax, ay), minimum(ax, ay)
    a = small / where(big == 0.0, 1.0, big)
    c = floor(4.0 * a + 0.5) * 0.25
    base = where(c == 0.0, 0.0, where(c == 0.25, math.atan(0.25), where(c == 0.5, math.atan(0.5), 0.0)))
    base = where(c == 0.75, math.atan(0.75), where(c == 1.0, math.atan(1.0), base))
    r = (a - c) / (1.0 + a * c)
    z = r * r
    angle = base + (r + r * (z * polynomial(ATAN[1:], z)))
    angle = where(ay > ax, math.pi / 2 - angle, angle)
    angle = where(x < 0.0, math.pi - angle, angle)
    return where(y < 0.0, -angle, angle)


EXPANSIONS: dict[str, Callable[..., Number]] = {
    "sin": sin,
    "cos": cos,
    "exp": exp,
    "log": log,
    "pow": pow,
    "atan2": atan2,
}
