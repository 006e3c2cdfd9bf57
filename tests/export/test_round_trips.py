"""Every kind of file, read back by another program's reader, for a run in which particles are born and die."""

from __future__ import annotations

import csv
import re
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import pointmass as pm
from pointmass.cache import Cache, record
from pointmass.cli import main
from pointmass.errors import InvalidInput
from pointmass.export import EXPORTERS, About, export
from pointmass.frame import Camera, Curves, Frame, Points, Segments, Triangles
from pointmass.render import write
from pointmass.render.camera import moved

Read = dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]  # ids, positions and velocities by number of the frame


def scene() -> pm.Scene:
    """A fountain over a floor, a sheet, and a chain of sticks."""
    return pm.Scene(
        bodies=[pm.cloth(3, 4, (1.5, 1.0)), pm.chain(3, start=(1, 1, 1))],
        emitters=[pm.Nozzle(rate=400.0, lifetime=pm.Spread(0.08, 0.03))],
        forces=[pm.Gravity()],
        colliders=[pm.Plane((0, -3, 0))],
    )


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    made = list(scene().simulation().frames(12, fps=60))
    counts = [len(frame.ids) for frame in made]
    assert len(set(counts)) > 3
    assert set(made[5].ids) - set(made[11].ids)
    assert set(made[11].ids) - set(made[5].ids)
    return made


def read_npz(path: Path) -> Read:
    with np.load(path) as data:
        counts, parts = data["count"], [data[name] for name in ("ids", "positions", "velocities")]
    return {k: tuple(part[k, :n] for part in parts) for k, n in enumerate(counts)}  # type: ignore[misc]


def read_csv(path: Path) -> Read:
    found: dict[int, list[list[str]]] = {}
    with path.open() as file:
        for number, _, *row in list(csv.reader(file))[1:]:
            found.setdefault(int(number), []).append(row)
    result: Read = {}
    for k, rows in found.items():
        states = np.array([row[1:] for row in rows], float)
        result[k] = np.array([int(row[0]) for row in rows]), states[:, :3], states[:, 3:]
    return result


def read_usd(path: Path) -> Read:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Points(stage.GetPrimAtPath("/World/particles"))
    attributes = (points.GetIdsAttr(), points.GetPointsAttr(), points.GetVelocitiesAttr())
    times = range(int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode()) + 1)
    return {k: tuple(np.array(a.Get(k)) for a in attributes) for k in times}  # type: ignore[misc]


def read_vtk(path: Path) -> Read:
    import pyvista

    reader = pyvista.get_reader(str(path))
    result: Read = {}
    for k in range(reader.number_time_points):
        reader.set_active_time_point(k)
        mesh = reader.read()[0]
        result[k] = np.array(mesh["id"]), np.array(mesh.points), np.array(mesh["velocity"])
    return result


def read_vtkhdf(path: Path) -> Read:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    result: Read = {}
    for k in range(reader.GetNumberOfSteps()):
        reader.SetStep(k)
        reader.Update()
        mesh = reader.GetOutput()
        columns = [
            mesh.GetPointData().GetArray("id"),
            mesh.GetPoints().GetData(),
            mesh.GetPointData().GetArray("velocity"),
        ]
        result[k] = tuple(vtk_to_numpy(column).copy() for column in columns)  # type: ignore[assignment]
    return result


def read_gsd(path: Path) -> Read:
    import gsd.hoomd

    with gsd.hoomd.open(str(path)) as file:
        return {f.configuration.step: (f.log["particles/id"], f.particles.position, f.particles.velocity) for f in file}


def read_ply(path: Path) -> Read:
    import trimesh

    result: Read = {}
    for file in path.parent.glob("*.ply"):
        raw = trimesh.load(file, process=False).metadata["_ply_raw"]["vertex"]["data"]
        ids = raw["id_low"].astype(np.int64) + (raw["id_high"].astype(np.int64) << 32)
        ids, first = np.unique(ids, return_index=True)  # corners with several places on the pattern
        columns = [np.stack([raw[prefix + axis] for axis in "xyz"], axis=1)[first] for prefix in ("", "v")]
        number = re.search(r"\d+", file.name)
        assert number is not None
        result[int(number[0])] = ids, columns[0], columns[1]
    return result


EXACT, SINGLE = 0.0, 1e-6
FORMATS: list[tuple[str, Callable[[Path], Read], float]] = [
    ("a.npz", read_npz, EXACT),
    ("a.csv", read_csv, EXACT),
    ("a_%03d.ply", read_ply, EXACT),
    ("a.pvd", read_vtk, EXACT),
    ("a.vtkhdf", read_vtkhdf, EXACT),
    ("a.usd", read_usd, SINGLE),
    ("a.usda", read_usd, SINGLE),
    ("a.gsd", read_gsd, SINGLE),
]


