"""Surfaces that kill: the same particles die in the same step on both paths, however a run is cut."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm

FLOOR = {"response": "kill"}


def rain(compiled, solver="leapfrog", contact="swept", n=300):
    """Drops fall on a ball, which some of them hit, and on a floor that kills; more come from a nozzle."""
    rng = np.random.default_rng(4)
    drops = pm.Particles(rng.uniform((-1, 0.6, -1), (1, 2.6, 1), (n, 3)), rng.normal(size=(n, 3)))
    nozzle = pm.Nozzle((0, 1.5, 0), direction=(0, -1, 0), rate=900.0, speed=3.0, cone=30.0, lifetime=0.4)
    ball = pm.Sphere((0, 0.4, 0), radius=0.4, restitution=0.7)
    system = pm.ParticleSystem(drops, [pm.Gravity(), pm.Drag(0.1)], [ball, pm.Plane(contact=contact, **FLOOR)])
    return pm.Simulation(system, solver, 1 / 60, emitters=[nozzle], compiled=compiled)


def state(sim):
    p = sim.system.particles
    return p.id, p.x, p.v, p.age


def assert_same(a, b):
    for one, two in zip(state(a), state(b), strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(("solver", "contact"), [("leapfrog", "swept"), ("rk4", "discrete"), ("dopri5", "swept")])
@pytest.mark.usefixtures("plain")
def test_both_paths_bury_the_same(solver, contact):
    n = 20 if solver == "dopri5" else 300
    slow, whole, cut = (rain(compiled, solver, contact, n=n) for compiled in (False, True, True))
    slow.step(30)
    whole.step(30)
    cut.step(7)
    list(cut.frames(5, fps=47.0))  # looks inside of steps
    cut.step(30 - cut.steps)
    killed = 30 + n + 450 - len(slow.system.particles)
    assert killed > 0.3 * n
    assert (slow.system.particles.x[:, 1] > 0).all()
    if solver == "dopri5":  # step control adds up in another order
        np.testing.assert_array_equal(slow.system.particles.id, whole.system.particles.id)
    else:
        assert_same(slow, whole)
    assert_same(whole, cut)


def test_compiled_kernels_bury_the_same():
    slow, fast = rain(False), rain(True)
    slow.step(30)
    fast.step(30)
    assert_same(slow, fast)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("solver", ["leapfrog", "implicit_euler"])
@pytest.mark.usefixtures("plain")
def test_a_link_that_hits_dies_and_takes_its_springs(compiled, solver):
    chain = pm.Particles([[0, 0.5, 0], [0, 0.8, 0], [0, 1.1, 0], [1, 3, 0]], m=0.1)
    springs = pm.Springs([(0, 1), (1, 2)], k_s=30.0, k_d=0.1)
    system = pm.ParticleSystem(chain, [pm.Gravity(), springs], [pm.Plane(**FLOOR)])
    sim = pm.Simulation(system, solver, 1 / 100, compiled=compiled)
    steps = []
    for _ in range(60):
        before = len(system.particles)
        sim.step()
        steps += [sim.steps] * (before - len(system.particles))
    fall = np.sqrt(2 * np.array([0.5, 0.8, 1.1]) / 9.81)  # the chain falls without being stretched
    np.testing.assert_allclose(steps, np.ceil(fall * 100), atol=1)
    np.testing.assert_array_equal(system.particles.id, [3])
    assert len(springs.ids) == 0


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.usefixtures("plain")
def test_it_dies_at_the_end_of_the_step_of_its_impact(compiled):
    system = pm.ParticleSystem(pm.Particles([[0, 1, 0]]), [pm.Gravity()], [pm.Plane(**FLOOR)])
    sim = pm.Simulation(system, "leapfrog", 1 / 50, compiled=compiled)
    counts = [len(frame.ids) for frame in sim.frames(60, fps=50)]
    fall = np.sqrt(2 / 9.81)
    assert counts == [int(k / 50 <= np.floor(fall * 50) / 50) for k in range(60)]
