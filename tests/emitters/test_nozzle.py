"""Births: when, where, how fast, for how long, however time is cut."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.solvers import SOLVERS

NAMES = ("time", "number", "x", "v", "lifetime")


def born(nozzle, cuts, seed=0, stream="s"):
    parts = [nozzle.births(a, b, seed, stream) for a, b in pairwise(cuts)]
    return {n: np.concatenate([getattr(p, n) for p in parts]) for n in NAMES}


@settings(max_examples=60, deadline=None)
@given(
    rate=st.floats(0.1, 3000),
    start=st.floats(-3, 3),
    length=st.floats(0.01, 2),
    cuts=st.lists(st.floats(0, 1), max_size=12),
)
def test_births_are_the_same_however_time_is_cut(rate, start, length, cuts):
    nozzle = pm.Nozzle(rate=rate, start=start, stop=start + length, lifetime=pm.Spread(2, 1), radius=0.1)
    t0, t1 = start - 0.5, start + length + 0.5
    whole = born(nozzle, [t0, t1])
    several = born(pm.Nozzle(**nozzle.arguments), [t0, *(t0 + np.sort(cuts) * (t1 - t0)), t1])
    for name in NAMES:
        np.testing.assert_array_equal(whole[name], several[name])
    assert len(whole["time"]) == pytest.approx(math.ceil(rate * length), abs=1)
    np.testing.assert_array_equal(whole["number"], np.arange(len(whole["number"])))
    np.testing.assert_array_equal(whole["time"], start + whole["number"] / rate)


@pytest.mark.parametrize("dt", [1 / 7, 1 / 60, 1 / 1000])
@pytest.mark.parametrize("name", ["euler", "leapfrog", "rk4", "dopri5", "implicit_midpoint"])
def test_a_stream_is_evenly_spaced(name, dt):
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))))
    nozzle = pm.Nozzle(direction=(1, 0, 0), rate=100, speed=3, cone=0)
    sim = pm.Simulation(system, SOLVERS[name](), dt, emitters=[nozzle])
    sim.step(round(0.5 / dt))
    p = system.particles
    np.testing.assert_allclose(p.x[:, 0], 3 * (sim.t - np.arange(len(p)) / 100), atol=1e-12)
    np.testing.assert_allclose(p.age, sim.t - np.arange(len(p)) / 100, atol=1e-12)
    assert len(np.unique(p.id)) == len(p)


def test_S02_steady_number():
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity()])
    sim = pm.Simulation(system, dt=1 / 60, emitters=[pm.Nozzle(rate=200, lifetime=2)])
    sim.step(180)
    for _ in range(20):
        sim.step()
        assert len(system.particles) == pytest.approx(400, abs=200 / 60)


def test_deaths_are_on_time():
    system = pm.ParticleSystem(pm.Particles([[9, 9, 9]]))
    sim = pm.Simulation(system, dt=1 / 60, emitters=[pm.Nozzle(rate=50, lifetime=pm.Spread(0.5, 0.3))], seed=4)
    lifetime = born(sim.emitters[0], [0, 4.0], 4, "Nozzle 0")["lifetime"]
    for _ in range(120):
        sim.step()
        k = np.arange(math.ceil(sim.t * 50 - 1e-9))
        alive = k[k / 50 + lifetime[k] > sim.t]
        np.testing.assert_array_equal(system.particles.id[1:] & (2**40 - 1), alive)
    assert system.particles.id[0] == 0


def test_lifetimes_are_columns_that_bodies_and_forces_may_use():
    p = pm.Particles(np.eye(3), v=[1, 0, 0], lifetime=[0.25, 0.5, np.inf])
    system = pm.ParticleSystem(p, [pm.Drag("age / lifetime")])
    sim = pm.Simulation(system, dt=1 / 64, emitters=[pm.Nozzle(rate=8, lifetime=0.25)], compiled=False)
    sim.step(15)
    assert (p.id[:3] == [0, 1, 2]).all()
    assert p.v[0, 0] < p.v[1, 0] < p.v[2, 0] == 1
    np.testing.assert_array_equal(p.lifetime, [0.25, 0.5, np.inf, 0.25, 0.25])
    sim.step()
    assert (p.id[:2] == [1, 2]).all()
    sim.step(48)
    assert p.id[0] == 2
    assert (p.age < p.lifetime).all()


def test_particles_added_by_hand_have_ids_of_their_own():
    system = pm.ParticleSystem(pm.Particles([[9, 9, 9]]), [pm.Gravity()])
    sim = pm.Simulation(system, dt=1 / 60, emitters=[pm.Nozzle(rate=100), pm.Nozzle(rate=100)])
    for _ in range(5):
        sim.step(3)
        system.add([[1, 1, 1]])
    assert len(np.unique(system.particles.id)) == len(system.particles)


@pytest.mark.parametrize("name", sorted(SOLVERS))
def test_every_solver_can_begin_without_particles(name):
    system = pm.ParticleSystem(pm.Particles(np.zeros((0, 3))), [pm.Gravity(), pm.Drag()], [pm.Plane(), pm.Sphere()])
    sim = pm.Simulation(system, SOLVERS[name](), 1 / 60, emitters=[pm.Nozzle(rate=50, start=0.1, lifetime=0.2)])
    for frame in sim.frames(30, fps=45):
        assert np.isfinite(frame.positions).all()
    assert len(system.particles) == pytest.approx(10, abs=1)


def test_streams_are_independent():
    n = 20_000
    one, two = (born(pm.Nozzle(rate=1, speed=pm.Spread(5, 2)), [0, n], 0, s)["v"] for s in ("a", "b"))
    three = born(pm.Nozzle(rate=1, speed=pm.Spread(5, 2)), [0, n], 1, "a")["v"]
    for other in (two, three):
        speeds = [np.linalg.norm(v, axis=1) for v in (one, other)]
        assert abs(np.corrcoef(speeds)[0, 1]) < 4 / np.sqrt(n)


@pytest.mark.parametrize("cone", [0.0, 20.0, 90.0, 180.0])
def test_directions_are_even_over_the_cone(cone):
    n = 20_000
    axis = np.array([1, 2, -2]) / 3
    v = born(pm.Nozzle(direction=axis, rate=1, speed=5, cone=cone), [0, n])["v"] / 5
    np.testing.assert_allclose(np.linalg.norm(v, axis=1), 1, rtol=1e-12)
    height, edge = v @ axis, np.cos(np.radians(cone))
    assert height.min() >= edge - 1e-12
    assert height.mean() == pytest.approx((1 + edge) / 2, abs=4 * (1 - edge) / np.sqrt(12 * n) + 1e-12)
    assert height.var() == pytest.approx((1 - edge) ** 2 / 12, rel=0.05, abs=1e-12)
    across = (v - height[:, None] * axis).mean(axis=0)
    assert np.abs(across).max() <= 4 / np.sqrt(n)


def test_places_are_even_over_the_disc():
    n = 20_000
    nozzle = pm.Nozzle(position=(1, 2, 3), direction=(0, 0, 1), rate=1, radius=0.5)
    x = born(nozzle, [0, n])["x"] - [1, 2, 3]
    assert not x[:, 2].any()
    r2 = (x**2).sum(axis=1)
    assert r2.max() <= 0.25 * (1 + 1e-12)
    assert r2.mean() == pytest.approx(0.125, rel=0.02)
    assert np.abs(x.mean(axis=0)).max() < 4 * 0.25 / np.sqrt(n)


def test_speeds_and_lifetimes_have_their_half_range():
    n = 20_000
    b = born(pm.Nozzle(rate=1, speed=pm.Spread(4, 1), lifetime=pm.Spread(3, 2)), [0, n])
    for values, mean, half in ((np.linalg.norm(b["v"], axis=1), 4, 1), (b["lifetime"], 3, 2)):
        assert np.abs(values - mean).max() <= half + 1e-12
        assert values.mean() == pytest.approx(mean, abs=4 * half / np.sqrt(3 * n))
        assert values.std() == pytest.approx(half / np.sqrt(3), rel=0.02)


@pytest.mark.parametrize(
    "wrong",
    [
        {"rate": 0},
        {"rate": math.inf},
        {"speed": -1},
        {"speed": pm.Spread(1, 2)},
        {"cone": 181},
        {"radius": -1},
        {"lifetime": 0},
        {"lifetime": pm.Spread(1, 1)},
        {"mass": 0},
        {"size": -1},
        {"start": 2, "stop": 2},
        {"start": -1e12, "rate": 10},
        {"direction": (0, 0, 0)},
        {"position": (0, np.nan, 0)},
        {"colour": "red"},
    ],
)
def test_wrong_arguments_are_named(wrong):
    with pytest.raises(pm.InvalidInput) as caught:
        pm.Nozzle(**wrong)
    assert any(name in str(caught.value) for name in wrong)


def test_a_nozzle_that_opens_after_all_time():
    assert len(pm.Nozzle(start=1e308).births(0.0, 1e6, 0, "late").number) == 0
