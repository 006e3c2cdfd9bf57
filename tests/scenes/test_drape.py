"""The scene drape: what is below its cloth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pointmass as pm
from pointmass.meshes import triangle_mesh
from pointmass.scenes.models import table
from tests.shapes import TETRAHEDRON


def test_a_table_is_closed_and_as_tall_as_it_is_said_to_be() -> None:
    mesh = triangle_mesh(*table(0.8))
    assert mesh.closed
    assert np.ptp(mesh.vertices[:, 1]) == pytest.approx(0.8)
    assert np.ptp(mesh.vertices[:, 0]) == pytest.approx(2 * 0.55 * 0.8, rel=1e-3)


def test_a_mesh_of_a_file_stands_on_the_floor_below_the_cloth(tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / "a.stl"
    trimesh.Trimesh(np.add(TETRAHEDRON[0], (3.0, 1.0, -2.0)), TETRAHEDRON[1]).export(path)
    drape = pm.SCENES["drape"](over=str(path), radius=0.25, particles=8)
    corners = drape.below().triangles.vertices + drape.below().at(0.0)
    assert [corners[:, 1].min(), corners[:, 1].max()] == pytest.approx([0.0, 0.5], abs=1e-12)
    np.testing.assert_allclose((corners.max(axis=0) + corners.min(axis=0))[[0, 2]], 0, atol=1e-12)
    assert drape.body().particles.x[:, 1].min() > 0.5
    scene = drape.build()
    assert pm.Scene.from_toml(scene.to_toml()) == scene


def test_a_flat_mesh_is_refused(tmp_path: Path) -> None:
    (tmp_path / "flat.obj").write_text("v 0 1 0\nv 1 1 0\nv 0 1 1\nf 1 2 3\n")
    with pytest.raises(pm.InvalidInput, match="the mesh is flat, and has no height to scale"):
        pm.SCENES["drape"](over=str(tmp_path / "flat.obj")).build()
    with pytest.raises(pm.InvalidInput, match=r"nowhere\.obj"):
        pm.SCENES["drape"](over=str(tmp_path / "nowhere.obj")).build()
