"""Changes of settings in a session: undo and redo, and kernels that are compiled beside it."""

from __future__ import annotations

import threading
import time

import pytest

import pointmass as pm
from pointmass.scenes import SCENES
from pointmass.viewer.live import Live, replay
from pointmass.viewer.messages import (
    AddParticle,
    Change,
    Choose,
    JoinPicked,
    Note,
    Pick,
    PinPicked,
    Redo,
    Reset,
    SetSolver,
    SetSwitch,
    ShootBall,
    Status,
    Undo,
)
from pointmass.viewer.session import Session
from pointmass.viewer.subject import Subject


class Heard:
    """A session that nobody plays, and what it tells."""

    def __init__(self, live):
        self.live, self.session = live, Session(live, playing=False)
        self.messages = []
        self.session.start()
        self.session.watch(self.messages.append)

    def send(self, *messages):
        """Send, and wait until all are done."""
        for message in messages:
            self.session.send(message)
        self.until(lambda: not self.session._waiting and self.session._preparing is None)

    def until(self, condition):
        end = time.monotonic() + 120
        while not condition():
            assert time.monotonic() < end
            time.sleep(0.01)

    def last(self, kind):
        return next((m for m in reversed(self.messages) if isinstance(m, kind)), None)


@pytest.fixture
def pendulum():
    heard = Heard(Live(Subject.of_shipped(SCENES["pendulum"](links=2))))
    yield heard
    heard.session.stop()


def test_undo_and_redo_of_every_change(pendulum):
    live, setups = pendulum.live, [pendulum.live.setup]
    for message in (
        Change(name="gravity", value=3.0),
        SetSolver(name="rk4", dt=1 / 500),
        SetSwitch(name="forces.0", on=False),
        Choose(preset="syrup"),
        Change(name="links", value=3),
    ):
        pendulum.send(message)
        pendulum.until(lambda: live.setup != setups[-1])
        setups.append(live.setup)
    assert live.solver == "rk4"
    for wanted in reversed(setups[:-1]):
        pendulum.send(Undo())
        pendulum.until(lambda wanted=wanted: live.setup == wanted)
    pendulum.until(lambda: not pendulum.last(Status).undo and pendulum.last(Status).redo)
    assert live.solver != "rk4"
    assert all(f.enabled for f in live.sim.system.forces)
    assert len(live.sim.system.particles) == 3
    for wanted in setups[1:]:
        pendulum.send(Redo())
        pendulum.until(lambda wanted=wanted: live.setup == wanted)
    pendulum.until(lambda: not pendulum.last(Status).redo)
    assert (live.solver, live.dt) == ("rk4", 1 / 500)
    assert len(live.sim.system.particles) == 4


def test_a_slider_on_its_way_is_one_change(pendulum, monkeypatch):
    monkeypatch.setattr("pointmass.viewer.history.TOGETHER", 1e3)
    for k in range(4):
        pendulum.send(Change(name="gravity", value=3.0 + k))
    pendulum.send(Change(name="drag", value=0.5))
    pendulum.until(lambda: pendulum.live.settings == {"gravity": 6.0, "drag": 0.5})
    pendulum.send(Undo())
    pendulum.until(lambda: pendulum.live.settings == {"gravity": 6.0})
    pendulum.send(Undo())
    pendulum.until(lambda: pendulum.live.settings == {})


def test_a_change_after_an_undo_forgets_what_was_undone(pendulum):
    pendulum.send(Change(name="gravity", value=3.0), Undo(), Change(name="drag", value=0.5))
    pendulum.until(lambda: "drag" in pendulum.live.settings)
    pendulum.until(lambda: pendulum.last(Status).undo and not pendulum.last(Status).redo)
    pendulum.send(Redo())
    pendulum.until(lambda: (pendulum.last(Note) or Note(level="info", text="")).text == "there is nothing to redo")


