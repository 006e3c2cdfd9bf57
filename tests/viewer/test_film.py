from __future__ import annotations

import base64
import gzip
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

import pointmass as pm
from pointmass.cli.export import command
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer import film

INDEX = """<!doctype html>
<html lang="en">
  <head>
    <title>pointmass</title>
    <script type="module" crossorigin src="./assets/a.js"></script>
    <link rel="stylesheet" crossorigin href="./assets/a.css">
  </head>
  <body>
    <canvas id="picture"></canvas>
  </body>
</html>
"""


@pytest.fixture(autouse=True)
def page(tmp_path_factory, monkeypatch):
    """A page whose code would end its element, if it could."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "assets").mkdir()
    (folder / "index.html").write_text(INDEX)
    (folder / "assets" / "a.js").write_text('const end = "</script><script>evil()", open = "<!-- <script";')
    (folder / "assets" / "a.css").write_text('a::after { content: "</style>"; }')
    monkeypatch.setattr(film, "page_folder", lambda: folder)


def simulation():
    return SCENES["springs"](side=2).build().simulation()


def read(path):
    """Head and frames: of each its head and its positions."""
    text = path.read_text(encoding="utf-8")
    assert text.lower().count("</script") == text.lower().count("<script")
    head = json.loads(re.search(r'<script type="application/json" id="film">(.*?)</script>', text)[1])
    data = b""
    for chunk in re.findall(r'<script type="text/plain" class="frames">(.*?)</script>', text):
        data += gzip.decompress(base64.b64decode(chunk, validate=True))
    frames = []
    while data:
        length = int.from_bytes(data[:4], "little")
        frames.append(one(data[4 : 4 + length]))
        data = data[4 + length :]
    return head, frames


def one(frame):
    _, _, length = np.frombuffer(frame, "<u4", 3)
    head = json.loads(frame[12 : 12 + length])
    places = head["places"]
    q = np.frombuffer(frame, "<u2", places["data"]["count"], 12 + length + places["data"]["offset"]).reshape(-1, 4)
    return head, np.add(places["low"], q[:, :3] * np.array(places["size"]) / 65535)


def check(found, frames):
    assert [head["number"] for head, _ in found] == list(range(len(frames)))
    for (head, x), frame in zip(found, frames, strict=True):
        assert head["time"] == frame.time
        tolerance = np.ptp(frame.positions, axis=0).max() / 65535
        np.testing.assert_allclose(x, frame.positions, atol=tolerance)


def test_a_simulation_is_in_the_file(tmp_path):
    path = pm.to_html(simulation(), tmp_path / "a.html", 8, 30, name="</script><b>&")
    head, found = read(path)
    check(found, list(simulation().frames(8, 30)))
    assert "</script><b>" not in path.read_text()
    assert head["welcome"]["name"] == "</script><b>&"
    assert (head["welcome"]["fps"], head["timeline"]["frames"], head["timeline"]["last"]) == (30, 8, 7)
    assert sum(item["part"] is not None for item in found[0][0]["items"]) > 0
    assert all(i["part"] is None for h, _ in found[1:] for i in h["items"] if i["name"] == "floor")


def test_a_cache_and_frames_give_the_same(tmp_path):
    scene = SCENES["springs"](side=2).build()
    cache = pm.record(scene.simulation(), tmp_path / "a.zarr", 6, scene.fps, scene=scene)
    head, found = read(pm.to_html(cache, tmp_path / "a.html"))
    check(found, list(cache))
    assert (head["welcome"]["name"], head["welcome"]["fps"]) == ("springs", scene.fps)
    _, some = read(pm.to_html(iter(list(cache)), tmp_path / "b.html", 4))
    check(some, cache[:4])


def test_nothing_is_fetched(tmp_path):
    text = pm.to_html(simulation(), tmp_path / "a.html", 2).read_text()
    assert "default-src 'none'" in text
    assert not re.search(r"(src|href)=", text)


def test_the_command_exports_a_film(tmp_path):
    cache = pm.record(simulation(), tmp_path / "a.zarr", 5)
    run = CliRunner().invoke(command, [str(cache.path), str(tmp_path / "a.html"), "-q"])
    assert run.exit_code == 0, run.output
    check(read(tmp_path / "a.html")[1], list(cache))
    run = CliRunner().invoke(command, [str(cache.path), str(tmp_path / "b.html"), "-q", "--frame", "3"])
    assert run.exit_code == 0, run.output
    np.testing.assert_allclose(read(tmp_path / "b.html")[1][0][1], cache[3].positions, atol=1e-4)


def test_what_cannot_be_filmed_is_said_and_nothing_is_left(tmp_path):
    for source, options, said in [
        (3, {}, "source"),
        ([3], {}, "source"),
        ([], {}, "no frames"),
        (simulation(), {"frames": 0}, "frames"),
        (simulation(), {"fps": -1}, "fps"),
    ]:
        with pytest.raises(InvalidInput, match=said):
            pm.to_html(source, tmp_path / "a.html", **options)
    with pytest.raises(InvalidInput, match="no folder"):
        pm.to_html(simulation(), tmp_path / "none" / "a.html")
    with pytest.raises(InvalidInput, match="it is a folder"):
        pm.to_html(simulation(), tmp_path)
    assert list(tmp_path.iterdir()) == []
