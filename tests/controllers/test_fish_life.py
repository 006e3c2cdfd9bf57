"""Fish over whole lives: they flee and hunt, mate, leave water that does not suit them; on any number of threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import pointmass as pm
from pointmass.bodies.fish import NODES
from pointmass.controllers import intention as order

DT = 1 / 960
ALONE = (0.0, 0.0, 0.0, 1e6)  # a home that is everywhere
MANY = """
import hashlib, sys
import pointmass as pm

scene = pm.SCENES["school"](fish=40, predators=2).build()
sim = scene.simulation()
sim.step(400)
print(hashlib.sha256(sim.system.particles.x.tobytes() + sim.system.particles.v.tobytes()).hexdigest())
"""


@pytest.fixture(autouse=True)
def compiled(monkeypatch):
    monkeypatch.setenv("POINTMASS_ENGINE", "compiled")


def simulation(bodies, names, brain, seed=0):
    scene = pm.Scene(bodies=bodies, names=names, solver=pm.SymplecticEuler(), dt=DT, controllers=[brain], seed=seed)
    sim = scene.simulation()
    return sim, sim.controllers[0]


def middles(sim, name):
    p = sim.system.particles
    return p.x[p.select(name)].reshape(-1, NODES, 3).mean(axis=1)


def test_prey_escapes_more_often_than_not():
    """A hundred chases far from each other: the pike comes from any direction, five lengths of its prey away."""
    count = 100
    places = 100.0 * np.stack([np.arange(count) % 10, np.zeros(count), np.arange(count) // 10], axis=1)
    rng = np.random.default_rng(5)
    angle = rng.uniform(0, 2 * np.pi, count)
    away = np.stack([np.cos(angle), rng.uniform(-0.2, 0.2, count), np.sin(angle)], axis=1)
    prey = pm.fish(count, places, rng.normal(size=(count, 3)) * (1, 0.2, 1), length=0.2, drag=267.0)
    pikes = pm.fish(count, places + away, -away, length=0.5, drag=667.0)
    brain = pm.FishBrain(["prey", "pikes"], ["prey", "predator"], vigour=[1.0, 0.45], home=ALONE, schools="none")
    sim, brain = simulation([prey, pikes], ["prey", "pikes"], brain)
    nearest = np.full(count, np.inf)
    for _ in range(20):
        sim.step(384)
        gap = np.linalg.norm(middles(sim, "prey") - middles(sim, "pikes"), axis=1)
        nearest = np.minimum(nearest, gap)
    caught = int((brain.memory["caught"][:count] > 0).sum())
    assert 0 < caught < count / 2
    assert np.median(nearest) < 1.0  # they were hunted
    assert brain.memory["eaten"][count:].sum() == brain.memory["caught"].sum()


def test_two_that_long_for_each_other_meet():
    pair = pm.fish(2, [(0, 0, 0), (0.4, 0, 0.9)], [(1, 0, 0), (-1, 0, 0.3)], length=0.3)
    brain = pm.FishBrain("pair", "pacifist", home=ALONE, schools="none", mood=0.0)
    sim, brain = simulation([pair], ["pair"], brain)
    brain.memory["mating"] = np.full(2, -400.0)
    seen = set()
    for _ in range(80):
        sim.step(96)
        seen |= set(brain.memory["intention"].tolist())
    assert order.MATE in seen
    assert (brain.memory["mated"] == 1).all()  # and then for a while they do not


def test_a_fish_leaves_water_that_is_too_cold():
    one = pm.fish(1, (1.2, 0, 0), (1, 0, 0), length=0.3)
    brain = pm.FishBrain("one", "pacifist", home=ALONE, schools="none", mood=0.0, temperature="20 - 8*x")
    sim, brain = simulation([one], ["one"], brain)
    sim.step(200)
    assert brain.memory["intention"].tolist() == [order.LEAVE]
    sim.step(9600)
    assert 20 - 8 * middles(sim, "one")[0, 0] > 15  # the lowest that suits it


def test_brains_on_any_number_of_threads_give_the_same_bits():
    def run(threads):
        environment = {**os.environ, "POINTMASS_THREADS": str(threads), "POINTMASS_ENGINE": "compiled"}
        done = subprocess.run(
            [sys.executable, "-c", MANY], env=environment, capture_output=True, text=True, check=True, timeout=600
        )
        return done.stdout

    assert run(1) == run(2) == run(3) != ""


def test_fish_swim_in_semi_implicit_steps_of_a_sixtieth():
    """One step of Newton each, as Tu and Terzopoulos took them; the beat is damped, and so the way is shorter."""
    shipped = pm.SCENES["school"](fish=8)
    scene = shipped.build()
    fine = list(scene.simulation().frames(120, 60))
    scene.solver, scene.dt = pm.ImplicitEuler(newton="one", cg_tolerance=1e-3), 1 / 60
    frames = list(scene.simulation().frames(120, 60))
    shipped.check(frames)
    went = [np.linalg.norm(f[-1].positions - f[0].positions, axis=1).mean() for f in (frames, fine)]
    assert 0.4 * went[1] < went[0] < went[1]
