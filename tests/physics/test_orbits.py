"""Gravity between particles, and around a fixed centre."""

import numpy as np
import pytest

import pointmass as pm

E = 0.5  # eccentricity


def kepler(solver, dt):
    speed = np.sqrt((1 + E) / (1 - E))
    system = pm.ParticleSystem(pm.Particles([[1 - E, 0, 0]], [[0, speed, 0]]), [pm.Attractor(mu=1.0)])
    return pm.Simulation(system, solver, dt)


def test_G01_kepler_comes_back():
    sim = kepler(pm.DormandPrince(rtol=1e-10, atol=1e-10), 2 * np.pi / 8)
    start = sim.system.get_state()
    sim.step(8)
    np.testing.assert_allclose(sim.system.get_state(), start, atol=1e-7)


def test_I14_error_falls_with_the_tolerance():
    errors = []
    for k in range(5, 11):
        sim = kepler(pm.DormandPrince(rtol=10.0**-k, atol=10.0**-k), 2 * np.pi)
        start = sim.system.get_state()
        sim.step()
        errors.append(np.linalg.norm(sim.system.get_state() - start))
    ratios = np.array(errors[:-1]) / errors[1:]
    assert ((ratios > 5) & (ratios < 20)).all()


def long_orbit(orbits, steps=200):
    """State after every step of leapfrog, shape (orbits, steps, 6)."""
    solver = pm.Leapfrog()
    speed = np.sqrt((1 + E) / (1 - E))

    def slope(t, y):
        r2 = y[0] * y[0] + y[1] * y[1]
        pull = -1.0 / (r2 * np.sqrt(r2))
        return np.array([y[2], y[3], pull * y[0], pull * y[1]])

    system = pm.FunctionSystem(slope, 4, order=2, velocity_dependent=False)
    y, h = np.array([1 - E, 0, 0, speed]), 2 * np.pi / steps
    path = np.empty((orbits, steps, 4))
    for i in range(orbits):
        for j in range(steps):
            y = solver.step(system, 0.0, y, h, {}).y1
            path[i, j] = y
    return path


@pytest.mark.parametrize("orbits", [60, pytest.param(1000, marks=pytest.mark.full)])
def test_G02_leapfrog_keeps_the_energy_and_turns_the_apsis(orbits):
    path = long_orbit(orbits)
    x, v = path[..., :2], path[..., 2:]
    r = np.linalg.norm(x, axis=-1)
    energy = 0.5 * (v**2).sum(axis=-1) - 1 / r
    error = (energy + 0.5) / 0.5
    assert error.min() >= -1e-4
    assert error.max() <= 3e-3
    # The mean of an orbit wavers as the grid of steps moves along it (by up to 2e-6), which a long run averages out.
    slope = np.polyfit(np.arange(orbits), error.mean(axis=1), 1)[0]
    assert abs(slope) < (1e-8 if orbits == 1000 else 1e-6)
    momentum = x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]
    axis = np.stack([v[..., 1] * momentum, -v[..., 0] * momentum], axis=-1) - x / r[..., None]  # v x L - x/r
    angle = np.unwrap(np.arctan2(*axis.mean(axis=1).T[::-1]))
    assert np.polyfit(np.arange(orbits), angle, 1)[0] == pytest.approx(-3.88e-3, rel=0.05)


def test_the_simulation_runs_the_same_leapfrog():
    sim = kepler(pm.Leapfrog(), 2 * np.pi / 200)
    path = long_orbit(2)
    sim.step(400)
    np.testing.assert_allclose(sim.system.get_state()[[0, 1, 3, 4]], path[-1, -1], rtol=1e-10)


def test_G03_figure_eight():
    # Chenciner and Montgomery (2000), with Simo's numbers.
    a = np.array([0.97000435669734, -0.24308753153583, 0])
    w = np.array([-0.93240737144104, -0.86473146092102, 0])
    p = pm.Particles([a, -a, [0, 0, 0]], [-w / 2, -w / 2, w])
    system = pm.ParticleSystem(p, [pm.Gravitation()])
    assert system.energy().total == pytest.approx(-1.2871420, abs=1e-7)
    np.testing.assert_allclose(system.angular_momentum(), 0, atol=1e-12)
    start = system.get_state()
    sim = pm.Simulation(system, pm.DormandPrince(rtol=1e-11, atol=1e-11), 6.32591398 / 4)
    sim.step(4)
    assert np.linalg.norm(system.get_state() - start) < 1e-6
    assert system.energy().total == pytest.approx(-1.2871420, abs=1e-7)


def test_G04_softened_pair():
    m1, m2, eps = 1.0, 3.0, 0.5
    omega = np.sqrt((m1 + m2) / (1 + eps**2) ** 1.5)
    x1, x2 = m2 / (m1 + m2), -m1 / (m1 + m2)
    p = pm.Particles([[x1, 0, 0], [x2, 0, 0]], [[0, omega * x1, 0], [0, omega * x2, 0]], m=[m1, m2])
    system = pm.ParticleSystem(p, [pm.Gravitation(eps=eps)])
    start = system.get_state()
    sim = pm.Simulation(system, pm.DormandPrince(rtol=1e-9, atol=1e-11), 2 * np.pi / omega / 4)
    sim.step(4)
    np.testing.assert_allclose(system.get_state(), start, atol=1e-6)


@pytest.mark.parametrize(("count", "tolerance"), [(400, 0.04), pytest.param(2000, 0.02, marks=pytest.mark.full)])
def test_G05_cold_collapse(count, tolerance):
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    x = direction * (((np.arange(count) + 0.5) / count) ** (1 / 3))[:, None]
    x -= x.mean(axis=0)
    spacing = (4 / 3 * np.pi / count) ** (1 / 3)
    system = pm.ParticleSystem(pm.Particles(x, m=1 / count), [pm.Gravitation(eps=0.1 * spacing)])
    fall = np.pi / 2 * np.sqrt(1 / 2)  # t_ff of a uniform sphere with G = M = R = 1
    sim = pm.Simulation(system, pm.Leapfrog(), fall / 200)
    energy = system.energy().total

    def half():
        return float(np.median(np.linalg.norm(system.particles.x, axis=1)))

    start, radius = half(), {}
    for step in range(1, 231):
        sim.step()
        radius[step] = half() / start
    assert radius[100] == pytest.approx(0.8368, rel=tolerance)
    assert radius[150] == pytest.approx(0.5972, rel=1.5 * tolerance)
    assert 1.00 <= min(radius, key=radius.get) / 200 <= 1.06 + (0.04 if count < 2000 else 0)
    assert abs(system.energy().total / energy - 1) < (0.01 if count == 2000 else 0.05)


def test_G06_three_bodies_keep_their_momenta():
    rng = np.random.default_rng(1)
    p = pm.Particles(rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), m=[1.0, 2.0, 0.5])
    system = pm.ParticleSystem(p, [pm.Gravitation(eps=0.2)])
    momentum, spin = system.momentum(), system.angular_momentum()
    sim = pm.Simulation(system, pm.Leapfrog(), 0.01)
    sim.step(500)
    np.testing.assert_allclose(system.momentum(), momentum, atol=1e-12)
    np.testing.assert_allclose(system.angular_momentum(), spin, atol=1e-12)
