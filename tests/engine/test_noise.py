"""Noise in kernels: the bits of the reference path, wherever a law may call it."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm

X = np.random.default_rng(2).uniform(-2, 2, (6, 3))


@pm.pair_force
def crowd(x1, v1, m1, x2, v2, m2, t, k=1.0):
    """A pull that differs from place to place."""
    return k * pm.noise(x1[0] + x2[0], x1[1] + x2[1], x1[2] + x2[2], t) * (x2 - x1)


def run(compiled, forces, solver="euler", dtype="float64", colliders=(), steps=2):
    system = pm.ParticleSystem(pm.Particles(X, m=2.0, dtype=dtype), forces(), colliders)
    sim = pm.Simulation(system, solver, 1 / 32, compiled=compiled)
    sim.step(steps)
    return system.particles


def test_compiled_curl_noise_has_the_bits_of_the_reference():
    solids = [pm.Sphere((0.3, 0, 0), 0.5)]
    forces = lambda: [pm.CurlNoise(octaves=1, around=solids), pm.Flow(("0", "noise(x, y, 0, t, 3)", "0"))]  # noqa: E731
    slow, fast = (run(compiled, forces, steps=20) for compiled in (False, True))
    np.testing.assert_array_equal(slow.x, fast.x)


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize(
    "forces",
    [
        lambda: [pm.Wind(("0", "noise(t, 0, 0, 0, 1)", "0"), k="1 + 0.1*noise(m, 0, 0, t, 0)")],
        lambda: [pm.Field(potential="noise(x, y, z, 0, 4)")],
        lambda: [crowd()],
    ],
    ids=["parameters", "gradient", "pairs"],
)
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_everywhere(forces, dtype):
    slow, fast = (run(compiled, forces, "symplectic_euler", dtype) for compiled in (False, True))
    np.testing.assert_allclose(slow.x, fast.x, rtol=0, atol=1e-14 if dtype == "float64" else 1e-6)
    np.testing.assert_allclose(slow.v, fast.v, rtol=0, atol=1e-13 if dtype == "float64" else 1e-5)


@pytest.mark.usefixtures("plain")
def test_a_collider_that_trembles():
    floor = [pm.Plane((0, "0.2*noise(4*t, 0, 0, 0, 1) - 1", 0))]
    slow, fast = (run(c, lambda: [pm.Gravity()], "symplectic_euler", colliders=floor) for c in (False, True))
    np.testing.assert_array_equal(slow.x, fast.x)


def test_compiled_random_motion_has_the_bits_of_the_reference_however_it_is_cut():
    forces = lambda: [pm.Flutter(lifetime=0.3), pm.Diffusion(interval=1 / 20)]  # noqa: E731
    slow, fast = (run(compiled, forces, steps=20) for compiled in (False, True))
    np.testing.assert_array_equal(slow.x, fast.x)
    sim = pm.Simulation(pm.ParticleSystem(pm.Particles(X, m=2.0), forces()), "euler", 1 / 32, compiled=True)
    for part in (1, 7, 12):
        sim.step(part)
    np.testing.assert_array_equal(sim.system.particles.x, fast.x)
