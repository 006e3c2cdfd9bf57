"""The command line: what it prints and writes, and one sentence for everything that it refuses."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from click.testing import CliRunner, Result

import pointmass as pm
from pointmass.cache import Cache
from pointmass.cli import main
from pointmass.scenes import SCENES

SMALL = ["--size", "64x48", "--quiet"]
SCENE = """
dt = 0.01
frames = 4
solver = "rk4"
[[bodies]]
type = "points"
x = [[0.0, 1.0, 0.0], [0.5, 1.0, 0.0]]
radius = 0.1
[[forces]]
type = "gravity"
[[forces]]
type = "drag"
k = 0.1
[[colliders]]
type = "plane"
"""
BURSTING = """
name = "bursting"
dt = 0.01
frames = 200
solver = "euler"
[[bodies]]
type = "points"
x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
[[forces]]
type = "springs"
pairs = [[0, 1]]
k_s = 1e5
rest = 0.9
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(SCENE)
    (tmp_path / "bursting.toml").write_text(BURSTING)
    return tmp_path


def pointmass(*arguments: str) -> Result:
    return CliRunner().invoke(main, list(arguments), catch_exceptions=False)


def contents(folder: Path) -> dict[str, bytes | None]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in folder.rglob("*")}


# ---------------------------------------------------------------------------------------------------------------- list


def test_list_as_json_holds_every_scene() -> None:
    done = pointmass("list", "--json")
    assert done.exit_code == 0
    scenes = json.loads(done.stdout)["scenes"]
    assert [s["name"] for s in scenes] == list(SCENES)
    for scene in scenes:
        assert scene["summary"]
        for parameter in scene["parameters"]:
            assert {"name", "default", "unit", "minimum", "maximum", "choices", "summary"} <= set(parameter)


def test_list_for_people_names_everything() -> None:
    done = pointmass("list")
    text = " ".join(done.stdout.split())
    for name in (*SCENES, *pm.SOLVERS, *pm.FORCES, "links", "N/m", "velocity_verlet"):
        assert name in text


def test_help_and_version() -> None:
    assert pm.__version__ in pointmass("--version").stdout
    for arguments in ([], ["-h"], ["--help"]):
        assert "SCENE is the name of a scene" in pointmass(*arguments).stdout
    for command in ("list", "run", "render", "view", "check", "export", "new"):
        assert "-h, --help" in pointmass(command, "-h").stdout


# ----------------------------------------------------------------------------------------------------------------- run


