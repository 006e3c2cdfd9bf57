"""One frame as a binary PLY file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.export.exporter import About
from pointmass.export.meshes import parts
from pointmass.export.particles import color_bytes, lonely, radii_and_colors
from pointmass.frame import Frame

KINDS = {"f4": "float", "f8": "double", "u4": "uint", "u1": "uchar"}
FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_ply(frames: Iterable[Frame], path: Path, about: About) -> None:
    """The particles of a frame as vertices, and its surfaces as faces between them.

    A vertex has `x`, `y`, `z` [m], `vx`, `vy`, `vz` [m/s], `radius` [m] (0 where it is not drawn as a ball), `red`,
    `green`, `blue`, `alpha`, `id_low` and `id_high`: id = id_low + 2^32 id_high, since PLY knows no longer numbers; and
    `s` and `t`, the place on the pattern of a surface. A particle that is at several places of a pattern, or on several
    surfaces, is several vertices with the same id. Coordinates are in the precision of the run, and y is up.
    """
    for frame in frames:
        vertices, faces = _vertices(frame)
        names = [f"property {KINDS[vertices.dtype[name].str[1:]]} {name}" for name in vertices.dtype.names or ()]
        header = ["ply", "format binary_little_endian 1.0", "comment pointmass", f"element vertex {len(vertices)}"]
        header += [*names, f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
        path.write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())


def _vertices(frame: Frame) -> tuple[NDArray[Any], NDArray[Any]]:
    """Vertices and faces as they stand in the file."""
    found, loose = parts(frame), lonely(frame)
    rows = np.concatenate([*(part.rows for part in found), loose])
    radii, colors = radii_and_colors(frame)
    light = np.concatenate([*(part.color for part in found), colors[loose]])
    places = [np.zeros((len(part.rows), 2)) if part.uv is None else part.uv for part in found]
    real = frame.positions.dtype.str
    columns: dict[str, tuple[str, NDArray[Any]]] = {
        **{name: (real, frame.positions[rows, k]) for k, name in enumerate("xyz")},
        **{f"v{name}": (real, frame.velocities[rows, k]) for k, name in enumerate("xyz")},
        "radius": ("<f4", radii[rows]),
        **dict(zip(("red", "green", "blue", "alpha"), (("u1", c) for c in color_bytes(light).T), strict=True)),
        "id_low": ("<u4", frame.ids[rows].astype(np.uint64) & 0xFFFFFFFF),
        "id_high": ("<u4", frame.ids[rows].astype(np.uint64) >> np.uint64(32)),
    }
    if any(part.uv is not None for part in found):
        uv = np.concatenate([*places, np.zeros((len(loose), 2))])
        columns |= {"s": ("<f4", uv[:, 0]), "t": ("<f4", uv[:, 1])}
    vertices = np.zeros(len(rows), [(name, kind) for name, (kind, _) in columns.items()])
    for name, (_, values) in columns.items():
        vertices[name] = values
    starts = np.cumsum([0, *(len(part.rows) for part in found)])
    corners = [part.faces + start for part, start in zip(found, starts, strict=False)]
    faces = np.zeros(sum(len(part.faces) for part in found), FACE)
    faces["count"] = 3
    faces["corners"] = np.concatenate([np.zeros((0, 3), np.int64), *corners])
    return vertices, faces
