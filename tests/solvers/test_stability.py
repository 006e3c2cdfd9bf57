"""Stability limits, found by running the solvers."""

from __future__ import annotations

import numpy as np
import pytest
from solver_problems import fixed

from pointmass.solvers import (
    SOLVERS,
    DormandPrince,
    ImplicitEuler,
    amplification,
    largest_safe_step,
    largest_safe_steps,
)

UNDAMPED = {
    "euler": 0.0,
    "midpoint": 0.0,
    "heun": 0.0,
    "symplectic_euler": 2.0,
    "leapfrog": 2.0,
    "bs32": 3.0**0.5,
    "rk4": 8.0**0.5,
    "dopri5": 0.99719,
    "implicit_euler": np.inf,
    "implicit_midpoint": np.inf,
    "bdf2": np.inf,
}
DECAY = {"euler": 2.0, "midpoint": 2.0, "heun": 2.0, "bs32": 2.5127, "rk4": 2.7853, "dopri5": 3.3066}


@pytest.mark.parametrize("name", UNDAMPED)
def test_undamped_oscillator(name):
    measured = largest_safe_step(fixed(name), 9.0, 0.0)
    assert measured == pytest.approx(UNDAMPED[name] / 3.0, rel=1e-4)


@pytest.mark.parametrize("name", DECAY)
def test_decay(name):
    assert largest_safe_step(fixed(name), 0.0, 5.0) == pytest.approx(DECAY[name] / 5.0, rel=1e-4)


def test_damped_oscillator():
    mode = 4.0, 2.0  # omega 2, zeta 0.5
    assert largest_safe_step(fixed("euler"), *mode) == pytest.approx(0.5, rel=1e-6)
    assert largest_safe_step(fixed("symplectic_euler"), *mode) == pytest.approx((5.0**0.5 - 1.0) / 2.0, rel=1e-6)


def test_critical_damping():
    limit = 2.0 * (2.0**0.5 - 1.0)
    assert largest_safe_step(fixed("symplectic_euler"), 1.0, 2.0) == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "limit"),
    [("rk4", 8.0**0.5), ("symplectic_euler", 0.0), ("leapfrog", 128e-9 ** (1 / 6)), ("implicit_midpoint", np.inf)],
)
def test_a_charge_in_a_magnetic_field(name, limit):
    """x'' = -i g x': the velocity turns by g h; a plain kick makes it longer, two passes of leapfrog by (g h)^6/128."""
    assert largest_safe_step(fixed(name), 0.0, 3.0j) == pytest.approx(limit / 3.0, rel=1e-4)


def test_the_fastest_mode_decides():
    assert largest_safe_step(fixed("leapfrog"), [1.0, 1600.0, 0.0], 0.0) == pytest.approx(0.05, rel=1e-6)


@pytest.mark.parametrize("name", SOLVERS)
def test_nothing_to_amplify_is_no_limit(name):
    assert largest_safe_step(fixed(name), [0.0, -4.0], [0.0, 0.0]) == np.inf


def test_adaptive_solvers_bound_their_own_step():
    assert largest_safe_step(DormandPrince(), 1e12, 0.0) == np.inf


def test_amplification():
    np.testing.assert_allclose(amplification(ImplicitEuler, 1.0, 0.0, [0.5, 2.0]), [0.8**0.5, 0.2**0.5], rtol=1e-12)
    assert amplification(SOLVERS["euler"], 2.0, 0.0, 0.1) == pytest.approx(1.04**0.5, rel=1e-14)


def test_bdf2_damps_less_than_backward_euler():
    """Per step at w h = 0.1: largest root of (3/2 - h l) r^2 - 2 r + 1/2, with l = i."""
    root = np.abs(np.roots([1.5 - 0.1j, -2.0, 0.5])).max()
    assert amplification(SOLVERS["bdf2"], 1.0, 0.0, 0.1) == pytest.approx(root, rel=1e-12)
    assert root == pytest.approx(0.99998, abs=1e-5)


@pytest.mark.parametrize("name", ["symplectic_euler", "leapfrog", "rk4", "euler", "heun", "implicit_euler"])
def test_limits_of_many_modes_are_those_of_each(name):
    """A few different damping ratios are tried; of many those in between are interpolated.

    Where two real eigenvalues meet (zeta = 1) a growth of 1e-9 moves the limit by some 1e-5.
    """
    rng = np.random.default_rng(2)
    zeta, omega = rng.choice([0.0, 0.1, 0.5, 1.0, 3.0], 400), rng.uniform(0.1, 50.0, 400)
    limits = largest_safe_steps(fixed(name), omega**2, 2 * zeta * omega)
    for k in range(0, 400, 40):
        assert limits[k] == pytest.approx(
            largest_safe_step(fixed(name), omega[k] ** 2, 2 * zeta[k] * omega[k]), rel=1e-4
        )
    zeta = rng.uniform(0.02, 2.0, 400)
    limits = largest_safe_steps(fixed(name), omega**2, 2 * zeta * omega)
    for k in range(0, 400, 40):
        assert limits[k] == pytest.approx(
            largest_safe_step(fixed(name), omega[k] ** 2, 2 * zeta[k] * omega[k]), rel=5e-3
        )


def test_many_modes_that_do_not_move_or_push_apart_have_no_limit():
    np.testing.assert_array_equal(largest_safe_steps(fixed("rk4"), [0.0, -4.0], [0.0, 0.0]), [np.inf, np.inf])
    assert largest_safe_steps(DormandPrince(), [1e12], [0.0])[0] == np.inf
