"""Clouds of particles, read from the files that exporters and other programs write."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array, reading, whole_number
from pointmass.foreign import last_time, open_stage, poly_data, shown_prims, shown_scene, to_world
from pointmass.libraries import check_library

Columns = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Cloud:
    """Particles of a file, as they were at one moment.

    Attributes
    ----------
    x, v : positions [m] and velocities [m/s], shape (n, 3); velocities that the file does not know are 0.
    radius : [m], shape (n,), 0 where the file does not know it.
    ids : that they had, shape (n,); None where the file has none.
    """

    x: NDArray[np.float64]
    v: NDArray[np.float64]
    radius: NDArray[np.float64]
    ids: NDArray[np.int64] | None = None


def read_cloud(path: str | Path, frame: int | None = None) -> Cloud:
    """Read the particles of a file: all its points, or else the vertices of its meshes.

    Parameters
    ----------
    path : `.npz`, `.csv`, `.gsd`, `.usd`, `.usdc`, `.usda` (of many frames), `.ply`, `.vtp`, `.obj` or `.glb` (of one),
        as `pointmass export` writes them. Lengths are taken as [m]; of other programs' files at least positions are
        found.
    frame : number of a frame in a file that has several, counted from 0; the last one by default.

    Raises
    ------
    InvalidInput
        No such file or frame, a file of another kind or damaged, a library that is not installed, a position that is
        not finite.
    """
    with reading("particle", path, tuple(READERS)) as file:
        suffix = file.suffix.lower()
        check_library("reading", suffix)
        found = READERS[suffix](file, None if frame is None else whole_number("frame", frame, at_least=0))
        x = finite_array("positions", np.reshape(found["x"], (-1, 3)), (None, 3))
        v, radius, ids = (found.get(name) for name in ("v", "radius", "ids"))
        return Cloud(
            x,
            np.zeros_like(x) if v is None else finite_array("velocities", v, x.shape),
            np.zeros(len(x)) if radius is None else finite_array("radii", radius, (len(x),)),
            None if ids is None else np.array(ids, np.int64).reshape(len(x)),
        )


def _at(frame: int | None, count: int) -> int:
    """Which of the frames of a file is meant."""
    number = count - 1 if frame is None else frame
    if not 0 <= number < count:
        raise InvalidInput(f"frame = {number} is not allowed: it has {count}, counted from 0")
    return number


def _npz(file: Path, frame: int | None) -> Columns:
    with np.load(file, allow_pickle=False) as data:
        k = _at(frame, len(data["count"]))
        rows = slice(int(data["count"][k]))
        names = {"x": "positions", "v": "velocities", "ids": "ids"}
        return {name: data[column][k, rows] for name, column in names.items() if column in data}


def _csv(file: Path, frame: int | None) -> Columns:
    last = 0  # number of a frame; one without particles has no row
    kept: list[dict[str, str]] = []
    with file.open(newline="", encoding="utf-8") as lines:
        for row in csv.DictReader(lines):
            number = int(row.get("frame") or 0)
            if number != last and frame is None:
                kept.clear()
            last = number
            if frame in (None, number):
                kept.append(row)
    _at(frame, last + 1)
    found: Columns = {"x": [[float(row[name]) for name in ("x", "y", "z")] for row in kept]}
    if kept and "vx" in kept[0]:
        found["v"] = [[float(row[name]) for name in ("vx", "vy", "vz")] for row in kept]
    if kept and "id" in kept[0]:
        found["ids"] = [int(row["id"]) for row in kept]
    return found


def _ply(file: Path, frame: int | None) -> Columns:
    from trimesh.exchange.ply import load_ply

    with file.open("rb") as stream:
        columns = load_ply(stream)["metadata"]["_ply_raw"]["vertex"]["data"]
    known = columns.dtype.names if isinstance(columns, np.ndarray) else columns  # of text it is a table

    def column(name: str) -> NDArray[Any]:
        return np.asarray(columns[name]).ravel()

    found: Columns = {"x": np.stack([column(name) for name in "xyz"], axis=1)}
    if "vx" in known:
        found["v"] = np.stack([column(name) for name in ("vx", "vy", "vz")], axis=1)
    if "radius" in known:
        found["radius"] = column("radius")
    if "id_low" in known:
        ids = column("id_low").astype(np.int64) + (column("id_high").astype(np.int64) << 32)
        _, first = np.unique(ids, return_index=True)  # one that is on a pattern at several places is there as often
        return {name: values[np.sort(first)] for name, values in {**found, "ids": ids}.items()}
    return found


def _obj(file: Path, frame: int | None) -> Columns:
    with file.open(encoding="utf-8") as lines:
        places = [[float(word) for word in line.split()[1:4]] for line in lines if line.startswith("v ")]
    return {"x": np.array(places).reshape(-1, 3)}


def _glb(file: Path, frame: int | None) -> Columns:
    import trimesh

    scene = shown_scene(file)
    parts = [
        trimesh.transform_points(scene.geometry[name].vertices, scene.graph[node][0]) for node, name in _nodes(scene)
    ]
    return {"x": np.concatenate([np.zeros((0, 3)), *parts])}


def _nodes(scene: Any) -> list[tuple[str, str]]:
    """Nodes of a scene that have points, and the names of what they have: of clouds, or else of meshes."""
    import trimesh

    nodes = [(node, scene.graph[node][1]) for node in scene.graph.nodes_geometry]
    clouds = [pair for pair in nodes if isinstance(scene.geometry[pair[1]], trimesh.PointCloud)]
    return clouds or nodes


def _vtp(file: Path, frame: int | None) -> Columns:
    from vtkmodules.util import numpy_support

    array_of: Any = numpy_support.vtk_to_numpy
    mesh = poly_data(file)
    columns = {"v": "velocity", "radius": "radius", "ids": "id"}
    arrays = {name: mesh.GetPointData().GetArray(column) for name, column in columns.items()}
    found = {name: array_of(array) for name, array in arrays.items() if array is not None}
    return {"x": array_of(mesh.GetPoints().GetData()), **found}


def _gsd(file: Path, frame: int | None) -> Columns:
    import gsd.hoomd

    with gsd.hoomd.open(str(file), "r") as run:
        one = run[_at(frame, len(run))]
        found: Columns = {"x": one.particles.position, "v": one.particles.velocity}
        return {**found, "radius": one.particles.diameter / 2, "ids": one.log.get("particles/id")}


def _usd(file: Path, frame: int | None) -> Columns:
    from pxr import Usd, UsdGeom

    stage = open_stage(file)
    time = last_time(stage)
    if stage.HasAuthoredTimeCodeRange():
        first, last = int(stage.GetStartTimeCode()), int(stage.GetEndTimeCode())
        time = Usd.TimeCode(first + _at(frame, last - first + 1))
    parts = [_usd_points(prim, time, *to_world(stage, prim, time)) for prim in shown_prims(stage, UsdGeom.Points, time)]
    if not parts:
        raise InvalidInput("it holds no points")
    common = set.intersection(*(set(part) for part in parts))
    return {name: np.concatenate([part[name] for part in parts]) for name in common}


def _usd_points(prim: Any, time: Any, turn: NDArray[np.float64], shift: NDArray[np.float64]) -> Columns:
    """The points of a prim where it stands in the world."""
    x = np.array(prim.GetPointsAttr().Get(time), np.float64).reshape(-1, 3)
    found: Columns = {"x": x @ turn + shift}
    velocities, widths, ids = (a.Get(time) for a in (prim.GetVelocitiesAttr(), prim.GetWidthsAttr(), prim.GetIdsAttr()))
    if velocities is not None and len(velocities) == len(x):
        found["v"] = np.array(velocities, np.float64) @ turn
    if widths is not None and len(widths) == len(x):
        found["radius"] = np.cbrt(abs(np.linalg.det(turn))) * np.array(widths, np.float64) / 2
    if ids is not None and len(ids) == len(x):
        found["ids"] = np.array(ids)
    return found


READERS: dict[str, Callable[[Path, int | None], Columns]] = {
    ".npz": _npz,
    ".csv": _csv,
    ".ply": _ply,
    ".obj": _obj,
    ".glb": _glb,
    ".vtp": _vtp,
    ".gsd": _gsd,
    ".usd": _usd,
    ".usda": _usd,
    ".usdc": _usd,
}
