"""Frames as binary glTF: one file that moves in web pages, game engines and Blender.

glTF has no particles that come and go, and no meshes that change. So each surface, and the particles beside them, is
cut into runs of frames in which nothing changes but places. A run is a mesh with a morph target for each of its frames;
an animation leads the weights from one to the next, and gives all other runs the scale 0. A cloth is one run; of a
fountain, each frame is one.
"""

from __future__ import annotations

import json
import shutil
import struct
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput
from pointmass.export.exporter import About
from pointmass.export.meshes import Part, parts
from pointmass.export.particles import lonely, normals, radii_and_colors, surfaces
from pointmass.frame import Frame, Triangles

Array = NDArray[Any]

LONGEST = 256  # targets of a mesh: as many layers each WebGL 2 has
LARGEST = 2**32 - 1  # bytes of a file, whose length it says in 32 bits
TOO_LARGE = (
    "a .glb file holds at most 4 GiB, and these frames are more: export a part of them, or a .usd, which has no limit"
)
POINTS, TRIANGLES = 0, 4  # modes
VERTICES, CORNERS = {"target": 34962}, {"target": 34963}  # what a view is for
COMPONENTS = {np.dtype("<f4"): 5126, np.dtype("<u4"): 5125}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


def write_glb(frames: Iterable[Frame], path: Path, about: About) -> None:
    """All frames: the surfaces, each an object with TEXCOORD_0, and the particles beside them as points.

    Lengths are in metres, y is up, times are in seconds from the first frame. Places between two frames are on the
    straight line. Who does not play it sees the last frame.
    """
    with tempfile.TemporaryFile(dir=path.parent) as stream:  # the list of what is in it comes first
        file = _File(stream)
        _write(frames, file)
        file.finish(path, about.name)


def _write(frames: Iterable[Frame], file: _File) -> None:
    runs: dict[tuple[Any, ...], _Run] = {}
    start = 0.0
    for k, frame in enumerate(frames):
        start = frame.time if k == 0 else start
        now = frame.time - start
        shapes = _shapes(frame)
        for key, run in list(runs.items()):
            shape = shapes.get(key)
            goes_on = shape is not None and run.first.is_like(shape)
            if shape is not None and goes_on:
                run.add(shape, now)
            if not goes_on or len(run.times) > LONGEST:  # a full one leads to where the next begins
                runs.pop(key).close(now)
        for key, shape in shapes.items():
            if key not in runs:
                runs[key] = _Run(file, shape, now, "" if k == 0 else f" {frame.number}")
    for run in runs.values():
        run.close(None)


@dataclass(frozen=True, eq=False)
class _Shape:
    """A surface, or the particles beside all surfaces, in a frame.

    Attributes
    ----------
    name : of the surface, or "particles".
    places : of the vertices, shape (n, 3).
    light : linear RGBA of the whole surface, shape (4,), or RGB of each point, shape (n, 3).
    normals : at the vertices, shape (n, 3), None = flat.
    faces : shape (k, 3), None = points.
    uv : places on the pattern, from the top left, shape (n, 2).
    ids : of the particles, if they are points.
    """

    name: str
    places: Array
    light: Array
    normals: Array | None = None
    faces: Array | None = None
    uv: Array | None = None
    ids: Array | None = None

    def is_like(self, other: _Shape) -> bool:
        """Whether nothing differs but places, normals, and the one colour of a surface."""
        pairs = [(self.faces, other.faces), (self.uv, other.uv), (self.ids, other.ids)]
        if self.faces is None:
            pairs.append((self.light, other.light))
        smooth = (self.normals is None) == (other.normals is None)
        return smooth and len(self.places) == len(other.places) and all(_same(a, b) for a, b in pairs)


