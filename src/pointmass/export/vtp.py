"""Frames as VTK's PolyData: one file for each, and a list of them that ParaView plays."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from pointmass.export.exporter import About
from pointmass.export.particles import radii_and_colors, sticks, surfaces
from pointmass.frame import Curves, Frame, Triangles


def write_vtp(frames: Iterable[Frame], path: Path, about: About) -> None:
    """The particles of a frame as points, with the lines and triangles between them.

    Point data: `id`, `velocity` [m/s], `radius` [m] (0 where it is not drawn as a ball), `rgba` (linear light); field
    data: `TimeValue` [s]. Lengths are in metres, in the precision of the run, and y is up.
    """
    for frame in frames:
        _save(particles(frame), path)


def write_pvd(frames: Iterable[Frame], path: Path, about: About) -> None:
    """A list of frames by their times, each a `.vtp` file beside it: `x.pvd` has `x_000000.vtp` and so on.

    Meshes with vertices of their own, such as colliders, are in files of their own, written once for each version.
    """
    entries: list[tuple[float, int, str]] = []
    written: dict[tuple[str, int], str] = {}
    for frame in frames:
        name = f"{path.stem}_{frame.number:06d}.vtp"
        _save(particles(frame), path.with_name(name))
        entries.append((frame.time, 0, name))
        shapes = [d for d in frame.drawables if isinstance(d, Triangles) and d.vertices is not None]
        for part, shape in enumerate(shapes, 1):
            key = shape.name, shape.version
            if key not in written:
                written[key] = f"{path.stem}_shape_{len(written):06d}.vtp"
                _save(_shape(shape), path.with_name(written[key]))
            entries.append((frame.time, part, written[key]))
    lines = [f'<DataSet timestep="{t!r}" part="{part}" file={quoteattr(name)}/>' for t, part, name in entries]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n<Collection>'
    path.write_text("\n".join([head, *lines, "</Collection>\n</VTKFile>\n"]), encoding="utf-8")


def particles(frame: Frame) -> Any:
    """The particles of a frame as PolyData, with the lines and triangles between them, as `write_vtp` says."""
    n = len(frame.ids)
    radii, colors = radii_and_colors(frame)
    mesh = _mesh(frame.positions)
    mesh.SetVerts(_cells(np.arange(n), np.ones(n, np.int64)))
    pairs, curves = sticks(frame), [d for d in frame.drawables if isinstance(d, Curves) and d.vertices is None]
    counts = [np.full(len(pairs), 2), *(np.diff(d.offsets) for d in curves)]
    mesh.SetLines(_cells(np.concatenate([pairs.ravel(), *(d.index for d in curves)]), np.concatenate(counts)))
    faces = np.concatenate([np.zeros((0, 3), np.int64), *(np.asarray(s.faces, np.int64) for s in surfaces(frame))])
    mesh.SetPolys(_cells(faces.ravel(), np.full(len(faces), 3)))
    for name, values in (("id", frame.ids), ("velocity", frame.velocities), ("radius", radii), ("rgba", colors)):
        mesh.GetPointData().AddArray(_array(values, name))
    mesh.GetFieldData().AddArray(_array(np.array([frame.time]), "TimeValue"))
    return mesh


def _shape(shape: Triangles) -> Any:
    assert shape.vertices is not None
    mesh = _mesh(shape.vertices)
    faces = np.asarray(shape.faces)
    mesh.SetPolys(_cells(faces.ravel(), np.full(len(faces), 3)))
    color = np.broadcast_to(np.asarray(shape.color, np.float32), (len(shape.vertices), 4))
    mesh.GetPointData().AddArray(_array(color, "rgba"))
    return mesh


def _mesh(places: NDArray[Any]) -> Any:
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    points = vtkPoints()
    points.SetData(_array(places.reshape(-1, 3), "points"))
    mesh = vtkPolyData()
    mesh.SetPoints(points)
    return mesh


def _cells(corners: NDArray[Any], counts: NDArray[Any]) -> Any:
    """Cells by the rows of their corners, one after another, and the number of corners of each."""
    from vtkmodules.vtkCommonDataModel import vtkCellArray

    cells = vtkCellArray()
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(counts, dtype=np.int64)])
    cells.SetData(_array(offsets, "offsets"), _array(corners.astype(np.int64), "corners"))
    return cells


def _array(values: NDArray[Any], name: str) -> Any:
    from vtkmodules.util import numpy_support

    convert: Any = numpy_support.numpy_to_vtk
    array = convert(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    return array


def _save(mesh: Any, path: Path) -> None:
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    writer = vtkXMLPolyDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(mesh)
    if not writer.Write():
        raise OSError(writer.GetErrorCode(), "VTK could not write it")