@pytest.mark.parametrize(("name", "read", "precision"), FORMATS, ids=[name for name, *_ in FORMATS])
def test_ids_places_and_velocities_come_back(
    tmp_path: Path, frames: list[Frame], name: str, read: Callable[[Path], Read], precision: float
) -> None:
    ahead = EXPORTERS[Path(name).suffix].ahead
    export(frames if ahead else iter(frames), tmp_path / name)
    found = read(tmp_path / name)
    assert sorted(found) == [frame.number for frame in frames]
    for frame in frames:
        order = np.argsort(frame.ids) if name.endswith("ply") else slice(None)
        ids, places, velocities = found[frame.number]
        assert ids.tolist() == frame.ids[order].tolist()
        np.testing.assert_allclose(places, frame.positions[order], rtol=precision, atol=precision)
        np.testing.assert_allclose(velocities, frame.velocities[order], rtol=precision, atol=precision)


@pytest.mark.parametrize(("name", "read"), [f[:2] for f in FORMATS], ids=[name for name, *_ in FORMATS])
def test_a_frame_may_be_empty(tmp_path: Path, name: str, read: Callable[[Path], Read]) -> None:
    none = np.zeros((0, 3), np.float32)
    empty = Frame(number=0, time=0.0, ids=np.zeros(0, np.int64), positions=none, velocities=none)
    x = np.arange(6, dtype=np.float32).reshape(2, 3)
    full = Frame(number=1, time=0.1, ids=np.array([3, 1 << 40]), positions=x, velocities=-x)
    export([empty, full], tmp_path / name)
    found = read(tmp_path / name)
    assert len(found.get(0, [[]])[0]) == 0
    assert found[1][0].tolist() == [3, 1 << 40]
    np.testing.assert_array_equal(found[1][1], x)


def test_every_kind_of_all_frames_is_read_back() -> None:
    elsewhere = {".usdc", ".vtp", ".obj", ".glb"}  # as .usd and .pvd; meshes; test_glb.py
    tried = {Path(name).suffix for name, *_ in FORMATS} | elsewhere
    assert tried == set(EXPORTERS)


def test_what_begins_with_all_times_wants_a_sequence_and_passes_on_what_goes_wrong(
    tmp_path: Path, frames: list[Frame]
) -> None:
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOHDF import vtkHDFReader

    with pytest.raises(InvalidInput, match=r"a \.vtkhdf file begins with the times of all its frames: record a cache"):
        export(iter(frames), tmp_path / "a.vtkhdf")

    class Broken(list[Frame]):
        passes = 0

        def __iter__(self) -> Iterator[Frame]:
            self.passes += 1
            yield from self[:2]
            if self.passes > 1:
                raise InvalidInput("frame 2 cannot be read")
            yield self[2]

    with pytest.raises(InvalidInput, match="frame 2 cannot be read"):
        export(Broken(frames[:3]), tmp_path / "a.vtkhdf")
    assert not list(tmp_path.iterdir())
    counts: list[int] = []
    export(frames, tmp_path / "a.vtkhdf", progress=counts.append)
    assert counts == list(range(1, 13))
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert times == pytest.approx([frame.time for frame in frames], rel=1e-6)


