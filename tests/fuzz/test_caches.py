"""Caches that are damaged or of others: one clear sentence or the right frames, never another number."""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.cache import Cache, record
from pointmass.cache.groups import METADATA, read_group, write_group
from pointmass.export import export
from pointmass.frame import Frame
from pointmass.render import image
from tests.fuzz.mutations import FULL, QUICK, damages, refused_or_right
from tests.same import assert_same_frame


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Cache:
    """Three frames with all that there can be: births, a cloth, a floor, trails, a net of springs."""
    scene = pm.Scene(
        bodies=[pm.cloth(4, 4), pm.chain(3)],
        emitters=[pm.Nozzle(rate=400.0, lifetime=0.1)],
        forces=[pm.Gravity()],
        colliders=[pm.Sphere((0, -1, 0), 0.5)],
        look=pm.Look(trails=0.1),
        fps=20.0,
    )
    path = tmp_path_factory.mktemp("fuzz") / "a.zarr"
    return record(scene.simulation(), path, 3, 20.0, scene=scene)


@pytest.fixture(scope="module")
def frames(cache: Cache) -> list[Frame]:
    return list(cache)


@pytest.fixture(scope="module")
def files(cache: Cache) -> dict[Path, bytes]:
    found = sorted(file for file in cache.path.rglob("*") if file.is_file() and "checkpoints" not in file.parts)
    return {file: file.read_bytes() for file in found}


def assert_clear_or_right(path: Path, frames: list[Frame]) -> None:
    with refused_or_right():
        opened = Cache.open(path)
        assert len(opened) == len(frames)
        _ = opened.fps, opened.camera
        for k, frame in enumerate(frames):
            with refused_or_right():
                assert_same_frame(opened.frame(k), frame)


def damaged_file(data: Any, files: dict[Path, bytes], frames: list[Frame], path: Path) -> None:
    file = data.draw(st.sampled_from(list(files)))
    new = data.draw(st.one_of(damages(files[file]), st.sampled_from(list(files.values()))))
    try:
        file.write_bytes(new)
        if new != files[file] and file.parent.name != "drawables":
            assert_clear_or_right(path, frames)
    finally:
        file.write_bytes(files[file])


@QUICK
@given(data=st.data())
def test_a_damaged_file(data: Any, cache: Cache, files: dict[Path, bytes], frames: list[Frame]) -> None:
    damaged_file(data, files, frames, cache.path)


@pytest.mark.full
@FULL
@given(data=st.data())
def test_ten_thousand_damaged_files(data: Any, cache: Cache, files: dict[Path, bytes], frames: list[Frame]) -> None:
    damaged_file(data, files, frames, cache.path)


VALUES = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just("../../x"), st.just(10**400)
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=5), inner, max_size=3)),
    max_leaves=5,
)
ARRAYS = st.one_of(
    st.integers(0, 40).map(lambda n: np.arange(n) - 3),
    st.integers(0, 40).map(lambda n: np.full((n, 3), np.nan)),
    st.integers(0, 20).map(lambda n: np.arange(6 * n, dtype=np.uint32).reshape(n, 3, 2)),
    st.just(np.float64(1.0)[None][0:0]),
    st.just(np.ones((2, 2), bool)),
)


def a_group_of_others(data: Any, cache: Cache, files: dict[Path, bytes], folder: Path) -> None:
    """A group whose checksums are right and whose contents are not what they should be."""
    groups = [file.parent for file in files if file.name == METADATA and file.parent.name.isdecimal()]
    group = data.draw(st.sampled_from(groups))
    attributes, arrays = read_group(group)
    for name in data.draw(st.lists(st.sampled_from([*attributes, *arrays, "new"]), min_size=1, max_size=3)):
        if data.draw(st.booleans()):
            arrays.pop(name, None)
            attributes[name] = data.draw(VALUES)
        elif name != "new":
            attributes.pop(name, None)
            arrays[name] = data.draw(ARRAYS)
    shutil.rmtree(group)
    try:
        with suppress(ValueError):  # NaN has no place in JSON
            write_group(group, attributes, arrays)
        with refused_or_right():
            opened = Cache.open(cache.path)
            for k in range(len(opened)):
                with refused_or_right():
                    use(opened.frame(k), folder)
    finally:
        shutil.rmtree(group, ignore_errors=True)
        for file, content in files.items():
            if group in file.parents:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)


def use(frame: Frame, folder: Path) -> None:
    image(frame, size=(24, 16))
    for name in ("x.npz", "x.csv", "x.ply", "x.obj", "x.gsd", "x.vtp"):
        export([frame], folder / name)


@settings(QUICK, max_examples=20)
@given(data=st.data())
def test_a_group_of_others(
    data: Any, cache: Cache, files: dict[Path, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    a_group_of_others(data, cache, files, tmp_path_factory.getbasetemp())


@pytest.mark.full
@settings(QUICK, max_examples=2_000)
@given(data=st.data())
def test_two_thousand_groups_of_others(
    data: Any, cache: Cache, files: dict[Path, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    a_group_of_others(data, cache, files, tmp_path_factory.getbasetemp())


def test_zarr_alone_notices_a_flipped_bit_too(cache: Cache, tmp_path: Path) -> None:
    shutil.copytree(cache.path, tmp_path / "a.zarr")
    chunk = tmp_path / "a.zarr/frames/000001/positions/c.0.0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 4
    chunk.write_bytes(data)
    metadata = json.loads((chunk.parent / METADATA).read_text())
    assert metadata["codecs"][1]["configuration"]["checksum"] is True
    with pytest.raises(RuntimeError):
        zarr.open_group(tmp_path / "a.zarr", mode="r")["frames/000001/positions"][:]
