from __future__ import annotations

import asyncio
import json
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
import websockets

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.scene import Scene
from pointmass.scenes import SCENES
from pointmass.viewer.live import Live
from pointmass.viewer.server import Server
from pointmass.viewer.session import Session
from pointmass.viewer.setup import Setup
from pointmass.viewer.subject import Subject

TOKEN = "the right token"


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A server with three particles, and a page that is one line."""
    page = tmp_path_factory.mktemp("page")
    (page / "assets").mkdir()
    (page / "index.html").write_text("<title>here</title>")
    (page / "assets" / "a.js").write_text("1")
    scene = pm.Scene(bodies=[pm.scatter(3, size=(1, 1, 1))], forces=[pm.Gravity()], dt=1 / 60)
    session = Session(Live(Subject.of_scene(scene)))
    server = Server(session, page, token=TOKEN)
    session.start()
    server.start()
    yield server
    server.stop()
    session.stop()


def get(server, path="/", token=TOKEN, **headers):
    """Status and text of a page."""
    address = f"http://127.0.0.1:{server.port}{path}" + (f"?token={token.replace(' ', '%20')}" if token else "")
    request = urllib.request.Request(address, headers=headers)
    for _ in range(100):
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.status, answer.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()
        except OSError:
            time.sleep(0.05)  # it has not begun yet
    raise AssertionError("no answer")


def connected(server, token=TOKEN, origin="own", host=None):
    """A web socket of a page."""
    own = f"http://127.0.0.1:{server.port}"
    return websockets.connect(
        f"ws://127.0.0.1:{server.port}/frames?token={token.replace(' ', '%20')}",
        origin=own if origin == "own" else origin,
        additional_headers={} if host is None else {"Host": host},
        max_size=None,
    )


async def refused(*args, **options):
    with pytest.raises(websockets.InvalidStatus) as error:
        async with connected(*args, **options):
            pass
    return error.value.response.status_code


async def binary(socket, seconds):
    """The next frame."""
    while True:
        message = await asyncio.wait_for(socket.recv(), seconds)
        if isinstance(message, bytes):
            return message


async def last(socket):
    """Hear all that comes, until the end."""
    while True:
        await asyncio.wait_for(socket.recv(), 10)


def test_the_page_needs_the_token(served):
    assert get(served) == (200, "<title>here</title>")
    assert get(served, "/assets/a.js", token="")[0] == 200  # the page's code is no secret
    for token in ("", "wrong", TOKEN[:-1], TOKEN + "x", "ü"):
        assert get(served, token=token.encode().decode("latin-1") if token.isascii() else "%C3%BC")[0] == 403


def test_the_scene_is_given_as_toml_to_who_has_the_token(served):
    status, text = get(served, "/scene.toml")
    assert status == 200
    assert Scene.from_toml(text) == served._session._player._as_set(Setup())
    assert get(served, "/scene.toml", token="wrong")[0] == 403
    assert get(served, "/scene.toml", Origin="http://evil.example")[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", "0.0.0.0"])
def test_a_foreign_host_is_refused(served, host):
    assert get(served, Host=host)[0] == 403
    assert get(served, "/assets/a.js", Host=host)[0] == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1", "https://127.0.0.1"])
def test_a_foreign_origin_is_refused(served, origin):
    assert get(served, Origin=origin)[0] == 403
    assert asyncio.run(refused(served, origin=origin)) == 403


def test_a_socket_needs_token_and_origin_and_host(served):
    assert asyncio.run(refused(served, token="wrong")) == 403
    assert asyncio.run(refused(served, origin=None)) == 403


def test_no_request_leaves_the_machine(served):
    address = f"http://127.0.0.1:{served.port}/?token={TOKEN.replace(' ', '%20')}"
    with urllib.request.urlopen(address, timeout=60) as answer:
        policy = answer.headers["Content-Security-Policy"]
        assert answer.headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert "http" not in policy


def test_frames_arrive_and_no_more_than_two_without_an_answer(served):
    async def talk():
        async with connected(served) as socket:
            frames, kinds = [], []
            while len(frames) < 2:
                message = await asyncio.wait_for(socket.recv(), 10)
                if isinstance(message, bytes):
                    frames.append(np.frombuffer(message, "<u4", 2)[1])
                else:
                    kinds.append(json.loads(message)["kind"])
            assert kinds[0] == "welcome"
            with pytest.raises(TimeoutError):
                await binary(socket, 0.5)
            await socket.send(json.dumps({"kind": "ack", "sequence": int(frames[0])}))
            message = await binary(socket, 10)
            assert np.frombuffer(message, "<u4", 2)[1] > frames[-1] + 5  # the newest, and none in between

    asyncio.run(talk())


def test_a_malformed_message_is_answered_with_a_sentence_and_all_goes_on(served):
    async def talk():
        async with connected(served) as socket:
            for text in ("nonsense", '{"kind": "speed", "factor": -1}', "[" * 9000, b"\xff\x00"):
                await socket.send(text)
            note = {}
            while note.get("level") != "error":
                message = await asyncio.wait_for(socket.recv(), 10)
                note = json.loads(message) if isinstance(message, str) else {}
            assert "message" in note["text"]

    asyncio.run(talk())
    assert get(served)[0] == 200


def test_a_message_that_is_too_large_ends_the_connection(served):
    async def talk():
        async with connected(served) as socket:
            await socket.send("x" * 200_000)
            with pytest.raises(websockets.ConnectionClosed):
                await last(socket)

    asyncio.run(talk())
    assert get(served)[0] == 200


def test_pages_come_and_go(served):
    async def come_and_go():
        for k in range(20):
            async with connected(served) as socket:
                if k % 2:
                    await socket.recv()

    asyncio.run(come_and_go())
    deadline = time.monotonic() + 60
    while served._session._watchers and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not served._session._watchers


def test_it_listens_beyond_this_machine_only_if_told_to(served, tmp_path):
    session = served._session
    for host in ("0.0.0.0", "::", "example.org"):
        with pytest.raises(InvalidInput, match="--expose"):
            Server(session, tmp_path, host=host)
    Server(session, tmp_path, host="0.0.0.0", expose=True)._socket.close()


def test_a_port_that_is_taken_is_said(served, tmp_path):
    with pytest.raises(InvalidInput, match="--port"):
        Server(served._session, tmp_path, port=served.port)


def test_what_is_begun_again_is_sent_as_a_whole(tmp_path):
    """Other springs may have the version of those before."""
    (tmp_path / "index.html").write_text("")
    session = Session(Live(Subject.of_shipped(SCENES["springs"](side=2))), playing=False)
    server = Server(session, tmp_path, token=TOKEN)
    session.start()
    server.start()

    async def talk():
        get(server)
        async with connected(server) as socket:
            brought = []
            for side in (2, 3):
                message = await binary(socket, 20)
                _, sequence, length = np.frombuffer(message, "<u4", 3)
                head = json.loads(message[12 : 12 + length])
                brought.append({item["name"] for item in head["items"] if item["part"] is not None})
                assert head["count"] == side**3
                await socket.send(json.dumps({"kind": "ack", "sequence": int(sequence)}))
                await socket.send(json.dumps({"kind": "change", "name": "side", "value": 3}))
            assert "stretch 0" in brought[0]
            assert brought[0] == brought[1]

    try:
        asyncio.run(talk())
    finally:
        server.stop()
        session.stop()
