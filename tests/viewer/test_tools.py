"""What a user does to a run by hand: pins, springs, particles, a ball and a sphere that push."""

from __future__ import annotations

import math

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer.additions import DAMPING_RATIO, RATE
from pointmass.viewer.inputs import Cut, Drop, Hold, Join, LetGo, Pin, Push, Remove, Shoot, Solve, Turn, Vanish
from pointmass.viewer.live import Live, replay
from pointmass.viewer.messages import Grab, JoinPicked, Note, Pick, PinPicked
from pointmass.viewer.session import Session
from pointmass.viewer.sphere import FOLLOWS, STIFFEST, MovingSphere
from pointmass.viewer.subject import Subject


def free(*places, dt=1e-3, solver=None, gravity=0.0, m=2.0):
    """Particles on which nothing acts."""
    body = pm.body_of(pm.Particles(places, m=m))
    live = Live(Subject.of_scene(pm.Scene(bodies=[body], forces=[pm.Gravity((0, -gravity, 0))], dt=dt, solver=solver)))
    live.start()
    return live


def particles(live):
    return live.sim.system.particles


def test_who_is_pinned_stays_and_who_is_let_go_falls():
    live = free((0, 1, 0), (1, 1, 0), gravity=9.81)
    live.sim.run(0.1)
    here = particles(live).x.copy()
    live.apply(Pin(0, True))
    live.sim.run(0.1)
    np.testing.assert_array_equal(particles(live).x[0], here[0])
    assert particles(live).x[1, 1] < here[1, 1] - 0.05
    live.apply(Pin(0, False))
    live.sim.run(0.2)
    fallen = here[0, 1] - particles(live).x[0, 1]
    assert fallen == pytest.approx(9.81 / 2 * 0.2**2, rel=0.01)


def test_who_is_led_or_gone_cannot_be_pinned():
    live = Live(Subject.of_shipped(SCENES["curtain"](particles=9)))
    led = int(live.sim.motions[0].ids[0])
    with pytest.raises(InvalidInput, match="led"):
        live.apply(Pin(led, False))
    with pytest.raises(InvalidInput, match="no longer"):
        live.apply(Pin(10**6, True))
    assert live.recording.inputs == []


@pytest.mark.parametrize("t", [0.02, 0.1, 0.3])
def test_a_new_spring_swings_as_its_closed_form_says(t):
    """Two equal masses on a damped spring: their distance is a damped oscillation about the rest length."""
    live = free((0, 0, 0), (1, 0, 0), dt=1e-4, solver=pm.RK4())
    live.apply(Join(0, 1))
    particles(live).x[1, 0] = 1.2
    live.sim.run(t)
    zeta, omega = DAMPING_RATIO, RATE * math.sqrt(1 - DAMPING_RATIO**2)
    swing = math.exp(-zeta * RATE * t) * (math.cos(omega * t) + zeta * RATE / omega * math.sin(omega * t))
    x = particles(live).x
    assert x[1, 0] - x[0, 0] == pytest.approx(1 + 0.2 * swing, abs=1e-6)
    assert x[:, 0].sum() == pytest.approx(1.2, abs=1e-12)


def test_springs_come_one_after_the_other():
    live = free((0, 0, 0), (1, 0, 0), (1, 1, 0), dt=1 / 60)
    before = len(live.sim.system.forces)
    live.apply(Join(0, 1))
    live.apply(Join(1, 2))
    (springs,) = live.sim.system.forces[before:]
    np.testing.assert_array_equal(springs.ids, [[0, 1], [1, 2]])
    np.testing.assert_allclose(springs.parameters["rest"].components[0].value, [1, 1])
    h_w = math.sqrt(springs.parameters["k_s"].components[0].value[0] * (1 / 2 + 1 / 2)) / 60
    assert h_w == pytest.approx(STIFFEST)  # no more than an explicit step allows
    drawn = {d.name: d for d in live.look().drawables}
    assert any("added" in name for name in drawn)


@pytest.mark.parametrize(("pair", "sentence"), [((0, 0), "another"), ((0, 1), "pinned"), ((0, 99), "no longer")])
def test_a_spring_that_cannot_be(pair, sentence):
    live = free((0, 0, 0), (1, 0, 0))
    live.apply(Pin(0, True))
    live.apply(Pin(1, True))
    with pytest.raises(InvalidInput, match=sentence):
        live.apply(Join(*pair))


def test_a_particle_is_added_and_everything_acts_on_it():
    live = free((0, 0, 0), (1, 0, 0), gravity=9.81)
    live.apply(Drop((0.5, 2.0, 0.0)))
    assert len(particles(live)) == 3
    assert particles(live).m[2] == 2.0
    live.sim.run(0.2)
    assert 2 - particles(live).x[2, 1] == pytest.approx(9.81 / 2 * 0.04, rel=0.01)
    live.apply(Join(0, 2))
    live.apply(Hold(2, (0, 5, 0)))
    live.sim.run(0.5)
    assert particles(live).x[0, 1] > particles(live).x[1, 1]