def _same(a: Array | None, b: Array | None) -> bool:
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def _shapes(frame: Frame) -> dict[tuple[Any, ...], _Shape]:
    """What there is in a frame, by what it is called, and the how manieth it is of those that are called so."""
    found: dict[tuple[Any, ...], _Shape] = {}
    for part, surface in zip(parts(frame), surfaces(frame), strict=True):
        count = sum(name == part.name for name, *_ in found)
        found[part.name, count] = _surface(part, _normals(frame, surface)[part.rows] if surface.smooth else None)
    alone = lonely(frame)
    if len(alone):
        light = radii_and_colors(frame)[1][alone, :3].clip(0, 1).astype("<f4")
        places = frame.positions[alone].astype("<f4")
        found["particles", "beside"] = _Shape("particles", places, light, ids=frame.ids[alone])
    return found


def _normals(frame: Frame, surface: Triangles) -> Array:
    """At each particle; glTF wants the length 1 also where there is none."""
    result = normals(frame.positions, np.asarray(surface.faces, np.int64))
    result[~result.any(axis=1)] = (0.0, 1.0, 0.0)
    return result.astype("<f4")


def _surface(part: Part, normals: Array | None) -> _Shape:
    return _Shape(
        part.name,
        part.vertices.astype("<f4"),
        part.color.mean(axis=0).clip(0, 1),
        normals,
        part.faces.astype("<u4"),
        None if part.uv is None else (part.uv * (1, -1) + (0, 1)).astype("<f4"),
    )


class _Run:
    """A mesh, while nothing of it changes but places.

    Those of its last frame are its own, so that who knows nothing of targets sees how all ends. Until that comes, each
    frame is written as it is.
    """

    def __init__(self, file: _File, shape: _Shape, now: float, number: str) -> None:
        self._file, self.first, self._name = file, shape, f"{shape.name}{number}"
        self.times: list[float] = []
        self._views: list[dict[str, int]] = []
        self.add(shape, now)

    def add(self, shape: _Shape, now: float) -> None:
        """One frame more."""
        moving = {"POSITION": shape.places} | ({} if shape.normals is None else {"NORMAL": shape.normals})
        self.times.append(now)
        self._views.append({name: self._file.view(values, VERTICES) for name, values in moving.items()})

    def close(self, end: float | None) -> None:
        """No frame more; it is seen until `end`, None = to the end of all."""
        file, shape = self._file, self.first
        *before, last = self._views
        ends = {name: file.values(view) for name, view in last.items()}
        primitive: dict[str, Any] = {
            "attributes": {name: file.accessor(view, ends[name]) for name, view in last.items()},
            "mode": POINTS if shape.faces is None else TRIANGLES,
        }
        if shape.uv is not None:
            primitive["attributes"]["TEXCOORD_0"] = file.store(shape.uv, VERTICES)
        if shape.faces is None:
            primitive["attributes"]["COLOR_0"] = file.store(shape.light, VERTICES)
        else:
            primitive["indices"] = file.store(shape.faces.reshape(-1, 1), CORNERS)
            primitive["material"] = file.material(shape.name, shape.light)
        if before:
            primitive["targets"] = [
                {name: file.accessor(view, file.less(view, ends[name])) for name, view in views.items()}
                for views in before
            ]
        rest = {"weights": [0] * len(before)} if before else {}
        mesh = file.add("meshes", {"name": self._name, "primitives": [primitive], **rest})
        node = file.add("nodes", {"name": self._name, "mesh": mesh} | ({} if end is None else {"scale": [0, 0, 0]}))
        if before:  # the weight of each target is 1 at its time, and in the end all are 0
            weights = np.eye(len(self.times), len(before), dtype="<f4")
            file.animate(node, "weights", self.times, weights.reshape(-1, 1), "LINEAR")
        seen = [(0.0, 0), (self.times[0], 1)] if self.times[0] > 0 else [(0.0, 1)]
        seen += [] if end is None else [(end, 0)]
        if len(seen) > 1:
            scales = np.repeat(np.array([[scale] for _, scale in seen], "<f4"), 3, axis=1)
            file.animate(node, "scale", [time for time, _ in seen], scales, "STEP")


