"""Snakes that head for a goal."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput


def led(goal, **arguments):
    body = pm.snake(12, 0.9, waves=1.5)
    scene = pm.Scene(
        bodies=[body],
        names=["snake"],
        forces=[pm.Gravity()],
        dt=1 / 1200,
        controllers=[pm.Steer("snake", goal, 0.1, **arguments)],
    )
    sim = scene.simulation()
    return pm.Simulation(sim.system, sim.solver, sim.dt, controllers=sim.controllers, compiled=True)


def test_it_reaches_goals_on_both_sides():
    for side in (1, -1):
        sim = led((1.2, 0.0, 0.8 * side), arrival=0.1)
        nearest = np.inf
        for _ in range(160):
            sim.run(0.05)
            head = sim.system.particles.x[:4].mean(axis=0)
            nearest = min(nearest, np.hypot(head[0] - 1.2, head[2] - 0.8 * side))
        assert nearest < 0.15


def test_its_bits_do_not_depend_on_how_the_run_is_cut():
    whole, pieces = led((1.0, 0.0, 0.5)), led((1.0, 0.0, 0.5))
    whole.step(300)
    for count in (7, 100, 193):
        pieces.step(count)
    assert np.array_equal(whole.system.particles.x, pieces.system.particles.x)


def test_what_has_no_muscles_is_refused():
    scene = pm.Scene(bodies=[pm.cloth(3, 3)], names=["sheet"], controllers=[pm.Steer("sheet")])
    with pytest.raises(InvalidInput, match="needs muscles, and body 'sheet' has none"):
        scene.simulation()


def test_goals_that_nobody_can_reach_are_refused():
    with pytest.raises(InvalidInput, match="goal may depend on t"):
        led(("x", 0, 0))
    rock = pm.Scene(
        bodies=[pm.snake(6)],
        names=["snake"],
        colliders=[pm.Sphere((2, 0, 0), radius=0.3)],
        controllers=[pm.Steer("snake", (2, 0, 0))],
    )
    with pytest.raises(InvalidInput, match=r"goal = \[2.0, 0.0, 0.0\] is not allowed: it is inside Sphere"):
        rock.simulation()
