"""Scene files that cannot be run: one sentence on stderr, exit code 2, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from pointmass.cache import Cache
from pointmass.cli import main

POINTS = '[[bodies]]\ntype = "points"\nx = [[0.0, 1.0, 0.0]]\n'
FORCE = POINTS + "[[forces]]\ntype = "
BAD = {
    "an attribute of the name of a column": (POINTS + "attributes = {x = 1.0}\n", "particle attribute 'x'"),
    "a pin counted from the end": (POINTS + "pinned = [-1]\n", "counted from 0, not [-1]"),
    "a pin of nobody": (POINTS + "pinned = 1\n", "rows of particles"),
    "nobody": ('[[bodies]]\ntype = "points"\nx = []\n', "there are no particles"),
    "half a particle": ('[[bodies]]\ntype = "lattice"\ncounts = [2.5, 2, 2]\n', "counts = [2.5, 2, 2] is not allowed"),
    "more than there is room for": ('[[bodies]]\ntype = "lattice"\ncounts = [100000, 100000, 100000]\n', "into memory"),
    "a formula that is nan": (FORCE + '"field"\nforce = ["log(-1)", "0", "0"]', "forces.0 (field): force 'log(-1)'"),
    "a parameter that is infinite": (FORCE + '"drag"\nk = "9**9**9**9"', "9**9**9 = inf"),
    "a constant that divides by zero": (FORCE + '"field"\npotential = "k*x"\nconstants = {k = "t/0"}', "by zero"),
    "a parameter that is negative": (FORCE + '"drag"\nk = "-1 - t"', "forces.0 (drag): at t = 0 s, k = -1.0 is"),
    "a parameter that is nan": (FORCE + '"gravity"\n[[forces]]\ntype = "drag"\nk = "log(t - 1)"', "forces.1 (drag): "),
    "a name that nobody knows": (FORCE + '"drag"\nk = "2*chrage"', "forces.0 (drag): unknown name in k '2*chrage': "),
    "a file that cannot be": (FORCE + '"field"\ngrid = "a\\u0000b.npz"', "zero character"),
    "a surface that is nowhere": (POINTS + '[[colliders]]\ntype = "plane"\npoint = [0, "log(t)", 0]', "point.y = -inf"),
}


@pytest.mark.parametrize(("text", "hint"), BAD.values(), ids=BAD)
def test_one_sentence_and_nothing_written(
    text: str, hint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text(text)
    for command in ("check", "run"):
        done = CliRunner().invoke(main, [command, "bad.toml"], catch_exceptions=False)
        assert (done.exit_code, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1
        assert hint in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["bad.toml"]


def test_what_turns_bad_in_the_run_keeps_the_frames_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text("dt = 0.01\nfps = 50\n" + FORCE + '"drag"\nk = "0.095 - t"')
    done = CliRunner().invoke(main, ["run", "bad.toml", "-o", "b.zarr"], catch_exceptions=False)
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "forces.0 (drag): at t = 0.1 s, k = -0.005" in done.stderr
    assert "; 6 frames kept in 'b.zarr'" in done.stderr
    assert len(Cache.open("b.zarr")) == 6
    done = CliRunner().invoke(main, ["render", "bad.toml", "-o", "b.mp4"], catch_exceptions=False)
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b.zarr", "bad.toml"]


def test_files_elsewhere_are_read_only_if_the_command_allows_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "cloud.csv").write_text("x,y,z\n0,1,0\n")
    Path("scenes/a.toml").write_text('frames = 2\n[[bodies]]\ntype = "cloud"\nfile = "../cloud.csv"\n')

    def ran(*words: str) -> tuple[int, str]:
        done = CliRunner().invoke(main, list(words), catch_exceptions=False)
        return done.exit_code, done.stderr or done.stdout

    code, said = ran("run", "scenes/a.toml")
    assert (code, said.count("\n")) == (2, 1)
    assert "bodies.0 (cloud): file = '../cloud.csv' is not allowed" in said
    assert "--allow-outside" in said
    assert ran("run", "scenes/a.toml", "--allow-outside")[0] == 0
    assert ran("run", "scenes/a.toml", "--set", "bodies.0.file=../cloud.csv", "-o", "b.zarr")[0] == 0
    assert ran("why", "a.zarr")[0] == 2  # a cache of a stranger does not decide what may be read
    assert "nothing has changed" in ran("why", "a.zarr", "--allow-outside")[1]
