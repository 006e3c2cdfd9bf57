"""Meshes that are damaged or hostile: one clear sentence, or a mesh; and no file reads one outside of its folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pointmass as pm
from pointmass.cli.memory import limited
from pointmass.errors import InvalidInput
from pointmass.export import export
from pointmass.libraries import NEEDED
from pointmass.meshes import READERS, TriangleMesh, read_mesh
from tests.fuzz.mutations import QUICK, damages, refused_or_right


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("meshes")
    made = {}
    cloth = next(iter(pm.Scene(bodies=[pm.cloth(4, 4)]).simulation().frames(1)))
    for suffix in READERS:
        box = trimesh.creation.icosphere(1)
        if suffix == ".gltf":
            files = trimesh.Scene(box).export(file_type="gltf")
            data = next(content for name, content in files.items() if name.endswith(".bin"))
            import base64

            document = json.loads(files["model.gltf"])
            document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
            made[suffix] = json.dumps(document).encode()
        elif suffix in NEEDED:
            export([cloth], folder / f"a{suffix}")
            made[suffix] = (folder / f"a{suffix}").read_bytes()
        else:
            box.export(folder / f"a{suffix}")
            made[suffix] = (folder / f"a{suffix}").read_bytes()
    pyvista.wrap(trimesh.creation.box()).save(folder / "ascii.vtp", binary=False)
    made["ascii.vtp"] = (folder / "ascii.vtp").read_bytes()
    made["ascii.ply"] = trimesh.exchange.ply.export_ply(trimesh.creation.box(), encoding="ascii")
    made["ascii.stl"] = trimesh.exchange.stl.export_stl_ascii(trimesh.creation.box()).encode()
    return made


@pytest.mark.parametrize("examples", [pytest.param(300), pytest.param(10_000, marks=pytest.mark.full)])
def test_damaged_meshes(examples: int, meshes: dict[str, bytes], tmp_path: Path) -> None:
    @settings(QUICK, max_examples=examples)
    @given(data=st.data())
    def damaged(data: Any) -> None:
        kind = data.draw(st.sampled_from(list(meshes)))
        file = tmp_path / f"a.{kind.rpartition('.')[2]}"
        file.write_bytes(data.draw(st.one_of(damages(meshes[kind]), st.sampled_from(list(meshes.values())))))
        with limited(), refused_or_right():
            mesh = read_mesh(file)
            assert isinstance(mesh, TriangleMesh)
            assert np.isfinite(mesh.vertices).all()
            assert mesh.faces.max() < len(mesh.vertices)

    damaged()


@pytest.mark.parametrize("name", ["../secret.bin", "{outside}/secret.bin", "sub/../../secret.bin"])
def test_no_mesh_reads_a_file_outside_of_its_folder(tmp_path: Path, name: str) -> None:
    inside = tmp_path / "inside"
    (inside / "sub").mkdir(parents=True)
    files = trimesh.Scene(trimesh.creation.box()).export(file_type="gltf")
    document = json.loads(files["model.gltf"])
    content = files[document["buffers"][0]["uri"]]
    (tmp_path / "secret.bin").write_bytes(content)
    (inside / "sub" / "near.bin").write_bytes(content)
    document["buffers"][0]["uri"] = "sub/near.bin"
    (inside / "a.gltf").write_text(json.dumps(document))
    if len(document["buffers"]) == 1:
        assert len(read_mesh(inside / "a.gltf").faces) == 12
    document["buffers"][0]["uri"] = name.format(outside=tmp_path)
    (inside / "a.gltf").write_text(json.dumps(document))
    with pytest.raises(InvalidInput, match="outside of its folder"):
        read_mesh(inside / "a.gltf")


def test_an_obj_without_its_materials_is_still_a_mesh(tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    text = trimesh.creation.box().export(file_type="obj")
    (inside / "a.obj").write_text("mtllib ../../../../etc/passwd\nusemtl x\n" + text)
    assert len(read_mesh(inside / "a.obj").faces) == 12
