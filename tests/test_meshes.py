"""Triangle meshes from files and arrays: what is read, what is cleaned, what is refused."""

import numpy as np
import pytest
import trimesh

import pointmass as pm
from pointmass.meshes import FORMATS, as_mesh, read_mesh, triangle_mesh

BALL = trimesh.creation.icosphere(2)
BLOCK = trimesh.creation.box((1, 2, 3))


def written(path, mesh):
    """A file by trimesh itself."""
    if path.suffix == ".gltf":
        for name, content in trimesh.exchange.gltf.export_gltf(mesh.scene()).items():
            (path.parent / name).write_bytes(content)
        return path.parent / "model.gltf"
    mesh.export(path)
    return path


@pytest.mark.parametrize("ending", FORMATS)
def test_what_another_library_writes_is_read(ending, tmp_path):
    found = read_mesh(written(tmp_path / f"ball{ending}", BALL))
    assert (len(found.vertices), len(found.faces)) == (len(BALL.vertices), len(BALL.faces))
    assert found.closed
    assert found.volume == pytest.approx(BALL.volume, rel=1e-6)
    assert found.areas.sum() == pytest.approx(BALL.area, rel=1e-6)
    apart = np.linalg.norm(found.vertices[:, None] - BALL.vertices, axis=2).min(axis=1)
    assert apart.max() < 1e-6


def test_all_parts_of_a_file_are_read_together(tmp_path):
    scene = trimesh.Scene([BALL, BALL.copy().apply_translation([3, 0, 0])])
    scene.export(tmp_path / "two.glb")
    found = read_mesh(tmp_path / "two.glb")
    assert found.closed
    assert found.volume == pytest.approx(2 * BALL.volume, rel=1e-6)


def test_larger_polygons_are_cut(tmp_path):
    (tmp_path / "square.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    found = read_mesh(tmp_path / "square.obj")
    assert len(found.faces) == 2
    assert found.areas.sum() == pytest.approx(1)
    assert not found.closed
    assert found.open_edges == 4


def test_vertices_at_one_place_become_one_and_flat_triangles_none():
    soup = BALL.triangles.reshape(-1, 3) + 1e-12 * np.random.default_rng(1).normal(size=(3 * len(BALL.faces), 3))
    faces = np.arange(len(soup)).reshape(-1, 3)
    flat = [[0, 0, 1], [0, 1, 1], [5, 5, 5]]
    found = triangle_mesh(soup, np.concatenate([faces, flat]))
    assert (len(found.vertices), len(found.faces)) == (len(BALL.vertices), len(BALL.faces))
    assert found.closed


@pytest.mark.parametrize("turned", [slice(None), slice(None, None, 3), slice(0, 1), slice(0, 0)])
def test_closed_meshes_face_outwards(turned):
    faces = np.array(BLOCK.faces)
    faces[turned] = faces[turned, ::-1]
    found = triangle_mesh(BLOCK.vertices, faces)
    assert found.closed
    assert found.volume == pytest.approx(6)
    assert ((found.normals * found.corners.mean(axis=1)).sum(axis=1) > 0).all()


def test_a_surface_with_one_side_stays_as_it_is():
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-0.3, 0.3, 2), indexing="ij")
    x = np.stack([(1 + v * np.cos(u / 2)) * np.cos(u), (1 + v * np.cos(u / 2)) * np.sin(u), v * np.sin(u / 2)], -1)
    number = np.arange(48).reshape(24, 2)
    ahead = np.concatenate([number[1:], number[:1, ::-1]])  # half a turn
    a, b, c, d = number[:, 0], number[:, 1], ahead[:, 1], ahead[:, 0]
    band = triangle_mesh(x.reshape(-1, 3), np.concatenate([np.stack([a, d, c], 1), np.stack([a, c, b], 1)]))
    assert band.open_edges == 48
    assert not band.closed


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        ([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "vertices of a mesh must be finite"),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], r"must have shape \(n, 3\)"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], r"\[0, 1, 3\]: they are numbered 0 to 2"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "they are numbered 0 to 2"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 0.5]], "whole numbers"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1]], "whole numbers of shape"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, np.nan]], "whole numbers"),
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], "at least one triangle whose area is not 0"),
        (np.zeros((0, 3)), np.zeros((0, 3)), "at least one triangle"),
    ],
)
def test_what_is_no_mesh_is_refused(vertices, faces, message):
    with pytest.raises(pm.InvalidInput, match=message):
        triangle_mesh(vertices, faces)


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("damage", ["cut", "noise", "empty", "text"])
def test_damaged_files_are_refused(ending, damage, tmp_path):
    whole = written(tmp_path / f"ball{ending}", BALL).read_bytes()
    noise = np.random.default_rng(1).bytes(400)
    content = {"cut": whole[: len(whole) // 2], "noise": noise, "empty": b"", "text": b"no mesh at all\n" * 20}
    bad = tmp_path / f"bad{ending}"
    bad.write_bytes(content[damage])
    with pytest.raises(pm.InvalidInput, match=rf"mesh file '.*bad{ending}': it (is damaged|holds no triangles)"):
        read_mesh(bad)


def test_files_that_are_not_there_or_of_another_kind(tmp_path):
    with pytest.raises(pm.InvalidInput, match="does not exist"):
        read_mesh(tmp_path / "none.obj")
    with pytest.raises(pm.InvalidInput, match=r"must end in \.obj, .*not in '\.txt'"):
        read_mesh(tmp_path / "none.txt")
    (tmp_path / "points.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        "0 0 0\n"
    )
    with pytest.raises(pm.InvalidInput, match="holds no triangles"):
        read_mesh(tmp_path / "points.ply")
    (tmp_path / "nan.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(pm.InvalidInput, match=r"nan\.obj': vertices of a mesh must be finite"):
        read_mesh(tmp_path / "nan.obj")
    with pytest.raises(pm.InvalidInput, match="the path of a file or a pair"):
        as_mesh(3)
