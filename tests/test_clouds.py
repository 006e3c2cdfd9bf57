"""Particles come back from the files that are exported, and from those of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pointmass as pm
from pointmass.clouds import READERS, read_cloud
from pointmass.errors import InvalidInput
from pointmass.export import About, export
from pointmass.frame import Frame

SINGLE = (".usd", ".usda", ".usdc", ".gsd", ".glb", ".obj")  # positions in single precision, or in nine digits
SERIES = (".npz", ".csv", ".usd", ".usda", ".usdc", ".gsd")
BARE = (".obj", ".glb")  # positions only


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    scene = pm.Scene(
        emitters=[pm.Nozzle(rate=300.0, lifetime=pm.Spread(0.05, 0.02), radius=0.01)], forces=[pm.Gravity()]
    )
    return list(scene.simulation().frames(8))


@pytest.mark.parametrize("suffix", READERS)
def test_particles_come_back(tmp_path: Path, frames: list[Frame], suffix: str) -> None:
    export(frames, tmp_path / f"a{suffix}", about=About(fps=60.0))
    for k in (None, 3) if suffix in SERIES else (None,):
        frame = frames[-1 if k is None else k]
        cloud = read_cloud(tmp_path / f"a{suffix}", k)
        order = np.arange(len(frame.ids))
        if cloud.ids is not None:
            order = np.argsort(frame.ids)[np.argsort(np.argsort(cloud.ids))]
            assert (cloud.ids == frame.ids[order]).all()
        np.testing.assert_allclose(cloud.x, frame.positions[order], rtol=1e-6 if suffix in SINGLE else 0)
        if suffix not in BARE:
            np.testing.assert_allclose(cloud.v, frame.velocities[order], rtol=1e-6, atol=1e-6 * (suffix in SINGLE))
            assert cloud.ids is not None
    if suffix in SERIES:
        with pytest.raises(InvalidInput, match="frame = 8 is not allowed: it has 8, counted from 0"):
            read_cloud(tmp_path / f"a{suffix}", 8)


def test_a_particle_of_a_pattern_comes_once(tmp_path: Path) -> None:
    scene = pm.Scene(bodies=[pm.cloth(3, 4), pm.chain(3)])
    frame = next(iter(scene.simulation().frames(1)))
    export([frame], tmp_path / "a.ply")
    assert sorted(read_cloud(tmp_path / "a.ply").ids) == frame.ids.tolist()


def test_files_of_others(tmp_path: Path) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 1.5\n1 2 3\n")
    (tmp_path / "a.csv").write_text("x,y,z\n0,0,1.5\n1,2,3\n")
    (tmp_path / "a.obj").write_text("v 0 0 1.5\nv 1 2 3\nvn 0 0 1\nf 1 2 1\n")
    for suffix in (".ply", ".csv", ".obj"):
        cloud = read_cloud(tmp_path / f"a{suffix}")
        assert cloud.x.tolist() == [[0, 0, 1.5], [1, 2, 3]]
        assert not cloud.v.any()
        assert cloud.ids is None


def test_a_stage_in_centimetres_and_moved(tmp_path: Path) -> None:
    from pxr import Gf, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    parent = UsdGeom.Xform.Define(stage, "/a")
    parent.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    UsdGeom.Points.Define(stage, "/a/b").GetPointsAttr().Set([(0, 200, 0)])
    stage.Save()
    assert read_cloud(tmp_path / "a.usda").x.tolist() == [[1, 2, 0]]


def test_a_stage_with_z_up_and_without_a_range_of_times(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 2.0)
    points = UsdGeom.Points.Define(stage, "/a")
    points.GetPointsAttr().Set([(1, 2, 3)], 7.0)
    points.GetVelocitiesAttr().Set([(0, 0, 1)], 7.0)
    points.GetWidthsAttr().Set([0.5], 7.0)
    stage.Save()
    cloud = read_cloud(tmp_path / "a.usda")
    assert (cloud.x.tolist(), cloud.v.tolist()) == ([[2, 6, -4]], [[0, 2, 0]])
    assert cloud.radius == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.npz", b"PK", "damaged"),
        ("a.csv", b"x,y\n1,2\n", "damaged"),
        ("a.csv", b"x,y,z\n1,nan,2\n", "positions must be finite"),
        ("a.usda", b"#usda 1.0\n", "it holds no points"),
        ("a.usd", b"junk", "damaged"),
        ("a.vtp", b"junk", "damaged"),
        ("a.gsd", b"junk", "damaged"),
        ("a.ply", b"ply\n", "damaged"),
        ("a.xyz", b"", "must end in"),
    ],
)
def test_what_is_refused(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput, match=says) as caught:
        read_cloud(tmp_path / name)
    assert "\n" not in str(caught.value)
    with pytest.raises(InvalidInput, match=r"does not exist|must end in"):
        read_cloud(tmp_path / f"none{name}")


def test_a_scene_begins_with_the_particles_of_a_file(tmp_path: Path, frames: list[Frame]) -> None:
    export(frames, tmp_path / "a.npz")
    (tmp_path / "a.toml").write_text(
        '[[bodies]]\ntype = "cloud"\nfile = "a.npz"\nframe = 5\nradius = 0.01\nscale = 2.0\n'
    )
    scene = pm.Scene.load(tmp_path / "a.toml")
    particles = scene.bodies[0].particles
    np.testing.assert_array_equal(particles.x, 2 * frames[5].positions)
    np.testing.assert_array_equal(particles.v, 2 * frames[5].velocities)
    assert (particles.radius == 0.01).all()
    scene.save(tmp_path / "b.toml")
    assert 'file = "a.npz"' in (tmp_path / "b.toml").read_text()
    assert pm.Scene.load(tmp_path / "b.toml") == scene


def test_no_code_runs_from_arrays(tmp_path: Path) -> None:
    value: Any = np.array([print], dtype=object)
    np.savez(tmp_path / "a.npz", count=np.array([1]), positions=value)
    with pytest.raises(InvalidInput, match="damaged"):
        read_cloud(tmp_path / "a.npz")
