"""A cache gives back the bits of its frames, to us and to zarr, and never a torn one."""

from __future__ import annotations

import itertools
import math
import shutil
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr

import pointmass as pm
from pointmass.cache import Cache, record
from pointmass.cache.groups import packed, unpacked
from pointmass.errors import Diverged, InvalidInput
from pointmass.frame import Arrows, Camera, Curves, Drawable, Frame, Points, Segments, Triangles
from pointmass.scenes import SCENES
from tests.same import assert_same_bits, assert_same_frame
from tests.small import SMALL

RNG = np.random.default_rng(0)


def some_drawables(k: int, n: int) -> tuple[Drawable, ...]:
    corners = RNG.normal(size=(30, 3)).astype(np.float32)
    pairs, white = np.arange(30, dtype=np.int32).reshape(15, 2), np.ones(4, np.float32)
    return (
        Points(name="particles", version=k, radius=np.float32(0.1), color=RNG.random((n, 4)), glow=True),
        Points(name="a/b ../c_", version=0, vertices=corners, index=np.arange(20), radius=RNG.random(20), color=white),
        Segments(name="..", version=k, vertices=corners, pairs=pairs, width=1 / 3),
        Curves(name="", version=-k, vertices=corners, index=np.arange(30), offsets=np.array([0, 30])),
        Triangles(name="__mesh", version=0, vertices=corners, faces=np.zeros((0, 3), np.int32), smooth=False),
        Arrows(name="field", version=k, vertices=corners, vectors=-corners, color=(1.0, math.inf, 0.0, 1.0)),
    )


def some_frame(k: int, n: int = 20, dtype: Any = np.float64) -> Frame:
    return Frame(
        number=k + 5,
        time=k / 3,
        ids=np.arange(n) + (1 << 40),
        positions=RNG.normal(size=(n, 3)).astype(dtype),
        velocities=np.full((n, 3), np.nan, dtype),
        drawables=some_drawables(k, n),
        quantities={"energy": 0.1 * k, "bad": math.nan, "huge": -math.inf},
    )


def pendulum_cache(path: Path, frames: int = 4) -> Cache:
    scene = SCENES["pendulum"](links=3).build()
    return record(scene.simulation(), path, frames, scene=scene)


# ---------------------------------------------------------------------------------------------------------------- bits


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_frames_come_back_bit_for_bit(tmp_path: Path, dtype: Any) -> None:
    frames = [some_frame(k, n, dtype) for k, n in enumerate((20, 0, 1, 5, 300))]
    statics: dict[tuple[str, int], Drawable] = {}
    cache = Cache.create(tmp_path / "a.zarr", fps=30)
    for frame in frames:
        cache.append(frame)
        for d in frame.drawables:
            statics.setdefault((d.name, d.version), d)
    opened = Cache.open(tmp_path / "a.zarr")
    assert (len(opened), opened.fps) == (5, 30.0)
    for k, (frame, again) in enumerate(zip(frames, opened, strict=True)):
        expected = tuple(statics[d.name, d.version] for d in frame.drawables)  # a version is stored once
        values = {f.name: getattr(frame, f.name) for f in fields(frame)}
        assert_same_frame(Frame(**{**values, "drawables": expected}), again)
        assert_same_frame(again, opened.frame(k))


def test_a_recorded_scene_is_the_scene(tmp_path: Path) -> None:
    scene = SCENES["pendulum"](links=3).build()
    cache = record(scene.simulation(), tmp_path / "p.zarr", 5, 60, scene=scene)
    for live, stored in zip(scene.simulation().frames(5, 60), Cache.open(tmp_path / "p.zarr"), strict=True):
        assert_same_frame(live, stored)
    again = Cache.open(tmp_path / "p.zarr")
    assert again.scene == scene
    assert again.camera == scene.camera
    assert again.attributes == cache.attributes
    about = again.attributes
    assert (about["seed"], about["dt"], about["solver"], about["dtype"]) == (0, scene.dt, "leapfrog", "float64")
    assert set(about["versions"]) >= {"pointmass", "numpy", "numba", "zarr"}
    assert len(about["scene_hash"]) == 64


@pytest.mark.parametrize("name", SCENES)
def test_frames_of_shipped_scenes_are_those_that_were_seen(tmp_path: Path, name: str) -> None:
    scene = SCENES[name].with_settings(SMALL.get(name, {})).build()
    cache = record(scene.simulation(), tmp_path / "s.zarr", 4, 30, scene=scene)
    for live, stored in zip(scene.simulation().frames(4, 30), cache, strict=True):
        assert_same_frame(live, stored)


