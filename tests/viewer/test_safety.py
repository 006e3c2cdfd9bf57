"""What pages do to a server that means no good, or nothing at all; the full counts need --full."""

from __future__ import annotations

import asyncio
import gc
import json
import random
import threading
import time
import tracemalloc
import urllib.request
from dataclasses import fields

import numpy as np
import pytest
import websockets

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.viewer.live import Live
from pointmass.viewer.messages import INBOUND, LONGEST, decode
from pointmass.viewer.server import IN_FLIGHT, Server
from pointmass.viewer.session import MOST_WAITING, Session
from pointmass.viewer.subject import Subject

FPS = 60
counts = pytest.mark.parametrize("share", [0.1, pytest.param(1.0, marks=pytest.mark.full)], ids=["tenth", "full"])


class Served:
    """A server with some particles, and a page that is one line."""

    def __init__(self, folder, particles=50):
        (folder / "index.html").write_text("<title>here</title>")
        scene = pm.Scene(bodies=[pm.scatter(particles, size=(1, 1, 1))], forces=[pm.Gravity()], dt=1 / FPS, fps=FPS)
        self.session = Session(Live(Subject.of_scene(scene)))
        self.server = Server(self.session, folder)
        self.session.start()
        self.server.start()
        self.own = f"http://127.0.0.1:{self.server.port}"

    def page(self):
        where = f"ws://127.0.0.1:{self.server.port}/frames?token={self.server.token}"
        return websockets.connect(where, origin=self.own, max_size=None)

    def get(self):
        with urllib.request.urlopen(self.server.address, timeout=60) as answer:
            return answer.status

    def close(self):
        self.server.stop()
        self.session.stop()


@pytest.fixture
def served(tmp_path):
    it = Served(tmp_path)
    yield it
    it.close()


def eventually(condition, patience=20.0):
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


async def frames(socket, seconds, acknowledge=True):
    """How many frames come in some time."""
    end, count = time.monotonic() + seconds, 0
    while (left := end - time.monotonic()) > 0:
        try:
            message = await asyncio.wait_for(socket.recv(), left)
        except TimeoutError:
            break
        if isinstance(message, bytes):
            count += 1
            if acknowledge:
                sequence = int(np.frombuffer(message, "<u4", 2)[1])
                await socket.send(json.dumps({"kind": "ack", "sequence": sequence}))
    return count


def dropped(socket):
    """The connection is gone, and nobody was told."""
    socket.transport.abort()


def tasks(served):
    """Unfinished tasks of the server's loop, asked in its thread."""
    answer = threading.Event()
    found = []

    def count():
        found.append(len(asyncio.all_tasks(loop)))
        answer.set()

    loop = served.server._server.servers[0].get_loop()
    loop.call_soon_threadsafe(count)
    assert answer.wait(5)
    return found[0]


@counts
def test_connects_and_disconnects_leave_the_server_as_it_was(served, share):
    async def come_and_go(number):
        for k in range(number):
            async with served.page() as socket:
                if k % 3:
                    await socket.recv()
                if k % 3 == 2:
                    dropped(socket)

    def state():
        eventually(lambda: not served.session._watchers and not served.server._pages)
        eventually(lambda: tasks(served) <= quiet)
        gc.collect()
        threads = [t for t in threading.enumerate() if not t.name.startswith("asyncio_")]  # its pool has a bound
        return len(threads), tracemalloc.get_traced_memory()[0]

    async def warm_up():  # what is made once, such as kernels, is made now
        async with served.page() as socket:
            await frames(socket, 2.0)
        await come_and_go(30)

    eventually(lambda: served.server._server.started)
    quiet = tasks(served)
    tracemalloc.start()
    try:
        asyncio.run(warm_up())
        threads, memory = state()
        asyncio.run(come_and_go(int(500 * share)))
        after = state()
    finally:
        tracemalloc.stop()
    assert after[0] <= threads
    assert after[1] - memory < 300_000  # less than 1 kB for each of 500
    assert served.get() == 200


def test_slow_and_dead_pages_hold_nobody_up(served):
    steps = []

    async def talk():
        async with served.page() as good:
            alone = await frames(good, 2.0)
            steps.append(served.session.latest.sequence)
            async with served.page() as slow, served.page() as deaf, served.page() as dead:
                # One acknowledges nothing; one does not even read; one is gone without a word.
                stuck = asyncio.create_task(frames(slow, 3.0, acknowledge=False))
                deaf.transport.pause_reading()
                await dead.recv()
                dropped(dead)
                await asyncio.sleep(1.0)
                begun = served.session.latest.sequence
                beside = await frames(good, 2.0)
                steps.append(served.session.latest.sequence - begun)
                assert await stuck == IN_FLIGHT
                deaf.transport.abort()
            return alone, beside

    alone, beside = asyncio.run(talk())
    assert beside > 0.5 * alone > 10
    assert steps[1] > 0.5 * 2.0 * FPS  # the simulation goes on
    eventually(lambda: not served.session._watchers)