def test_undo_and_redo_of_what_is_done_by_hand(pendulum):
    live = pendulum.live

    def state():
        p, forces = live.sim.system.particles, live.sim.system.forces
        added = [f.ids.tolist() for f in forces if getattr(f, "family", "") == "added"]
        return p.id.tolist(), p.pinned.tolist(), added, live._sphere.radius, dict(live.settings)

    sequence = pendulum.session.latest.sequence
    states = [state()]
    for message in (
        PinPicked(),
        JoinPicked(),
        AddParticle(place=(1.0, 0.0, 0.0)),
        Change(name="gravity", value=3.0),
        ShootBall(place=(0.0, 0.0, 2.0), velocity=(0.0, 0.0, -1.0), radius=0.1),
        PinPicked(),
    ):
        pendulum.send(*(Pick(sequence=sequence, row=row) for row in (1, 2)), message)
        pendulum.until(lambda: state() != states[-1])
        states.append(state())
    assert states[1][1] == [True, False, True]
    assert states[3][0] == [0, 1, 2, 3]
    for message, wanted in [(Undo(), states[-2::-1]), (Redo(), states[1:]), (Undo(), states[-2::-1])]:
        for each in wanted:
            pendulum.send(message)
            pendulum.until(lambda each=each: state() == each)
    pendulum.until(lambda: not pendulum.last(Status).undo)
    again = replay(Subject.of_shipped(SCENES["pendulum"](links=2)), live.recording, live.steps)
    assert again.system.get_state().tobytes() == live.sim.system.get_state().tobytes()


def test_two_pins_at_once_are_two_changes(pendulum):
    sequence, p = pendulum.session.latest.sequence, pendulum.live.sim.system.particles
    for row in (1, 2):
        pendulum.send(Pick(sequence=sequence, row=row), PinPicked())
    pendulum.until(lambda: p.pinned.tolist() == [True, True, True])
    pendulum.send(Undo())
    pendulum.until(lambda: p.pinned.tolist() == [True, True, False])


def test_what_was_done_to_an_earlier_run_is_not_undone(pendulum):
    sequence = pendulum.session.latest.sequence
    pendulum.send(Change(name="gravity", value=3.0), Pick(sequence=sequence, row=1), PinPicked())
    pendulum.until(lambda: pendulum.live.pinned)
    pendulum.send(Reset(), Undo())
    pendulum.until(lambda: pendulum.live.settings == {})
    assert pendulum.live.sim.system.particles.pinned.tolist() == [True, False, False]
    pendulum.until(lambda: not pendulum.last(Status).undo)


def test_a_step_back_that_cannot_be_made_is_left_out(pendulum):
    live, sequence = pendulum.live, pendulum.session.latest.sequence
    pendulum.send(Change(name="gravity", value=3.0), Pick(sequence=sequence, row=2), PinPicked())
    pendulum.until(lambda: live.pinned)
    live.sim.system.remove([2])
    pendulum.send(Undo())
    pendulum.until(lambda: "particle 2 is no longer there" in pendulum.last(Note).text)
    pendulum.send(Undo())
    pendulum.until(lambda: live.settings == {})


def test_what_needs_a_kernel_waits_for_it_and_the_run_does_not():
    """The job that compiles is held up: meanwhile frames are made, numbers are changed, and settings wait in order."""
    scene = pm.Scene(bodies=[pm.scatter(3, size=(1, 1, 1))], forces=[pm.Gravity(), pm.Drag(0.1)], dt=1 / 60)
    live = Live(Subject.of_scene(scene))
    compiled, real = threading.Event(), live.prepare
    live.prepare = lambda what: compiled.wait if getattr(what, "solver", "") else real(what)
    heard = Heard(live)
    heard.session._playing = True
    heard.session.send(SetSolver(name="rk4", dt=0.0))
    heard.until(lambda: "compiled" in (heard.last(Note) or Note(level="info", text="")).text)
    steps = live.steps
    heard.until(lambda: live.steps > steps + 3)
    assert live.solver == "symplectic_euler"
    heard.session.send(SetSwitch(name="forces.1", on=False))
    heard.until(lambda: heard.session._postponed)
    compiled.set()
    heard.until(lambda: live.solver == "rk4" and live.setup.switches == {"forces.1": False})
    heard.until(lambda: heard.last(Note).text == "")
    kinds = [type(what).__name__ for _, what in live.recording.inputs]
    assert kinds == ["Solve", "Toggle"]
    heard.session.stop()