def test_the_stage_has_meshes_curves_shapes_and_a_camera(tmp_path: Path, frames: list[Frame]) -> None:
    from pxr import Gf, Usd, UsdGeom

    camera = Camera(position=(0, 1, 5), target=(0, 1, 0), fov=40.0)
    export(frames, tmp_path / "a.usdc", about=About(fps=30, camera=camera))
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    assert (stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (30, 0, 11)
    kinds = {p.GetName(): p.GetTypeName() for p in stage.GetPrimAtPath("/World").GetChildren()}
    assert kinds["particles"] == "Points"
    assert kinds["cloth"] == "Mesh"
    assert {"Camera", "BasisCurves"} <= set(kinds.values())

    cloth, frame = UsdGeom.Mesh(stage.GetPrimAtPath("/World/cloth")), frames[7]
    drawn = next(d for d in frame.drawables if d.name == "cloth")
    corners = np.array(cloth.GetFaceVertexIndicesAttr().Get(7))
    points = np.array(cloth.GetPointsAttr().Get(7))
    np.testing.assert_allclose(points[corners], frame.positions[drawn.faces].reshape(-1, 3), atol=1e-6)
    st = UsdGeom.PrimvarsAPI(cloth).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    np.testing.assert_allclose(np.array(st.Get(7)), drawn.uv.reshape(-1, 2), atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(np.array(cloth.GetNormalsAttr().Get(7)), axis=1), 1, atol=1e-6)
    assert cloth.GetFaceVertexIndicesAttr().GetNumTimeSamples() == 1  # what does not change is written once

    plane = next(d for d in frame.drawables if d.name.startswith("plane"))
    shape = UsdGeom.Mesh(stage.GetPrimAtPath("/World/" + plane.name.replace(" ", "_")))
    assert shape.GetPointsAttr().GetNumTimeSamples() == 1
    assert len(shape.GetPointsAttr().Get(7)) == len(plane.vertices)
    seen = UsdGeom.Camera(stage.GetPrimAtPath("/World/camera")).GetCamera(0)
    assert seen.transform.ExtractTranslation() == Gf.Vec3d(0, 1, 5)
    assert seen.GetFieldOfView(seen.FOVVertical) == pytest.approx(40, rel=1e-5)


def still(number: int, level: float, *drawables: Any) -> Frame:
    x = np.full((3, 3), level)
    return Frame(number=number, time=number / 60, ids=np.arange(3), positions=x, velocities=0 * x, drawables=drawables)


def test_what_stands_still_in_a_stage_jumps_when_it_moves_and_hides_when_it_is_gone(tmp_path: Path) -> None:
    from pxr import Usd, UsdGeom

    strand = Curves(name="strand", index=np.array([0, 1, 2]), offsets=np.array([0, 3]), width=0.01)
    export(
        [still(0, 0.0), still(1, 0.0, strand), still(2, 0.0, strand), still(3, 1.0)],
        tmp_path / "a.usd",
    )
    stage = Usd.Stage.Open(str(tmp_path / "a.usd"))
    points = UsdGeom.Points(stage.GetPrimAtPath("/World/particles")).GetPointsAttr()
    assert points.GetTimeSamples() == [0, 2, 3]
    assert points.Get(1.9)[0][0] == 0
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/World/strand"))
    seen = [curves.GetVisibilityAttr().Get(k) for k in range(4)]
    assert seen == ["invisible", "inherited", "inherited", "invisible"]
    assert list(curves.GetCurveVertexCountsAttr().Get(1)) == [3]
    assert curves.GetTypeAttr().Get() == "linear"


def test_vtk_and_gsd_have_lines_faces_and_looks(tmp_path: Path, frames: list[Frame]) -> None:
    import gsd.hoomd
    import pyvista

    frame = frames[-1]
    sticks = sum(len(d.pairs) for d in frame.drawables if isinstance(d, Segments))
    cloth = next(d for d in frame.drawables if isinstance(d, Triangles) and d.vertices is None)
    assert sticks
    export(frames, tmp_path / "a.vtp")
    mesh = pyvista.read(tmp_path / "a.vtp")
    assert (mesh.n_verts, mesh.n_lines, mesh.n_faces) == (len(frame.ids), sticks, len(cloth.faces))
    assert mesh.field_data["TimeValue"] == [frame.time]
    drawn = next(d for d in frame.drawables if isinstance(d, Points))
    rows = slice(None) if drawn.index is None else drawn.index
    np.testing.assert_allclose(mesh["radius"][rows], drawn.radius)
    export(frames, tmp_path / "a.gsd")
    with gsd.hoomd.open(str(tmp_path / "a.gsd")) as file:
        last = file[-1]
    assert sticks == last.bonds.N
    np.testing.assert_allclose(last.particles.diameter, 2 * mesh["radius"])
    assert (np.abs(last.particles.position) <= last.configuration.box[0] / 2).all()


@pytest.mark.parametrize("name", ["a.mp4", "a.webm", "a.gif", "a_%02d.png"])
def test_a_film_has_its_frames(tmp_path: Path, frames: list[Frame], name: str) -> None:
    import av

    write(frames[:5], tmp_path / name, fps=25, size=(64, 48))
    if name.endswith("png"):
        assert len(list(tmp_path.glob("*.png"))) == 5
        return
    with av.open(str(tmp_path / name)) as film:
        shapes = [picture.to_ndarray(format="rgb24").shape for picture in film.decode(video=0)]
    assert shapes == [(48, 64, 3)] * 5


@pytest.mark.parametrize("suffix", ["npz", "csv", "gsd", "pvd", "usd", "glb"])  # of USD only what Python sees
def test_frames_are_let_go(tmp_path: Path, suffix: str) -> None:
    """A run of 24 frames takes no more memory than one of 4, beyond two arrays."""
    n = 2_000 if suffix == "csv" else 10_000
    size = n * 3 * 8

    def run(count: int) -> Iterator[Frame]:
        for k in range(count):
            x = np.full((n, 3), float(k))
            yield Frame(number=k, time=k / 60, ids=np.arange(n), positions=x, velocities=x.copy())

    def peak(count: int) -> int:
        tracemalloc.start()
        export(run(count), tmp_path / f"{count}.{suffix}")
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    assert peak(24) < peak(4) + 2 * size


def test_a_run_is_exported_while_it_runs(tmp_path: Path) -> None:
    export(scene().simulation().frames(4), tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as data:
        assert len(data["count"]) == 4


def test_a_camera_that_moves_moves_in_a_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pxr import Usd, UsdGeom

    turning = Camera(position=(0, 0, 5), target=(0, 0, 0), orbit=90.0)
    still = scene().changed(camera=replace(turning, orbit=0.0))
    for name, each in (("turning", scene().changed(camera=turning)), ("still", still)):
        record(each.simulation(), tmp_path / f"{name}.zarr", 4, 4.0, scene=each)
        monkeypatch.chdir(tmp_path)
        assert CliRunner().invoke(main, ["export", f"{name}.zarr", f"{name}.usd", "--quiet"]).exit_code == 0
        stage = Usd.Stage.Open(f"{name}.usd")
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/camera"))
        places = [camera.ComputeLocalToWorldTransform(k).ExtractTranslation() for k in range(4)]
        wanted = [moved(each.camera, frame).position for frame in Cache.open(f"{name}.zarr")]
        np.testing.assert_allclose(places, wanted, atol=1e-12)