class _File:
    """The arrays of a file, as they come, and the list of what they are."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._size = stream, 0
        self._lists: dict[str, list[Any]] = {}
        self._samplers: list[Any] = []
        self._channels: list[Any] = []
        self._kinds: list[tuple[np.dtype[Any], tuple[int, ...]]] = []  # of each view

    def add(self, what: str, entry: dict[str, Any]) -> int:
        """An entry in one of the lists of glTF; returns its number."""
        entries = self._lists.setdefault(what, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, values: Array, use: dict[str, int]) -> int:
        """Write an array of shape (n, k); returns the number of its view."""
        data = np.ascontiguousarray(values).tobytes()
        if self._size + len(data) > LARGEST:
            raise InvalidInput(TOO_LARGE)
        self._stream.seek(self._size)
        self._stream.write(data + bytes(-len(data) % 4))
        self._kinds.append((values.dtype, values.shape))
        view = self.add("bufferViews", {"buffer": 0, "byteOffset": self._size, "byteLength": len(data), **use})
        self._size += len(data) + -len(data) % 4
        return view

    def values(self, view: int) -> Array:
        """What was written."""
        dtype, shape = self._kinds[view]
        place = self._lists["bufferViews"][view]
        self._stream.seek(place["byteOffset"])
        return np.frombuffer(self._stream.read(place["byteLength"]), dtype).reshape(shape)

    def less(self, view: int, base: Array) -> Array:
        """Write the difference to another one in the place of an array; returns it."""
        difference: Array = self.values(view) - base
        self._stream.seek(self._lists["bufferViews"][view]["byteOffset"])
        self._stream.write(difference.tobytes())
        return difference

    def accessor(self, view: int, values: Array) -> int:
        """Say what is in a view; returns the number of that."""
        what = {"componentType": COMPONENTS[values.dtype], "count": len(values), "type": KINDS[values.shape[1]]}
        bounds = {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self.add("accessors", {"bufferView": view, **what, **bounds})

    def store(self, values: Array, use: dict[str, int] | None = None) -> int:
        """Write an array and say what it is."""
        return self.accessor(self.view(values, use or {}), values)

    def material(self, name: str, light: Array) -> int:
        """A surface of one colour, seen from both sides."""
        look = {"baseColorFactor": light.tolist(), "metallicFactor": 0.0, "roughnessFactor": 0.8}
        entry = {"name": name, "pbrMetallicRoughness": look, "doubleSided": True}
        materials = self._lists.setdefault("materials", [])
        return materials.index(entry) if entry in materials else self.add("materials", entry)

    def animate(self, node: int, path: str, times: list[float], values: Array, interpolation: str) -> None:
        """Lead a property of a node through values at times [s]."""
        inputs = self.store(np.array(times, "<f4").reshape(-1, 1))
        self._samplers.append({"input": inputs, "output": self.store(values), "interpolation": interpolation})
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})

    def finish(self, path: Path, name: str) -> None:
        """Write the file: the list, and then the arrays."""
        nodes = range(len(self._lists.get("nodes", [])))
        scene = {"name": name} | ({"nodes": [*nodes]} if nodes else {})
        document = {"asset": {"version": "2.0", "generator": "pointmass"}, "scene": 0, "scenes": [scene], **self._lists}
        if self._size:
            document["buffers"] = [{"byteLength": self._size}]
        if self._channels:
            document["animations"] = [{"name": name, "samplers": self._samplers, "channels": self._channels}]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + (8 + self._size if self._size else 0)
        if length > LARGEST:
            raise InvalidInput(TOO_LARGE)
        with path.open("wb") as file:
            file.write(struct.pack("<4sII", b"glTF", 2, length))
            file.write(struct.pack("<I4s", len(text), b"JSON") + text)
            if self._size:
                file.write(struct.pack("<I4s", self._size, b"BIN\0"))
                self._stream.seek(0)
                shutil.copyfileobj(self._stream, file, 1 << 20)
