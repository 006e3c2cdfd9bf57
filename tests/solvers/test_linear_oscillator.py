"""Methods on x'' = -w^2 x, where a step is a known polynomial of y = w h."""

from __future__ import annotations

import numpy as np
import pytest
from solver_problems import energy, fixed, oscillator, run

START = [1.0, 0.0]


def test_euler_energy_grows_by_one_plus_y_squared():
    y = run(oscillator(), fixed("euler"), START, 0.1, 100)
    assert energy(y[-1]) == pytest.approx(1.01**100, rel=1e-11)


@pytest.mark.parametrize(
    ("name", "invariant"),
    [
        ("symplectic_euler", lambda x, v: v**2 + x**2 - 0.5 * x * v),
        ("leapfrog", lambda x, v: v**2 + x**2 * (1.0 - 0.5**2 / 4.0)),
    ],
)
def test_symplectic_invariants(name, invariant):
    y = run(oscillator(), fixed(name), START, 0.5, 10_000)
    values = invariant(*y.T)
    np.testing.assert_allclose(values, values[0], rtol=1e-10)


@pytest.mark.parametrize("name", ["symplectic_euler", "leapfrog"])
def test_symplectic_limit_is_two(name):
    assert np.abs(run(oscillator(), fixed(name), START, 1.99, 10_000)[:, 0]).max() < 100.0
    assert np.abs(run(oscillator(), fixed(name), START, 2.01, 200)[:, 0]).max() > 1e6


@pytest.mark.parametrize("name", ["symplectic_euler", "leapfrog"])
def test_symplectic_recurrence_gives_the_frequency(name):
    x = run(oscillator(), fixed(name), START, 0.5, 1000)[:, 0]
    np.testing.assert_allclose(x[2:] + x[:-2], (2.0 - 0.25) * x[1:-1], atol=1e-12, rtol=0.0)


def dormand_prince_ratio(y):
    return 1 - y**6 / 1800 + y**8 / 1600 - y**10 / 14400 + y**12 / 360000


@pytest.mark.parametrize(
    ("name", "ratio"),
    [
        ("midpoint", 1.015625),
        ("heun", 1.015625),
        ("rk4", 147425 / 147456),
        ("bs32", 2293 / 2304),
        ("dopri5", dormand_prince_ratio(0.5)),
    ],
)
def test_energy_ratio_of_one_step(name, ratio):
    y = run(oscillator(), fixed(name), START, 0.5, 1)
    assert energy(y[-1]) == pytest.approx(ratio, rel=1e-12)


def test_rk4_decays_below_its_limit_and_grows_above():
    below, above = (run(oscillator(), fixed("rk4"), START, h, 200) for h in (2.82, 2.84))
    assert energy(below[-1]) < 1.0 < energy(above[-1])


def test_implicit_euler_damps():
    y = run(oscillator(), fixed("implicit_euler"), START, 1.0, 10)
    assert energy(y[-1]) == pytest.approx(2.0**-10, rel=1e-10)


def test_implicit_midpoint_conserves_energy():
    y = run(oscillator(), fixed("implicit_midpoint"), START, 5.0, 1000)
    np.testing.assert_allclose(energy(y), 1.0, rtol=1e-10)


def test_symplectic_euler_with_explicit_drag():
    stable, unstable = (run(oscillator(1.0, 0.5), fixed("symplectic_euler"), START, h, 500) for h in (1.23, 1.25))
    assert abs(stable[-1, 0]) < 1e-3
    assert np.abs(unstable[:, 0]).max() > 1e6
