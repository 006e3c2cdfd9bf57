"""Flutter and diffusion: the statistics of Ornstein, Uhlenbeck and Einstein, and the same motion on any way there."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

import pointmass as pm

N = 20_000


def velocity(field, t, n=N):
    return pm.ParticleSystem(pm.Particles(np.zeros((n, 3))), [field]).deriv_eval(t).reshape(-1, 3)


def test_chance_is_even_and_stays_with_a_particle():
    p = pm.Particles(np.zeros((N, 3)))
    counts = np.histogram(p.chance, bins=50, range=(0, 1))[0]
    assert ((counts - N / 50) ** 2 / (N / 50)).sum() < 49 + 5 * sqrt(2 * 49)  # chi squared of 49 degrees of freedom
    kept = p.chance[1::2].copy()
    p.remove(slice(0, N, 2))
    np.testing.assert_array_equal(p.chance, kept)
    assert pm.Particles(np.zeros((3, 3)), dtype="float32").chance.dtype == np.float32


@pytest.mark.parametrize("t", [0.0, 0.13, 1234.5])
def test_flutter_has_the_mean_and_deviation_that_was_asked_for(t):
    u = velocity(pm.Flutter((0.5, 0.2, 2.0), lifetime=0.7, seed=3), t) / (0.5, 0.2, 2.0)
    assert np.abs(u.mean(axis=0)).max() < 5 / sqrt(N)
    np.testing.assert_allclose((u**2).mean(axis=0), 1, rtol=5 * sqrt(2 / N))
    assert (u**4).mean() == pytest.approx(3, abs=0.15 + 5 * sqrt(96 / N))  # normal, but for the few kicks that count
    correlation = np.corrcoef(u.T) - np.eye(3)
    assert np.abs(correlation).max() < 5 / sqrt(N)


def test_flutter_is_forgotten_exponentially():
    field = pm.Flutter((1, 1, 1), lifetime=0.5)
    u = velocity(field, 3.0)
    for lag in (0.25, 0.5, 1.0, 2.0):
        now = (u * velocity(field, 3.0 + lag)).mean()
        # decay times are 0.92 T, and forces constant for T / 4: e^(-t/T) within 0.03
        assert now == pytest.approx(np.exp(-lag / 0.5), abs=0.03 + 5 / sqrt(3 * N))


def test_flutter_has_no_jumps():
    # A kick changes u by some strength sqrt(2 h) in a cell of h T: |u'| is below 6 sqrt(2 / h) / T, with h = 1/4.
    times = np.linspace(0, 2, 20_001)
    u = np.array(pm.Flutter.law(None, times, (1, 1, 1), 0.5, 0.0, 0.37))
    assert np.abs(np.diff(u, axis=1)).max() < 6 * sqrt(8) / 0.5 * 1e-4


def test_s05_the_variance_of_flutter_at_any_step():
    """After 5 T it is s^2 for 1e5 walkers, and the step is not asked: h = T/10 and h = T give the same velocities."""
    T, s = 0.4, 1.5
    field = pm.Flutter((s, s, s), T, seed=5)
    walkers = velocity(field, 5 * T, 100_000)
    np.testing.assert_allclose(walkers.var(axis=0), s**2, rtol=0.03)
    for steps in (50, 5):
        sim = pm.Simulation(pm.ParticleSystem(pm.Particles(np.zeros((500, 3))), [field]), "euler", dt=5 * T / steps)
        sim.step(steps)
        np.testing.assert_allclose(sim.frame().velocities, walkers[:500], rtol=0, atol=1e-9)


def test_the_displacement_of_flutter():
    T, s, t = 0.1, 0.8, 2.0
    times = (np.arange(200)[:, None] + 0.5) * t / 200
    u = np.array(pm.Flutter.law(None, times, (s, s, s), T, 0.0, pm.Particles(np.zeros((1500, 3))).chance))
    wanted = 2 * s**2 * (T * t - T**2 * (1 - np.exp(-t / T)))  # Ornstein & Uhlenbeck (1930)
    assert (u.mean(axis=1) ** 2).mean() * t**2 == pytest.approx(wanted, rel=5 * sqrt(2 / 4500))


@pytest.mark.parametrize("solver", [pm.Euler(), pm.RK4()])
def test_mean_square_displacement_of_diffusion(solver):
    D, interval = 0.3, 0.05
    p = pm.Particles(np.zeros((4000, 3)))
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Diffusion(D, interval)]), solver, dt=interval)
    sim.step(40)
    # RK4 takes a sixth of each step from the next interval: 1/18 + 2 / 6 of one interval's share at either end
    assert (p.x**2).sum(axis=1).mean() == pytest.approx(6 * D * 40 * interval, rel=5 * sqrt(2 / 12_000) + 0.02)


def test_s06_mean_square_displacement_of_many_walkers():
    D, interval = 0.3, 0.05
    p = pm.Particles(np.zeros((100_000, 3)))
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Diffusion(D, interval, seed=2)]), "euler", dt=interval)
    for _ in range(3):
        sim.step(5)
        assert (p.x**2).sum(axis=1).mean() == pytest.approx(6 * D * sim.t, rel=0.03)


def test_diffusion_in_a_wind_is_the_same_after_a_while():
    D, tau = 0.2, 0.05
    p = pm.Particles(np.zeros((3000, 3)), m=1.0)
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Wind(pm.Diffusion(D, 0.02), k=1 / tau)]), pm.Leapfrog(), dt=0.01)
    sim.step(300)
    wanted = 6 * D * (3 - 1.5 * tau)  # Langevin (1908): at rest at the start, 2 D (t - 3/2 tau) per axis
    assert (p.x**2).sum(axis=1).mean() == pytest.approx(wanted, rel=5 * sqrt(2 / 9000))


def test_motion_goes_by_the_particle_and_not_by_its_row():
    few, many = pm.Particles(np.zeros((3, 3))), pm.Particles(np.zeros((10, 3)))
    many.remove([0, 4, 5])
    field = pm.Flutter()
    few.remove([0])
    u, w = (pm.ParticleSystem(p, [field]).deriv_eval(0.4).reshape(-1, 3) for p in (few, many))
    np.testing.assert_array_equal(u, w[:2])


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (lambda: pm.Flutter(lifetime=0), "lifetime = 0"),
        (lambda: pm.Flutter(seed=-1), "seed = -1"),
        (lambda: pm.Diffusion(-1), "coefficient = -1"),
        (lambda: pm.Diffusion(interval=0), "interval = 0"),
    ],
)
def test_refusals(make, hint):
    with pytest.raises(pm.InvalidInput, match=hint):
        make()