def test_particles_come_and_go(tmp_path: Path) -> None:
    scene = pm.Scene(emitters=[pm.Nozzle(rate=200.0, lifetime=0.1)], forces=[pm.Gravity()])
    cache = record(scene.simulation(), tmp_path / "n.zarr", 12, scene=scene)
    counts = {len(frame.ids) for frame in cache}
    assert len(counts) > 2
    for live, stored in zip(scene.simulation().frames(12), cache, strict=True):
        assert_same_bits(live.ids, stored.ids)
        assert_same_bits(live.positions, stored.positions)


def test_zarr_alone_reads_it(tmp_path: Path) -> None:
    cache = pendulum_cache(tmp_path / "p.zarr")
    root = zarr.open_group(tmp_path / "p.zarr", mode="r")
    assert root.attrs["format"] == "pointmass cache"
    assert sorted(root["frames"].group_keys()) == [f"{k:06d}" for k in range(4)]
    for k, frame in enumerate(cache):
        group = root[f"frames/{k:06d}"]
        assert group.attrs["time"] == frame.time
        assert group.attrs["quantities"]["energy"] == frame.quantities["energy"]
        for name in ("ids", "positions", "velocities"):
            assert_same_bits(getattr(frame, name), group[name][...])
        assert [tuple(pair) for pair in group.attrs["drawables"]] == [(d.name, d.version) for d in frame.drawables]
    points = next(d for d in cache[0].drawables if d.kind == "points")
    stored = root[f"drawables/{points.name}/{points.version}"]
    assert stored.attrs["kind"] == "points"


def test_a_drawable_that_stays_is_stored_once_and_is_one_object(tmp_path: Path) -> None:
    cache = pendulum_cache(tmp_path / "p.zarr")
    chain = [d for f in cache for d in f.drawables if d.kind == "segments"]
    assert len(list((tmp_path / "p.zarr/drawables").glob("chain*/[0-9]*"))) == 1
    assert chain[0] is chain[1] is chain[3]


@pytest.mark.parametrize(
    "value", [None, True, 3, 0.1, -math.inf, "a", (1.0, (2.0, math.nan)), np.float32(0.1), np.arange(3)]
)
def test_values_of_attributes_come_back(value: Any) -> None:
    again = unpacked(packed(value))
    assert_same_bits(value, again) if not isinstance(value, tuple) else np.testing.assert_equal(again, value)


def test_it_is_a_sequence(tmp_path: Path) -> None:
    cache = pendulum_cache(tmp_path / "p.zarr")
    assert cache[-1].number == 3
    assert [f.number for f in cache[1:3]] == [1, 2]
    with pytest.raises(IndexError):
        _ = cache[4]
    for k in (-1, 4):
        with pytest.raises(InvalidInput, match=f"frame = {k} is not allowed: the cache .* has 4 frames"):
            cache.frame(k)


# ------------------------------------------------------------------------------------------------------ what goes wrong


def test_places_that_are_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    pendulum_cache(tmp_path / "p.zarr")
    sim = SCENES["pendulum"]().build().simulation()
    for path, sentence in (
        ("none/p.zarr", "there is no folder"),
        ("file/p.zarr", "there is no folder"),
        ("file", "something else is there"),
        ("folder", "something else is there"),
        ("p.zarr", "is there already: give another name"),
    ):
        with pytest.raises(InvalidInput, match=sentence):
            record(sim, tmp_path / path, 2)
    with pytest.raises(InvalidInput, match="something else is there"):
        record(sim, tmp_path / "folder", 2, overwrite=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder", "p.zarr"]
    assert (tmp_path / "file").read_text() == "mine"


def test_an_old_cache_stays_until_the_new_run_has_begun(tmp_path: Path) -> None:
    pendulum_cache(tmp_path / "p.zarr", 3)
    flow = pm.Scene(bodies=[pm.points([[1, 0, 0]])], forces=[pm.Flow(("-y", "x", "0"))], solver=pm.Leapfrog())
    with pytest.raises(InvalidInput):
        record(flow.simulation(), tmp_path / "p.zarr", 5, overwrite=True)
    assert len(Cache.open(tmp_path / "p.zarr")) == 3
    record(SCENES["pendulum"]().build().simulation(), tmp_path / "p.zarr", 2, overwrite=True)
    assert len(Cache.open(tmp_path / "p.zarr")) == 2
    assert [p.name for p in tmp_path.iterdir()] == ["p.zarr"]


def test_frames_before_a_divergence_are_kept(tmp_path: Path) -> None:
    springs = pm.Springs([(0, 1)], 1e6, rest=0.5)
    system = pm.ParticleSystem(pm.Particles([[0, 0, 0], [1, 0, 0]]), [springs])
    with pytest.raises(Diverged):
        record(pm.Simulation(system, pm.Euler(), 0.001), tmp_path / "d.zarr", 1000, 1000)
    assert 0 < len(Cache.open(tmp_path / "d.zarr")) < 1000


def test_frames_before_an_interrupt_are_kept(tmp_path: Path) -> None:
    def stop(frames: int) -> None:
        if frames == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(SCENES["pendulum"]().build().simulation(), tmp_path / "i.zarr", 9, progress=stop)
    assert len(Cache.open(tmp_path / "i.zarr")) == 3


@pytest.mark.parametrize(("where", "call", "frames"), [("create", 1, 0), ("append", 1, 1), ("append", 4, 4)])
def test_an_interrupt_at_the_end_of_a_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, call: int, frames: int
) -> None:
    written: Any = getattr(Cache, where)
    calls = itertools.count(1)

    def interrupted(*arguments: Any, **options: Any) -> Any:
        written(*arguments, **options)
        if next(calls) == call:
            raise KeyboardInterrupt

    monkeypatch.setattr(Cache, where, interrupted)
    with pytest.raises(KeyboardInterrupt):
        record(SCENES["pendulum"]().build().simulation(), tmp_path / "i.zarr", 9)
    assert [f.number for f in Cache.open(tmp_path / "i.zarr")] == list(range(frames))


