from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.viewer.framing import Framing
from pointmass.viewer.live import Live
from pointmass.viewer.messages import Change, Choose, Drag, Grab, Play, Release, Reset, Speed, Status, Step
from pointmass.viewer.playback import Playback
from pointmass.viewer.session import MOST_WAITING, Session
from pointmass.viewer.subject import Subject

X0 = (0.0, 1.0, 0.0)


def scene(**values):
    body = pm.body_of(pm.Particles([X0, (1, 1, 0)], v=[(1, 0, 0), (0, 0, 0)]))
    return pm.Scene(bodies=[body], dt=1 / 240, fps=60, **values)


class Watched:
    """A session with somebody who watches and takes notes."""

    def __init__(self, player, **options):
        self.session = Session(player, **options)
        self.messages = []
        self.frames = 0
        self.news = threading.Condition()
        self.session.start()
        self.leave = self.session.watch(self.hear)

    def hear(self, message):
        with self.news:
            if message is None:
                self.frames += 1
            else:
                self.messages.append(message)
            self.news.notify()

    def until(self, condition):
        with self.news:
            assert self.news.wait_for(condition, timeout=120)

    @property
    def frame(self):
        return self.session.latest.frame

    def last(self, kind):
        return next((m for m in reversed(self.messages) if m.kind == kind), None)


@pytest.fixture
def watch():
    watched = []

    def begin(player, **options):
        watched.append(Watched(player, **options))
        return watched[-1]

    yield begin
    for each in watched:
        each.session.stop()


def live(**values):
    return Live(Subject.of_scene(scene(**values)))


def test_it_runs_in_real_time_pauses_and_goes_on(watch):
    it = watch(live())
    begun = time.monotonic()
    it.until(lambda: it.frame.time > 0.5)
    assert time.monotonic() - begun > 0.4
    it.session.send(Play(on=False))
    it.until(lambda: it.last("status") == Status(playing=False, speed=1.0))
    number = it.frame.number
    time.sleep(0.1)
    assert it.frame.number == number
    it.session.send(Play(on=True))
    it.until(lambda: it.frame.number > number)


def test_one_step_is_one_frame(watch):
    it = watch(live(), playing=False)
    assert it.frame.time == 0
    for k in (1, 2, 3):
        it.session.send(Step())
        it.until(lambda k=k: it.frame.number == k)
    time.sleep(0.05)
    assert it.frame.time == pytest.approx(3 / 60)
    assert it.last("status").playing is False


def test_slow_motion_shows_what_is_between_steps(watch):
    it = watch(live(), playing=False)
    it.session.send(Speed(factor=0.05))
    it.session.send(Step())
    it.until(lambda: it.frame.number == 1)
    assert it.frame.time == pytest.approx(0.05 / 60)
    np.testing.assert_allclose(it.frame.positions[0], [0.05 / 60, 1, 0], atol=1e-12)


def test_reset_begins_again(watch):
    it = watch(live())
    it.until(lambda: it.frame.number > 3)
    it.session.send(Play(on=False))
    it.session.send(Reset())
    it.until(lambda: it.frame.time == 0)
    np.testing.assert_array_equal(it.frame.positions[0], X0)


def test_it_rests_while_nobody_watches(watch):
    it = watch(live())
    it.until(lambda: it.frame.number > 3)
    it.leave()
    time.sleep(0.1)
    number = it.frame.number
    time.sleep(0.1)
    assert it.frame.number == number


def test_a_grab_names_a_row_of_a_frame(watch):
    it = watch(live(), playing=False)
    it.session.send(Grab(sequence=1, row=1, target=(2.0, 2.0, 2.0)))
    it.until(lambda: it.session.latest.held == 1)
    assert it.session.latest.target == (2.0, 2.0, 2.0)
    for _ in range(5):
        it.session.send(Step())
        it.session.send(Drag(target=(3.0, 1.0, 0.0)))
    it.until(lambda: it.frame.positions[1, 0] > 1)
    it.session.send(Release())
    it.until(lambda: it.session.latest.held == -1)
    it.session.send(Grab(sequence=1, row=2, target=(0.0, 0.0, 0.0)))
    it.until(lambda: it.last("note") and "row 2" in it.last("note").text)
    it.session.send(Grab(sequence=999, row=0, target=(0.0, 0.0, 0.0)))
    it.until(lambda: "frame 999" in it.last("note").text)


