"""Parameters: numbers, columns, formulas of attributes, functions of t, and what is refused."""

import math

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter
from pointmass.particles import Particles
from pointmass.tracing import functions as fn

P = Particles(np.zeros((3, 3)), m=[1.0, 2.0, 3.0], radius=[0.1, 0.2, 0.3], charge=[5.0, 6.0, 7.0])
ROWS = np.array([0, 2])


@pytest.mark.parametrize(
    ("value", "expected", "constant", "common"),
    [
        (2, 2.0, True, True),
        (np.float32(2), 2.0, True, True),
        ("2*pi", 2 * math.pi, True, True),
        ("1 + t", 1.5, False, True),
        (lambda t: fn.sin(t) + 1, math.sin(0.5) + 1, False, True),
        (np.cos, math.cos(0.5), False, True),
        (lambda t: 3.0, 3.0, False, True),
        ([1.0, 2.0, 3.0], [1.0, 3.0], False, False),
        ("0.1*radius*t", [0.005, 0.015], False, False),
        ("charge + m + age", [6.0, 10.0], False, False),
    ],
)
def test_scalars(value, expected, constant, common):
    p = Parameter("k", value)
    p.check(P, 3, "particles")
    assert p.constant == constant
    assert p.common == common
    np.testing.assert_allclose(p.of(P, 0.5, ROWS)[0], expected, rtol=1e-15)
    np.testing.assert_allclose(np.broadcast_to(p.of(P, np.array([0.5, 0.5]), ROWS)[0], 2), expected, rtol=1e-15)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ((1, 2, 3), [1, 2, 3]),
        ([1, 2], [1, 2, 0]),
        (np.array([1.0, 2.0, 3.0]), [1, 2, 3]),
        (("t", "charge", 0), [0.5, [5.0, 7.0], 0]),
        (lambda t: (t, 2 * t, 1.0), [0.5, 1.0, 1.0]),
        (lambda t: (t, 1.0), [0.5, 1.0, 0.0]),
        (lambda t: np.array([t, t, 1.0]), [0.5, 0.5, 1.0]),
        ((lambda t: t, "2", 3), [0.5, 2, 3]),
        (np.arange(9.0).reshape(3, 3), [[0, 6], [1, 7], [2, 8]]),
    ],
)
def test_vectors(value, expected):
    p = Parameter("g", value, vector=True)
    p.check(P, 3, "particles")
    for got, want in zip(p.of(P, 0.5, ROWS), expected, strict=True):
        np.testing.assert_allclose(got, want)


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        (math.nan, "k = nan is not allowed: it must be finite and at least 0"),
        (-1, "k = -1 is not allowed"),
        ("-2*3", "k = -6.0 is not allowed"),
        ("1/0", "divides by zero"),
        ("1/sin(0)", "divides by zero"),
        ("t/0", "divides by zero"),
        (10**400, "k = inf is not allowed"),
        (lambda t: math.nan, "law 'k': it computes with nan"),
        (lambda t: t + math.nan, "law 'k': it computes with nan"),
        (lambda t: fn.log(-1.0), "law 'k': it computes with nan"),
        (lambda t: math.inf, "law 'k': it returns inf"),
        (lambda t: t / 0, "law 'k': it divides by zero"),
        (lambda t: t % 0, "law 'k': it divides by zero"),
        ([1, 2, math.inf], "entry 2 is inf"),
        ([1, -2, 3], "k = -2.0 is not allowed"),
        (None, "must be a number, not None"),
        ([[1], [1, 2]], "must be a number"),
        ("", "must be a formula"),
        (math.sin, "pm.sin"),
        (lambda t: (t, t, t), "must return 1 number"),
        (lambda t: None, "returned nothing"),
        (lambda: 1, "TypeError"),
    ],
)
def test_refused(value, hint):
    with pytest.raises(InvalidInput) as error:
        Parameter("k", value, at_least=0)
    assert hint in str(error.value)


@pytest.mark.parametrize(
    ("value", "hint"),
    [
        ("text", "three numbers or formulas"),
        (3.0, "three numbers or formulas"),
        ((1, 2, 3, 4), "three numbers or formulas"),
        ((1, math.nan, 3), "g.y = nan"),
        (lambda t: t, "returns three numbers, not 1"),
        (lambda t: (t, math.nan, t), "law 'g.y': it computes with nan"),
        (("t", "log(-1)", 0), ": log(-1) = nan"),
        (np.zeros((2, 2)), "must have shape"),
    ],
)
def test_refused_vectors(value, hint):
    with pytest.raises(InvalidInput) as error:
        Parameter("g", value, vector=True)
    assert hint in str(error.value)


def test_refused_by_the_particles():
    with pytest.raises(InvalidInput, match="unknown name in k '2\\*chrage': 'chrage': did you mean 'charge'"):
        Parameter("k", "2*chrage").check(P, 3, "particles")
    with pytest.raises(InvalidInput, match="k has 2 values for 3 particles"):
        Parameter("k", [1, 2]).check(P, 3, "particles")


@pytest.mark.parametrize(
    ("value", "t", "hint"),
    [
        ("1 - t", 2.0, "at t = 2 s, k = -1.0 is not allowed: it must be finite and at least 0 [N]"),
        (lambda t: 1 - t, 2.0, "at t = 2 s, k = -1.0 is not allowed"),
        ("log(t)", 0.0, "at t = 0 s, k = -inf is not allowed"),
        ("log(t - 1)", 0.0, "at t = 0 s, k = nan is not allowed"),
        ("charge - 6", 0.0, "at t = 0 s, k = -1.0 is not allowed"),
        ("1/age", 0.0, "at t = 0 s, k = inf is not allowed"),
    ],
)
def test_refused_when_evaluated(value, t, hint):
    p = Parameter("k", value, unit="N", at_least=0)
    p.check(P, 3, "particles")
    for clock in (t, np.array([t, t])):
        with pytest.raises(InvalidInput) as error:
            p.of(P, clock, ROWS)
        assert hint in str(error.value)


def test_a_rate_may_be_anything():
    assert Parameter("k", "sqrt(t)", at_least=0).rate().at(0.25) == (1.0,)
    assert Parameter("k", "1 - t", at_least=0).rate().at(0.25) == (-1.0,)
    assert np.isinf(Parameter("k", "log(1 + t)").rate().at(-1.0)[0])


def test_rate_is_exact():
    place = Parameter("center", ("sin(2*t)", lambda t: t**3, 4.0), vector=True)
    np.testing.assert_allclose(place.rate().at(0.3), [2 * math.cos(0.6), 0.27, 0], rtol=1e-14)
    np.testing.assert_allclose(place.rate().rate().at(0.3), [-4 * math.sin(0.6), 1.8, 0], rtol=1e-14)


def test_columns_follow_removal_and_precision():
    p = Parameter("k", [1.0, 2.0, 3.0])
    p.keep(np.array([True, False, True]))
    single = Particles(np.zeros((2, 3)), dtype=np.float32)
    (column,) = p.of(single, 0.0, np.arange(2))
    np.testing.assert_array_equal(column, np.float32([1, 3]))
    assert column.dtype == np.float32


def test_the_users_array_is_copied():
    mine = np.array([1.0, 2.0, 3.0])
    p = Parameter("k", mine)
    mine[:] = 9
    np.testing.assert_array_equal(p.of(P, 0.0, ROWS)[0], [1, 3])
