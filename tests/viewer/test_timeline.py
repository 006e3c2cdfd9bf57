from __future__ import annotations

import time

import numpy as np
import pytest

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer.messages import Loop, Play, Reset, Resume, Seek, Status, Timeline, Welcome
from pointmass.viewer.playback import Playback
from pointmass.viewer.session import Session

PATIENCE = 240.0  # kernels may have to be compiled [s]


def recorded(path, frames, scene=None, **options):
    scene = scene or SCENES["springs"](side=2).build()
    return pm.record(scene.simulation(), path, frames, scene.fps, scene=scene, **options)


@pytest.fixture
def cache(tmp_path):
    return recorded(tmp_path / "a.zarr", 10)


def eventually(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def same(a, b):
    return all(getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in ("ids", "positions", "velocities"))


def test_any_frame_is_shown_and_play_goes_on_from_it(cache):
    playback = Playback(cache)
    assert same(playback.start(), cache[0])
    for k in (7, 2, 9, 0):
        assert same(playback.take(Seek(frame=k)), cache[k])
    playback.take(Seek(frame=4))
    assert [playback.advance(1.0).number for _ in range(3)] == [5, 6, 7]
    assert [playback.advance(2.0).number] == [8]
    assert playback.advance(1.0) is None
    assert playback.advance(1.0).number == 0  # asked for more after the end, it begins again
    with pytest.raises(InvalidInput, match=r"seek\.frame = 10"):
        playback.take(Seek(frame=10))


def test_a_range_is_played_again_and_again(cache):
    playback = Playback(cache)
    playback.start()
    playback.take(Loop(on=True, first=3, last=5))
    playback.take(Seek(frame=4))
    assert [playback.advance(1.0).number for _ in range(7)] == [5, 3, 4, 5, 3, 4, 5]
    assert (playback.state().loop, playback.state().first, playback.state().last) == (True, 3, 5)
    for first, last in ((5, 3), (0, 10)):
        with pytest.raises(InvalidInput, match=r"loop\."):
            playback.take(Loop(on=True, first=first, last=last))
    playback.take(Loop(on=False, first=0, last=0))
    assert (playback.state().loop, playback.state().last) == (False, 9)
    assert playback.advance(1.0).number == 6


def test_a_cache_that_grows_is_followed(tmp_path):
    sim = SCENES["springs"](side=2).build().simulation()
    frames = list(sim.frames(12, 60))
    writing = pm.Cache.create(tmp_path / "a.zarr", fps=60)
    for frame in frames[:4]:
        writing.append(frame)
    playback = Playback(pm.Cache.open(tmp_path / "a.zarr"))
    playback.start()
    assert playback.poll() is None
    for frame in frames[4:9]:
        writing.append(frame)
    assert playback.poll() is None  # the first frame is seen, and stays
    assert playback.state().frames == 9
    assert same(playback.take(Seek(frame=8)), frames[8])
    assert playback.poll() is None
    for frame in frames[9:]:
        writing.append(frame)
    assert same(playback.poll(), frames[11])  # who stands at the end sees what comes
    assert playback.poll() is None


def test_a_cache_that_is_made_anew_is_followed(tmp_path):
    recorded(tmp_path / "a.zarr", 10)
    playback = Playback(pm.Cache.open(tmp_path / "a.zarr"))
    playback.take(Loop(on=True, first=5, last=8))
    playback.take(Seek(frame=9))
    again = recorded(tmp_path / "a.zarr", 3, SCENES["bounce"]().build(), overwrite=True)
    assert same(playback.poll(), again[2])
    assert (playback.state().frames, playback.state().loop) == (3, False)


@pytest.mark.parametrize(
    ("scene", "frame"),
    [
        (SCENES["springs"](side=2).build(), 5),
        (SCENES["fountain"]().build().changed(dt=1 / 100), 4),  # births, and frames between the steps
        (SCENES["cloth"](particles=8).build().changed(dtype="float32"), 3),
        (SCENES["flow"]().build(), 2),
    ],
    ids=["springs", "fountain", "cloth", "flow"],
)
def test_a_simulation_goes_on_from_a_frame_to_the_same_bits(tmp_path, scene, frame):
    cache = recorded(tmp_path / "a.zarr", frame + 4, scene)
    playback = Playback(cache)
    playback.take(Seek(frame=frame))
    assert playback.take(Resume(frame=frame)) is None
    assert playback.state().computing == frame
    eventually(lambda: playback.poll() is not None)
    assert playback.state().live
    assert playback.state().computing == -1
    assert playback.frames is None
    assert playback.grabs == (scene.simulation().system.order == 2)
    for k in range(frame + 1, len(cache)):
        made = playback.advance(1.0)
        assert (made.number, made.time) == (k, cache[k].time)
        assert same(made, cache[k])
    assert playback.advance(1.0) is not None  # beyond the cache's end
    assert same(playback.take(Seek(frame=1)), cache[1])
    assert not playback.state().live
    assert playback.advance(1.0).number == 2


def test_what_would_come_out_otherwise_does_not_go_on(tmp_path):
    scene = SCENES["springs"](side=2).build()
    sim = scene.simulation()
    sim.system.particles.v[:, 0] += 1e-9
    cache = pm.record(sim, tmp_path / "a.zarr", 4, scene.fps, scene=scene)
    playback = Playback(cache)
    playback.take(Resume(frame=3))

    def refused():
        try:
            return playback.poll()
        except InvalidInput as error:
            return "frame 0 comes out otherwise" in str(error)

    eventually(refused)
    assert not playback.state().live
    assert playback.state().computing == -1


def test_a_cache_without_a_scene_does_not_go_on(tmp_path):
    scene = SCENES["springs"](side=2).build()
    playback = Playback(pm.record(scene.simulation(), tmp_path / "a.zarr", 2))
    assert not playback.state().resumable
    with pytest.raises(InvalidInput, match="scene="):
        playback.take(Resume(frame=1))


def test_a_session_scrubs_loops_and_goes_on(cache):
    playback = Playback(cache)
    session = Session(playback, playing=False)
    heard = []
    session.start()
    leave = session.watch(heard.append)

    def newest(kind):
        return next((m for m in reversed(heard) if isinstance(m, kind)), None)

    try:
        assert [type(m) for m in session.greeting()][-1] is Timeline
        session.send(Seek(frame=6))
        eventually(lambda: session.latest.frame.number == 6)
        session.send(Loop(on=True, first=2, last=4))
        eventually(lambda: newest(Timeline) and newest(Timeline).last == 4)
        session.send(Resume(frame=6))
        eventually(lambda: newest(Timeline).live)
        eventually(lambda: session.latest.frame.number > len(cache))  # it runs
        assert newest(Status).playing
        assert newest(Welcome).grabs
        session.send(Play(on=False))
        session.send(Reset())
        eventually(lambda: not newest(Timeline).live)
        eventually(lambda: not newest(Welcome).grabs)
        assert session.latest.frame.number == 0
        np.testing.assert_array_equal(session.latest.frame.positions, cache[0].positions)
    finally:
        leave()
        session.stop()
