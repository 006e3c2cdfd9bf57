"""The surfaces of a frame as meshes for other programs: OBJ, PLY and GLB."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import srgb
from pointmass.errors import InvalidInput
from pointmass.frame import Frame, Triangles
from pointmass.sequences import is_sequence

Writer = Callable[["list[Part]", Path], None]


@dataclass(frozen=True, eq=False)
class Part:
    """One surface; corners with several places on the pattern are several vertices.

    Attributes
    ----------
    name : of the surface.
    vertices : [m], shape (n, 3).
    faces : shape (k, 3), counter-clockwise seen from outside.
    uv : place of each vertex on the pattern, shape (n, 2), or None.
    color : linear RGBA of each vertex, shape (n, 4).
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None
    color: NDArray[np.float64]


def write_meshes(frames: Sequence[Frame], path: Path, progress: Callable[[int], None] | None = None) -> None:
    """The surfaces of bodies, such as cloth: of the last frame, or of each frame for a name such as `x_%04d.obj`.

    Places on the pattern are kept as texture coordinates (`vt` in OBJ, `s` and `t` in PLY, TEXCOORD_0 in GLB), lengths
    are in metres, and y is up. OBJ and GLB hold an object for each surface, PLY all of them as one. OBJ has its colours
    in a `.mtl` beside it.

    Parameters
    ----------
    frames : read one at a time.
    path : is written over.
    progress : called with the number of frames written so far.

    Raises
    ------
    InvalidInput
        A frame has no surface.
    """
    write = WRITERS[path.suffix.lower()]
    if not is_sequence(path):
        frames = [frames[len(frames) - 1]]
    for k, frame in enumerate(frames):
        write(parts(frame), path.with_name(path.name % frame.number) if is_sequence(path) else path)
        if progress is not None:
            progress(k + 1)


def parts(frame: Frame) -> list[Part]:
    """The surfaces between the particles of a frame.

    Raises
    ------
    InvalidInput
        There are none.
    """
    found = [d for d in frame.drawables if isinstance(d, Triangles) and d.vertices is None and len(d.faces)]
    if not found:
        raise InvalidInput(
            f"frame {frame.number} has no surface to export: cloth and jelly have one, unless look.surfaces is false"
        )
    return [_part(surface, frame) for surface in found]


def _part(surface: Triangles, frame: Frame) -> Part:
    corners = np.asarray(surface.faces, np.int64).ravel()
    uv = None if surface.uv is None else np.asarray(surface.uv, np.float64).reshape(-1, 2)
    keys = corners[:, None] if uv is None else np.column_stack([corners, uv])
    _, first, faces = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    rows = corners[first]
    color = np.asarray(surface.color, np.float64)
    return Part(
        surface.name,
        frame.positions[rows].astype(np.float64),
        faces.reshape(-1, 3).astype(np.int64),
        None if uv is None else uv[first],
        np.tile(color, (len(rows), 1)) if color.ndim == 1 else color[rows],
    )


def _bytes(light: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Linear RGBA as the bytes that files of pictures have."""
    rgb = srgb(np.clip(light[..., :3], 0, 1))
    return np.round(255 * np.concatenate([rgb, np.clip(light[..., 3:], 0, 1)], axis=-1)).astype(np.uint8)


def _library() -> Any:
    import trimesh  # on first use: it takes a while

    return trimesh


def _mesh(part: Part, visual: Any) -> Any:
    mesh = _library().Trimesh(part.vertices, part.faces, visual=visual, process=False)
    mesh.metadata["name"] = part.name
    return mesh


def _obj(surfaces: list[Part], path: Path) -> None:
    trimesh = _library()
    scene = trimesh.Scene()
    patterned = any(part.uv is not None for part in surfaces)  # all or none: `vt` are counted as `v` are
    for part in surfaces:
        uv = np.zeros((len(part.vertices), 2)) if patterned and part.uv is None else part.uv
        material = trimesh.visual.material.SimpleMaterial(diffuse=_bytes(part.color.mean(axis=0)), name=part.name)
        scene.add_geometry(_mesh(part, trimesh.visual.TextureVisuals(uv=uv, material=material)), part.name)
    text, files = trimesh.exchange.obj.export_obj(
        scene, return_texture=True, mtl_name=f"{path.stem}.mtl", header="pointmass", digits=9
    )
    path.write_text(text, encoding="utf-8")
    for name, content in files.items():
        path.with_name(name).write_bytes(content)


def _ply(surfaces: list[Part], path: Path) -> None:
    starts = np.cumsum([0, *(len(part.vertices) for part in surfaces)])
    places = np.concatenate([np.zeros((len(p.vertices), 2)) if p.uv is None else p.uv for p in surfaces])
    whole = Part(
        path.stem,
        np.concatenate([part.vertices for part in surfaces]),
        np.concatenate([part.faces + start for part, start in zip(surfaces, starts, strict=False)]),
        places,
        np.concatenate([part.color for part in surfaces]),
    )
    mesh = _mesh(whole, _library().visual.ColorVisuals(vertex_colors=_bytes(whole.color)))
    if any(part.uv is not None for part in surfaces):
        mesh.vertex_attributes |= {"s": places[:, 0].astype(np.float32), "t": places[:, 1].astype(np.float32)}
    path.write_bytes(mesh.export(file_type="ply"))


def _glb(surfaces: list[Part], path: Path) -> None:
    trimesh = _library()
    scene = trimesh.Scene()
    for part in surfaces:
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=part.color.mean(axis=0).clip(0, 1),
            metallicFactor=0.0,
            roughnessFactor=0.8,
            doubleSided=True,
        )
        scene.add_geometry(_mesh(part, trimesh.visual.TextureVisuals(uv=part.uv, material=material)), part.name)
    path.write_bytes(scene.export(file_type="glb"))


WRITERS: dict[str, Writer] = {".obj": _obj, ".ply": _ply, ".glb": _glb}
