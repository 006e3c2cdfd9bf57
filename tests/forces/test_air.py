"""Vortex lines and rings, gusts and buoyancy against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import pointmass as pm

RNG = np.random.default_rng(5)


def velocity(field, x, t=0.0):
    return pm.ParticleSystem(pm.Particles(x), [field]).deriv_eval(t).reshape(-1, 3)


def test_a_long_line_is_a_vortex():
    x = RNG.uniform(-1, 1, (50, 3))
    line = velocity(pm.VortexLine((0, 0, -1e5), (0, 0, 1e5), 2.0, eps=0.1), x)
    # what is missing beyond the ends is below (1/1e5)^2 of the whole
    np.testing.assert_allclose(line, velocity(pm.Vortex(2.0, eps=0.1), x), rtol=1e-9, atol=1e-15)


def test_lines_make_a_ring():
    # A polygon of n sides differs from its circle by some (pi / n)^2 of the whole.
    n = 200
    angle = 2 * np.pi * np.arange(n + 1) / n
    corners = 0.5 * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    x = RNG.uniform(-1, 1, (40, 3))
    polygon = sum(velocity(pm.VortexLine(a, b, eps=0.1), x) for a, b in pairwise(corners))
    ring = velocity(pm.VortexRing(eps=0.1), x)
    np.testing.assert_allclose(polygon, ring, rtol=0, atol=5 * (np.pi / n) ** 2 * np.abs(ring).max())


@pytest.mark.parametrize("eps", [0.0, 0.2])
def test_a_ring_on_its_axis(eps):
    z = np.linspace(-3, 3, 31)
    e = np.array([2, -1, 2]) / 3
    u = velocity(pm.VortexRing((1, 2, 3), (2, -1, 2), 0.7, 1.5, eps), (1, 2, 3) + z[:, None] * e)
    speed = 1.5 * 0.7**2 / (2 * (0.7**2 + z**2 + eps**2) ** 1.5)
    np.testing.assert_allclose(u, speed[:, None] * e, rtol=1e-13, atol=1e-15)
    near = velocity(pm.VortexRing((1, 2, 3), (2, -1, 2), 0.7, 1.5, eps), (1, 2, 3) + z[:, None] * e + (0, 2e-9, 1e-9))
    np.testing.assert_allclose(near, u, rtol=0, atol=1e-7)


def test_close_to_the_core_of_a_thin_ring():
    # Nearby it is a straight line: Gamma / (2 pi eps) r / (r^2 + eps^2) up to terms of log(R / eps) / R.
    eps, r = 1e-3, 2e-3
    u = velocity(pm.VortexRing(radius=1.0, eps=eps), [[1 + r, 0, 0], [1 - r, 0, 0]])
    line = r / (2 * np.pi * (r**2 + eps**2))
    assert u[1, 1] - u[0, 1] == pytest.approx(2 * line, rel=0.01)


@pytest.mark.parametrize("field", [pm.VortexLine((0, -0.4, 0), (0.3, 0.5, 0), eps=0.2), pm.VortexRing(eps=0.2)])
def test_no_divergence(field):
    x, h = RNG.uniform(-1, 1, (40, 3)), 1e-5
    slopes = [
        (velocity(field, x + h * e) - velocity(field, x - h * e))[:, k] / (2 * h) for k, e in enumerate(np.eye(3))
    ]
    assert np.abs(sum(slopes)).max() < 1e-7


def test_gusts_have_the_mean_and_the_intensity_that_was_asked_for():
    x = RNG.uniform(-2000, 2000, (20_000, 3))
    u = velocity(pm.Gust((3, 0, 4), intensity=0.4, length=2.0), x, 7.3)
    np.testing.assert_allclose(u.mean(axis=0), (3, 0, 4), rtol=0, atol=5 * 2 / np.sqrt(20_000))
    np.testing.assert_allclose(u.std(axis=0), 2, rtol=5 / np.sqrt(20_000))


def test_gusts_travel_with_the_wind():
    x, mean = RNG.uniform(-1, 1, (50, 3)), np.array([3.0, 1.0, 0.0])
    field = pm.Gust(mean, length=2.0, lifetime=1e9)
    np.testing.assert_allclose(velocity(field, x, 0.0), velocity(field, x + 1.5 * mean, 1.5), rtol=0, atol=1e-8)


def test_smoke_rises_at_the_lift_over_the_drag():
    p = pm.Particles(np.zeros((1, 3)), m=2.0, temperature=323.0)
    smoke = pm.Simulation(pm.ParticleSystem(p, [pm.Buoyancy(beta=0.03), pm.Drag(0.5)]), pm.RK4(), dt=0.05)
    smoke.step(1000)
    np.testing.assert_allclose(p.v[0], [0, 2.0 * 0.03 * 30 / 0.5, 0], rtol=1e-5)


def test_smoke_that_cools_down_as_it_ages():
    # v' = beta T0 e^(-c age), v = beta T0 (1 - e^(-c t)) / c; Euler's method is off by c dt / 2.
    p = pm.Particles(np.zeros((1, 3)))
    force = pm.Buoyancy("293 + 100*exp(-2*age)", beta=0.1)
    pm.Simulation(pm.ParticleSystem(p, [force]), pm.Euler(), dt=1e-3).step(1000)
    assert p.v[0, 1] == pytest.approx(10 * (1 - np.exp(-2)) / 2, rel=1.1e-3)


@pytest.mark.parametrize(
    ("make", "hint"),
    [
        (lambda: pm.VortexLine((1, 2, 3), (1, 2, 3)), "must be different places"),
        (lambda: pm.VortexRing(axis=(0, 0, 0)), "axis = "),
        (lambda: pm.VortexRing(radius=0), "radius = 0"),
        (lambda: pm.Gust(("t", 0, 0)), "must be three numbers"),
        (lambda: pm.Gust(lifetime=0), "lifetime = 0"),
        (lambda: pm.Buoyancy(beta=-1), "beta = -1"),
    ],
)
def test_refusals(make, hint):
    with pytest.raises(pm.InvalidInput, match=hint):
        make()
