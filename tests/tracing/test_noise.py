"""Noise: the plain version, exact slopes, statistics in closed form, and places that have no cell."""

from __future__ import annotations

import sys
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import pointmass as pm
from pointmass.tracing.columns import source
from pointmass.tracing.noise import mean_square, noise_of, single
from pointmass.tracing.trace import trace

sys.path.append(str(Path(__file__).parents[1]))
import naive

RNG = np.random.default_rng(3)
PLACES = RNG.uniform(-50, 50, (4, 2000))
MANY = RNG.uniform(-500, 500, (4, 100_000))  # 1e5 cells: independent, nearly


def test_equals_the_plain_version():
    places = RNG.uniform(-5, 5, (4, 20))
    for seed in (0, 7, 2**24 - 1):
        still = [naive.noise(p, None, seed) for p in places[:3].T.tolist()]
        np.testing.assert_allclose(pm.noise(*places[:3], seed=seed), still, rtol=0, atol=1e-12)
        moving = [naive.noise(p[:3], p[3], seed) for p in places.T.tolist()]
        np.testing.assert_allclose(pm.noise(*places, seed=seed), moving, rtol=0, atol=1e-12)


def test_the_same_numbers_on_every_machine():
    assert float(pm.noise(0.25, 1.5, -3.75)).hex() == "-0x1.eb9a512aa167ep+0"
    assert float(pm.noise(0.25, 1.5, -3.75, 0.125, seed=5, octaves=3)).hex() == "-0x1.26822ae381e88p+0"


@pytest.mark.parametrize("orders", [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1), (1, 1, 0, 0), (0, 0, 1, 1)])
def test_slopes_equal_finite_differences(orders):
    h = 1e-5
    for axis in range(4):
        step = h * np.eye(4)[axis][:, None]
        up, down = (noise_of(0, orders).columns(*(PLACES + s), 0.0) for s in (step, -step))
        exact = noise_of(0, orders).derivative(axis).columns(*PLACES, 0.0)
        # the central difference is off by h^2/6 times a derivative of fifth order or less, which is below 5e4
        np.testing.assert_allclose((up - down) / (2 * h), exact, rtol=0, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2, 3])
def test_second_derivatives_are_continuous_between_cells(axis):
    places = PLACES.copy()
    if axis < 3:
        places[axis] = np.round(places[axis])
    for orders in ((2, 0, 0, 0), (1, 1, 0, 0), (0, 0, 2, 0), (0, 1, 0, 1), (0, 0, 0, 2)):
        step = 1e-8 * np.eye(4)[axis][:, None]
        a, b = (noise_of(0, orders).columns(*(places + s), 0.0) for s in (step, -step))
        np.testing.assert_allclose(a, b, rtol=0, atol=2e-8 * 1e3)  # third derivatives are below 1e3


def test_mean_0_and_root_mean_square_1():
    for timed in (False, True):
        places = MANY if timed else MANY[:3]
        for octaves in (1, 3):
            value = pm.noise(*places, octaves=octaves, gain=0.7, seed=1)
            # 1e5 values that are as good as independent: 5 standard errors, the square's being below sqrt(2/n)
            assert abs(value.mean()) < 5 / sqrt(1e5)
            assert (value**2).mean() == pytest.approx(1, abs=5 * sqrt(2e-5))
        for orders in ((1, 0, 0), (1, 0, 1), (0, 2, 0)):
            slope = noise_of(0, orders + (0,) * timed).columns(*places, 0.0)
            assert (slope**2).mean() == pytest.approx(mean_square(orders, timed), rel=5 * sqrt(4e-5))


def test_fields_of_other_seeds_components_and_times_are_independent():
    place = MANY[:3]
    fields = [pm.noise(*place), pm.noise(*place, seed=1), noise_of(1, (0, 0, 0)).columns(*place, 0.0)]
    fields += [pm.noise(*place, t, seed=2) for t in (0.0, 2.0)]  # a gradient lives for less than 2
    correlation = np.corrcoef(fields) - np.eye(5)
    assert np.abs(correlation).max() < 5 / sqrt(1e5)


def test_it_does_not_pulse():
    strength = [np.std(pm.noise(*MANY[:3], t)) for t in np.linspace(0, 1, 6)]
    np.testing.assert_allclose(strength, 1, rtol=0, atol=5 * sqrt(1e-5))


def test_places_without_a_cell():
    for bad in (np.nan, np.inf, -np.inf):
        assert np.isnan(pm.noise(bad, 0.5, 0.5))
        assert np.isnan(pm.noise(0.5, 0.5, 0.5, bad))
    far = 2.0**24  # the lattice repeats
    np.testing.assert_allclose(pm.noise(0.25 + far, 0.5, 0.5 - far), pm.noise(0.25, 0.5, 0.5), rtol=0, atol=1e-8)
    below, above = pm.noise(np.array([far - 1e-8, far + 1e-8]), 0.5, 0.25)
    assert abs(below - above) < 1e-6  # and goes on smoothly where it does


def test_float32_columns_stay_float32():
    value = pm.noise(*PLACES[:3].astype(np.float32))
    assert value.dtype == np.float32
    np.testing.assert_allclose(value, pm.noise(*PLACES[:3].astype(np.float32).astype(np.float64)), rtol=0, atol=1e-4)


def test_in_laws_and_formulas():
    law = trace(lambda x, t: pm.noise(*x, t, seed=3, octaves=2), {"x": "vector", "t": "scalar"}, 1)
    np.testing.assert_array_equal(law.columns(*PLACES)[0], pm.noise(*PLACES, seed=3, octaves=2))
    slopes = law.jacobian("x_y", "t").columns(*PLACES)
    step = np.array([0, 1e-6, 0, 0])[:, None]
    difference = (law.columns(*(PLACES + step))[0] - law.columns(*(PLACES - step))[0]) / 2e-6
    np.testing.assert_allclose(slopes[0], difference, rtol=0, atol=1e-7)
    flow = pm.ParticleSystem(pm.Particles(PLACES[:3].T), [pm.Flow(("noise(x, y, z, t, 7)", "0", "0"))])
    np.testing.assert_array_equal(flow.deriv_eval(0.5)[::3], pm.noise(*PLACES[:3], 0.5, seed=7))


def test_refusals():
    with pytest.raises(pm.InvalidInput, match="octaves of noise = 0 is not allowed"):
        pm.noise(0.0, 0.0, 0.0, octaves=0)
    with pytest.raises(pm.InvalidInput, match="gain of noise = -1"):
        pm.noise(0.0, 0.0, 0.0, octaves=2, gain=-1)
    with pytest.raises(pm.InvalidInput, match="takes 5 argument"):
        pm.Field(("noise(x, y)", "0", "0"))


def test_what_is_asked_at_one_place_is_computed_by_one_call():
    """Components share their hashes, and have the bits that each has alone."""
    x, y, z, t = np.random.default_rng(2).uniform(-5, 5, (4, 30))

    def law(x, y, z, t):
        return *(single((x, y, z), 7.0, k) for k in range(3)), single((t, y, z), 7.0)

    traced = trace(law, dict.fromkeys("xyzt", "scalar"), 4)
    assert source(traced.program, traced.inputs, "law").count("calls[") == 2
    alone = [
        *(noise_of(k, (0, 0, 0)).columns(x, y, z, 7.0) for k in range(3)),
        noise_of(0, (0, 0, 0)).columns(t, y, z, 7.0),
    ]
    np.testing.assert_array_equal(traced.columns(x, y, z, t), alone)