def test_run_writes_a_cache(folder: Path) -> None:
    done = pointmass("run", "a.toml", "-o", "b.zarr", "--frames", "3", "--json")
    assert (done.exit_code, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    assert result.pop("seconds") >= 0
    assert result == {"command": "run", "path": "b.zarr", "frames": 3, "diverged": None, "interrupted": False}
    assert len(Cache.open("b.zarr")) == 3


def test_the_default_output_is_said_on_stderr(folder: Path) -> None:
    done = pointmass("run", "a.toml")
    assert done.exit_code == 0
    assert done.stdout == ""
    assert re.fullmatch(r"pointmass: 4 frames in [\d.]+ s: a.zarr\n", done.stderr)
    assert len(Cache.open("a.zarr")) == 4
    assert pointmass("run", "pendulum", "--frames", "2", "-q").stderr == ""
    assert len(Cache.open("pendulum.zarr")) == 2


def test_options_reach_the_run(folder: Path) -> None:
    run = ["run", "a.toml", "-o", "b.zarr", "--frames", "3", "--fps", "30", "--substeps", "5", "--solver", "verlet"]
    settings = ["--set", "forces.1.k=0.3", "--set", "look.color=red"]
    done = pointmass(*run, "--seed", "7", "--dtype", "float32", "--threads", "1", *settings)
    assert done.exit_code == 0
    cache = Cache.open("b.zarr")
    scene = cache.scene
    assert scene is not None
    assert (scene.frames, scene.fps, scene.dt, scene.seed, scene.dtype) == (3, 30.0, 1 / 150, 7, "float32")
    assert (scene.forces[1].arguments["k"], scene.look.color) == (0.3, "red")
    assert (cache.fps, cache.attributes["solver"], cache.attributes["seed"]) == (30.0, "leapfrog", 7)
    assert cache[2].positions.dtype == np.float32
    assert pointmass("run", "a.toml", "-o", "c.zarr", "--dt", "0.004").exit_code == 0
    assert Cache.open("c.zarr").attributes["dt"] == 0.004


def test_parameters_of_shipped_scenes_are_set(folder: Path) -> None:
    done = pointmass("run", "pendulum", "--frames", "2", "--set", "links=3", "--set", "length=2", "-o", "p.zarr")
    assert done.exit_code == 0
    assert len(Cache.open("p.zarr")[0].ids) == 4


def test_a_second_run_replaces_the_first_with_the_same_bits(folder: Path) -> None:
    pointmass("run", "a.toml", "-o", "b.zarr", "--frames", "2")
    pointmass("run", "a.toml", "-o", "b.zarr", "--set", "seed=1")
    pointmass("run", "a.toml", "-o", "c.zarr", "--set", "seed=1")
    first, second = Cache.open("b.zarr"), Cache.open("c.zarr")
    assert len(first) == 4
    for a, b in zip(first, second, strict=True):
        assert a.positions.tobytes() == b.positions.tobytes()


def test_a_run_goes_on_and_says_why_it_does_not(folder: Path) -> None:
    run = ["run", "a.toml", "-o", "b.zarr"]
    assert pointmass(*run, "--frames", "3").exit_code == 0
    assert "3 frames of 'b.zarr' stay, the run goes on from there" in pointmass(*run, "--resume").stderr
    done = pointmass(*run)
    assert "nothing to do: the scene has not changed since 'b.zarr' was made" in done.stderr
    assert pointmass("why", "b.zarr").stdout == "nothing has changed: 4 frames\n"
    text = (folder / "a.toml").read_text()
    (folder / "a.toml").write_text(text.replace("frames = 4", "frames = 4\nseed = 5"))
    assert pointmass("why", "b.zarr").stdout.splitlines() == [
        "seed: the default -> 5",
        "a run keeps 0 frames of 4, and makes the rest again",
    ]
    told = json.loads(pointmass("why", "b.zarr", "a.toml", "--set", "seed=6", "--json").stdout)
    assert (told["changes"], told["kept"]) == ([{"path": "seed", "old": None, "new": 6}], 0)
    refused = pointmass(*run, "--resume")
    assert refused.exit_code == 2
    assert "--resume finds another scene in 'b.zarr' (seed: the default -> 5)" in refused.stderr
    assert "the scene has changed (seed: the default -> 5): all frames are made again" in pointmass(*run).stderr
    assert "4 frames in" in pointmass(*run, "--anew").stderr
    assert len(Cache.open("b.zarr")) == 4


def test_a_divergence_keeps_the_frames_before_it(folder: Path) -> None:
    done = pointmass("run", "bursting.toml", "-o", "d.zarr", "--json")
    assert done.exit_code == 3
    warned, ended = done.stderr.splitlines()
    assert warned.startswith("pointmass: euler amplifies the motion of spring 0 (particles 0-1) at any dt")
    assert re.fullmatch(r"pointmass: diverged in step \d+ .* at particle .*; \d+ frames kept in 'd.zarr'", ended)
    result = json.loads(done.stdout)
    assert 0 < result["frames"] < 200
    assert result["diverged"]["step"] > 0
    assert len(Cache.open("d.zarr")) == result["frames"]


# -------------------------------------------------------------------------------------------------------------- render


@pytest.mark.parametrize("name", ["f.mp4", "f.gif", "f.webm", "f.mov", "f.png"])
def test_render_writes_films_and_pictures(folder: Path, name: str) -> None:
    done = pointmass("render", "a.toml", "-o", name, *SMALL)
    assert done.exit_code == 0
    assert (folder / name).stat().st_size > 100
    assert sorted(p.name for p in folder.iterdir()) == sorted(["a.toml", "bursting.toml", name])


def test_render_of_a_cache_is_the_render_of_its_scene(folder: Path) -> None:
    pointmass("run", "a.toml")
    for source, name in (("a.toml", "x_%04d.png"), ("a.zarr", "y_%04d.png")):
        assert pointmass("render", source, "-o", name, *SMALL).exit_code == 0
    for k in range(4):
        assert (folder / f"x_{k:04d}.png").read_bytes() == (folder / f"y_{k:04d}.png").read_bytes()
    assert pointmass("render", "a.zarr", "-o", "last.png", *SMALL).exit_code == 0
    assert pointmass("render", "a.zarr", "-o", "two.png", "--frame", "2", *SMALL).exit_code == 0
    assert (folder / "last.png").read_bytes() == (folder / "y_0003.png").read_bytes()
    assert (folder / "two.png").read_bytes() == (folder / "y_0002.png").read_bytes()


def test_render_options_change_the_picture(folder: Path) -> None:
    pointmass("run", "a.toml")
    seen = set()
    for options in ([], ["--caption"], ["--azimuth", "90"], ["--elevation", "60"], ["--fov", "60"]):
        done = pointmass("render", "a.zarr", "-o", "x.png", "--json", *SMALL, *options)
        assert json.loads(done.stdout)["frames"] == 1
        seen.add((folder / "x.png").read_bytes())
    assert len(seen) == 5


def test_a_part_of_a_film_is_that_part_also_while_the_camera_moves(folder: Path) -> None:
    pointmass("run", "a.toml")
    moves = ["--orbit", "900", "--dolly", "0.5", *SMALL]
    for name, part in (("x_%04d.png", []), ("y_%04d.png", ["--first", "1", "--last", "2"])):
        assert pointmass("render", "a.zarr", "-o", name, *part, *moves).exit_code == 0
    assert sorted(p.name for p in folder.glob("y_*")) == ["y_0001.png", "y_0002.png"]
    assert (folder / "y_0002.png").read_bytes() == (folder / "x_0002.png").read_bytes()
    assert (folder / "x_0001.png").read_bytes() != (folder / "x_0000.png").read_bytes()


def test_render_of_one_frame_simulates_no_further(folder: Path) -> None:
    done = pointmass("render", "bursting.toml", "-o", "x.png", "--frame", "1", *SMALL)
    assert done.exit_code == 0
    assert (folder / "x.png").exists()


def test_render_of_a_divergence_holds_what_came_before(folder: Path) -> None:
    done = pointmass("render", "bursting.toml", "-o", "d.gif", "--size", "32x24", "--json")
    assert done.exit_code == 3
    assert "diverged in step" in done.stderr
    assert "holds the" in done.stderr
    assert json.loads(done.stdout)["frames"] > 0
    assert sorted(p.name for p in folder.iterdir()) == ["a.toml", "bursting.toml", "d.gif"]
    late = pointmass("render", "bursting.toml", "-o", "x.png", "--frame", "199", *SMALL)
    assert late.exit_code == 3
    assert "'x.png' was not written" in late.stderr
    assert not (folder / "x.png").exists()


# --------------------------------------------------------------------------------------------------- export, check, new


def test_export_writes_arrays(folder: Path) -> None:
    pointmass("run", "a.toml")
    assert pointmass("export", "a.zarr", "a.npz").exit_code == 0
    with np.load("a.npz") as data:
        assert data["positions"].tobytes() == np.stack([f.positions for f in Cache.open("a.zarr")]).tobytes()


def test_export_writes_the_surfaces_of_a_frame(folder: Path) -> None:
    (folder / "sheet.toml").write_text('frames = 3\n[[bodies]]\ntype = "cloth"\nrows = 3\ncols = 3\n')
    pointmass("run", "sheet.toml")
    assert pointmass("export", "sheet.zarr", "s.ply", "--frame", "0").exit_code == 0
    assert (folder / "s.ply").read_bytes().startswith(b"ply")
    assert pointmass("export", "sheet.zarr", "s_%02d.obj").exit_code == 0
    assert sorted(p.name for p in folder.glob("s_*.obj")) == ["s_00.obj", "s_01.obj", "s_02.obj"]
    late = pointmass("export", "sheet.zarr", "s.glb", "--frame", "3")
    assert "--frame 3 is not allowed: there are the frames 0 to 2" in late.stderr


def test_export_takes_scenes_and_chooses_by_the_ending(folder: Path) -> None:
    for name in ("a.usda", "a.csv", "a_%d.png"):
        done = pointmass("export", "a.toml", name, "--frames", "2")
        assert (done.exit_code, done.stdout) == (0, "")
        assert re.fullmatch(rf"pointmass: 2 frames in [\d.]+ s: {re.escape(name)}\n", done.stderr)
    names = {"a.toml", "bursting.toml", "a.usda", "a.csv", "a_0.png", "a_1.png"}
    assert {p.name for p in folder.iterdir()} == names
    assert "endTimeCode = 1" in (folder / "a.usda").read_text()
    assert 'def Camera "camera"' in (folder / "a.usda").read_text()
    burst = pointmass("export", "bursting.toml", "b.npz")
    assert burst.exit_code == 3
    with np.load("b.npz") as data:
        assert f"'b.npz' holds the {len(data['time'])} frames before it" in burst.stderr


def test_check_says_what_is_safe(folder: Path) -> None:
    result = json.loads(pointmass("check", "pendulum", "--json").stdout)
    assert set(result) == {
        "scene", "solver", "dt", "largest_safe_dt", "recommended_dt", "recommended_substeps",
        "frequency", "damping_ratio", "period", "safe", "solver_reason",
        "particles", "springs", "forces", "emitters", "families", "carriers", "warning",
    }  # fmt: skip
    assert result["safe"] is True
    assert (result["particles"], result["springs"], result["solver"]) == (13, 12, "leapfrog")
    assert result["largest_safe_dt"] > result["dt"]
    unsafe = pointmass("check", "pendulum", "--dt", "0.01")
    assert unsafe.exit_code == 0
    found = re.search(r"verdict\s+not safe: use --dt ([\d.e-]+) or --substeps (\d+)", unsafe.stdout)
    assert found
    for advice in (["--dt", found[1]], ["--substeps", found[2]], ["--solver", "implicit_euler", "--dt", "0.01"]):
        assert json.loads(pointmass("check", "pendulum", "--json", *advice).stdout)["safe"] is True
    free = json.loads(pointmass("check", "a.toml", "--set", "forces.1.k=0", "--json").stdout)
    assert (free["largest_safe_dt"], free["period"], free["frequency"], free["safe"]) == (None, None, 0.0, True)
    assert "amplifies this motion at any dt" in pointmass("check", "orbit", "--solver", "euler").stdout


def test_a_run_with_too_long_a_step_says_so_in_one_line_and_runs(folder: Path) -> None:
    (folder / "stiff.toml").write_text(BURSTING.replace("euler", "leapfrog").replace("1e5", "30000.0"))
    arguments = ["run", "stiff.toml", "-o", "s.zarr", "--frames", "2"]
    done = pointmass(*arguments)
    assert done.exit_code == 0
    lines = [line for line in done.stderr.splitlines() if "too long" in line]
    assert lines == [
        "pointmass: dt = 0.01 s is too long for leapfrog: spring 0 (particles 0-1) takes part in a motion with "
        "omega dt = 2.45, and the limit is 2; the largest safe dt is about 0.00816 s: use a smaller dt, more substeps "
        "or implicit_euler"
    ]
    assert pointmass(*arguments, "--quiet").stderr == ""
    assert "too long" not in pointmass(*arguments, "--dt", "0.008").stderr


def test_check_says_which_springs_are_nearest_to_the_limit(folder: Path) -> None:
    """Two masses of 0.5 kg on a spring of 100 N/m: w = 20, and of leapfrog's limit 2 a step of 0.05 takes a half."""
    (folder / "two.toml").write_text(
        """
        dt = 0.05
        solver = "leapfrog"
        forces = [{type = "gravity"}, {type = "springs", pairs = [[0, 1]], k_s = 100.0, family = "shear"},
                  {type = "springs", pairs = [[2, 3]], k_s = 25.0}]
        [[bodies]]
        type = "points"
        x = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]
        m = 0.5
        """
    )
    result = json.loads(pointmass("check", "two.toml", "--json").stdout)
    shear, other = result["families"]
    assert (shear["family"], shear["force"], shear["count"], other["family"]) == ("shear", "springs", 1, "springs")
    assert (shear["omega_dt"], shear["share"], shear["share_together"]) == (pytest.approx(1), *[pytest.approx(0.5)] * 2)
    assert (other["omega_dt"], other["share"], other["damping_ratio"]) == (pytest.approx(0.5), pytest.approx(0.25), 0)
    (carrier,) = result["carriers"]
    assert (carrier["name"], carrier["particles"]) == ("spring 0 of family shear (particles 0-1)", [0, 1])
    assert carrier["part"] == shear["part"] == pytest.approx(1.0)
    assert (result["recommended_dt"], result["recommended_substeps"], result["safe"]) == (0.095, 1, True)
    text = pointmass("check", "two.toml").stdout
    assert re.search(r"carried by +spring 0 of family shear \(particles 0-1\): 100 % of its energy", text)
    assert re.search(r"elements +family +count +omega dt +damping +alone +together +carries\n", text)
    assert re.search(r"shear +1 +1 +0 +50 % +50 % +100 %\n", text)
    assert "warning          gravity acts, but nothing is pinned and there is no floor" in text
    stiff = ["check", "two.toml", "--set", "forces.1.k_s=1e9"]
    assert "would need 556 substeps in each frame; use --solver implicit_euler" in pointmass(*stiff).stdout
    implicit = json.loads(pointmass(*stiff, "--json", "--solver", "implicit_euler").stdout)
    assert (implicit["safe"], implicit["recommended_dt"], implicit["families"][0]["share"]) == (True, None, 0.0)
    euler = json.loads(pointmass("check", "two.toml", "--json", "--solver", "euler").stdout)
    assert (euler["families"][0]["share"], euler["recommended_dt"], euler["largest_safe_dt"]) == (None, None, 0.0)


@pytest.mark.parametrize(
    "held",
    [
        '[[colliders]]\ntype = "plane"',
        '[[zones]]\ntype = "half_space"',
        '[[forces]]\ntype = "harmonic"',
        '[[bodies]]\ntype = "points"\nx = [[0, 0, 0]]\npinned = [0]',
    ],
)
def test_check_warns_of_a_fall_for_ever_only_where_nothing_ends_it(folder: Path, held: str) -> None:
    free = '[[forces]]\ntype = "gravity"\n[[bodies]]\ntype = "points"\nx = [[1, 2, 3]]\n'
    for text, warned in ((free, True), (f"{free}{held}\n", False)):
        (folder / "free.toml").write_text(text)
        assert (json.loads(pointmass("check", "free.toml", "--json").stdout)["warning"] is not None) is warned


def test_check_looks_at_the_first_particle_of_each_emitter(folder: Path) -> None:
    """A drop of mass m in air of drag k slows down at the rate k/m, however late it is born."""
    (folder / "late.toml").write_text(
        """
        dt = 0.01
        solver = "rk4"
        forces = [{type = "drag", k = 0.5}]
        emitters = [{type = "nozzle", mass = 0.1}, {type = "nozzle", mass = 0.001, start = 0.2, rate = 1.0}]
        """
    )
    result = json.loads(pointmass("check", "late.toml", "--json").stdout)
    assert (result["particles"], result["emitters"], result["safe"]) == (0, 2, False)
    assert result["frequency"] == pytest.approx(500.0)
    assert result["largest_safe_dt"] == pytest.approx(2.785 / 500, rel=1e-3)
    short = json.loads(pointmass("check", "late.toml", "--json", "--frames", "6").stdout)
    assert (short["frequency"], short["safe"]) == (pytest.approx(5.0), True)
    assert json.loads(pointmass("check", "fountain", "--json").stdout)["frequency"] == pytest.approx(0.1)
    assert "0 particles, 0 springs, 1 force, 2 emitters" in pointmass("check", "late.toml").stdout


def test_new_writes_a_scene_that_runs(folder: Path) -> None:
    assert pointmass("new").exit_code == 0
    assert pointmass("new", "mine.toml").exit_code == 0
    text = (folder / "mine.toml").read_text()
    scene = pm.Scene.from_toml(text)
    assert set(tomllib.loads(text)) >= {"bodies", "forces", "colliders", "camera", "look", "solver"}
    assert {force.name for force in scene.forces} >= {"gravity", "field"}
    headers = [line for line in text.splitlines() if line.startswith("[[")]
    assert all("#" in text.split(header)[0][-400:] for header in headers)
    assert json.loads(pointmass("check", "mine.toml", "--json").stdout)["safe"] is True
    assert pointmass("render", "mine.toml", "-o", "m.png", "--frames", "20", *SMALL).exit_code == 0
    again = pointmass("new", "mine.toml")
    assert (again.exit_code, again.stderr) == (2, "pointmass: 'mine.toml' is there already: give another name\n")
    assert (folder / "mine.toml").read_text() == text


# ----------------------------------------------------------------------------------------------------------- bad input

LINE = "\n[[forces]]\n"
BAD_FILES = {
    "key": SCENE + "colour = 1\n",
    "solver": SCENE.replace("rk4", "rk5"),
    "force": SCENE.replace("drag", "dragg"),
    "mass": SCENE.replace("radius = 0.1", "m = -1.0"),
    "dt": SCENE.replace("dt = 0.01", "dt = 0.0"),
    "nan": SCENE.replace("k = 0.1", "k = nan"),
    "nan in a list": SCENE.replace("0.5, 1.0", "nan, 1.0"),
    "nan in the camera": SCENE + "[camera]\nazimuth = nan\n",
    "camera on its target": SCENE + "[camera]\nposition = [1, 1, 1]\ntarget = [1, 1, 1]\n",
    "restitution": SCENE + "restitution = 1.2\n",
    "self spring": SCENE + LINE + 'type = "springs"\npairs = [[1, 1]]\n',
    "missing particle": SCENE + LINE + 'type = "springs"\npairs = [[0, 9]]\n',
    "formula": SCENE + LINE + 'type = "field"\nforce = ["__import__(\'os\')", "0", "0"]\n',
    "attribute": SCENE + LINE + 'type = "field"\nforce = ["x.__class__", "0", "0"]\n',
    "unknown name": SCENE + LINE + 'type = "field"\nforce = ["chrge*x", "0", "0"]\n',
    "no grid": SCENE + LINE + 'type = "field"\ngrid = "none.npz"\n',
    "cut grid": SCENE + LINE + 'type = "field"\ngrid = "cut.npz"\n',
    "wrong grid": SCENE + LINE + 'type = "field"\ngrid = "wrong.npz"\n',
    "color": SCENE + '[look]\ncolor = "blau"\n',
    "color by": SCENE + '[look]\ncolor_by = "heat"\n',
    "not TOML": "frames = = 3",
    "empty": "",
    "binary": "\udcff\udcfe",
    "too many": 'dt = 0.1\n[[bodies]]\ntype = "scatter"\ncount = 1000000000000000\n',
    "solver of a flow": 'solver = "leapfrog"\n[[bodies]]\ntype = "scatter"\ncount = 3\n' + LINE + 'type = "vortex"\n',
}
BAD_OPTIONS: list[tuple[str, list[str], str]] = [
    ("--frames", ["--frames", "0"], "frames = 0 is not allowed"),
    ("--frames text", ["--frames", "x"], "'--frames'"),
    ("--fps", ["--fps", "-1"], "fps = -1.0 is not allowed"),
    ("--dt", ["--dt", "0"], "dt = 0.0 is not allowed"),
    ("--dt nan", ["--dt", "nan"], "dt = nan is not allowed"),
    ("--substeps", ["--substeps", "0"], "substeps = 0 is not allowed"),
    ("both", ["--dt", "0.01", "--substeps", "4"], "--dt and --substeps both set the step"),
    ("--solver", ["--solver", "rk5"], "unknown solver 'rk5': did you mean 'rk4'"),
    ("--seed", ["--seed", "-3"], "seed = -3 is not allowed"),
    ("--dtype", ["--dtype", "float16"], "dtype = 'float16' is not allowed"),
    ("--threads", ["--threads", "0"], "threads = 0 is not allowed"),
    ("--set", ["--set", "k"], "--set 'k' is not allowed: write name=value"),
    ("--set name", ["--set", "=3"], "--set '=3' is not allowed"),
    ("--set path", ["--set", "forces.9.k=3"], "the scene has no 'forces.9.k'"),
    ("--set nan", ["--set", "forces.1.k=nan"], "nan is not allowed"),
    ("--set value", ["--set", "forces.1.k=-1"], "k = -1 is not allowed"),
    ("unknown", ["--frmes", "3"], "--frmes"),
]
BAD_RENDERS: list[tuple[str, list[str], str]] = [
    ("suffix", ["-o", "x.avi"], "unknown kind of picture or film '.avi'"),
    ("no suffix", ["-o", "x"], "unknown kind of picture or film ''"),
    ("folder", ["-o", "none/x.mp4"], "there is no folder 'none'"),
    ("is folder", ["-o", "folder.mp4"], "it is a folder"),
    ("--frame", ["-o", "x.png", "--frame", "4"], "--frame 4 is not allowed: there are 4 frames, counted from 0"),
    ("--frame negative", ["-o", "x.png", "--frame", "-1"], "--frame -1 is not allowed"),
    ("--last", ["-o", "x.mp4", "--last", "4"], "--last 4 is not allowed: there are 4 frames"),
    (
        "--first after",
        ["-o", "x.mp4", "--first", "2", "--last", "1"],
        "--last 1 is not allowed: it is before --first 2",
    ),
    ("--first picture", ["-o", "x.png", "--first", "1"], "--first and --last belong to a film"),
    ("--follow", ["-o", "x.mp4", "--follow", "-1"], "camera.follow = -1 is not allowed"),
    ("--orbit", ["-o", "x.mp4", "--orbit", "nan"], "orbit = nan is not allowed"),
    ("--frame film", ["-o", "x.mp4", "--frame", "1"], "--frame belongs to a single picture"),
    ("text in a name", ["-o", "x_%s.png"], "one number"),
    ("two numbers in a name", ["-o", "x_%d_%d.png"], "one number"),
    ("long name", ["-o", "x" * 300 + ".mp4"], "name"),
    ("odd size", ["-o", "x.mp4", "--size", "641x360"], "even"),
    ("--size", ["-o", "x.mp4", "--size", "large"], "--size 'large' is not allowed"),
    ("--size 0", ["-o", "x.mp4", "--size", "0x100"], "size"),
    ("--size huge", ["-o", "x.mp4", "--size", "999999x999999"], "size"),
    ("--azimuth", ["-o", "x.mp4", "--azimuth", "nan"], "azimuth = nan is not allowed"),
    ("--fov", ["-o", "x.mp4", "--fov", "180"], "fov = 180.0 is not allowed"),
    ("fps", ["-o", "x.mp4", "--fps", "5000"], "fps = 5000.0 is not allowed"),
]


@pytest.fixture
def old_files(folder: Path) -> Path:
    np.savez(folder / "whole.npz", values=np.ones((2, 2, 2, 3)), origin=np.zeros(3), spacing=np.ones(3))
    (folder / "cut.npz").write_bytes((folder / "whole.npz").read_bytes()[:300])
    np.savez(folder / "wrong.npz", something=np.ones(3))
    pointmass("run", "a.toml", "-o", "old.zarr", "--frames", "2")
    (folder / "folder.mp4").mkdir()
    (folder / "old.mp4").write_text("old film")
    (folder / "scene.png").write_text(SCENE)
    return folder


def full_disk(*_: object, **__: object) -> NoReturn:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@contextmanager
def opened_on_full(path: Path, *_: object, **__: object) -> Iterator[io.StringIO]:
    """What is written lies in a buffer until the file is closed, and there is no room for it then."""
    path.touch()
    yield io.StringIO()
    full_disk()


def assert_refused(folder: Path, arguments: list[str], sentence: str = "") -> None:
    before = contents(folder)
    done = pointmass(*arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert re.fullmatch(r"pointmass: [^\n]+\n", done.stderr), done.stderr
    assert sentence in done.stderr
    assert contents(folder) == before


@pytest.mark.parametrize("what", BAD_FILES)
def test_bad_files(old_files: Path, what: str) -> None:
    (old_files / "bad.toml").write_bytes(BAD_FILES[what].encode(errors="surrogateescape"))
    assert_refused(old_files, ["run", "bad.toml", "-o", "old.zarr"])
    assert_refused(old_files, ["render", "bad.toml", "-o", "old.mp4"])
    if not what.startswith(("color by", "solver of")):
        assert_refused(old_files, ["check", "bad.toml"])


@pytest.mark.parametrize(("arguments", "sentence"), [b[1:] for b in BAD_OPTIONS], ids=[b[0] for b in BAD_OPTIONS])
def test_bad_options(old_files: Path, arguments: list[str], sentence: str) -> None:
    for command in (["run", "a.toml", "-o", "old.zarr"], ["render", "a.toml", "-o", "old.mp4"], ["check", "a.toml"]):
        assert_refused(old_files, [*command, *arguments], sentence)


@pytest.mark.parametrize(("arguments", "sentence"), [b[1:] for b in BAD_RENDERS], ids=[b[0] for b in BAD_RENDERS])
def test_bad_renders(old_files: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], sentence: str) -> None:
    monkeypatch.setattr(pm.Simulation, "frame", lambda *_: pytest.fail("it is simulated before it is refused"))
    assert_refused(old_files, ["render", "a.toml", *arguments], sentence)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["rnu", "pendulum"], "No such command"),
        (["run"], "Missing argument"),
        (["run", "pendlum"], "unknown scene 'pendlum': did you mean 'pendulum'"),
        (["run", "none.toml"], "cannot read the scene 'none.toml': No such file"),
        (["run", "folder.mp4"], "'folder.mp4' is a folder, not a scene"),
        (["run", "old.zarr"], "is a folder, not a scene"),
        (["run", "pendulum", "--set", "linsk=3"], "unknown parameter of scene pendulum: 'linsk': did you mean 'links'"),
        (["run", "pendulum", "--set", "links=0"], "links = 0 is not allowed"),
        (["run", "pendulum", "--set", "length=nan"], "length = nan is not allowed"),
        (["run", "a.toml", "-o", "none/x.zarr"], "there is no folder 'none'"),
        (["run", "a.toml", "-o", "a.toml"], "something else is there"),
        (["run", "a.toml", "-o", "folder.mp4"], "something else is there"),
        (["run", "a.toml", "-o", "old.mp4/x.zarr"], "there is no folder"),
        (["render", "folder.mp4", "-o", "x.mp4"], "is not a pointmass cache"),
        (["render", "old.zarr", "-o", "x.mp4", "--dt", "0.1"], "--dt cannot change the cache"),
        (["render", "old.zarr", "-o", "x.mp4", "--set", "a=1"], "--set cannot change the cache"),
        (["render", "old.zarr", "-o", "x.png", "--frame", "2"], "there are 2 frames"),
        (["run", "a.toml", "-o", "x.zarr", "--resume"], "--resume finds no cache 'x.zarr'"),
        (["run", "a.toml", "--resume", "--anew"], "--resume and --anew cannot both be wanted"),
        (["why", "none.zarr"], "there is no such folder"),
        (["export", "old.zarr"], "Missing argument 'OUT'"),
        (["export", "old.zarr", "x.xyz"], "unknown kind of export '.xyz'"),
        (["export", "old.zarr", "none/x.npz"], "there is no folder"),
        (["export", "none.zarr", "x.npz"], "there is no such folder"),
        (["export", "folder.mp4", "x.npz"], "is not a pointmass cache"),
        (["check", "pendlum"], "unknown scene"),
        (["new", "scene.txt"], "ends in .toml"),
        (["new", "none/scene.toml"], "cannot write 'none/scene.toml'"),
        (["run", "a.toml", "--seed", str(2**63)], "seed = 9223372036854775808 is not allowed"),
        (["render", "scene.png", "-o", "./scene.png"], "is the scene itself"),
    ],
)
def test_bad_commands(old_files: Path, arguments: list[str], sentence: str) -> None:
    assert_refused(old_files, arguments, sentence)


