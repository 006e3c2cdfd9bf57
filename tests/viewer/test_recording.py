"""Recordings in files."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

import pointmass as pm
from pointmass.cli.main import main
from pointmass.cli.options import RunOptions
from pointmass.cli.replay import saved_from
from pointmass.errors import InvalidInput
from pointmass.scenes import SCENES
from pointmass.viewer.inputs import (
    Blow,
    Cut,
    Drop,
    Hold,
    Join,
    Lead,
    LetGo,
    Pin,
    Push,
    Remove,
    Restore,
    Shoot,
    Solve,
    Toggle,
    Turn,
    Vanish,
)
from pointmass.viewer.live import Live
from pointmass.viewer.recording_file import INPUTS, load, save
from pointmass.viewer.setup import Setup
from pointmass.viewer.subject import Subject

EVERYTHING = [
    Hold(2, (0.5, 0.25, 0.1)),
    Lead((0.5, 1 / 3, 0.1)),
    LetGo(),
    Turn({"gravity": 3.0}),
    Solve("rk4", 1 / 3000),
    Toggle("forces.0", False),
    Restore(Setup(parameters={"gravity": 2.0}, switches={"forces.0": True})),
    Blow((0.0, 1.0, 0.0)),
    Pin(1, True),
    Join(0, 2),
    Cut(0, 2),
    Join(0, 2, 1.5),
    Drop((0.1, 0.2, 0.3)),
    Remove(3),
    Drop((0.1, 0.2, 0.3), 3),
    Shoot((0.0, -1.0, 1.0), (0.0, 0.0, -9.0), 0.1),
    Push((0.0, -1.0, 0.1), 0.1),
    Vanish(),
]


@pytest.fixture
def recorded():
    """A pendulum to which everything was done."""
    live = Live(Subject.of_shipped(SCENES["pendulum"](links=2)))
    live.start()
    for what in EVERYTHING:
        assert live.apply(what) is None
        live.advance(0.5)
    return live


OPTIONS = RunOptions(settings=("links=2",))


def test_a_file_gives_the_recording_back(recorded, tmp_path):
    saved = saved_from("pendulum", OPTIONS, recorded)
    save(saved, tmp_path / "a.json")
    assert load(tmp_path / "a.json") == saved
    assert {type(what).__name__ for _, what in saved.recording.inputs} == set(INPUTS)
    assert not (tmp_path / "a.json.part").exists()


def replay(path):
    return CliRunner().invoke(main, ["replay", str(path)])


def test_the_command_replays_to_the_same_bits(recorded, tmp_path):
    path = tmp_path / "a.json"
    saved = saved_from("pendulum", OPTIONS, recorded)
    save(saved, path)
    done = replay(path)
    assert done.exit_code == 0
    assert f"pendulum: {recorded.steps} steps" in done.stdout
    save(replace(saved, digest="0" * 64), path)
    done = replay(path)
    assert done.exit_code == 2
    assert "bits" in done.output


def test_a_scene_file_is_inside(tmp_path):
    scene = pm.Scene(bodies=[pm.scatter(3, size=(1, 1, 1))], forces=[pm.Gravity()], dt=1 / 60, solver=pm.RK4())
    live = Live(Subject.of_scene(scene))
    live.start()
    live.advance(1.0)
    live.apply(Shoot((0, 0, 1), (0, 0, -3), 0.2))
    for _ in range(20):
        live.advance(1.0)
    save(saved_from("mine.toml", RunOptions(dt=0.1), live), tmp_path / "a.json")
    assert replay(tmp_path / "a.json").exit_code == 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d.update({"pointmass recording": 2}), "format 1"),
        (lambda d: d["recording"]["inputs"].append([3, "NoSuch", {}]), "NoSuch"),
        (lambda d: d["recording"]["inputs"].append([3, "Hold", {"particle": "x", "target": [0, 0, 0]}]), "particle"),
        (lambda d: d["recording"]["inputs"].append(3), "recording"),
        (lambda d: d.pop("steps"), "steps"),
        (lambda d: d.update({"steps": "many"}), "steps"),
    ],
)
def test_what_is_no_recording_is_said(recorded, tmp_path, change, sentence):
    path = tmp_path / "a.json"
    save(saved_from("pendulum", OPTIONS, recorded), path)
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InvalidInput, match=sentence):
        load(path)


def test_a_file_that_cannot_be_read_or_written_is_said(recorded, tmp_path):
    with pytest.raises(InvalidInput, match="cannot read"):
        load(tmp_path / "none.json")
    (tmp_path / "text.json").write_text("nonsense")
    with pytest.raises(InvalidInput, match="JSON"):
        load(tmp_path / "text.json")
    with pytest.raises(InvalidInput, match="cannot write"):
        save(saved_from("pendulum", OPTIONS, recorded), tmp_path / "no" / "a.json")
