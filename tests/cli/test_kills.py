"""Commands that are killed at random moments: nothing is torn, nothing is left, and the next one has the same bits."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from pointmass.cache import Cache

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

SCENE = """
dt = 0.004
[[emitters]]
type = "nozzle"
rate = 150.0
lifetime = {{ mean = 0.2, half_range = 0.1 }}
[[forces]]
type = "gravity"
[[forces]]
type = "drag"
k = {drag}
[[colliders]]
type = "plane"
point = [0.0, -0.2, 0.0]
"""
FRAMES = ["--frames", "36", "--quiet"]  # with two checkpoints
LONG = ["--frames", "70", "--quiet"]  # with two parts of a film
RUN = ["run", "a.toml", "-o", "out.zarr", *FRAMES]
VIEW = ["--size", "64x48", "--quiet"]
COMMANDS = {
    "run": RUN,
    "run of an edited scene": RUN,
    "run anew": [*RUN, "--anew"],
    "film": ["render", "cache.zarr", "-o", "out.mp4", *VIEW],
    "film of a scene": ["render", "a.toml", "-o", "out.webm", *FRAMES, *VIEW],
    "gif": ["render", "cache.zarr", "-o", "out.gif", *VIEW],
    "pictures": ["render", "cache.zarr", "-o", "out_%04d.png", *VIEW],
    **{
        suffix: ["export", "cache.zarr", f"out{suffix}", "--quiet"]
        for suffix in (".usd", ".npz", ".csv", ".pvd", ".gsd", "_%04d.ply", "_%02d.obj", ".glb", ".html")
    },
    "export of a scene": ["export", "a.toml", "out.npz", *FRAMES],
}


class Forks:
    """See forks.py."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, str(Path(__file__).with_name("forks.py"))]
        self._process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self, arguments: list[str], kill: float | None = None) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"arguments": arguments, "kill": kill}) + "\n")
        self._process.stdin.flush()
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer

    def end(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kills")
    (folder / "a.toml").write_text(SCENE.format(drag='"0.2 if t > 0.3 else 0.1"'))
    (folder / "edited.toml").write_text(SCENE.format(drag='"0.3 if t > 0.3 else 0.1"'))
    command = [sys.executable, "-m", "pointmass.cli", "run", "a.toml", "-o", "cache.zarr", *LONG]
    subprocess.run(command, cwd=folder, check=True)
    return folder


@pytest.fixture(scope="module")
def forks(folder: Path) -> Iterator[Forks]:
    forks = Forks(folder)
    yield forks
    forks.end()


def made(folder: Path) -> dict[str, bytes]:
    """The files that a command has made."""
    files = [file for top in folder.glob("*out*") for file in ([top] if top.is_file() else top.rglob("*"))]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files if file.is_file()}


def clear(folder: Path) -> None:
    for top in folder.glob("*out*"):
        shutil.rmtree(top) if top.is_dir() else top.unlink()


def prepare(kind: str, folder: Path, forks: Forks) -> None:
    clear(folder)
    if kind == "run of an edited scene":
        assert forks(["run", "edited.toml", *RUN[2:]])["code"] == 0
    elif kind == "run anew":
        assert forks(RUN)["code"] == 0


def assert_whole(folder: Path, whole: dict[str, bytes]) -> None:
    """What is there after a kill can be read, and of files under their final names nothing is torn."""
    if (folder / "out.zarr").exists():
        for k, frame in enumerate(Cache.open(folder / "out.zarr")):
            assert frame.number == k
    for name, content in made(folder).items():
        if not name.startswith((".", "out.zarr")):
            assert content == whole[name], name


def kill_and_go_on(kind: str, folder: Path, forks: Forks, chance: random.Random, count: int) -> None:
    prepare(kind, folder, forks)
    seconds = forks(COMMANDS[kind])["seconds"]
    whole = made(folder)
    hit = 0
    for _ in range(count):
        prepare(kind, folder, forks)
        for _ in range(chance.choice((1, 1, 2))):  # what a kill leaves may be killed, too
            hit += forks(COMMANDS[kind], chance.uniform(0, seconds))["code"] is None
            assert_whole(folder, whole)
        answer = forks(COMMANDS[kind])
        assert answer["code"] == 0, (folder / "commands.log").read_text()
        assert made(folder) == whole  # the same bits, and nothing beside them
    assert hit > 0.2 * count or count == 1


@pytest.mark.parametrize("kind", COMMANDS)
def test_a_killed_command_goes_on_to_the_same_bits(kind: str, folder: Path, forks: Forks) -> None:
    kill_and_go_on(kind, folder, forks, random.Random(kind), 1)


@pytest.mark.full
@pytest.mark.parametrize("kind", COMMANDS)
def test_commands_that_are_killed_two_hundred_times(kind: str, folder: Path, forks: Forks) -> None:
    kill_and_go_on(kind, folder, forks, random.Random(f"{kind} again"), 1 + 200 // len(COMMANDS))
