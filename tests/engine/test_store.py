"""Kernels on disk: shared by processes, never torn, readable, and cleared away."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from pointmass.cli.kernels import command
from pointmass.engine import store

TEXT = '@njit(**ENTRY)\ndef twice(a):\n    """Twice a number."""\n    return R(2) * a\n'
PROGRAM = f"""
import logging, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
logging.getLogger("pointmass").setLevel(logging.INFO)
from pointmass.engine import store
print(store.load("a test", {TEXT!r}, "float64").twice(4.0))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("POINTMASS_CACHE", str(tmp_path))
    monkeypatch.setattr(store, "LOADED", {})
    return tmp_path


def process(**environment: str) -> subprocess.Popen[str]:
    env = {**os.environ, **environment}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_the_second_process_compiles_nothing(folder: Path) -> None:
    said = "compiling a test (once per machine)...\n"
    for expected in (said + "8.0\n", "8.0\n"):
        out, err = process().communicate()
        assert (out, err) == (expected, "")


def test_processes_at_once_do_not_disturb_each_other(folder: Path) -> None:
    for running in [process() for _ in range(4)]:
        out, err = running.communicate()
        assert out.endswith("8.0\n")
        assert not err
    assert [p.suffix for p in (folder / "kernels").iterdir() if p.is_file()] == [".py"]


@pytest.mark.parametrize("enabled", [True, False])
def test_garbage_waits_while_a_kernel_compiles(folder: Path, enabled: bool) -> None:
    """The collector stands still meanwhile, and is as it was before afterwards."""
    code = f"""
import gc
from numba.core.event import Listener, install_listener
from pointmass.engine import store
if not {enabled}:
    gc.disable()
text = "@njit(**FLAGS)\\ndef twice(x):\\n    return 2 * x\\n\\n@njit(**ENTRY)\\ndef run(x):\\n    return twice(x)\\n"
store.load("t", text, "float64")
seen = []
class Look(Listener):
    def on_start(self, event): seen.append(gc.isenabled())
    def on_end(self, event): pass
with install_listener("numba:compile", Look()):
    assert store.LOADED.popitem()[1].run(1.0) == 2
print(seen, gc.isenabled())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[0] == f"[False, False] {enabled}"


def test_what_it_depends_on_is_in_the_name(folder: Path) -> None:
    modules = [store.load(*text) for text in [("t", TEXT, "float64"), ("t", TEXT, "float32"), ("u", TEXT, "float64")]]
    assert len({m.__name__ for m in modules}) == 3
    assert store.load("t", TEXT, "float64") is modules[0]


def test_the_file_is_plain_python_that_can_be_read(folder: Path) -> None:
    path = Path(str(store.load("what it is", TEXT, "float64").__file__))
    assert path.read_text(encoding="utf-8").startswith('"""what it is\n\nPrinted by pointmass')
    assert store.plain("what it is", TEXT, "float64")["twice"](1.5) == 3.0


def test_a_folder_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("POINTMASS_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr(store, "LOADED", {})
    with pytest.warns(RuntimeWarning, match="set POINTMASS_CACHE"):
        assert store.load("t", TEXT, "float64").twice(1.0) == 2.0


def test_the_command(folder: Path) -> None:
    assert CliRunner().invoke(command).output.startswith("0 kernels, 0.0 MB in ")
    store.load("t", TEXT, "float64").twice(1.0)
    assert CliRunner().invoke(command).output.startswith("1 kernel, ")
    assert '"kernels": 1' in CliRunner().invoke(command, ["--json"]).output
    assert CliRunner().invoke(command, ["--clear"]).output.startswith("deleted 1 kernel, ")
    assert not list(store.kept())
