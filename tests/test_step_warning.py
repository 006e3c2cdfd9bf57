"""A run says once, at its start, that its step is too long for its springs; what it says agrees with `stability`."""

import re
import time
import warnings

import numpy as np
import pytest

import pointmass as pm
from pointmass.solvers import as_solver
from pointmass.step_warning import LARGE, too_long


def pair(k_s=100.0, k_d=0.0, family="springs"):
    """Two masses of 0.5 kg: w = sqrt(4 k_s), 20 by default."""
    return pm.ParticleSystem(
        pm.Particles([[0, 0, 0], [1, 0, 0]], m=0.5), [pm.Springs([(0, 1)], k_s=k_s, k_d=k_d, family=family)]
    )


def said(system, solver, dt) -> str | None:
    return too_long(system, as_solver(solver), dt)


def test_what_it_says():
    assert said(pair(family="shear"), "leapfrog", 0.2) == (
        "dt = 0.2 s is too long for leapfrog: spring 0 of family shear (particles 0-1) takes part in a motion with "
        "omega dt = 4, and the limit is 2; the largest safe dt is about 0.1 s: use a smaller dt, more substeps or "
        "implicit_euler"
    )
    assert said(pair(), "euler", 1e-6) == (
        "euler amplifies the motion of spring 0 (particles 0-1) at any dt: use symplectic_euler, rk4 or implicit_euler"
    )
    damper = said(pair(k_s=0.0, k_d=1.0), "rk4", 1.0)  # the rate is k_d/mu = 4
    assert damper is not None
    assert "with rate dt = 4, and the limit is 2.79; the largest safe dt is about 0.696 s" in damper


@pytest.mark.parametrize("solver", ["symplectic_euler", "leapfrog", "rk4", "yoshida4"])
@pytest.mark.parametrize("k_d", [0.0, 2.0])
def test_it_speaks_just_above_the_limit_and_not_below(solver, k_d):
    body = pm.lattice((4, 3, 3), k_s=300.0, damping_ratio=0.02 * k_d)
    system = pm.ParticleSystem(body.particles, [pm.Gravity(), *body.forces])
    limit = system.stability(solver).largest_safe_dt
    assert said(system, solver, 0.999 * limit) is None
    text = said(system, solver, 1.02 * limit)
    assert text is not None
    found = re.search(r"about ([\d.e-]+) s", text)
    assert found
    assert float(found[1]) == pytest.approx(limit, rel=0.01)


def test_air_that_damps_what_springs_do_not():
    """Euler's limit is d/k = (c/m)/w^2 = 1/400 for c = 0.5."""
    system = pair()
    system.forces.append(pm.Drag(0.5))
    assert said(system, "euler", 0.99 / 400) is None
    text = said(system, "euler", 1.1 / 400)
    assert text is not None
    assert "the largest safe dt is about 0.0025 s" in text


@pytest.mark.parametrize("solver", ["implicit_euler", "implicit_midpoint", "bdf2", "dopri5", "bs32"])
def test_solvers_without_a_limit_or_with_steps_of_their_own(solver):
    assert said(pair(1e9), solver, 1.0) is None


def test_systems_of_which_there_is_nothing_to_say():
    assert said(pm.ParticleSystem(pm.Particles([[0, 0, 0]]), [pm.Harmonic(k_s=1e9)]), "euler", 1.0) is None
    system = pair(1e9)
    system.forces[0].enabled = False
    assert said(system, "leapfrog", 1.0) is None
    system = pair(1e9)
    system.particles.pin([0, 1])
    assert said(system, "leapfrog", 1.0) is None
    assert said(pair(0.0), "leapfrog", 1e3) is None
    system = pair()
    system.particles.x[1] = np.nan
    assert said(system, "leapfrog", 1e3) is None


def test_a_run_warns_once_and_does_what_it_would_do_anyway():
    runs = []
    for action in ("always", "ignore"):
        sim = pm.Simulation(pair(), pm.Leapfrog(), dt=0.11, compiled=False)
        sim.system.particles.x[1, 0] = 1.001
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter(action)
            sim.step(2)
            sim.step(3)
            sim.run(0.2)
        assert [w.category for w in caught] == ([pm.UnstableStep] if action == "always" else [])
        assert all(w.filename == __file__ for w in caught)
        runs.append(sim.system.get_state().tobytes())
    assert runs[0] == runs[1]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pm.Simulation(pair(), pm.Leapfrog(), dt=0.09, compiled=False).step(5)
    with pytest.warns(pm.UnstableStep, match="spring 0"):
        list(pm.Simulation(pair(), pm.Leapfrog(), dt=0.11, compiled=False).frames(2))


def test_a_large_system_takes_a_moment():
    """300,000 springs: the first particles tell."""
    n = 300_001
    x = np.arange(n)[:, None] * [1.0, 0, 0]
    links = pm.Springs(np.stack([np.arange(n - 1), np.arange(1, n)], axis=1), k_s=100.0)
    assert 36 * (n - 1) > 10 * LARGE
    system = pm.ParticleSystem(pm.Particles(x), [links])
    limit = 2 / (2 * np.sqrt(100.0))
    began = time.process_time()
    assert said(system, "leapfrog", 0.99 * limit) is None
    assert said(system, "leapfrog", 1.2 * limit) is not None
    assert time.process_time() - began < 2.0


def test_a_run_whose_implicit_steps_are_divided_says_so_once() -> None:
    particles = pm.Particles([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [0, 40.0, 0], [30.0, 0, 0]])
    particles.pin([0])
    system = pm.ParticleSystem(particles, [pm.Springs([(0, 1), (1, 2)], 1e5)])
    sim = pm.Simulation(system, pm.ImplicitEuler(max_iterations=3), 1 / 60, compiled=False)
    with pytest.warns(pm.DividedStep, match="implicit_euler were not solved in a step of 0.0167 s") as caught:
        sim.step(3)
    assert len(caught) == 1
    assert sim.engine.stats.rejected > 1
