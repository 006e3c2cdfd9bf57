"""Formulas: what they mean, and that nothing but arithmetic gets in."""

import math
import time
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pointmass.errors import InvalidInput
from pointmass.laws.formula import DEEPEST, FUNCTIONS, LONGEST, Formula
from pointmass.tracing.trace import trace

PYTHON = {
    "sin": math.sin,
    "cos": math.cos,
    "abs": abs,
    "min": min,
    "max": max,
    "floor": math.floor,
    "sqrt": math.sqrt,
    "where": lambda c, a, b: a if c else b,
}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2**3", 8.0),
        ("(-1)**2", 1.0),
        ("-2**2", -4.0),
        ("2**-1", 0.5),
        ("4**0.5", 2.0),
        ("7 % 4", 3.0),
        ("1 if 2 < 3 else 4", 1.0),
        ("(1 < 2) - (2 < 1)", 1.0),
        ("where(1 != 1, 5, 6)", 6.0),
        ("min(1, 2) + max(1, 2)", 3.0),
        ("pi", math.pi),
        ("e", math.e),
        ("+x", 1.5),
        ("x*y + 1e3", 1003.0),
        ("atan2(0, -1)", math.pi),
        ("pow(x, 2)", 2.25),
    ],
)
def test_meaning(text, value):
    formula = Formula(text)
    values = {"x": 1.5, "y": 2.0}
    assert formula(values) == pytest.approx(value, rel=1e-15)
    arrays = {n: np.full(3, v) for n, v in values.items()}
    np.testing.assert_allclose(np.broadcast_to(formula(arrays), 3), value, rtol=1e-15)
    law = trace(lambda x, y: formula({"x": x, "y": y}), {"x": "scalar", "y": "scalar"}, 1)
    assert law.columns(1.5, 2.0)[0] == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("", "1 to 2000"),
        ("x" * (LONGEST + 1), "1 to 2000"),
        ("x +", "not a formula"),
        ("x\0", "not a formula"),
        ("x.real", "a dot"),
        ("__import__('os')", "unknown function"),
        ("f(x)", "unknown function"),
        ("(1).bit_length()", "functions of one's own"),
        ("lambda: x", "Lambda"),
        ("[x for x in y]", "ListComp"),
        ("'text'", "'text'"),
        ("True", "True"),
        ("1j", "1j"),
        ("a < b < c", "chained"),
        ("a and b", "BoolOp"),
        ("a @ b", "BinOp"),
        ("sin(x, y)", "takes 1 argument"),
        ("sin(x=1)", "but not"),
        ("sin(*x)", "Starred"),
        ("1e999", "above 1e308"),
        ("1" + "0" * 400, "above 1e308"),
        ("-" * 1500 + "x", f"more than {DEEPEST}"),
        ("+".join("x" * 500), f"more than {DEEPEST}"),
        ("(" * 500 + "x" + ")" * 500, "not a formula"),
        ("sine(x)", "did you mean 'sin'"),
        ("sin", "k 'sin': sin is a function, so write it with brackets: sin(x)"),
        ("2*atan2 + x", "atan2 is a function, so write it with brackets: atan2(x, y)"),
        ("where", "where(x, y, z)"),
        ("1/0", "divides by zero"),
        ("5 % 0", "divides by zero"),
        ("0**-1", "divides by zero"),
        ("pow(0, -1)", "divides by zero"),
        ("x/0", "divides by zero"),
        ("x % (1 - 1)", "divides by zero"),
        ("1 if x > 0 else 1/0", "divides by zero"),
        ("log(-1)", "'log(-1)' has a part that is not finite: log(-1) = nan"),
        ("x + sqrt(-1)", ": sqrt(-1) = nan"),
        ("0*log(0)", ": log(0) = -inf"),
        ("(-1)**0.5", ": (-1)**0.5 = nan"),
        ("1e308*10", ": 1e308*10 = inf"),
        ("exp(1000)*x", ": exp(1000) = inf"),
    ],
)
def test_refused(text, hint):
    with pytest.raises(InvalidInput) as error:
        Formula(text, what="k")
    assert hint in str(error.value)
    assert "\n" not in str(error.value).replace("\\n", "")


def test_a_tower_of_powers_is_refused_at_once():
    """Floats, not Python's whole numbers, which would grow until the memory ends."""
    start = time.perf_counter()
    for text in ("9**9**9**9", "-9**9**9", "x + 9**9**9**9", "9**" * 60 + "9"):
        with pytest.raises(InvalidInput, match=r"not finite: .* = inf"):
            Formula(text, what="k")
    assert time.perf_counter() - start < 1.0


def test_division_by_what_is_zero_only_now():
    with pytest.raises(InvalidInput, match="divides by zero"):
        Formula("1/x")({"x": 0.0})


def test_names():
    assert Formula("k*x + sin(pi*t)").names == {"k", "x", "t"}
    with pytest.raises(InvalidInput, match="unknown name in k 'radius \\+ chrage': 'chrage': did you mean 'charge'"):
        Formula("radius + chrage", ["charge", "radius"], what="k")
    with pytest.raises(InvalidInput, match=r"^unknown name in k: 'chrage': did you mean 'charge'"):
        Formula("chrage", ["charge", "radius"], what="k")


@settings(max_examples=300, deadline=None)
@given(st.one_of(st.text(max_size=60), st.text("x0123456789+-*/%().,<>=! sincoeft", max_size=40)))
def test_any_text_is_a_formula_or_an_error(text):
    with suppress(InvalidInput):
        formula = Formula(text)
        law = trace(lambda x: formula(dict.fromkeys(formula.names, x)), {"x": "scalar"}, 1)
        law.columns(np.array([0.0, 1.0, -1.0]))
        law.jacobian("x").columns(np.array([0.0, 1.0, -1.0]))


numbers = st.floats(0.25, 4.0).map(lambda v: repr(round(v, 3)))
leaves = st.one_of(numbers, st.sampled_from(["x", "y", "t", "pi"]))


def grown(inner):
    pair = st.tuples(inner, inner)
    return st.one_of(
        pair.map(lambda p: f"({p[0]} + {p[1]})"),
        pair.map(lambda p: f"({p[0]} - {p[1]})"),
        pair.map(lambda p: f"{p[0]} * {p[1]}"),
        inner.map(lambda a: f"-({a})"),
        inner.map(lambda a: f"({a})**2"),
        inner.map(lambda a: f"sin({a})"),
        inner.map(lambda a: f"abs({a})"),
        inner.map(lambda a: f"sqrt(abs({a}))"),
        pair.map(lambda p: f"min({p[0]}, {p[1]})"),
        pair.map(lambda p: f"(1 if {p[0]} < {p[1]} else 2)"),
        pair.map(lambda p: f"({p[0]}) / (1 + abs({p[1]}))"),
    )


@settings(max_examples=200, deadline=None)
@given(st.recursive(leaves, grown, max_leaves=8))
def test_value_is_that_of_python(text):
    values = {"x": 1.25, "y": -0.75, "t": 2.5}
    python = eval(text, {"__builtins__": {}, "pi": math.pi, **PYTHON}, values)
    formula = Formula(text)
    law = trace(lambda x, y, t: formula({"x": x, "y": y, "t": t}), dict.fromkeys("xyt", "scalar"), 1)
    traced = float(law.columns(*values.values())[0])
    assert float(formula(values)) == pytest.approx(python, rel=1e-9, abs=1e-9)
    assert traced == pytest.approx(python, rel=1e-9, abs=1e-9)


def test_every_function_is_documented():
    assert all(function.__doc__ for function, _ in FUNCTIONS.values())