def test_a_page_that_only_sends_fills_no_memory(served):
    async def talk():
        async with served.page() as socket:
            for _ in range(5 * MOST_WAITING):
                await socket.send('{"kind": "speed", "factor": 1.0}')
            assert len(served.session._waiting) <= MOST_WAITING

    asyncio.run(talk())
    eventually(lambda: not served.session._waiting)
    assert served.get() == 200


NUMBERS = [0, 1, -1, 2**31, 2**63, 10**400, 0.5, -0.0, 1e308, 1e-308, float("nan"), float("inf"), -1e16]
TEXTS = ["", "x", "\x00", "\ud800", "ü" * 50, "x" * 5000, "__class__", "../../etc/passwd", "</script>", "{}", "ack"]


def nonsense(chance):
    """Something that is not quite a message."""
    what = chance.random()
    if what < 0.15:
        return chance.randbytes(chance.randrange(200))
    if what < 0.25:
        return "".join(chr(chance.randrange(1, 0xD000)) for _ in range(chance.randrange(100)))
    if what < 0.3:
        return chance.choice(["[" * 5000, '{"a":' * 3000, "9" * 5000, "x" * (LONGEST + 1), "null", "[]", "1e999", ""])
    kind = chance.choice(list(INBOUND))
    document = {"kind": kind} | {f.name: value(chance) for f in fields(INBOUND[kind])}
    if chance.random() < 0.3 and len(document) > 1:
        del document[chance.choice(list(document))]
    if chance.random() < 0.2:
        document[chance.choice(TEXTS)] = value(chance)
    text = json.dumps(document)
    if chance.random() < 0.3:
        cut = chance.randrange(len(text))
        text = text[:cut] + chance.choice(["", "\\", '"', "}", "\u2028"]) + text[cut + chance.randrange(3) :]
    return text


def value(chance, deep=0):
    what = chance.random()
    if what < 0.4:
        return chance.choice(NUMBERS)
    if what < 0.7:
        return chance.choice([None, True, False, *TEXTS])
    if deep > 2:
        return []
    if what < 0.9:
        return [value(chance, deep + 1) for _ in range(chance.choice([0, 1, 3, 3, 3, 4]))]
    return {chance.choice(TEXTS): value(chance, deep + 1)}


@counts
def test_malformed_messages_leave_it_running(served, share):
    chance = random.Random(7)
    sent = [nonsense(chance) for _ in range(int(10_000 * share))]
    refused = 0
    for text in sent:
        try:
            decode(text)
        except InvalidInput:
            refused += 1
    assert 0.5 * len(sent) < refused < len(sent)  # some are messages after all, and ask for what is not there

    async def talk():
        socket = await served.page()
        hears = asyncio.create_task(frames(socket, 1e9, acknowledge=False))
        for text in sent:
            try:
                await socket.send(text if isinstance(text, bytes) else text.encode("utf-8", "replace").decode())
            except websockets.ConnectionClosed:  # what is no UTF-8 ends a connection
                hears.cancel()
                socket = await served.page()
                hears = asyncio.create_task(frames(socket, 1e9, acknowledge=False))
        hears.cancel()
        await asyncio.gather(hears, return_exceptions=True)
        await socket.close()
        async with served.page() as good:
            await good.send('{"kind": "speed", "factor": 1.0}')
            await good.send('{"kind": "reset"}')
            await good.send('{"kind": "play", "on": true}')
            return await frames(good, 2.0)

    assert asyncio.run(talk()) > 10
    assert served.session._thread.is_alive()
    assert served.get() == 200


def test_what_is_foreign_gets_403(served):
    def status(**headers):
        request = urllib.request.Request(served.server.address, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code

    async def refused(name=None, origin=served.own, token=None):
        where = f"ws://{name or served.own[7:]}/frames?token={token or served.server.token}"
        try:
            async with websockets.connect(where, origin=origin, host="127.0.0.1", port=served.server.port):
                return 101
        except websockets.InvalidStatus as error:
            return error.response.status_code

    assert served.get() == 200
    assert status(Host="evil.example") == status(Origin="http://evil.example") == 403
    assert asyncio.run(refused()) == 101
    assert asyncio.run(refused(name="evil.example")) == 403
    assert asyncio.run(refused(origin="http://evil.example")) == 403
    assert asyncio.run(refused(token=served.server.token[:-1])) == 403
