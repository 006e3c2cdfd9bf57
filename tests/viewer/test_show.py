from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
import websockets

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer import show as module
from pointmass.viewer.inputs import Hold, LetGo, Turn
from pointmass.viewer.running import Running


@pytest.fixture(autouse=True)
def page(tmp_path, monkeypatch):
    (tmp_path / "index.html").write_text("<title>here</title>")
    monkeypatch.setattr(module, "page_folder", lambda: tmp_path)
    monkeypatch.delenv(module.HUB, raising=False)


@pytest.fixture
def show():
    made = []

    def shows(*args, **options):
        made.append(pm.show(*args, **options))
        return made[-1]

    yield shows
    for each in made:
        each.stop()


def ball(**options):
    system = pm.ParticleSystem(pm.Particles([(0, 1, 0)]), forces=[pm.Gravity()])
    return pm.Simulation(system, dt=1e-3, **options)


def get(address, **headers):
    for _ in range(100):
        try:
            with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=60) as answer:
                return answer.status, answer.headers
        except urllib.error.HTTPError as error:
            return error.code, {}
        except OSError:
            time.sleep(0.05)
    raise AssertionError("no answer")


async def first(address, origin, name="127.0.0.1"):
    """The first message of a page's socket, by a name of its host, or the status by which it was refused."""
    port, token = int(address.split(":")[2].split("/")[0]), address.split("token=")[1]
    where = f"ws://{name}:{port}/frames?token={token}" if name[0].isdigit() else f"ws://{name}/frames?token={token}"
    try:
        async with websockets.connect(where, origin=origin, host="127.0.0.1", port=port, max_size=None) as socket:
            return json.loads(await socket.recv())
    except websockets.InvalidStatus as error:
        return error.response.status_code


def test_a_notebook_frames_the_page(show):
    it = show(ball(), height=420)
    text = it._repr_html_()
    assert text.startswith(f'<iframe src="{it.address}"')
    assert 'height="420"' in text
    assert it.address in repr(it)
    status, headers = get(it.address)
    assert status == 200
    assert headers["Content-Security-Policy"].endswith("frame-ancestors 'self' http://localhost:* http://127.0.0.1:*")
    assert get(it.address, Host="hub.example.org")[0] == 403


@pytest.mark.parametrize("hub", [True, False])
def test_behind_a_proxy_the_notebooks_server_hands_it_on(show, monkeypatch, hub):
    if hub:
        monkeypatch.setenv(module.HUB, "/user/a b/")
    it = show(ball(), **({} if hub else {"proxy": "/proxy/{port}"}))
    port = it.address.split(":")[2].split("/")[0]
    token = it.address.split("token=")[1]
    prefix = "/user/a b" if hub else ""
    assert it._repr_html_().startswith(f'<iframe src="{prefix}/proxy/{port}/?token={token}"')
    assert get(it.address, Host="hub.example.org")[0] == 200
    assert get(it.address + "x", Host="hub.example.org")[0] == 403
    for origin in ("https://hub.example.org", "http://hub.example.org"):
        assert asyncio.run(first(it.address, origin, "hub.example.org"))["kind"] == "welcome"
    assert asyncio.run(first(it.address, "https://evil.example", "hub.example.org")) == 403


@pytest.mark.parametrize(
    ("source", "name"),
    [
        (ball, "simulation"),
        (SCENES["pendulum"], "pendulum"),
        (lambda: SCENES["pendulum"]().build(), "pendulum"),
    ],
    ids=["simulation", "shipped", "scene"],
)
def test_simulations_and_scenes_are_shown(show, source, name):
    it = show(source())
    get(it.address)
    welcome = asyncio.run(first(it.address, it.address.split("/?")[0]))
    assert (welcome["name"], welcome["grabs"]) == (name, True)


def test_a_cache_is_shown(show, tmp_path):
    it = show(pm.record(ball(), tmp_path / "a.zarr", 3))
    get(it.address)
    assert asyncio.run(first(it.address, it.address.split("/?")[0]))["frames"] == 3


def test_a_simulation_runs_on_and_stays_as_it_is():
    sim, alone = ball(), ball()
    sim.run(0.1)
    alone.run(0.1)
    before = sim.system.get_state().copy()
    running = Running(sim, fps=50)
    begun = running.start()
    made = [running.advance(1.0) for _ in range(3)]
    alone_frames = list(alone.frames(4, 50))
    for a, b in zip([begun, *made], alone_frames, strict=True):
        assert a.time == b.time
        np.testing.assert_array_equal(a.positions, b.positions)
    np.testing.assert_array_equal(sim.system.get_state(), before)
    again = running.start()
    assert again.time == begun.time
    np.testing.assert_array_equal(again.positions, begun.positions)


@pytest.mark.parametrize("compiled", [False, True])
def test_a_simulation_can_be_grabbed(compiled):
    running = Running(ball(compiled=compiled))
    running.start()
    running.advance(1.0)
    target = (0.5, 1.5, 0.0)
    running.apply(Hold(int(running.sim.system.particles.id[0]), target))
    assert (running.held, running.target) == (0, target)
    running.sim.run(3.0)
    np.testing.assert_allclose(running.sim.system.particles.x[0], np.add(target, (0, -9.81 / 100, 0)), atol=1e-6)
    running.apply(LetGo())
    assert running.held == -1
    with pytest.raises(InvalidInput, match="settings"):
        running.apply(Turn({"g": 1.0}))


def test_nobody_is_grabbed_in_a_flow():
    running = Running(SCENES["flow"]().build().simulation())
    running.start()
    assert not running.grabs
    with pytest.raises(InvalidInput, match="flow"):
        running.apply(Hold(0, (0, 0, 0)))


def test_what_cannot_be_shown_is_said():
    for source, options, said in [
        (3, {}, "source"),
        (ball(), {"height": 3}, "height"),
        (ball(), {"proxy": "/proxy/"}, r"\{port\}"),
        (ball(), {"fps": 0}, "fps"),
    ]:
        with pytest.raises(InvalidInput, match=said):
            pm.show(source, **options)


def test_stop_ends_its_threads_and_needs_no_notebook():
    code = (
        "import sys, threading, time, pathlib, pointmass as pm\n"
        "from pointmass.viewer import show\n"
        "show.page_folder = lambda: pathlib.Path('.')\n"
        "it = pm.show(pm.Simulation(pm.ParticleSystem(pm.Particles([(0, 1, 0)]))))\n"
        "time.sleep(0.3)\n"
        "it.stop()\n"
        "assert [t.name for t in threading.enumerate() if t.name.startswith('pointmass')] == []\n"
        "assert 'IPython' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stderr