def test_a_full_disk_is_said_and_nothing_is_left(old_files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Path.open
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", lambda p, mode="r", **k: (opened_on_full if mode == "x" else opened)(p, mode, **k))
        assert_refused(old_files, ["new", "n.toml"], "cannot write 'n.toml': No space left")
    monkeypatch.setattr("PIL.Image.Image.save", full_disk)
    assert_refused(old_files, ["render", "old.zarr", "-o", "f.png", *SMALL], "cannot write 'f.png': No space left")


def test_a_damaged_cache_is_refused(old_files: Path) -> None:
    (old_files / "old.zarr/frames/000001/positions/c.0.0").write_bytes(b"junk")
    assert_refused(old_files, ["render", "old.zarr", "-o", "old.mp4"], "frame 1 of the cache 'old.zarr' cannot be read")
    assert_refused(old_files, ["export", "old.zarr", "x.npz"], "frame 1 of the cache")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is read-only for root")
def test_a_read_only_folder_is_refused(old_files: Path) -> None:
    (old_files / "closed").mkdir(mode=0o500)
    for arguments in (["run", "a.toml", "-o", "closed/x.zarr"], ["render", "a.toml", "-o", "closed/x.mp4"]):
        assert_refused(old_files, arguments, "cannot write into folder 'closed'")


@pytest.mark.parametrize("command", [["run", "a.toml", "-o", "i.zarr"], ["render", "a.toml", "-o", "i.mp4", *SMALL]])
def test_an_interrupt_ends_with_130(folder: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]) -> None:
    frame: Callable[..., Any] = pm.Simulation.frame

    def interrupted(self: Any, number: int = 0, *rest: Any) -> Any:
        if number == 2:
            raise KeyboardInterrupt
        return frame(self, number, *rest)

    with monkeypatch.context() as broken:
        broken.setattr(pm.Simulation, "frame", interrupted)
        done = pointmass(*command)
    assert done.exit_code == 130
    if command[0] == "run":
        assert done.stderr == "pointmass: interrupted: 2 frames kept in 'i.zarr'; the same command goes on from there\n"
        assert len(Cache.open("i.zarr")) == 2
    else:
        assert done.stderr == (
            "pointmass: interrupted: 'i.mp4' was not written; the same command goes on from what is done, which is"
            " kept in '.i.mp4.zarr'\n"
        )
        assert pointmass(*command).exit_code == 0
        assert sorted(p.name for p in folder.iterdir()) == ["a.toml", "bursting.toml", "i.mp4"]