def test_what_was_added_stays_when_a_slider_is_turned():
    live = Live(Subject.of_shipped(SCENES["pendulum"](links=2)))
    live.start()
    live.apply(Join(0, 2))
    live.apply(Pin(1, True))
    assert live.apply(Turn({"gravity": 3.0})) is None
    assert live.apply(Solve("rk4", 0.0)) is None
    assert [f.family for f in live.sim.system.forces if isinstance(f, pm.Springs)] == ["chain", "added"]
    assert particles(live).pinned[1]


def law(x, v, t, **parameters):
    """The push on one particle of 2 kg."""
    force = MovingSphere(**parameters)
    system = pm.ParticleSystem(pm.Particles([x], v=[v], m=2.0), [force])
    return system.deriv_eval(t, system.get_state())[3:] * 2.0


def test_the_push_of_a_moving_sphere():
    how = {"center": (0, 0, 0), "velocity": (1, 0, 0), "since": 1.0, "duration": 2.0, "radius": 0.5, "rate": 10.0}
    depth = 0.5 - 0.3
    np.testing.assert_allclose(law((0.3, 0, 0), (0, 0, 0), 0.5, **how), [2 * 100 * depth, 0, 0])  # before it moves
    np.testing.assert_allclose(law((1.0, 0.3, 0), (0, 0, 0), 2.0, **how), [0, 2 * 100 * depth, 0])
    np.testing.assert_allclose(law((2.0, 0, 0.3), (0, 0, 0), 9.0, **how), [0, 0, 2 * 100 * depth])  # at rest
    damped = law((1.3, 0, 0), (-1.0, 0, 0), 2.0, **how, damping=0.25)
    np.testing.assert_allclose(damped, [2 * 100 * depth * 1.5, 0, 0])  # it and the sphere meet with 2 m/s
    np.testing.assert_array_equal(law((2.0, 0, 0), (0, 0, 0), 2.0, **how), [0, 0, 0])  # outside
    assert np.isfinite(law((1.0, 0, 0), (0, 0, 0), 2.0, **how)).all()  # in the middle


@pytest.mark.parametrize("solver", [pm.SymplecticEuler(), pm.RK4(), pm.ImplicitEuler()])
@pytest.mark.parametrize("dt", [1 / 480, 1 / 60])
def test_a_ball_pushes_whom_it_meets_before_itself(solver, dt):
    live = free((0, 0.02, 0), (0, 3, 0), dt=dt, solver=solver)
    live.apply(Shoot((0, 0, 2.0), (0, 0, -4.0), 0.3))
    live.sim.run(0.4)
    assert particles(live).v[0, 2] == 0.0
    live.sim.run(0.6)
    assert particles(live).v[0, 2] < -2.0
    assert np.abs(particles(live).v[0]).max() < 20.0
    np.testing.assert_array_equal(particles(live).x[1], (0, 3, 0))
    ball = next(d for d in live.look().drawables if d.name == "pushing sphere")
    np.testing.assert_allclose(ball.vertices, [[0, 0, 2 - 4 * live.sim.t]], atol=1e-9)
    live.apply(Vanish())
    assert all(d.name != "pushing sphere" for d in live.look().drawables)


def test_a_sphere_follows_where_it_is_led():
    live = free((0.0, 0.0, 0.0), dt=1 / 240)
    live.apply(Push((-1.0, 0.0, 0.0), 0.2))
    for k in range(31):
        live.apply(Push((-1.0 + k / 30, 0.0, 0.0), 0.2))
        live.sim.run(FOLLOWS)
    assert particles(live).x[0, 0] > 0.15  # it is pushed out to the right
    assert particles(live).v[0, 0] > 0.5


def test_in_a_flow_there_is_nothing_to_push():
    live = Live(Subject.of_shipped(SCENES["flow"]()))
    for what in (Shoot((0, 0, 0), (1, 0, 0), 0.1), Push((0, 0, 0), 0.1), Join(0, 1)):
        with pytest.raises(InvalidInput, match="flow"):
            live.apply(what)


def work(live):
    """A user's minute at a cloth."""
    p = particles(live)
    yield Pin(int(p.id[20]), True)
    yield Hold(int(p.id[5]), (0.2, 0.4, 0.6))
    yield Push((0.0, 0.5, 0.3), 0.1)
    yield LetGo()
    yield Push((0.0, 0.5, 0.1), 0.1)
    yield Solve("rk4", 1 / 4000)
    yield Pin(int(p.id[20]), False)
    yield Shoot((0.0, 0.0, 1.0), (0.0, 0.0, -9.0), 0.1)
    yield Join(int(p.id[0]), int(p.id[60]))
    yield Join(int(p.id[1]), int(p.id[50]))
    yield Cut(int(p.id[0]), int(p.id[60]))
    yield Turn({"gravity": 3.0})


