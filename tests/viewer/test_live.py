from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer.inputs import Hold, Lead, LetGo, Turn
from pointmass.viewer.live import Live, replay
from pointmass.viewer.mouse import RATE
from pointmass.viewer.subject import Subject

START = (0.3, 1.0, -0.2)


def one(dt=1e-3, solver=None, m=2.0, gravity=9.81):
    """A particle that falls."""
    body = pm.body_of(pm.Particles([START], m=m))
    scene = pm.Scene(bodies=[body], forces=[pm.Gravity((0, -gravity, 0))], dt=dt, solver=solver)
    return Live(Subject.of_scene(scene))


def run(live, seconds):
    live.sim.run(seconds)
    return live.sim.system.particles.x[0].copy()


def critical(t, x0, target, rest):
    """x(t) of x'' = -w^2 (x - rest) - 2 w x' from rest at x0, with w = RATE."""
    a = np.subtract(x0, rest)
    return rest + a * (1 + RATE * t) * math.exp(-RATE * t)


@pytest.mark.parametrize("t", [0.05, 0.2, 0.6])
def test_a_grabbed_particle_goes_where_the_spring_says(t):
    live = one(dt=1e-4, solver=pm.RK4())
    target = (1.0, 2.0, 0.5)
    live.apply(Hold(int(live.sim.system.particles.id[0]), target))
    rest = np.array(target) - (0, 9.81 / RATE**2, 0)
    np.testing.assert_allclose(run(live, t), critical(t, START, target, rest), atol=1e-9)


def test_u01_a_held_mass_rests_m_g_over_k_m_below_the_cursor():
    live = one(dt=1e-3)
    target = (1.0, 2.0, 0.5)
    live.apply(Hold(int(live.sim.system.particles.id[0]), target))
    offset = run(live, 30 / RATE) - target
    np.testing.assert_allclose(offset, [0, -9.81 / RATE**2, 0], atol=1e-6)


def test_release_leaves_the_velocity_as_it_is():
    live = one(gravity=0.0)
    live.apply(Hold(int(live.sim.system.particles.id[0]), (1, 1, 1)))
    run(live, 0.05)
    v = live.sim.system.particles.v[0].copy()
    assert np.linalg.norm(v) > 0.1
    live.apply(LetGo())
    run(live, 0.1)
    np.testing.assert_array_equal(live.sim.system.particles.v[0], v)


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.Leapfrog(), pm.RK4(), pm.Heun(), pm.ImplicitEuler()])
@pytest.mark.parametrize("dt", [1 / 240, 1 / 30, 0.2])
def test_no_step_is_too_long_for_the_mouse(solver, dt):
    live = one(dt=dt, solver=solver, gravity=0.0)
    live.apply(Hold(int(live.sim.system.particles.id[0]), (1.0, 1.0, 1.0)))
    np.testing.assert_allclose(run(live, 400 * max(dt, 1 / 60)), [1, 1, 1], atol=1e-3)


def test_a_grab_lifts_all_that_hangs_together():
    live = Live(Subject.of_shipped(SCENES["springs"]()))
    p = live.sim.system.particles
    live.apply(Hold(int(p.id[0]), tuple(p.x[0] + (0, 1, 0))))
    k_m = live.sim.system.forces[-1].parameters["k_s"].components[0].value
    assert k_m == pytest.approx(min(RATE**2 * p.m[~p.pinned].sum(), p.m[0] * (0.4 / live.sim.dt) ** 2))


def inputs(live):
    """A minute of a user's work."""
    p = live.sim.system.particles
    yield Hold(int(p.id[5]), (0.2, 0.4, 0.6))
    yield Lead((0.5, 0.5, 0.5))
    yield Turn({"gravity": 3.0})
    yield Lead((-0.5, 0.2, 0.3))
    yield LetGo()
    yield Turn({"gravity": 12.0})


@pytest.mark.parametrize("speed", [1.0, 0.37])
def test_a_recording_replays_to_the_same_bits(speed):
    subject = Subject.of_shipped(SCENES["cloth"](particles=8))
    live = Live(subject)
    live.start()
    for what in inputs(live):
        assert live.apply(what) is None
        for _ in range(2):
            live.advance(speed)
    again = replay(subject, live.recording, live.sim.steps)
    assert again.steps == live.sim.steps > 0
    assert again.system.get_state().tobytes() == live.sim.system.get_state().tobytes()
    untouched = replay(subject, type(live.recording)(), live.sim.steps)
    assert untouched.system.get_state().tobytes() != live.sim.system.get_state().tobytes()


def test_a_parameter_changes_the_run_from_here_on():
    live = Live(Subject.of_shipped(SCENES["cloth"](particles=8)))
    live.start()
    live.advance(1.0)
    before = live.sim.system.get_state().copy()
    assert live.apply(Turn({"gravity": 0.0})) is None
    np.testing.assert_array_equal(live.sim.system.get_state(), before)
    gravity = next(f for f in live.sim.system.forces if isinstance(f, pm.Gravity))
    assert gravity.parameters["g"].components[1].value == 0
    assert {p.name: p.value for p in live.parameters}["gravity"] == 0.0


def test_a_fountain_rises_higher_and_replays():
    subject = Subject.of_shipped(SCENES["fountain"](rate=300.0))
    live = Live(subject)
    live.start()
    for k in range(12):
        if k == 6:
            assert live.apply(Turn({"speed": 20.0, "wind": 5.0, "restitution": 0.9})) is None
        live.advance(4.0)
    p = live.sim.system.particles
    assert len(np.unique(p.id)) == len(p)
    young = p.age < 0.2
    assert p.v[young, 1].max() > 15 > p.v[~young & (p.age > 0.5), 1].max()
    again = replay(subject, live.recording, live.sim.steps)
    assert again.system.get_state().tobytes() == live.sim.system.get_state().tobytes()
    frame = live.apply(Turn({"rate": 600.0}))  # other births: ids would be used twice
    assert frame is not None


def test_other_particles_begin_again():
    live = Live(Subject.of_shipped(SCENES["cloth"](particles=8)))
    live.start()
    live.advance(1.0)
    frame = live.apply(Turn({"particles": 10}))
    assert frame is not None
    assert frame.time == 0
    assert len(frame.positions) == 100
    assert live.recording.setup.parameters == {"particles": 10}
    assert live.recording.inputs == []


def test_a_value_that_is_not_allowed_changes_nothing():
    live = Live(Subject.of_shipped(SCENES["cloth"](particles=8)))
    live.start()
    for settings in ({"gravity": -5.0}, {"no such": 1}, {"held": "nobody"}, {"gravity": "x"}):
        with pytest.raises(InvalidInput):
            live.apply(Turn(settings))
    assert live.recording.inputs == []
    assert live.settings == {}


def test_presets_start_from_the_scene_as_it_was_opened():
    live = Live(Subject.of_shipped(SCENES["cloth"](particles=8)))
    live.apply(Turn({"gravity": 1.0}))
    frame = live.apply(live.preset("handkerchief"))
    values = {p.name: p.value for p in live.parameters}
    assert (values["held"], values["gravity"], values["particles"]) == ("middle", 9.81, 8)
    assert frame is not None
    with pytest.raises(InvalidInput, match="preset"):
        live.preset("no such")


def test_nobody_is_grabbed_in_a_flow():
    live = Live(Subject.of_shipped(SCENES["flow"]()))
    assert not live.grabs
    with pytest.raises(InvalidInput, match="flow"):
        live.apply(Hold(0, (0, 0, 0)))
