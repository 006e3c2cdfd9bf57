"""Surfaces as OBJ, PLY and GLB, read back by trimesh and by VTK."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pointmass as pm
from pointmass.errors import InvalidInput
from pointmass.export import export
from pointmass.frame import Frame

FORMATS = ("obj", "ply", "glb")


def frames_of(count: int = 1, **look: object) -> list[Frame]:
    """A sheet, a solid whose faces have a pattern each, and a floor, which is no body."""
    scene = pm.Scene(
        bodies=[pm.cloth(3, 4, (1.5, 1.0)), pm.jelly((2, 3, 2), (0.1, 0.2, 0.1), center=(2, 0, 0))],
        forces=[pm.Gravity()],
        colliders=[pm.Plane((0, -3, 0))],
        look=pm.Look(groups={"cloth": {"color": "red"}, "jelly": {"color": "#3070b0"}}, **look),
    )
    (frame,) = scene.simulation().frames(1)
    return [replace(frame, number=k, positions=frame.positions + 0.1 * k) for k in range(count)]


def corners_of(frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Places and patterns of all corners, sorted, as the simulation has them."""
    drawn = [d for d in frame.drawables if d.name in ("cloth", "jelly")]
    places = np.concatenate([frame.positions[d.faces].reshape(-1, 3) for d in drawn])
    return places, np.concatenate([d.uv.reshape(-1, 2) for d in drawn])


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Likewise as trimesh reads them."""
    loaded = trimesh.load(path, process=False)
    meshes = [loaded] if path.suffix == ".ply" else [loaded.geometry[name] for name in ("cloth", "jelly")]
    uv = [m.visual.uv for m in meshes]
    places = np.concatenate([m.vertices[m.faces].reshape(-1, 3) for m in meshes])
    return places, np.concatenate([p[m.faces].reshape(-1, 2) for p, m in zip(uv, meshes, strict=True)])


@pytest.mark.parametrize("suffix", FORMATS)
def test_trimesh_reads_places_and_patterns_of_every_corner(tmp_path: Path, suffix: str) -> None:
    (frame,) = frames_of()
    export([frame], tmp_path / f"a.{suffix}")
    (places, uv), (wanted, pattern) = read(tmp_path / f"a.{suffix}"), corners_of(frame)
    np.testing.assert_allclose(places, wanted, atol=1e-7)  # single precision
    np.testing.assert_allclose(uv, pattern, atol=1e-7)
    assert {p.suffix for p in tmp_path.iterdir()} == {f".{suffix}"} | ({".mtl"} if suffix == "obj" else set())


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_vtk_reads_the_same(tmp_path: Path, suffix: str) -> None:
    pyvista = pytest.importorskip("pyvista")
    (frame,) = frames_of()
    export([frame], tmp_path / f"a.{suffix}")
    mesh = pyvista.read(str(tmp_path / f"a.{suffix}"))
    wanted, pattern = corners_of(frame)
    faces = mesh.faces.reshape(-1, 4)[:, 1:]
    np.testing.assert_allclose(mesh.points[faces].reshape(-1, 3), wanted, atol=1e-6)
    named = [a for a in mesh.point_data.values() if a.ndim == 2 and a.shape[1] == 2]  # one for each material, else -1
    np.testing.assert_allclose(np.max(named, axis=0)[faces].reshape(-1, 2), pattern, atol=1e-6)


def test_an_exported_solid_is_closed_and_its_objects_are_named(tmp_path: Path) -> None:
    export(frames_of(), tmp_path / "a.glb")
    parts = trimesh.load(tmp_path / "a.glb").geometry
    assert set(parts) == {"cloth", "jelly"}
    jelly = parts["jelly"].copy()
    jelly.merge_vertices(merge_tex=True)
    assert jelly.is_watertight
    assert jelly.volume == pytest.approx(0.002, rel=1e-5)
    np.testing.assert_allclose(parts["cloth"].visual.material.baseColorFactor, [255, 0, 0, 255])


def test_colours_of_obj_and_ply_are_those_of_the_look(tmp_path: Path) -> None:
    frames = frames_of()
    export(frames, tmp_path / "a.ply")
    stored = trimesh.load(tmp_path / "a.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    colors = [[int(stored[name][k]) for name in ("red", "green", "blue", "alpha")] for k in (0, -1)]
    assert colors == [[255, 0, 0, 255], [0x30, 0x70, 0xB0, 255]]
    export(frames, tmp_path / "a.obj")
    assert "mtllib a.mtl" in (tmp_path / "a.obj").read_text()
    text = (tmp_path / "a.mtl").read_text()
    diffuse = next(line for line in text.splitlines() if line.startswith("Kd")).split()[1:]
    assert [float(part) for part in diffuse] == [1, 0, 0]


def test_a_number_in_the_name_makes_a_file_for_each_frame(tmp_path: Path) -> None:
    frames, seen = frames_of(3), []
    export(frames, tmp_path / "f_%03d.ply", seen.append)
    assert seen == [1, 2, 3]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["f_000.ply", "f_001.ply", "f_002.ply"]
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(read(tmp_path / f"f_{k:03d}.ply")[0], corners_of(frame)[0], atol=1e-6)
    export(frames, tmp_path / "last.ply")
    assert (tmp_path / "last.ply").read_bytes() == (tmp_path / "f_002.ply").read_bytes()


def test_the_mesh_of_a_cloth_is_read_again_with_its_pattern(tmp_path: Path) -> None:
    """What is written can be draped again."""
    scene = pm.Scene(bodies=[pm.cloth(3, 4)])
    export(list(scene.simulation().frames(1)), tmp_path / "a.obj")
    again = pm.cloth_from_mesh(tmp_path / "a.obj")
    assert len(again.particles) == 12
    assert again.particles.surfaces["cloth"].uv.max() == 1


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_frame_without_surfaces_is_a_cloud_of_points(tmp_path: Path, suffix: str) -> None:
    (frame,) = frames_of(surfaces=False)
    export([frame], tmp_path / f"a.{suffix}")
    loaded = trimesh.load(tmp_path / f"a.{suffix}")
    cloud = next(iter(loaded.geometry.values())) if suffix == "glb" else loaded
    np.testing.assert_allclose(cloud.vertices, frame.positions, atol=1e-7)
    with pytest.raises(InvalidInput, match=r"a sequence needs one number, such as x_%04d\."):
        export([frame], tmp_path / f"a_%s.{suffix}")
    assert [p.name for p in tmp_path.iterdir()] == [f"a.{suffix}"]
