"""The functions that laws, formulas and parameters may use, for symbols, numbers and arrays alike.

`sin, cos, exp, log, pow, atan2` are polynomials of our own (`elementary`), so that both paths and all machines agree on
every bit; a C library's differ from one machine to the next and do not vectorise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.tracing.program import Symbol, Vector, power, three, whole_power

Number = Any  # a float, an array or a Symbol
Triple = tuple[Number, ...]  # a Vector, or any three numbers

NUMPY: dict[str, Callable[..., Any]] = {
    "sqrt": np.sqrt,
    "abs": np.abs,
    "floor": np.floor,
    "min": np.minimum,
    "max": np.maximum,
    "where": np.where,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "lt": np.less,
    "le": np.less_equal,
    "ldexp": lambda x, k: np.ldexp(x, np.asarray(k).astype(np.int32)),
    "significand": lambda x: np.frexp(x)[0],
    "exponent": lambda x: np.frexp(x)[1].astype(np.asarray(x).dtype),
}


def operation(name: str, *arguments: Number) -> Number:
    """`name` as an operation of the program where an argument is a symbol, else its value."""
    for argument in arguments:
        if isinstance(argument, Symbol):
            nodes = (argument.lift(a) for a in arguments)
            return Symbol(argument.program, argument.program.operation(name, *nodes))
        if isinstance(argument, (tuple, list)) and any(isinstance(a, Symbol) for a in argument):
            raise InvalidInput("a vector was used as a number: use pm.length(v), pm.dot(a, b) or v[0]")
    if name in NUMPY:
        with np.errstate(all="ignore"):
            return np.asarray(NUMPY[name](*arguments))[()]
    from pointmass.tracing.columns import elementary

    return elementary(name)(*arguments)[0]


def sqrt(a: Number) -> Number:
    """Square root; its derivative at 0 is taken as 0."""
    return operation("sqrt", a)


def sin(a: Number) -> Number:
    """Sine of an angle [rad]; full accuracy up to |a| of some 1e7 (float32: 1e4)."""
    return operation("sin", a)


def cos(a: Number) -> Number:
    """Cosine of an angle [rad]; full accuracy up to |a| of some 1e7 (float32: 1e4)."""
    return operation("cos", a)


def tan(a: Number) -> Number:
    """Tangent of an angle [rad]."""
    return sin(a) / cos(a)


def exp(a: Number) -> Number:
    """e to the power a."""
    return operation("exp", a)


def log(a: Number) -> Number:
    """Natural logarithm; NaN below 0, -inf at 0."""
    return operation("log", a)


def pow(a: Number, b: Number) -> Number:
    """`a` to the power `b`; NaN where a < 0 and b is not whole. A small whole number `b` is a product."""
    if isinstance(a, Symbol):
        return a**b
    if isinstance(b, (int, float)) and whole_power(b):
        return power(a, b)
    return operation("pow", a, b)


def atan2(y: Number, x: Number) -> Number:
    """Angle of the point (x, y) [rad], in [-pi, pi]; 0 at the origin."""
    return operation("atan2", y, x)


def absolute(a: Number) -> Number:
    """|a|."""
    return operation("abs", a)


def floor(a: Number) -> Number:
    """Largest whole number that is at most a."""
    return operation("floor", a)


def minimum(a: Number, b: Number) -> Number:
    """The smaller of two numbers."""
    return operation("min", a, b)


def maximum(a: Number, b: Number) -> Number:
    """The larger of two numbers."""
    return operation("max", a, b)


def where(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`: the `if` of a law. Vectors are taken component by component."""
    parts = (condition, a, b)
    traced = any(isinstance(p, Symbol) for p in parts)
    vectors = [isinstance(p, (tuple, list)) or (traced and isinstance(p, np.ndarray) and p.ndim > 0) for p in parts]
    if not any(vectors):
        return operation("where", *parts)
    triples = (three(p) if vector else (p, p, p) for p, vector in zip(parts, vectors, strict=True))
    return Vector(where(*each) for each in zip(*triples, strict=True))


def dot(a: Triple, b: Triple) -> Number:
    """Scalar product of two vectors."""
    a, b = three(a), three(b)
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Triple, b: Triple) -> Vector:
    """Vector product."""
    a, b = three(a), three(b)
    return Vector((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


def length(a: Triple) -> Number:
    """Length of a vector; its derivative at 0 is taken as 0."""
    return sqrt(dot(a, a))


def add(a: Triple, b: Triple) -> Vector:
    """a + b."""
    return Vector((a[0] + b[0], a[1] + b[1], a[2] + b[2]))


def sub(a: Triple, b: Triple) -> Vector:
    """a - b."""
    return Vector((a[0] - b[0], a[1] - b[1], a[2] - b[2]))


def scale(s: Number, a: Triple) -> Vector:
    """s a."""
    return Vector((s * a[0], s * a[1], s * a[2]))


def inverse(a: Number) -> Number:
    """1/a, and 0 where a is 0: the guard of every division by a length."""
    return where(a == 0.0, 0.0, 1.0 / where(a == 0.0, 1.0, a))
