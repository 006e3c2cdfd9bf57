"""sin, cos, exp, log, pow and atan2 against NumPy in higher precision."""

import numpy as np
import pytest

from pointmass.tracing import functions as fn
from pointmass.tracing.trace import trace

RNG = np.random.default_rng(3)
ANGLES = np.concatenate([RNG.uniform(-10, 10, 4000), RNG.uniform(-1e5, 1e5, 2000), np.arange(-20, 21) * np.pi / 4])
POSITIVE = np.exp(RNG.uniform(-80, 80, 6000))
DTYPES = [np.float64, np.float32]


def ulps(result, exact):
    """Largest error in units of the last place."""
    rounded = np.abs(exact).astype(result.dtype)
    return float(np.max(np.abs(result.astype(np.longdouble) - exact) / np.spacing(rounded)))


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", ["sin", "cos"])
def test_sine_and_cosine(name, dtype):
    a = ANGLES[np.abs(ANGLES) < (1e6 if dtype == np.float64 else 1e4)].astype(dtype)
    result = getattr(fn, name)(a)
    exact = getattr(np, name)(a.astype(np.longdouble))
    assert result.dtype == dtype
    near_zero = np.abs(exact) < 1e-3  # there the error is absolute: it comes from the reduction of the angle
    assert ulps(result[~near_zero], exact[~near_zero]) < 3
    assert np.abs(result[near_zero] - exact[near_zero]).max() < 2 * np.finfo(dtype).eps


@pytest.mark.parametrize("dtype", DTYPES)
def test_exponential(dtype):
    a = RNG.uniform(-80, 80, 6000).astype(dtype)
    assert ulps(fn.exp(a), np.exp(a.astype(np.longdouble))) < 2


@pytest.mark.parametrize("dtype", DTYPES)
def test_logarithm(dtype):
    a = np.concatenate([POSITIVE, RNG.uniform(0.9, 1.1, 2000)]).astype(dtype)
    assert ulps(fn.log(a), np.log(a.astype(np.longdouble))) < 3


@pytest.mark.parametrize("dtype", DTYPES)
def test_angle_of_a_point(dtype):
    y, x = RNG.standard_normal((2, 6000)).astype(dtype)
    assert ulps(fn.atan2(y, x), np.arctan2(y.astype(np.longdouble), x)) < 3


@pytest.mark.parametrize("dtype", DTYPES)
def test_power(dtype):
    a, b = np.exp(RNG.uniform(-5, 5, 6000)).astype(dtype), RNG.uniform(-6, 6, 6000).astype(dtype)
    exact = a.astype(np.longdouble) ** b
    relative = np.abs(fn.pow(a, b) - exact) / exact
    assert (relative < 2 * np.finfo(dtype).eps * (1 + np.abs(b * np.log(a)))).all()


@pytest.mark.parametrize("dtype", DTYPES)
def test_sine_of_anything_finite_stays_within_one(dtype):
    a = np.logspace(3, 38, 500).astype(dtype)
    assert (np.abs(fn.sin(a)) <= 1).all()
    assert (np.abs(fn.cos(-a)) <= 1).all()


def test_special_values():
    inf, nan = np.inf, np.nan
    same = np.testing.assert_array_equal
    same(fn.exp(np.array([nan, inf, -inf, 1000, -1000, 0])), [nan, inf, 0, inf, 0, 1])
    same(fn.log(np.array([nan, inf, 0, -1, 1])), [nan, inf, -inf, nan, 0])
    same(fn.sin(np.array([nan, inf, -inf, 0])), [nan, nan, nan, 0])
    same(fn.cos(np.array([nan, inf, 0])), [nan, nan, 1])
    same(
        fn.atan2(np.array([0, 0, 1, -1, nan, 1.0]), np.array([0, 2, 0, 0, 1, inf])),
        [0, 0, *fn.atan2(np.array([1, -1.0]), 0.0), nan, 0],
    )
    assert fn.atan2(0.0, -1.0) == np.pi
    assert fn.atan2(1.0, 0.0) == np.pi / 2


@pytest.mark.parametrize("b", [-3.0, -2.0, 0.0, 1.0, 2.0, 3.0, 0.5, 101.0])
def test_power_of_special_values(b):
    a = np.array([-np.inf, -2.5, -1, 0, 1, 2.5, np.inf, np.nan])
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(fn.pow(a, np.array(b)), a**b, rtol=1e-13)


def test_exp_to_the_edges():
    assert np.isfinite(fn.exp(709.7))
    assert fn.exp(710.0) == np.inf
    assert 0 < fn.exp(-744.0) < 1e-320
    assert fn.exp(-746.0) == 0
    assert fn.exp(np.float32(89.0)) == np.inf
    assert fn.exp(np.float32(-104.0)) == 0


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log"])
def test_a_law_computes_the_same_bits_as_the_function(name, dtype):
    function = getattr(fn, name)
    a = RNG.uniform(0.1, 20, 500).astype(dtype)
    law = trace(function, {"x": "scalar"}, 1)
    np.testing.assert_array_equal(law.columns(a)[0], function(a))


def test_numbers_give_numbers():
    assert float(fn.sqrt(4.0)) == 2.0
    assert fn.where(True, 2.0, 3.0) == 2.0
    assert np.ndim(fn.where(True, 2.0, 3.0)) == 0
    assert fn.pow(-2.0, 3) == -8.0
    assert fn.pow(2.0, 3) == 8.0
