"""The command as a process: kills, interrupts, threads, pipes."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pointmass.cache import Cache
from tests.same import assert_same_frame

COMMAND = [sys.executable, "-m", "pointmass.cli"]
TWO_THREADS = {"POINTMASS_THREADS": "2"}


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for_frames(cache: Path, count: int) -> None:
    deadline = time.monotonic() + 60
    while not (cache / "frames" / f"{count - 1:06d}").is_dir():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def kill_a_run(folder: Path, chance: random.Random) -> None:
    process = start(folder, "run", "pendulum", "-o", "k.zarr", "--frames", "100000", "--set", "links=2")
    wait_for_frames(folder / "k.zarr", chance.randrange(1, 6))
    time.sleep(chance.uniform(0, 0.05))
    process.send_signal(signal.SIGKILL)
    process.communicate()
    cache = Cache.open(folder / "k.zarr")
    assert len(cache) >= 1
    for k, frame in enumerate(cache):
        assert frame.number == k
        assert frame.drawables


def test_a_killed_run_leaves_a_whole_cache(tmp_path: Path) -> None:
    for attempt in range(3):
        (tmp_path / str(attempt)).mkdir()
        kill_a_run(tmp_path / str(attempt), random.Random(attempt))


def test_a_killed_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    run = ["run", "pendulum", "--set", "links=2", "--quiet", "-o"]
    process = start(tmp_path, *run, "k.zarr", "--frames", "100000")
    wait_for_frames(tmp_path / "k.zarr", 40)  # beyond a checkpoint
    process.send_signal(signal.SIGKILL)
    process.communicate()
    frames = len(Cache.open(tmp_path / "k.zarr")) + 10
    for name in ("k.zarr", "w.zarr"):
        assert start(tmp_path, *run, name, "--frames", str(frames)).wait(timeout=120) == 0
    killed, whole = (Cache.open(tmp_path / name) for name in ("k.zarr", "w.zarr"))
    for a, b in zip(killed, whole, strict=True):
        assert_same_frame(a, b)


@pytest.mark.full
def test_two_hundred_killed_runs_leave_whole_caches(tmp_path: Path) -> None:
    for attempt in range(200):
        (tmp_path / str(attempt)).mkdir()
        kill_a_run(tmp_path / str(attempt), random.Random(1000 + attempt))


@pytest.mark.parametrize(
    ("number", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_a_signal_keeps_the_frames_and_says_so(tmp_path: Path, number: signal.Signals, code: int, word: str) -> None:
    process = start(tmp_path, "run", "pendulum", "-o", "c.zarr", "--frames", "100000")
    wait_for_frames(tmp_path / "c.zarr", 3)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    frames = len(Cache.open(tmp_path / "c.zarr"))
    assert (process.returncode, out) == (code, "")
    assert err == f"pointmass: {word}: {frames} frames kept in 'c.zarr'; the same command goes on from there\n"


def test_a_terminated_render_leaves_nothing(tmp_path: Path) -> None:
    process = start(tmp_path, "render", "pendulum", "-o", "p.mp4", "--frames", "100000", "--json")
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob(".pointmass-*/run.zarr/frames/*")):
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (143, "pointmass: terminated: 'p.mp4' was not written\n")
    assert json.loads(out)["interrupted"] is True
    assert not list(tmp_path.iterdir())


def test_threads_change_no_bits(tmp_path: Path) -> None:
    command = [*COMMAND, "render", "springs", "--frames", "2", "--set", "side=3", "--size", "64x48", "--quiet"]
    for name, threads, extra in (("a", ["--threads", "1"], {}), ("b", ["--threads", "3"], {}), ("c", [], TWO_THREADS)):
        arguments = [*command, "-o", f"{name}.png", *threads]
        subprocess.run(arguments, cwd=tmp_path, env={**os.environ, **extra}, check=True, stderr=subprocess.DEVNULL)
    first = (tmp_path / "a.png").read_bytes()
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "c.png").read_bytes() == first


def test_a_reader_that_stops_early_is_no_error(tmp_path: Path) -> None:
    process = start(tmp_path, "list")
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == ""
    assert process.wait() == 0


def test_the_script_is_installed() -> None:
    script = Path(sys.executable).with_name("pointmass")
    if not script.exists():
        pytest.skip("pointmass is not installed into this environment")
    done = subprocess.run([script, "run", "pendlum"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("pointmass: unknown scene 'pendlum': did you mean 'pendulum'?")
