"""No scene and no cache gets more memory than the limit, unless --allow-large is given."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from pointmass.cli import main, memory

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="other systems do not keep to such a limit")

LATTICE = '[[bodies]]\ntype = "lattice"\ncounts = [{n}, {n}, {n}]\n'


@pytest.fixture
def small_machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine with 2 GB of memory more than this process has by now."""
    fields = Path("/proc/self/statm").read_text().split()
    used = int(fields[5]) * 4096  # data
    monkeypatch.setattr(memory, "_machine", lambda: int((used + 2e9) / memory.SHARE))
    monkeypatch.chdir(tmp_path)


def ended(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(main, list(arguments), catch_exceptions=False)
    return done.exit_code, done.stderr


@pytest.mark.usefixtures("small_machine")
def test_a_scene_that_asks_for_too_much_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(LATTICE.format(n=600))
    code, said = ended("run", "a.toml")
    assert (code, said.count("\n")) == (2, 1)
    assert "75%" in said
    assert "--allow-large" in said
    assert [p.name for p in tmp_path.iterdir()] == ["a.toml"]


@pytest.mark.usefixtures("small_machine")
def test_what_runs_out_of_memory_is_told_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numpy as np

    from pointmass.scene import Scene

    (tmp_path / "a.toml").write_text(LATTICE.format(n=2))
    monkeypatch.setattr(Scene, "simulation", lambda self: np.ones(500_000_000))
    code, said = ended("run", "a.toml")
    assert (code, said.count("\n")) == (2, 1)
    assert "this needs more than" in said
    assert "give --allow-large" in said
    limits: list[int] = []
    monkeypatch.setattr(Scene, "simulation", lambda self: limits.append(_soft()) or sys.exit(0))
    for options, free in (([], False), (["--allow-large"], True)):
        ended("run", "a.toml", *options)
        assert (limits.pop() < 0) == free
    assert _soft() < 0  # as before


def _soft() -> int:
    import resource

    return resource.getrlimit(resource.RLIMIT_DATA)[0]
