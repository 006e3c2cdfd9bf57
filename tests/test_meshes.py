"""Triangle meshes from files and arrays: what is read, what is cleaned, what is refused."""

import time
from base64 import b64encode

import numpy as np
import pytest
import pyvista
import trimesh
from pxr import Gf, Sdf, Usd, UsdGeom
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

import pointmass as pm
from pointmass.export import export
from pointmass.meshes import READERS, as_mesh, read_mesh, triangle_mesh

BALL = trimesh.creation.icosphere(2)
BLOCK = trimesh.creation.box((1, 2, 3))


def written(path, mesh):
    """A file by trimesh itself, by PyVista, or by Pixar's library."""
    if path.suffix == ".gltf":
        for name, content in trimesh.exchange.gltf.export_gltf(mesh.scene()).items():
            (path.parent / name).write_bytes(content)
        return path.parent / "model.gltf"
    if path.suffix == ".vtp":
        pyvista.wrap(mesh).save(path)
    elif path.suffix.startswith(".usd"):
        staged(path, mesh.vertices, np.full(len(mesh.faces), 3), mesh.faces.ravel())
    else:
        mesh.export(path)
    return path


def staged(path, vertices, counts, corners):
    """A stage with one mesh; returns the stage and the mesh."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    mesh = UsdGeom.Mesh.Define(stage, "/a/mesh")
    mesh.GetPointsAttr().Set(np.asarray(vertices, np.float32))
    mesh.GetFaceVertexCountsAttr().Set(np.asarray(counts, np.int32))
    mesh.GetFaceVertexIndicesAttr().Set(np.asarray(corners, np.int32))
    stage.Save()
    return stage, mesh


@pytest.mark.parametrize("ending", READERS)
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


@pytest.mark.parametrize("ending", READERS)
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


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0.5, 0]]


def test_polygons_of_vtk_are_cut_and_keep_their_pattern(tmp_path):
    mesh = pyvista.PolyData(SQUARE, faces=[4, 0, 1, 2, 3, 3, 1, 4, 2], lines=[2, 0, 1], verts=[1, 0])
    mesh.active_texture_coordinates = np.array(SQUARE)[:, :2] / 2
    for binary in (True, False):
        mesh.save(tmp_path / "a.vtp", binary=binary)
        found = read_mesh(tmp_path / "a.vtp")
        assert (len(found.faces), found.areas.sum()) == (3, pytest.approx(1.5))
        np.testing.assert_allclose(found.uv, found.corners[..., :2] / 2)


@pytest.mark.parametrize(("interpolation", "count"), [("faceVarying", 7), ("vertex", 5), ("varying", 5)])
def test_polygons_of_a_stage_are_cut_and_keep_their_pattern(interpolation, count, tmp_path):
    corners = [0, 1, 2, 3, 1, 4, 2]
    stage, mesh = staged(tmp_path / "a.usda", SQUARE, [4, 3], corners)
    places = np.array(SQUARE)[:, :2] / 2
    uv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("UVMap", Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    uv.Set((places[corners] if count == 7 else places).astype(np.float32))
    stage.Save()
    found = read_mesh(tmp_path / "a.usda")
    assert (len(found.faces), found.areas.sum()) == (3, pytest.approx(1.5))
    np.testing.assert_allclose(found.uv, found.corners[..., :2] / 2)
    assert found.normals[:, 2] == pytest.approx(1)
    mesh.GetOrientationAttr().Set("leftHanded")
    stage.Save()
    assert read_mesh(tmp_path / "a.usda").normals[:, 2] == pytest.approx(-1)


def test_a_stage_says_where_its_meshes_are_and_which_are_seen(tmp_path):
    stage, mesh = staged(tmp_path / "a.usdc", [[0, 0, 0], [100, 0, 0], [0, 0, 100]], [3], [0, 1, 2])
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.XformCommonAPI(mesh).SetTranslate(Gf.Vec3d(0, 0, 100))
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(2)
    mesh.GetPointsAttr().Set(np.array([[0, 0, 0], [100, 0, 0], [0, 0, 300]], np.float32), 2)
    for name, hide in (("hidden", lambda m: m.MakeInvisible()), ("guide", lambda m: m.GetPurposeAttr().Set("guide"))):
        other = UsdGeom.Mesh.Define(stage, f"/b/{name}")
        other.GetPointsAttr().Set([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
        other.GetFaceVertexCountsAttr().Set([3])
        other.GetFaceVertexIndicesAttr().Set([0, 1, 2])
        hide(other)
    stage.Save()
    found = read_mesh(tmp_path / "a.usdc")
    assert sorted(map(tuple, found.vertices.tolist())) == [(0, 1, 0), (0, 4, 0), (1, 1, 0)]  # y is up, in metres


def test_a_stage_refers_to_nothing_outside_of_its_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    for folder in (tmp_path, inside):
        stage, _ = staged(folder / "b.usda", SQUARE, [4], [0, 1, 2, 3])
        stage.SetDefaultPrim(stage.GetPrimAtPath("/a"))
        stage.Save()
    stage = Usd.Stage.CreateNew(str(inside / "a.usda"))
    stage.DefinePrim("/c").GetReferences().AddReference("./b.usda")
    stage.Save()
    (tmp_path / "link.usda").symlink_to(inside / "b.usda")
    for file in (inside / "a.usda", tmp_path / "link.usda"):
        assert len(read_mesh(file).faces) == 2
    for kind in ("reference", "payload", "layer"):
        name = f"{kind}.usda"
        stage = Usd.Stage.CreateNew(str(inside / name))
        prim = stage.DefinePrim("/c")
        if kind == "reference":
            prim.GetReferences().AddReference("../b.usda")
        elif kind == "payload":
            prim.GetPayloads().AddPayload("../b.usda")
        else:
            stage.GetRootLayer().subLayerPaths.append("../b.usda")
        stage.Save()
        with pytest.raises(pm.InvalidInput, match=r"it names '.*, which is outside of its folder: put it there"):
            read_mesh(inside / name)


@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
@pytest.mark.parametrize("packed", ["None", "ZLib", "LZ4", "LZMA"])
@pytest.mark.parametrize("order", ["LittleEndian", "BigEndian"])
@pytest.mark.parametrize("wide", ["UInt32", "UInt64"])
@pytest.mark.parametrize("encoded", [True, False])
def test_every_way_in_which_vtk_writes_is_read(mode, packed, order, wide, encoded, tmp_path):
    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(tmp_path / "a.vtp"))
    writer.SetInputData(pyvista.wrap(BALL))
    for setting in (f"DataModeTo{mode}", f"CompressorTypeTo{packed}", f"ByteOrderTo{order}", f"HeaderTypeTo{wide}"):
        getattr(writer, f"Set{setting}")()
    writer.SetEncodeAppendedData(encoded)
    assert writer.Write()
    assert read_mesh(tmp_path / "a.vtp").volume == pytest.approx(BALL.volume, rel=1e-6)


@pytest.mark.parametrize("header", [(2**31, 32768, 0), (1, 2**31, 0), (0, 32768, 8), (1, 8, 9)])
@pytest.mark.parametrize("encoded", [True, False])
def test_arrays_of_vtk_that_cannot_be_so_long_are_refused_at_once(header, encoded, tmp_path):
    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(tmp_path / "a.vtp"))
    writer.SetInputData(pyvista.wrap(BALL))
    writer.SetEncodeAppendedData(encoded)
    assert writer.Write()
    data = (tmp_path / "a.vtp").read_bytes()
    start = data.find(b"_", data.find(b"<AppendedData")) + 1
    new = np.array(header, "<u4").tobytes()
    new = b64encode(new) if encoded else new
    (tmp_path / "a.vtp").write_bytes(data[:start] + new + data[start + len(new) :])
    began = time.perf_counter()
    with pytest.raises(pm.InvalidInput, match="it says that it holds more than its length allows"):
        read_mesh(tmp_path / "a.vtp")
    assert time.perf_counter() - began < 1


@pytest.mark.parametrize("binary", [True, False])
def test_polygons_of_vtk_with_corners_that_are_not_there_are_refused(binary, tmp_path):
    pyvista.PolyData(SQUARE, faces=[3, 0, 1, 99]).save(tmp_path / "a.vtp", binary=binary)
    with pytest.raises(pm.InvalidInput, match=r"face 0 of a mesh has the vertices \[0, 1, 99\]"):
        read_mesh(tmp_path / "a.vtp")


@pytest.mark.parametrize(
    ("counts", "corners", "message"),
    [
        ([3], [0, 1, 99], r"face 0 of a mesh has the vertices \[0, 1, 99\]"),
        ([4], [0, 1, 2], "its polygons have other corners than it says"),
        ([-3, 6], [0, 1, 2], "its polygons have other corners than it says"),
        ([2], [0, 1], "holds no triangles"),
    ],
)
def test_polygons_of_a_stage_with_corners_that_are_not_there_are_refused(counts, corners, message, tmp_path):
    staged(tmp_path / "a.usda", SQUARE, counts, corners)
    with pytest.raises(pm.InvalidInput, match=message):
        read_mesh(tmp_path / "a.usda")


@pytest.mark.parametrize("ending", [".obj", ".ply", ".glb", ".vtp", ".usd", ".usda", ".usdc"])
def test_what_is_exported_comes_back(ending, tmp_path):
    scene = pm.Scene(bodies=[pm.cloth(4, 5, (1.5, 1.0)), pm.chain(3)], forces=[pm.Gravity()])
    frames = list(scene.simulation().frames(4))
    export(frames, tmp_path / f"a{ending}")
    found = read_mesh(tmp_path / f"a{ending}")
    (surface,) = (d for d in frames[-1].drawables if d.name == "cloth")

    def rows(*columns):
        """Triangles in the order of their numbers."""
        whole = np.concatenate(columns, axis=2).reshape(-1, 3 * sum(c.shape[2] for c in columns)).round(5) + 0.0
        return whole[np.lexsort(whole.T)]

    corners = frames[-1].positions[surface.faces]
    np.testing.assert_allclose(rows(found.corners), rows(corners), atol=2e-5)
    assert (found.uv is None) == (ending == ".vtp")  # whose particles are not several vertices on a pattern
    if found.uv is not None:
        np.testing.assert_allclose(rows(found.corners, found.uv), rows(corners, surface.uv), atol=2e-5)
    assert len(pm.cloth_from_mesh(str(tmp_path / f"a{ending}")).particles) == 20
