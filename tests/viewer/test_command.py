from __future__ import annotations

import re
import sys
import urllib.error
import urllib.request
import webbrowser

import pytest
from click.testing import CliRunner

import pointmass as pm
from pointmass.cli import view
from pointmass.cli.main import Terminated, main
from pointmass.viewer import page
from pointmass.viewer.recording_file import load


@pytest.fixture
def built(tmp_path, monkeypatch):
    """A page that is one line, and a user who leaves at once."""
    folder = tmp_path / "page"
    folder.mkdir()
    (folder / "index.html").write_text("<title>here</title>")
    monkeypatch.setattr(page, "page_folder", lambda: folder)
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)

    def leave():
        raise KeyboardInterrupt

    monkeypatch.setattr(view, "_wait", leave)
    return opened


def pointmass(*arguments):
    return CliRunner().invoke(main, arguments)


def test_it_prints_the_address_and_opens_it(built):
    done = pointmass("view", "pendulum")
    assert done.exit_code == 0
    (address,) = done.stdout.splitlines()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address)
    assert built == [address]


def test_it_opens_nothing_if_told_so_and_serves_meanwhile(built, monkeypatch):
    seen = []

    def look():
        with pytest.raises(urllib.error.HTTPError) as error:
            urllib.request.urlopen("http://127.0.0.1:18231/", timeout=5)
        seen.append(error.value.code)
        raise Terminated

    monkeypatch.setattr(view, "_wait", look)
    done = pointmass("view", "pendulum", "--no-browser", "--port", "18231")
    assert (done.exit_code, seen, built) == (143, [403], [])


def test_a_scene_file_and_a_cache(built, tmp_path):
    scene = pm.Scene(bodies=[pm.scatter(3)], name="mine")
    scene.save(tmp_path / "mine.toml")
    pm.record(scene.simulation(), tmp_path / "mine.zarr", frames=2)
    for source in ("mine.toml", "mine.zarr"):
        assert pointmass("view", str(tmp_path / source), "--no-browser").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("pendulum", "--frames", "3"), "--frames belongs to run and render"),
        (("pendulum", "--host", "0.0.0.0"), "--expose"),
        (("pendulum", "--port", "70000"), "--port"),
        (("no-such-scene",), "no-such-scene"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(built, arguments, sentence):
    done = pointmass("view", *arguments, "--no-browser")
    assert done.exit_code == 2
    assert sentence in done.stderr
    assert done.stdout == ""


def test_a_cache_cannot_be_changed(built, tmp_path):
    pm.record(pm.Scene(bodies=[pm.scatter(3)]).simulation(), tmp_path / "a.zarr", frames=2)
    done = pointmass("view", str(tmp_path / "a.zarr"), "--dt", "0.1")
    assert done.exit_code == 2
    assert "--dt cannot change the cache" in done.stderr


def test_a_page_that_was_not_built_is_said_with_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr(page, "__file__", str(tmp_path / "a" / "b" / "c" / "d" / "page.py"))
    done = pointmass("view", "pendulum")
    assert done.exit_code == 2
    assert "Node.js" in done.stderr
    assert "npm run build" in done.stderr


def test_missing_packages_are_said_with_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "pointmass.viewer.server", None)
    done = pointmass("view", "pendulum")
    assert done.exit_code == 2
    assert "pip install 'pointmass[view]'" in done.stderr


def test_what_is_done_is_recorded_and_replays(built, tmp_path, monkeypatch):
    path = tmp_path / "done.json"
    done = pointmass("view", "pendulum", "--set", "links=2", "--dt", "0.001", "--record", str(path))
    assert done.exit_code == 0
    assert "done.json" in done.stderr
    saved = load(path)
    assert (saved.scene, saved.options) == ("pendulum", {"settings": ["links=2"], "dt": 0.001})
    assert pointmass("replay", str(path)).exit_code == 0
    refused = pointmass("view", "pendulum", "--record", str(tmp_path / "no" / "done.json"))
    assert refused.exit_code == 2
    assert "folder" in refused.output


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("no_such", "unknown solver"), ("rk4@0", "step of rk4"), ("euler,euler", "different solvers")],
)
def test_a_duel_of_nobody_is_refused(built, text, sentence):
    result = CliRunner().invoke(main, ["view", "pendulum", "--duel", text])
    assert result.exit_code != 0
    assert sentence in result.output


def test_a_duel_opens_the_page(built):
    result = CliRunner().invoke(main, ["view", "pendulum", "--set", "links=1", "--duel", "euler,rk4@1/120"])
    assert result.exit_code == 0, result.output
    assert re.search(r"http://127.0.0.1:\d+/\?token=", result.output)