def test_what_a_kill_leaves_behind_is_not_seen(tmp_path: Path) -> None:
    pendulum_cache(tmp_path / "p.zarr", 3)
    shutil.copytree(tmp_path / "p.zarr/frames/000002", tmp_path / "p.zarr/frames/.000003.part")
    (tmp_path / "p.zarr/frames/.000003.part/zarr.json").unlink()
    cache = Cache.open(tmp_path / "p.zarr")
    assert len(cache) == 3
    assert cache[2].number == 2
    cache.append(some_frame(3))
    assert len(Cache.open(tmp_path / "p.zarr")) == 4


@pytest.mark.parametrize(
    ("harm", "sentence"),
    [
        (shutil.rmtree, "there is no such folder"),
        (lambda p: (p / "zarr.json").unlink(), "is not a pointmass cache"),
        (lambda p: (p / "zarr.json").write_text("{"), "is not a pointmass cache"),
        (lambda p: (p / "zarr.json").write_text('{"attributes": {"format": "other"}}'), "is not a pointmass cache"),
        (lambda p: shutil.rmtree(p / "frames"), "is damaged: run the scene again"),
        (lambda p: shutil.rmtree(p / "frames/000001"), "frame 1 is missing"),
        (
            lambda p: (p / "zarr.json").write_text(
                (p / "zarr.json").read_text().replace('"version": 2', '"version": 9')
            ),
            "has version 9",
        ),
    ],
)
def test_folders_that_are_no_cache(tmp_path: Path, harm: Any, sentence: str) -> None:
    pendulum_cache(tmp_path / "p.zarr", 3)
    harm(tmp_path / "p.zarr")
    with pytest.raises(InvalidInput, match=sentence) as caught:
        Cache.open(tmp_path / "p.zarr")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "harm",
    [
        lambda f: (f / "positions/c.0.0").write_bytes((f / "positions/c.0.0").read_bytes()[:-9]),
        lambda f: (f / "positions/c.0.0").write_bytes(b"\x28\xb5\x2f\xfd junk"),
        lambda f: (f / "positions/c.0.0").unlink(),
        lambda f: (f / "positions/zarr.json").write_text("{}"),
        lambda f: (f / "zarr.json").write_text('{"attributes": {"number": 1}}'),
        lambda f: (f / "zarr.json").unlink(),
        lambda f: shutil.rmtree(f / "velocities"),
        lambda f: shutil.rmtree(f.parent.parent / "drawables/particles/1"),
    ],
)
def test_damaged_frames_get_one_sentence(tmp_path: Path, harm: Any) -> None:
    pendulum_cache(tmp_path / "p.zarr", 3)
    harm(tmp_path / "p.zarr/frames/000001")
    cache = Cache.open(tmp_path / "p.zarr")
    with pytest.raises(InvalidInput, match=r"frame 1 of the cache .* cannot be read") as caught:
        cache.frame(1)
    assert "\n" not in str(caught.value)


def test_a_law_in_python_is_recorded_without_its_text(tmp_path: Path) -> None:
    @pm.unary_force
    def lift(x: Any, v: Any, m: Any, t: Any, k: float = 1.0) -> Any:
        return 0.0, k * m, 0.0

    scene = pm.Scene(bodies=[pm.points([[0, 0, 0]])], forces=[lift()], camera=Camera(fov=20.0))
    cache = record(scene.simulation(), tmp_path / "l.zarr", 2, scene=scene)
    assert cache.scene is None
    assert Cache.open(tmp_path / "l.zarr").camera.fov == 20.0