@pytest.mark.parametrize("scene", ["cloth", "pendulum"])
def test_all_of_it_replays_to_the_same_bits(scene):
    shipped = SCENES["cloth"](particles=8) if scene == "cloth" else SCENES["pendulum"](links=64)
    subject = Subject.of_shipped(shipped)
    live = Live(subject)
    live.start()
    for what in [*work(live), *([Drop((0.3, 0.5, 0.0))] if scene == "pendulum" else [])]:
        assert live.apply(what) is None
        live.advance(0.6)
    if scene == "pendulum":
        for what in (Remove(int(particles(live).id[-1])), Drop((0.3, 0.5, 0.0), int(particles(live).id[-1]))):
            assert live.apply(what) is None
            live.advance(0.6)
    again = replay(subject, live.recording, live.steps)
    assert again.t == live.sim.t > 0.05
    assert again.system.particles.id.tobytes() == particles(live).id.tobytes()
    assert again.system.get_state().tobytes() == live.sim.system.get_state().tobytes()


def test_a_spring_comes_back_as_long_as_it_was_and_a_particle_as_who_it_was():
    live = free((0, 0, 0), (1, 0, 0), (2, 0, 0))
    before = len(live.sim.system.forces)
    live.apply(Join(0, 1))
    cut = live.undoing(Join(1, 2))
    live.apply(Join(1, 2))
    again = live.undoing(cut)
    live.apply(cut)
    (springs,) = live.sim.system.forces[before:]
    np.testing.assert_array_equal(springs.ids, [[0, 1]])
    particles(live).x[2, 0] = 5.0
    live.apply(again)
    (springs,) = live.sim.system.forces[before:]
    np.testing.assert_array_equal(springs.ids, [[0, 1], [1, 2]])
    np.testing.assert_allclose(springs.parameters["rest"].components[0].value, [1, 1])
    for pair in ((1, 2), (0, 1)):
        live.apply(Cut(*pair))
    assert len(live.sim.system.forces) == before
    with pytest.raises(InvalidInput, match="no spring any more between the particles 0 and 1"):
        live.apply(Cut(0, 1))

    remove = live.undoing(Drop((0, 1, 0)))
    live.apply(Drop((0, 1, 0)))
    back = live.undoing(remove)
    live.apply(remove)
    assert particles(live).id.tolist() == [0, 1, 2]
    live.apply(back)
    assert particles(live).id.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(particles(live).x[3], (0, 1, 0))


def test_a_ball_flies_on_where_another_one_took_its_place():
    live = free((9, 9, 9))
    first, second = Shoot((0, 0, 2.0), (0, 0, -4.0), 0.3), Shoot((5, 5, 5), (1, 0, 0), 0.1)
    assert live.undoing(first) == Vanish()
    live.apply(first)
    live.sim.run(0.25)
    back = live.undoing(second)
    assert back == Shoot((0.0, 0.0, pytest.approx(1.0)), (0.0, 0.0, -4.0), 0.3)
    live.apply(second)
    assert live.undoing(back) == Shoot((5.0, 5.0, 5.0), (1.0, 0.0, 0.0), 0.1)
    assert live.undoing(Push((0, 0, 0), 0.1)) is None
    live.apply(Push((0, 0, 0), 0.1))
    assert live.undoing(Vanish()) is None  # a sphere that was led is no change to take back


def test_particles_are_picked_by_row_and_pinned_and_joined_by_a_key():
    live = free((0, 0, 0), (1, 0, 0), (2, 0, 0))
    session = Session(live, playing=False)
    notes = []
    session.start()
    session.watch(lambda m: notes.append(m.text) if isinstance(m, Note) and m.text else None)

    session.stop()  # from here on, this thread is the session's
    session._guarded(lambda: session._take(PinPicked()))
    assert notes == ["pick a particle first"]
    sequence = session.latest.sequence
    for message in (Pick(sequence=sequence, row=2), Grab(sequence=sequence, row=0, target=(0.0, 0.0, 0.0))):
        session._take(message)
    assert live.picked == [0, 2]
    assert session.latest.picked == [0, 2]
    session._take(PinPicked())
    assert particles(live).pinned.tolist() == [True, False, False]
    assert session.latest.pinned
    session._take(PinPicked())
    assert not particles(live).pinned.any()
    session._take(JoinPicked())
    np.testing.assert_array_equal(live.sim.system.forces[-1].ids, [[0, 2]])
