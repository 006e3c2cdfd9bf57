"""The tracer: programs, their derivatives, and what users get to read when a law cannot be traced."""

import math

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.tracing import functions as fn
from pointmass.tracing.columns import columns, source
from pointmass.tracing.derivative import RULES, gradient
from pointmass.tracing.program import Program, Symbol
from pointmass.tracing.trace import trace

A = np.array([-2.3, -1.0, -0.4, 0.0, 0.3, 1.0, 1.7, 2.9])
B = np.array([1.3, -0.8, 0.6, 2.0, -1.1, 0.9, 3.0, -2.0])


def law(function, arguments="ab"):
    return trace(function, dict.fromkeys(arguments, "scalar"), None)


SMOOTH = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - 3.0 * b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a, b: -a * b,
    "abs": lambda a, b: abs(a - 0.1),
    "min": fn.minimum,
    "max": fn.maximum,
    "where": lambda a, b: fn.where(a < b, a * a, b * a),
    "sqrt": lambda a, b: fn.sqrt(a * a + b * b),
    "sin": lambda a, b: fn.sin(a * b),
    "cos": lambda a, b: fn.cos(a + b),
    "exp": lambda a, b: fn.exp(a * b),
    "log": lambda a, b: fn.log(2.5 + a * a + b),
    "pow": lambda a, b: fn.pow(a * a + 1.0, b),
    "atan2": lambda a, b: fn.atan2(a + 0.05, b),
}


def test_every_rule_is_tested():
    assert set(SMOOTH) == set(RULES)


