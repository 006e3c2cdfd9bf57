"""glTF that moves: what VTK's reader plays is what the frames are."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import pointmass as pm
from pointmass.clouds import read_cloud
from pointmass.errors import InvalidInput
from pointmass.export import About, export, glb
from pointmass.export.meshes import parts
from pointmass.export.particles import lonely, radii_and_colors
from pointmass.frame import Frame, Triangles
from pointmass.meshes import read_mesh


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    """A sheet, a chain and a fountain, whose drops come and go."""
    scene = pm.Scene(
        bodies=[pm.cloth(3, 4, (1.5, 1.0)), pm.chain(3, start=(1, 1, 1))],
        emitters=[pm.Nozzle(rate=400.0, lifetime=pm.Spread(0.08, 0.03))],
        forces=[pm.Gravity()],
    )
    return list(scene.simulation().frames(12, fps=60))


class Player:
    """VTK's reader."""

    def __init__(self, path: Path) -> None:
        from vtkmodules.vtkIOGeometry import vtkGLTFReader

        self._reader = vtkGLTFReader()
        self._reader.SetFileName(str(path))
        self._reader.SetApplyDeformationsToGeometry(True)
        self._reader.SetFrameRate(60)
        self._reader.UpdateInformation()
        self.animations = self._reader.GetNumberOfAnimations()
        if self.animations:
            self._reader.EnableAnimation(0)
            self._reader.UpdateInformation()

    def at(self, time: float) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Corners of the triangles of each surface, shape (k, 3, 3), and places of points that are seen then."""
        from vtkmodules.util.numpy_support import vtk_to_numpy

        self._reader.UpdateTimeStep(time)
        surfaces, points = [], []
        for mesh in self._leaves(self._reader.GetOutput()):
            x = vtk_to_numpy(mesh.GetPoints().GetData()).astype(float)
            if not x.any():  # its scale is 0
                continue
            if mesh.GetNumberOfPolys():
                corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
                surfaces.append(x[corners])
            else:
                points.append(x)
        return surfaces, points

    def _leaves(self, block: Any) -> Iterator[Any]:
        for k in range(block.GetNumberOfBlocks()):
            if (part := block.GetBlock(k)) is not None:
                yield from self._leaves(part) if part.IsA("vtkMultiBlockDataSet") else [part]


def check(path: Path, frames: list[Frame]) -> None:
    """That the file shows each frame at its time."""
    player = Player(path)
    for frame in frames:
        surfaces, points = player.at(frame.time - frames[0].time)
        wanted = [part.vertices[part.faces] for part in parts(frame)]
        assert len(surfaces) == len(wanted)
        for corners in wanted:
            assert any(s.shape == corners.shape and np.allclose(s, corners, rtol=0, atol=1e-6) for s in surfaces)
        alone = frame.positions[lonely(frame)]
        assert len(points) == (len(alone) > 0)
        if len(alone):
            np.testing.assert_allclose(points[0], alone, rtol=0, atol=1e-6)


def contents(path: Path) -> dict[str, Any]:
    """The list of what is in a file."""
    data = path.read_bytes()
    assert (data[:4], *struct.unpack("<II", data[4:12])) == (b"glTF", 2, len(data))
    length, kind = struct.unpack("<I4s", data[12:20])
    assert (kind, length % 4) == (b"JSON", 0)
    found: dict[str, Any] = json.loads(data[20 : 20 + length])
    return found


def test_every_frame_is_played(tmp_path: Path, frames: list[Frame]) -> None:
    export(iter(frames), tmp_path / "a.glb", about=About(name="fountain"))
    check(tmp_path / "a.glb", frames)
    document = contents(tmp_path / "a.glb")
    assert [a["name"] for a in document["animations"]] == ["fountain"]
    cloth = next(mesh for mesh in document["meshes"] if mesh["name"] == "cloth")["primitives"][0]
    assert [set(target) for target in cloth["targets"]] == [{"POSITION", "NORMAL"}] * 11
    assert len(document["meshes"]) == 13  # the drops of each frame are others


def test_times_begin_with_the_first_frame_and_places_between_two_are_on_the_way(
    tmp_path: Path, frames: list[Frame]
) -> None:
    export(frames[4:], tmp_path / "a.glb")
    check(tmp_path / "a.glb", frames[4:])
    a, b = (parts(frame)[0] for frame in frames[4:6])
    ((corners,), _) = Player(tmp_path / "a.glb").at(0.25 / 60)
    np.testing.assert_allclose(corners, (0.75 * a.vertices + 0.25 * b.vertices)[a.faces], rtol=0, atol=1e-6)


def test_long_runs_are_several_meshes_that_join(
    tmp_path: Path, frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glb, "LONGEST", 4)
    export(frames, tmp_path / "a.glb")
    check(tmp_path / "a.glb", frames)
    names = [m["name"] for m in contents(tmp_path / "a.glb")["meshes"] if m["name"].startswith("cloth")]
    assert names == ["cloth", "cloth 4", "cloth 8"]
    player = Player(tmp_path / "a.glb")
    for k in range(11):
        a, b = (parts(frame)[0] for frame in frames[k : k + 2])
        ((corners,), _) = player.at((k + 0.5) / 60)
        np.testing.assert_allclose(corners, (0.5 * a.vertices + 0.5 * b.vertices)[a.faces], rtol=0, atol=1e-6)


def test_a_surface_may_change_come_and_go(tmp_path: Path) -> None:
    x = np.random.default_rng(1).normal(size=(6, 5, 3))
    one, two = np.array([[0, 1, 2]]), np.array([[0, 1, 2], [1, 2, 3]])
    made = [[one, two], [one, two], [two, two], [one], [], [two]]
    frames = [
        Frame(
            number=k,
            time=1 + k / 60,
            ids=np.arange(5),
            positions=x[k],
            velocities=0 * x[k],
            drawables=tuple(Triangles(name="torn", faces=faces) for faces in made[k]),  # two of one name
        )
        for k in range(6)
    ]
    export(frames, tmp_path / "a.glb")
    check(tmp_path / "a.glb", frames)


def test_who_does_not_play_it_sees_the_last_frame(tmp_path: Path, frames: list[Frame]) -> None:
    export(frames, tmp_path / "a.glb")
    last = frames[-1]
    found = trimesh.load_scene(tmp_path / "a.glb", process=False)
    np.testing.assert_allclose(found.geometry["cloth"].vertices, parts(last)[0].vertices, atol=1e-6)
    np.testing.assert_allclose(read_cloud(tmp_path / "a.glb").x, last.positions[lonely(last)], atol=1e-6)
    mesh = read_mesh(tmp_path / "a.glb")
    assert (len(mesh.vertices), len(mesh.faces)) == (12, 12)
    assert mesh.uv is not None


def test_a_picture_has_no_animation(tmp_path: Path, frames: list[Frame]) -> None:
    export([frames[3]], tmp_path / "a.glb")
    assert "animations" not in contents(tmp_path / "a.glb")
    check(tmp_path / "a.glb", [frames[3]])


def test_colours_are_linear_light(tmp_path: Path) -> None:
    scene = pm.Scene(bodies=[pm.points([[0, 0, 0]])], look=pm.Look(color="#8090a0"))
    (frame,) = scene.simulation().frames(1)
    export([frame], tmp_path / "a.glb")
    (cloud,) = trimesh.load_scene(tmp_path / "a.glb").geometry.values()
    np.testing.assert_allclose(cloud.colors[0] / 255, radii_and_colors(frame)[1][0], atol=0.5 / 255)


def test_frames_may_be_empty(tmp_path: Path, frames: list[Frame]) -> None:
    none = np.zeros((0, 3))
    empty = Frame(number=0, time=0.0, ids=np.zeros(0, np.int64), positions=none, velocities=none)
    export([empty, replace(empty, number=1, time=0.5)], tmp_path / "a.glb")
    assert contents(tmp_path / "a.glb")["scenes"] == [{"name": "a"}]
    later = [empty, *(replace(frame, time=frame.time + 1) for frame in frames[:2])]
    export(later, tmp_path / "a.glb")
    check(tmp_path / "a.glb", later)


def test_what_is_too_large_is_refused(tmp_path: Path, frames: list[Frame], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glb, "LARGEST", 5_000)
    with pytest.raises(InvalidInput, match=r"a \.glb file holds at most 4 GiB.*\.usd"):
        export(frames, tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())