def test_what_is_not_allowed_is_said_and_it_goes_on(watch):
    it = watch(live())
    it.session.send(Change(name="gravity", value=1.0))
    it.until(lambda: it.last("note") and "gravity" in it.last("note").text)
    it.session.send(Choose(preset="no such"))
    it.until(lambda: it.last("note") and "no such" in it.last("note").text)
    assert it.last("note").level == "error"
    number = it.frame.number
    it.until(lambda: it.frame.number > number + 2)


def test_divergence_pauses_and_is_said(watch):
    @pm.unary_force
    def explodes(x, v, m, t):
        return pm.exp(400.0 * t), 0.0, 0.0

    it = watch(live(forces=[explodes()]))
    it.until(lambda: it.last("note") and "diverged" in it.last("note").text)
    it.until(lambda: it.last("status") and not it.last("status").playing)
    it.session.send(Reset())
    it.until(lambda: it.frame.time == 0)
    assert it.last("note").text == ""


def test_messages_do_not_pile_up():
    session = Session(live())
    for k in range(3 * MOST_WAITING):
        session.send(Drag(target=(float(k), 0.0, 0.0)))
    assert len(session._waiting) == 1
    for _ in range(3 * MOST_WAITING):
        session.send(Step())
    assert len(session._waiting) == MOST_WAITING


def test_a_cache_is_played_to_its_end_and_again(watch, tmp_path):
    cache = pm.record(scene().simulation(), tmp_path / "a.zarr", frames=5, fps=60)
    it = watch(Playback(pm.Cache.open(cache.path)))
    it.until(lambda: it.frame.number == 4)
    it.until(lambda: it.last("status") and not it.last("status").playing)
    it.session.send(Change(name="gravity", value=1.0))
    it.until(lambda: it.last("note") and "cache" in it.last("note").text)
    it.session.send(Reset())
    it.until(lambda: it.frame.number == 0)
    assert it.session.greeting()[0].frames == 5


def test_a_cache_without_frames_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="no frames"):
        Playback(pm.Cache.create(tmp_path / "a.zarr"))


def test_the_camera_makes_room_for_what_comes():
    sim = scene().simulation()
    framing = Framing(pm.Camera())
    assert framing.sees(sim.frame(0))
    near = framing.view.position
    assert not framing.sees(sim.frame(1))  # too early
    sim.run(5.0)
    assert framing.sees(sim.frame(2))
    assert np.linalg.norm(framing.view.position) > np.linalg.norm(near)
    fixed = Framing(pm.Camera(position=(0, 0, 9), target=(0, 1, 0)))
    fixed.sees(sim.frame(0))
    assert fixed.view.position == (0, 0, 9)


def test_it_is_said_how_much_of_the_picture_is_needed():
    x = np.float32([(-1, 0, 0), (2, 0, 0)])
    frame = pm.Frame(number=0, time=0.0, ids=np.arange(2), positions=x, velocities=np.zeros_like(x))
    framing = Framing(pm.Camera(position=(0, 0, 10), target=(0, 0, 0), fov=40))
    most = framing.view.wide  # nothing was seen yet
    assert most == pytest.approx(16 / 9 * np.tan(np.radians(20)))
    framing.sees(frame)
    assert framing.view.wide == pytest.approx(1.12 * 2 / 10)
    framing.sees(replace(frame, positions=50 * x, time=1.0))
    assert framing.view.wide == most  # what its picture does not show, a narrow one need not
