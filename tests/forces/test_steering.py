"""Steering: what flocks, hunters and obstacles do to those who see them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import pointmass as pm


def force_on(force: Any, p: pm.Particles, t: float = 0.0) -> np.ndarray:
    force.bind(p)
    f = np.zeros_like(p.x)
    force.add_forces(p, t, p.x, p.v, f)
    return f


def crowd() -> pm.Particles:
    rng = np.random.default_rng(6)
    return pm.Particles(rng.uniform(0, 4, (60, 3)), rng.standard_normal((60, 3)), rng.uniform(0.5, 2, 60))


def polarisation(v: np.ndarray) -> float:
    return float(np.linalg.norm((v / np.linalg.norm(v, axis=1, keepdims=True)).mean(axis=0)))


def test_F14_a_ring_aligns():
    """models.md F14: each sees 2 on either side; the ring is so large that nobody leaves his place in it."""
    turn = 2 * math.pi * np.arange(20) / 20
    heading = np.random.default_rng(3).uniform(-math.pi / 3, math.pi / 3, 20)
    x = 1000 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    v = np.stack([np.cos(heading), np.sin(heading), 0 * heading], axis=1)
    chords = [2000 * math.sin(math.pi * k / 20) for k in (2, 3)]
    rule = pm.Flocking(sum(chords) / 2, separation=0.0, alignment=10.0, cohesion=0.0, field_of_view=360.0)
    p = pm.Particles(x, v)
    sim = pm.Simulation(pm.ParticleSystem(p, [rule]), "euler", dt=0.01, compiled=False)
    spread = np.ptp(v, axis=0)
    assert polarisation(v) < 0.95
    for _ in range(10):
        sim.step(100)
        assert (np.ptp(p.v, axis=0) <= spread).all()
        spread = np.ptp(p.v, axis=0)
    assert polarisation(p.v) >= 0.999


def test_who_sees_nobody_feels_nothing():
    p = pm.Particles([[0, 0, 0], [2.6, 0, 0]], [[1, 2, 3], [0, -1, 0]])
    assert (force_on(pm.Flocking(cutoff=2.5), p) == 0).all()
    assert (force_on(pm.Flocking(cutoff=2.7), p) != 0).any()


def test_separation_alone_conserves_momentum_where_nobody_has_a_blind_angle():
    p = crowd()
    p.m[:] = 0.3
    rule = {"separation": 5.0, "separation_radius": 2.0, "alignment": 0.0, "cohesion": 0.0}
    f = force_on(pm.Flocking(**rule, field_of_view=360.0), p)
    assert np.abs(f.sum(axis=0)).max() < 1e-12 * np.abs(f).sum()
    blind = force_on(pm.Flocking(**rule, field_of_view=200.0), p)
    assert np.abs(blind.sum(axis=0)).max() > 1e-3 * np.abs(blind).sum()


def test_cohesion_of_all_with_all_leaves_their_middle_at_rest():
    p = crowd()
    rule = pm.Flocking(cutoff=10.0, separation=0.0, alignment=0.0, cohesion=2.0, field_of_view=360.0)
    a = force_on(rule, p) / p.m[:, None]
    middle = (p.x.sum(axis=0) - p.x) / (len(p) - 1)
    np.testing.assert_allclose(a, 2.0 * (middle - p.x), rtol=0, atol=1e-13)
    assert np.abs(a.sum(axis=0)).max() < 1e-12


@pytest.mark.parametrize(("view", "seen"), [(90, 1), (180, 2), (269, 2), (271, 3), (360, 4)])
def test_field_of_view_is_a_cone_around_the_velocity(view, seen):
    """Others are 0, 90, 135 and 180 degrees off the heading, but for a trifle of the second."""
    c = math.sqrt(0.5)
    p = pm.Particles([[0, 0, 0], [0, 0, 1], [0, 1, 1e-4], [c, 0, -c], [0, 0, -1]], [[0, 0, 2.0], *[[0, 0, 0]] * 4])
    away = pm.Flee(by=[1, 2, 3, 4], on=[0], strength=4.0, cutoff=4.0, field_of_view=view)
    weights = force_on(away, p)[0]
    each = [force_on(pm.Flee(by=[k], on=[0], strength=4.0, cutoff=4.0, field_of_view=view), p)[0] for k in range(1, 5)]
    assert sum((f != 0).any() for f in each) == seen
    np.testing.assert_allclose(weights, sum(each) / max(1, 0.75 * seen), rtol=0, atol=1e-3)


def test_the_limit_bends_no_acceleration():
    p = crowd()
    free, held = (force_on(pm.Flocking(separation=9.0, limit=limit), p) / p.m[:, None] for limit in (None, 2.0))
    size = np.linalg.norm(free, axis=1, keepdims=True)
    assert 0 < (size > 2).sum() < len(p)
    np.testing.assert_allclose(held, free * np.minimum(1, 2 / size), rtol=0, atol=1e-13)


def test_who_flees_is_not_noticed_and_never_panics():
    p = crowd()
    p.tag("hunters", [3, 4, 5])
    f = force_on(pm.Flee(by="hunters", strength=7.0, cutoff=9.0), p)
    far = np.delete(np.arange(len(p)), [3, 4, 5])
    alone = force_on(pm.Flee(by="hunters", on=far, strength=7.0, cutoff=9.0), p)
    np.testing.assert_array_equal(f[far], alone[far])
    assert (alone[[3, 4, 5]] == 0).all()
    assert (f[[3, 4, 5]] != 0).any(axis=1).all()  # of each other
    assert (np.linalg.norm(f, axis=1) <= 7.0 * p.m * (1 + 1e-12)).all()
    np.testing.assert_array_equal(force_on(pm.Flee(by="hunters", strength=-7.0, cutoff=9.0), p), -f)


def test_seek_takes_the_velocity_that_it_wants_and_arrives():
    target, rate = (30.0, 40.0, 0.0), 2.0
    p = pm.Particles([[0, 0, 0]])
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Seek(target, 5.0, rate, arrival=4.0)]), "dopri5", compiled=False)
    sim.run(1.0)
    np.testing.assert_allclose(p.v[0], 5.0 * (1 - math.exp(-rate)) * np.array([0.6, 0.8, 0]), rtol=1e-5, atol=0)
    sim.run(40.0)
    np.testing.assert_allclose(p.x[0], target, rtol=0, atol=1e-3)


def test_cruise_finds_its_speed_and_keeps_its_heading():
    v = np.array([[3.0, 4.0, 12.0], [0.3, 0.4, 1.2], [0, 0, 0]])
    p = pm.Particles(np.zeros((3, 3)), v)
    sim = pm.Simulation(pm.ParticleSystem(p, [pm.Cruise(6.5, rate=0.7)]), "dopri5", compiled=False)
    sim.run(1.5)
    speeds = 6.5 + (np.array([13.0, 1.3]) - 6.5) * math.exp(-0.7 * 1.5)
    np.testing.assert_allclose(p.v[:2], speeds[:, None] * np.array([[3, 4, 12]]) / 13, rtol=1e-5, atol=0)
    assert (p.v[2] == 0).all()
    assert np.linalg.norm(force_on(pm.Cruise(6.5, 100.0, limit=2.0), p), axis=1)[:2] == pytest.approx([2, 2], rel=1e-12)


def test_avoid_looks_ahead_and_along():
    wall = pm.Avoid([pm.Plane((0, 0, 0), (1, 0, 0))], strength=8.0, distance=1.0, horizon=0.5)
    p = pm.Particles([[2, 0, 0]] * 3, [[-4, 7, 0], [4, 7, 0], [-1.9, 7, 0]])
    np.testing.assert_allclose(force_on(wall, p)[:, 0], [8 * (1 - 2 / 3), 0, 0], rtol=0, atol=1e-12)
    assert (force_on(wall, p)[:, 1:] == 0).all()


def test_birds_fly_around_a_ball_into_which_they_would_fly_otherwise():
    rng = np.random.default_rng(1)
    x = np.concatenate([np.full((40, 1), -20.0), rng.uniform(-2, 2, (40, 2))], axis=1)
    ball = pm.Sphere(radius=3.0)
    nearest = {}
    for strength in (0.0, 40.0):
        p = pm.Particles(x, (9, 0, 0))
        forces = [pm.Cruise(9.0), pm.Avoid([ball], strength=strength, distance=1.0, horizon=0.7)]
        sim = pm.Simulation(pm.ParticleSystem(p, forces), "leapfrog", dt=1 / 60, compiled=False)
        nearest[strength] = np.inf
        for _ in range(240):
            sim.step(1)
            nearest[strength] = min(nearest[strength], float(np.linalg.norm(p.x, axis=1).min()))
    assert nearest[0.0] < 1.0
    assert nearest[40.0] > 3.0


def flight() -> pm.Scene:
    """Birds, hunters, a ball and somewhere to go."""
    rng = np.random.default_rng(2)
    birds = pm.scatter(300, (0, 0, 0), (6, 6, 6), seed=1)
    hunters = pm.points(rng.uniform(-6, 6, (2, 3)), rng.standard_normal((2, 3)))
    ball = pm.Sphere((2, 0, 0), radius=1.0)
    return pm.Scene(
        bodies=[birds, hunters],
        names=["birds", "hunters"],
        forces=[
            pm.Flocking(1.5, 0.6, 6.0, limit=20.0, on="birds"),
            pm.Flee(by="hunters", on="birds", strength=20.0, cutoff=4.0),
            pm.Flee(by="birds", on="hunters", strength=-9.0, cutoff=5.0, field_of_view=220.0),
            pm.Seek(("t", 1, 0), 3.0, 0.2),
            pm.Cruise(3.0),
            pm.Avoid([ball], 30.0),
        ],
        dt=1 / 60,
        solver=pm.Leapfrog(),
    )


def test_kernels_agree_with_the_reference_and_with_runs_that_are_cut():
    """Ways part slowly: until then rounding is all that differs, unless somebody comes into view a step later."""
    scene = flight()
    compiled = scene.simulation()
    plain = pm.Simulation(scene.simulation().system, scene.solver, scene.dt, compiled=False)
    whole = [f.positions.copy() for f in compiled.frames(13, 60)]
    slow = [f.positions.copy() for f in plain.frames(13, 60)]
    np.testing.assert_allclose(whole[-1], slow[-1], rtol=0, atol=1e-9)
    again = pm.Scene.from_toml(scene.to_toml()).simulation()
    for _ in range(12):
        again.step(1)
    np.testing.assert_array_equal(again.system.particles.x, whole[-1])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pm.Flocking(field_of_view=400.0), "field_of_view = 400.0 is not allowed"),
        (lambda: pm.Flocking(cutoff=0.0), "cutoff = 0.0 is not allowed"),
        (lambda: pm.Flocking(limit=-1.0), "limit = -1.0 is not allowed"),
        (lambda: pm.Flee(by="hawks"), "unknown group of particles 'hawks'"),
        (lambda: pm.Flee(by=[99]), "rows of particles must be whole numbers below 60"),
        (lambda: pm.Avoid([]), r"around = \[\] is not allowed"),
        (lambda: pm.Seek(arrival=0.0), "arrival = 0.0 is not allowed"),
        (lambda: pm.Cruise(speed=-1.0), "speed = -1.0 is not allowed"),
    ],
)
def test_what_is_refused(make, words):
    with pytest.raises(pm.InvalidInput, match=words):
        make().bind(crowd())
