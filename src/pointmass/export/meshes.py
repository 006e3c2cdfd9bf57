"""One frame as a mesh for other programs: OBJ by trimesh, and the parts of which PLY makes one and GLB several."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.export.exporter import About
from pointmass.export.particles import color_bytes, radii_and_colors, surfaces
from pointmass.frame import Frame, Triangles

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Part:
    """One surface; corners with several places on the pattern are several vertices.

    Attributes
    ----------
    name : of the surface.
    rows : of the particle at each vertex, shape (n,).
    vertices : [m], shape (n, 3).
    faces : shape (k, 3), counter-clockwise seen from outside.
    uv : place of each vertex on the pattern, shape (n, 2), or None.
    color : linear RGBA of each vertex, shape (n, 4).
    """

    name: str
    rows: NDArray[np.int64]
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    color: NDArray[np.float64]


def parts(frame: Frame) -> list[Part]:
    """The surfaces between the particles of a frame."""
    return [_part(surface, frame) for surface in surfaces(frame)]


def _part(surface: Triangles, frame: Frame) -> Part:
    uv = None if surface.uv is None else np.asarray(surface.uv, np.float64)
    rows, faces, places = _vertices(np.asarray(surface.faces, np.int64).tobytes(), None if uv is None else uv.tobytes())
    color = np.asarray(surface.color, np.float64)
    return Part(
        surface.name,
        rows,
        frame.positions[rows].astype(np.float64),
        faces,
        places,
        np.tile(color, (len(rows), 1)) if color.ndim == 1 else color[rows],
    )


@lru_cache(maxsize=4)  # the same ones in frame after frame; to find them takes longer than to write one
def _vertices(faces: bytes, uv: bytes | None) -> tuple[Array, Array, Array | None]:
    """One vertex for corners of the same particle at the same place on the pattern.

    Returns
    -------
    particle of each vertex, shape (n,); the faces in these, shape (k, 3); places on the pattern, shape (n, 2).
    """
    corners = np.frombuffer(faces, np.int64)
    places = None if uv is None else np.frombuffer(uv, np.float64).reshape(-1, 2)
    keys = corners[:, None] if places is None else np.column_stack([corners, places])
    _, first, found = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return corners[first], found.reshape(-1, 3).astype(np.int64), None if places is None else places[first]


def _library() -> Any:
    import trimesh  # on first use: it takes a while

    return trimesh


def _mesh(part: Part, visual: Any) -> Any:
    mesh = _library().Trimesh(part.vertices, part.faces, visual=visual, process=False)
    mesh.metadata["name"] = part.name
    return mesh


def write_obj(frames: Iterable[Frame], path: Path, about: About) -> None:
    """The surfaces of a frame, each an object with places on the pattern as `vt`; without any, its particles as points.

    Lengths are in metres, and y is up. Colours are in a `.mtl` beside it, those of points behind their coordinates.
    """
    for frame in frames:
        found = parts(frame)
        text, files = _obj(found, path) if found else (_obj_points(frame), {})
        path.write_text(text, encoding="utf-8")
        for name, content in files.items():
            path.with_name(name).write_bytes(content)


def _obj(surfaces: list[Part], path: Path) -> tuple[str, dict[str, bytes]]:
    trimesh = _library()
    scene = trimesh.Scene()
    patterned = any(part.uv is not None for part in surfaces)  # all or none: `vt` are counted as `v` are
    for part in surfaces:
        uv = np.zeros((len(part.vertices), 2)) if patterned and part.uv is None else part.uv
        diffuse = color_bytes(part.color.mean(axis=0))
        material = trimesh.visual.material.SimpleMaterial(diffuse=diffuse, name=part.name)
        scene.add_geometry(_mesh(part, trimesh.visual.TextureVisuals(uv=uv, material=material)), part.name)
    text, files = trimesh.exchange.obj.export_obj(
        scene, return_texture=True, mtl_name=f"{path.stem}.mtl", header="pointmass", digits=9
    )
    return text, files


def _obj_points(frame: Frame) -> str:
    colors = color_bytes(radii_and_colors(frame)[1])[:, :3] / 255
    lines = [
        f"v {x!r} {y!r} {z!r} {r:.4f} {g:.4f} {b:.4f}"
        for (x, y, z), (r, g, b) in zip(frame.positions.tolist(), colors.tolist(), strict=True)
    ]
    points = [f"p {k + 1}" for k in range(len(lines))]
    return "\n".join(["# pointmass", *lines, *points, ""])
