"""What stays of a cache, and that a run that goes on has the bits of one that was never stopped."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import pytest
import trimesh

import pointmass as pm
from pointmass.cache import Cache, plan, record
from pointmass.cache.provenance import Making, same_until
from pointmass.errors import InvalidInput
from pointmass.lock import locked
from pointmass.scenes import SCENES
from tests.same import assert_same_frame

FRAMES = 40


def fountain(k: Any = 0.15, start: float = 0.0, **more: Any) -> pm.Scene:
    """Two emitters, of which one opens later, and an air that may change."""
    return pm.Scene(
        emitters=[
            pm.Nozzle(rate=100.0, lifetime=pm.Spread(0.2, 0.1)),
            pm.Nozzle(position=(1, 0, 0), rate=60.0, lifetime=0.2, start=start),
        ],
        forces=[pm.Gravity(), pm.Drag(k=k)],
        colliders=[pm.Plane((0, -0.2, 0))],
        dt=1 / 240,
        frames=FRAMES,
        **more,
    )


def made(scene: pm.Scene, path: Path, frames: int = FRAMES, **options: Any) -> Cache:
    return record(scene.simulation(), path, frames, scene.fps, scene=scene, **options)


def stop_after(count: int) -> Any:
    def progress(frames: int) -> None:
        if frames >= count:
            raise KeyboardInterrupt

    return progress


def assert_whole(path: Path, scene: pm.Scene, frames: int = FRAMES) -> None:
    """The frames of a cache are those of a run that nobody has stopped."""
    cache = Cache.open(path)
    assert len(cache) == frames
    for stored, alone in zip(cache, scene.simulation().frames(frames, scene.fps), strict=True):
        assert_same_frame(stored, alone)


def test_a_stopped_run_goes_on_from_a_checkpoint_with_the_same_bits(tmp_path: Path) -> None:
    scene = fountain()
    for count in (19, 35):
        with pytest.raises(KeyboardInterrupt):
            made(scene, tmp_path / "a.zarr", resume=True, progress=stop_after(count))
    sim = scene.simulation()
    record(sim, tmp_path / "a.zarr", FRAMES, scene=scene, resume=True)
    assert sim.engine.stats.steps < 64  # of 156: the last checkpoint was at step 128
    assert_whole(tmp_path / "a.zarr", scene)
    with pytest.raises(InvalidInput, match="resume = True is not allowed for a simulation after 156 steps"):
        record(sim, tmp_path / "a.zarr", FRAMES, scene=scene, resume=True)


@pytest.mark.parametrize(("name", "fps"), [("fish", 60.0), ("snake", 240.0)])
def test_brains_go_on(tmp_path: Path, name: str, fps: float) -> None:
    scene = SCENES[name]().build().changed(fps=fps)
    with pytest.raises(KeyboardInterrupt):
        made(scene, tmp_path / "a.zarr", 14, resume=True, progress=stop_after(12))
    assert plan(tmp_path / "a.zarr", scene.simulation(), scene, scene.fps).state is not None
    made(scene, tmp_path / "a.zarr", 14, resume=True)
    assert_whole(tmp_path / "a.zarr", scene, 14)


def test_a_run_that_tears_goes_on(tmp_path: Path) -> None:
    scene = SCENES["tear"].with_settings({"particles": 8}).build()
    with pytest.raises(KeyboardInterrupt):
        made(scene, tmp_path / "a.zarr", 30, progress=stop_after(28))
    sim = scene.simulation()
    record(sim, tmp_path / "a.zarr", 30, scene.fps, scene=scene, resume=True)
    assert sim.engine.stats.steps < sim.steps
    assert_whole(tmp_path / "a.zarr", scene, 30)


def test_a_longer_run_adds_frames_and_an_unchanged_one_writes_nothing(tmp_path: Path) -> None:
    scene = fountain()
    made(scene, tmp_path / "a.zarr", 20)
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")}
    sim = scene.simulation()
    record(sim, tmp_path / "a.zarr", 20, scene=scene, resume=True)
    assert sim.engine.stats.steps == 0
    made(scene, tmp_path / "a.zarr", 7, resume=True)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")} == before
    turned = scene.changed(camera=pm.Camera(azimuth=90.0), summary="seen from the side")
    assert made(turned, tmp_path / "a.zarr", 20, resume=True).camera.azimuth == 90
    made(scene, tmp_path / "a.zarr", resume=True)
    assert_whole(tmp_path / "a.zarr", scene)


LATER = "0.3 if t > 0.5 else 0.1"


@pytest.mark.parametrize(
    ("old", "new", "kept"),
    [
        (fountain("0.2 if t > 0.5 else 0.1"), fountain(LATER), True),
        (fountain(LATER), fountain("where(t >= 0.45, 0.5, 0.1)"), True),
        (fountain("0.2 if t > 0.5 else 0.1", dtype="float32"), fountain(LATER, dtype="float32"), False),
        (fountain(start=0.5), fountain(start=0.55), True),
        (fountain(start=0.5), fountain(start=0.1), False),
        (fountain(), fountain(k=0.2), False),
        (fountain(), fountain(seed=1), False),
    ],
)
def test_only_what_an_edit_can_affect_is_made_again(tmp_path: Path, old: pm.Scene, new: pm.Scene, kept: bool) -> None:
    made(old, tmp_path / "a.zarr")
    first = Cache.open(tmp_path / "a.zarr").attributes["made_by"]
    found = plan(tmp_path / "a.zarr", new.simulation(), new, new.fps)
    assert (found.kept, found.same) == (17 if kept else 0, False)
    made(new, tmp_path / "a.zarr", resume=True)
    assert_whole(tmp_path / "a.zarr", new)
    cache = Cache.open(tmp_path / "a.zarr")
    assert cache.attributes["made_by"] != first
    assert cache.scene == new
    group = {k: _made_by(tmp_path / "a.zarr", k) for k in (0, 16, 17, FRAMES - 1)}
    assert group == {k: first if k < found.kept else cache.attributes["made_by"] for k in group}


def _made_by(path: Path, k: int) -> str:
    from pointmass.cache.groups import read_attributes

    return str(read_attributes(path / "frames" / f"{k:06d}")["made_by"])


def test_changes_are_told_by_their_place(tmp_path: Path) -> None:
    made(fountain(), tmp_path / "a.zarr", 2)
    new = fountain(k=0.2, seed=3)
    found = plan(tmp_path / "a.zarr", new.simulation(), new, 30.0)
    assert [str(change) for change in found.changes] == [
        "forces.1.k: 0.15 -> 0.2",
        "seed: the default -> 3",
        "fps: 60.0 -> 30.0",
    ]


def test_a_file_that_has_changed_counts(tmp_path: Path) -> None:
    mesh = tmp_path / "m.stl"
    trimesh.creation.box((1, 1, 1)).export(mesh)
    scene = pm.Scene(emitters=[pm.MeshEmitter(mesh=str(mesh), rate=10.0)])
    first = Making.of(scene, scene.simulation(), 60.0)
    trimesh.creation.box((1, 2, 1)).export(mesh)
    second = Making.of(scene, scene.simulation(), 60.0)
    assert first is not None
    assert second is not None
    assert first.hash != second.hash
    assert first.untouched_until(second) == 0
    assert [change.path for change in first.changes(second)] == [(str(mesh),)]


@pytest.mark.parametrize(
    ("old", "new", "time"),
    [
        ("3 if t > 6 else x", "4 if t > 6 else x", 6.0),
        ("3 if t > 6 else x", "3 if 7 < t else x", 6.0),
        ("x if t <= 6 else 1", "x", 6.0),
        ("2*where(t < 5, 1, z) + y", "2*where(t < 5, 1, 9) + y", 5.0),
        ("(1 if t > 2 else 0) + (5 if t > 4 else 0)", "(1 if t > 2 else 0) + (6 if t > 4 else 0)", 4.0),
        ("3 if t > 6 else x", "3 if t > 6 else y", 0.0),
        ("3 if t < 6 else x", "4 if t < 6 else x", 0.0),
        ("sin(t)", "cos(t)", 0.0),
        ("3 if x > 6 else 1", "4 if x > 6 else 1", 0.0),
        ("not a (formula", "3 if t > 6 else x", 0.0),
    ],
)
def test_formulas_are_the_same_until_a_time(old: str, new: str, time: float) -> None:
    assert same_until(old, new) == same_until(new, old) == time


def test_a_law_in_python_cannot_be_known(tmp_path: Path) -> None:
    @pm.unary_force
    def law(x, v, m, t):  # type: ignore[no-untyped-def]
        return -x[0], -x[1], -x[2]

    scene = pm.Scene(bodies=[pm.chain(2)], forces=[law()])
    made(scene, tmp_path / "a.zarr", 3)
    assert not plan(tmp_path / "a.zarr", scene.simulation(), scene, scene.fps).known
    made(scene, tmp_path / "a.zarr", 4, resume=True)
    assert_whole(tmp_path / "a.zarr", scene, 4)


def test_a_second_writer_is_refused_with_the_number_of_the_first(tmp_path: Path) -> None:
    with (
        locked(tmp_path / "a.zarr", "the cache"),
        pytest.raises(InvalidInput, match=f"being written by process {os.getpid()}: wait"),
    ):
        made(fountain(), tmp_path / "a.zarr", 2)
    made(fountain(), tmp_path / "a.zarr", 2)
    assert [p.name for p in tmp_path.iterdir()] == ["a.zarr"]


def test_a_damaged_checkpoint_is_passed_over(tmp_path: Path) -> None:
    scene = fountain()
    cache = made(scene, tmp_path / "a.zarr", 39)
    folders = sorted((cache.path / "checkpoints").glob("[0-9]*"))
    assert [f.name for f in folders] == ["000000064", "000000128"]
    (folders[1] / "particles.x" / "c.0.0").write_bytes(b"junk")
    state = cache.state()
    assert state is not None
    assert state["steps"][0] == 64
    assert cache.state(before=-math.inf) is None
    made(scene, tmp_path / "a.zarr", resume=True)
    assert_whole(tmp_path / "a.zarr", scene)
