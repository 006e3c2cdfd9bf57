"""The line that says why the first picture on a machine takes long."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from pointmass.cli.compiling import compiling_said
from pointmass.engine.threads import use_threads

LINE = "pointmass: compiling the renderer (once per machine, about 20 s)...\n"


def compile_one(module: str) -> None:
    def one() -> int:
        return 1

    one.__module__ = module
    numba.njit(one)()


@pytest.mark.parametrize(
    ("quiet", "module", "said"),
    [(False, "pointmass.render.kernels", LINE), (False, "mine", ""), (True, "pointmass.render.kernels", "")],
)
def test_said_once_and_only_of_the_renderer(
    capsys: pytest.CaptureFixture[str], quiet: bool, module: str, said: str
) -> None:
    with compiling_said(quiet):
        compile_one(module)
        compile_one(module)
    compile_one(module)
    assert capsys.readouterr() == ("", said)


def test_a_program_may_call_commands_with_other_threads() -> None:
    before, most = numba.get_num_threads(), numba.config.NUMBA_NUM_THREADS
    try:
        for threads in (1, most, most + 1):
            use_threads(threads)
            compile_one("mine")
            assert numba.get_num_threads() == min(threads, most)
    finally:
        numba.set_num_threads(before)


@pytest.mark.full
def test_said_only_when_the_cache_is_empty(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pointmass.cli", "render", "pendulum", "--frames", "2", "--size", "64x48"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for said in (True, False):
        done = subprocess.run(
            [*command, "-o", "x.png"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        assert (LINE in done.stderr) is said
        assert done.stdout == ""
