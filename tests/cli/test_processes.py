"""The command as a process: kills, interrupts, threads, pipes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pointmass.cache import Cache

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


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a list of processes")
def test_the_processes_of_a_killed_render_end(tmp_path: Path) -> None:
    assert start(tmp_path, "run", "pendulum", "-o", "a.zarr", "--frames", "130", "--quiet").wait(timeout=60) == 0
    film = ["render", "a.zarr", "--size", "96x64", "--quiet", "-o"]
    process = start(tmp_path, *film, "killed.mp4", "--processes", "2")
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob(".killed.mp4.part/*")):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    children = [other for other in processes() if parent(other) == process.pid]
    assert len(children) >= 2
    process.send_signal(signal.SIGKILL)
    process.communicate()
    while set(children) & set(processes()):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    for name in ("killed.mp4", "whole.mp4"):
        assert start(tmp_path, *film, name).wait(timeout=120) == 0
    assert (tmp_path / "killed.mp4").read_bytes() == (tmp_path / "whole.mp4").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zarr", "killed.mp4", "whole.mp4"]


def processes() -> list[int]:
    return [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdecimal()]


def parent(process: int) -> int | None:
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:  # it has ended
        return None


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


def test_a_terminated_render_goes_on(tmp_path: Path) -> None:
    film = ["render", "pendulum", "-o", "p.mp4", "--size", "64x48"]
    process = start(tmp_path, *film, "--frames", "100000", "--json")
    wait_for_frames(tmp_path / ".p.mp4.zarr", 3)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=30)
    goes_on = "the same command goes on from what is done, which is kept in '.p.mp4.zarr'"
    assert (process.returncode, err) == (143, f"pointmass: terminated: 'p.mp4' was not written; {goes_on}\n")
    assert json.loads(out)["interrupted"] is True
    again = start(tmp_path, *film, "--frames", "3")
    assert "nothing to do" in again.communicate(timeout=60)[1]
    assert [p.name for p in tmp_path.iterdir()] == ["p.mp4"]


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
