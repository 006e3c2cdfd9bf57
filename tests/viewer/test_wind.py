"""The wind's direction."""

from __future__ import annotations

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.viewer.inputs import Blow, Restore, Turn
from pointmass.viewer.live import Live, replay
from pointmass.viewer.setup import Setup
from pointmass.viewer.subject import Subject


def blown(*forces, **values):
    """A particle of 1 kg at rest, in the wind."""
    body = pm.body_of(pm.Particles([(0, 0, 0)]))
    live = Live(Subject.of_scene(pm.Scene(bodies=[body], forces=forces, dt=1 / 240, **values)))
    live.start()
    return live


def force(live):
    return live.sim.system.deriv_eval()[3:]


def test_the_wind_pushes_where_it_is_turned_to_as_strongly():
    live = blown(pm.Gravity(), pm.Wind((3.0, 0.0, 4.0), k=0.5))
    assert live.wind == (3.0, 0.0, 4.0)
    np.testing.assert_allclose(force(live), [1.5, -9.81, 2.0])
    assert live.apply(Blow((0.0, 2.0, 0.0))) is None
    np.testing.assert_allclose(force(live), [0, 2.5 - 9.81, 0])
    np.testing.assert_allclose(live.wind, (0, 5, 0))
    live.apply(Restore(Setup()))
    np.testing.assert_allclose(force(live), [1.5, -9.81, 2.0])


@pytest.mark.parametrize(
    "velocity",
    [pm.Gust((2.0, 0, 0), intensity=0.0), [pm.Gust((2.0, 0, 0), intensity=0.0), ("0", "0*t", "0")], (2, 0, 0)],
)
def test_gusts_and_sums_are_turned(velocity):
    live = blown(pm.Wind(velocity, k=1.0))
    live.apply(Blow((0.0, 0.0, 1.0)))
    np.testing.assert_allclose(force(live), [0, 0, 2.0], atol=1e-12)
    assert Scene.from_toml(live.text()).forces[0].arguments.keys() == live._scene.forces[0].arguments.keys()


@pytest.mark.parametrize("velocity", [(0, 0, 0), ("sin(t)", 0, 0), pm.Vortex(circulation=1.0)])
def test_what_has_no_direction_has_no_handle(velocity):
    assert blown(pm.Wind(velocity, k=1.0)).wind is None
    assert blown(pm.Gravity()).wind is None


def test_the_slider_of_the_speed_keeps_the_direction():
    live = Live(Subject.of_shipped(SCENES["flag"](particles=8)))
    live.start()
    live.apply(Blow((0.0, 0.0, 1.0)))
    live.apply(Turn({"wind": 3.0}))
    np.testing.assert_allclose(live.wind, (0, 0, 3))


def test_no_direction_is_refused():
    live = blown(pm.Wind((1, 0, 0), k=1.0))
    with pytest.raises(InvalidInput, match="direction"):
        live.apply(Blow((0.0, 0.0, 0.0)))
    assert live.setup == Setup()


def test_it_replays_to_the_same_bits():
    subject = Subject.of_shipped(SCENES["flag"](particles=8))
    live = Live(subject)
    live.start()
    for direction in ((0.0, 0.0, 1.0), (1.0, 0.5, 1.0)):
        live.advance(0.5)
        live.apply(Blow(direction))
    live.advance(0.5)
    again = replay(subject, live.recording, live.steps)
    assert again.system.get_state().tobytes() == live.sim.system.get_state().tobytes()
