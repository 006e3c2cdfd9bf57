"""Fish with brains in water: they reach goals, eat what they see, and their bits are the same after a restart."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.fish import NODES
from pointmass.controllers.swimmers import Swimmers
from pointmass.errors import InvalidInput

DT = 1 / 1024  # the clock is exact, so that a restart has the same times
LENGTH = 0.3


def system(count=1, extra=(), colliders=(), detail=0):
    places = [(0.0, 0.0, 0.8 * k) for k in range(count)]
    body = pm.fish(count, places, detail=detail)
    p = body.particles
    if len(extra):
        p.add(extra, m=1e-3)
    p.tag("fish", np.arange(NODES * count))
    p.tag("food", np.arange(NODES * count, len(p)))
    return pm.ParticleSystem(p, body.forces, colliders)


def test_the_beat_goes_on_where_it_is_when_its_frequency_changes():
    whole = system()
    fish = Swimmers(whole, ["fish"])
    memory, one = fish.rest(), np.ones(1)
    (muscles,) = (f for f in whole.forces if isinstance(f, pm.Muscles))

    def moment(t):
        wave = {n: muscles.parameters[n].components[0].value for n in ("frequency", "phase")}
        return np.sin(2 * math.pi * wave["frequency"] * t + wave["phase"])

    fish.drive(memory, 0.0, 0.2 * one, 2.0 * one, 0.0 * one, one)
    before = moment(0.73)
    fish.drive(memory, 0.73, 0.2 * one, 3.1 * one, 0.0 * one, one)
    np.testing.assert_allclose(moment(0.73), before, atol=1e-12)
    assert np.ptp(before) > 0.5


def test_a_fish_reaches_its_goal():
    goal = np.array([0.5, 0.05, 0.45])
    sim = pm.Simulation(system(), dt=DT, controllers=[pm.Swim("fish", tuple(goal))], compiled=True)
    nearest = min(float(np.linalg.norm(f.positions[0] - goal)) for f in sim.frames(80, 10))
    assert nearest < 0.5 * LENGTH


def test_a_hungry_fish_eats_what_it_sees_and_food_comes_again():
    food = [(0.7, 0.0, 0.3)]
    brain = pm.FishBrain("fish", food="food", mood=0.0, appetite=50.0, feeding=(5.0, 0.0, 0.0, 0.1, 0.1, 0.1))
    sim = pm.Simulation(system(extra=food), dt=DT, controllers=[brain], compiled=True)
    sim.run(8.0)
    assert brain.memory["eaten"].tolist() == [1.0]
    np.testing.assert_allclose(sim.system.particles.x[-1], (5, 0, 0), atol=0.06)


def test_a_fish_swims_around_what_is_in_its_way():
    ball = pm.Sphere((0.75, 0.0, 0.02), 0.25, restitution=0.0)
    brain = pm.FishBrain("fish", home=(3.0, 0.0, 0.0, 1.0))
    sim = pm.Simulation(system(colliders=[ball]), dt=DT, controllers=[brain])
    deep = [float(ball.distance(f.positions, 0.0).min()) for f in sim.frames(80, 10)]
    assert min(deep) > -1e-6
    assert min(deep) < LENGTH  # it was there
    assert np.linalg.norm(sim.system.particles.x[0]) > 2 * LENGTH  # and did not stay


def test_a_restart_goes_on_with_the_same_bits():
    def run(whole, memory=None):
        brain = pm.FishBrain("fish", schools="always", sight=3.0)
        sim = pm.Simulation(whole, dt=DT, controllers=[brain], seed=3)
        brain.memory = memory or brain.memory
        return sim, brain

    straight, _ = run(system(9))
    straight.step(820)
    first, brain = run(system(9))
    first.step(408)  # a look is every 102 steps
    later = system(9)
    later.particles.x, later.particles.v = first.system.particles.x, first.system.particles.v
    later.t = first.t
    again, _ = run(later, brain.memory)
    again.step(412)
    assert np.array_equal(again.system.particles.x, straight.system.particles.x)
    assert np.ptp(again.system.particles.x[:NODES, 0]) > 0.1


def test_what_brains_do_not_take():
    with pytest.raises(InvalidInput, match=r"goal = \[2.0, 0.0, 0.0\] is not allowed: it is inside"):
        pm.Simulation(system(colliders=[pm.Sphere((2, 0, 0), 0.5)]), controllers=[pm.Swim("fish", (2, 0, 0))])
    with pytest.raises(InvalidInput, match="has no muscles and fins of fish"):
        pm.Simulation(system(extra=[(1.0, 0, 0)]), controllers=[pm.Swim("food")])
    with pytest.raises(InvalidInput, match="unknown group of particles 'cat'"):
        pm.Simulation(system(), controllers=[pm.FishBrain("cat")])
    with pytest.raises(InvalidInput, match="unknown value of kinds: 'shark'"):
        pm.FishBrain(kinds="shark")
    with pytest.raises(InvalidInput, match="kinds has 1 entries for 2 bodies"):
        pm.FishBrain(["a", "b"], ["prey"])
    with pytest.raises(InvalidInput, match=r"comfort = \[9, 3\] is not allowed"):
        pm.FishBrain(comfort=[9, 3])