@pytest.mark.parametrize("name", SMOOTH)
def test_derivative_equals_finite_differences(name):
    function = law(SMOOTH[name])
    h = 1e-6
    exact = function.jacobian("a", "b").columns(A, B)
    near = [
        (function.columns(A + h, B)[0] - function.columns(A - h, B)[0]) / (2 * h),
        (function.columns(A, B + h)[0] - function.columns(A, B - h)[0]) / (2 * h),
    ]
    for e, n in zip(exact, near, strict=True):
        np.testing.assert_allclose(np.broadcast_to(e, 8), n, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize(
    ("function", "at", "slope"),
    [
        (fn.sqrt, 0.0, 0.0),  # taken as 0: what makes a spring of length 0 harmless
        (lambda a: fn.sqrt(a * a), 0.0, 0.0),
        (lambda a: fn.atan2(a, a), 0.0, 0.0),
        (lambda a: a**2, -3.0, -6.0),
        (lambda a: a**3, -2.0, 12.0),
        (lambda a: a**-1, -2.0, -0.25),
        (lambda a: fn.operation("pow", a, 3.0), -2.0, 12.0),
        (lambda a: fn.operation("pow", a, 2.0), 0.0, 0.0),
        (lambda a: a**1.5, 0.0, 0.0),
        (lambda a: fn.floor(a) * a, 2.5, 2.0),
        (lambda a: (a > 1.0) * a, 2.5, 1.0),
        (lambda a: a % 2.0, 5.5, 1.0),
        (lambda a: fn.where(a == 0.0, 0.0, fn.sin(a) * fn.inverse(a)), 0.0, 0.0),
    ],
)
def test_derivative_at_the_edges(function, at, slope):
    (exact,) = law(function, "a").jacobian("a").columns(np.array([at]))
    assert np.ravel(exact)[0] == pytest.approx(slope, abs=1e-12)


def test_second_derivatives():
    function = law(lambda a, b: fn.exp(a * b) + a**3)
    second = function.jacobian("a").jacobian("a", "b").columns(0.5, 0.25)
    e = math.exp(0.125)
    np.testing.assert_allclose(second, [0.0625 * e + 3.0, e + 0.125 * e], rtol=1e-14)


def test_gradient_inside_a_law():
    function = trace(lambda x: gradient(fn.dot(x, x), x), {"x": "vector"}, 3)
    assert [float(v) for v in function.columns(1.0, 2.0, 3.0)] == [2.0, 4.0, 6.0]
    assert trace(lambda x: gradient(4.0, x), {"x": "vector"}, 3).columns(1.0, 2.0, 3.0) == (0.0, 0.0, 0.0)


def test_what_is_equal_is_computed_once():
    function = law(lambda a, b: (fn.sin(a) + b, fn.sin(a) - b))
    operations = [node[0] for node in function.program.nodes]
    assert operations.count("sin") == 1


def test_numbers_are_folded_and_zeros_dropped():
    function = law(lambda a, b: (0.0 * a + 1.0 * b, 2.0 * 3.0 + fn.sqrt(fn.Symbol(b.program, b.lift(4.0)))))
    assert "return (b, 8.0,)" in source(function.program, ("a", "b"), "f")


def test_folding_never_raises():
    def extreme(a, b):
        big = a * 0.0 + 1e308
        infinite = big * 10.0
        return (
            infinite - infinite,
            fn.floor(infinite),
            1.0 / (a * 0.0),
            fn.exp(infinite),
            fn.log(a * 0.0),
            fn.sin(big * 1e5),
        )

    program = Program()
    symbols = [Symbol(program, program.argument(name)) for name in "ab"]
    program.outputs = [result.node for result in extreme(*symbols)]
    result = columns(program, "ab")(A, B)
    np.testing.assert_array_equal(result, [np.nan, np.inf, np.inf, np.inf, -np.inf, np.nan])
    with pytest.raises(InvalidInput, match="it computes with nan"):
        law(extreme)


def test_conditions_are_numbers_and_numbers_are_conditions():
    function = law(
        lambda a, b: ((a > 0) - (a < 0), (a > 0) + (b > 0), fn.where(a, 1.0, 2.0), (a > 0) & b, ~(a > 0) | (b > 0))
    )
    sign, count, nonzero, both, either = function.columns(A, B)
    np.testing.assert_array_equal(sign, np.sign(A))
    np.testing.assert_array_equal(count, (A > 0).astype(int) + (B > 0))
    np.testing.assert_array_equal(nonzero, np.where(A != 0, 1.0, 2.0))
    np.testing.assert_array_equal(both, (A > 0) & (B != 0))
    np.testing.assert_array_equal(either, ~(A > 0) | (B > 0))
    assert all(np.asarray(r).dtype == float for r in (sign, count, nonzero, both, either))


def test_python_operators():
    function = law(lambda a, b: (a % 1.5, 7 % (a + 4), a // 2, 2**b, +a, abs(a), a != b, 3 - a, 3 / (b + 9)))
    expected = (A % 1.5, 7 % (A + 4), A // 2, 2**B, A, abs(A), A != B, 3 - A, 3 / (B + 9))
    for got, want in zip(function.columns(A, B), expected, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-14)


def test_numpy_in_laws():
    k, zero_dimensional = np.float64(2.0), np.array(3.0)
    function = law(
        lambda a, b: (
            k * a,
            k > a,
            np.sqrt(abs(a)),
            np.power(a, 2),
            np.maximum(a, b),
            zero_dimensional - a,
            np.arctan2(a, b),
        )
    )
    expected = (2 * A, A < 2, np.sqrt(abs(A)), A**2, np.maximum(A, B), 3 - A, np.arctan2(A, B))
    for got, want in zip(function.columns(A, B), expected, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-15)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, v: -2.0 * x + v / 2,
        lambda x, v: -(x - v * 0.5) - x,
        lambda x, v: -2.0 * np.array(x) + np.array(v) * 0.5,
        lambda x, v: fn.add(fn.scale(-2.0, x), fn.scale(0.5, v)),
        lambda x, v: [-2.0 * x[k] + 0.5 * v[k] for k in range(3)],
        lambda x, v: np.float64(-2.0) * x + np.array([0.5, 0.5, 0.5]) * np.array(v),
    ],
)
def test_vectors_in_laws(function):
    traced = trace(function, {"x": "vector", "v": "vector"}, 3)
    result = traced.columns(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    np.testing.assert_allclose(result, [0.0, -1.5, -3.0])


def test_numpy_products_of_vectors():
    traced = trace(
        lambda x, v: (np.dot(x, v), *np.cross(x, v), np.sqrt(np.dot(x, x)), np.linalg.norm(v)),
        {"x": "vector", "v": "vector"},
        6,
    )
    x, v = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 7.0])
    np.testing.assert_allclose(traced.columns(*x, *v), [x @ v, *np.cross(x, v), np.sqrt(x @ x), np.linalg.norm(v)])


def branching(a, b):
    return a if a > 0 else b


@pytest.mark.parametrize(
    ("function", "hint"),
    [
        (branching, "pm.where"),
        (min, "pm.minimum"),
        (lambda a, b: a > 0 and b, "pm.where"),
        (lambda a, b: np.where(a > 0, 1, 2), "pm.where"),
        (lambda a, b: math.sin(a), "pm.sin"),
        (lambda a, b: float(a), "pm.sin"),
        (lambda a, b: np.tanh(a), "cannot use np.tanh"),
        (lambda a, b: a + "text", "not with str"),
        (lambda a, b: 1 / 0, "ZeroDivisionError"),
        (lambda a, b: a.real, "AttributeError"),
        (lambda a, b: None, "returned nothing"),
        (lambda a, b: a[0], "TypeError"),
        (lambda a, b: list(a), "used as a vector"),
        (lambda a, b: fn.sqrt((a, b, a)), "pm.length"),
        (lambda a, b: "text", "must return numbers"),
        (lambda a, b: a * 10**400, "below 1e308"),
    ],
)
def test_laws_that_cannot_be_traced(function, hint):
    with pytest.raises(InvalidInput, match=r"^law ") as error:
        law(function)
    assert hint in str(error.value)


def test_products_of_two_vectors_are_named():
    with pytest.raises(InvalidInput, match=r"pm\.dot"):
        trace(lambda x: x * x, {"x": "vector"}, 3)


def test_a_symbol_of_another_law():
    kept = []
    law(lambda a, b: kept.append(a) or a)
    with pytest.raises(InvalidInput, match="another law"):
        law(lambda a, b: a + kept[0])


def test_two_inputs_of_one_name():
    with pytest.raises(InvalidInput, match="'x_y'"):
        trace(lambda x, x_y: x, {"x": "vector", "x_y": "scalar"}, 3)


def test_precision_is_kept():
    function = law(
        lambda a, b: (fn.where(a > 0, 1.0, 2.0) * b, fn.atan2(a, b), fn.exp(a) + 1e-9, (a > 0) * 2.0, fn.sqrt(2.0) * b)
    )
    for out in function.columns(A.astype(np.float32), 2.0):
        assert out.dtype == np.float32
    for out in function.columns(A, np.float64(2.0)):
        assert out.dtype == np.float64


def test_divisions_by_a_number_that_is_zero():
    assert law(lambda a, b: a / b).columns(1.0, 0.0)[0] == np.inf
