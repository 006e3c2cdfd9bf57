"""Frames as a USD stage: for Blender, Houdini, Maya, Omniverse and usdview."""

from __future__ import annotations

import errno
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.export.exporter import About
from pointmass.export.particles import normals, radii_and_colors
from pointmass.frame import Arrows, Camera, Curves, Drawable, Floats, Frame, Points, Segments, Triangles

Array = NDArray[Any]

SAVED_AFTER = 1_000_000  # particles: what is saved need not stay in memory
APERTURE = 24.0  # height of the camera's film [mm]; only what it is to the focal length matters
WIDE = 16 / 9  # width of the picture for its height
SCHEMAS = {
    "particles": "Points",
    "points": "Points",
    "triangles": "Mesh",
    "curves": "BasisCurves",
    "segments": "BasisCurves",
    "arrows": "BasisCurves",
}


def write_usd(frames: Iterable[Frame], path: Path, about: About) -> None:
    """One stage with y up and in metres; a time code is the number of a frame, and a run has `about.fps` a second.

    `/World/particles` are `Points` with all particles: `ids`, `velocities` [m/s], `widths` [m] (0 where one is not
    drawn as a ball) and colours (linear light). Surfaces, and shapes such as colliders, are `Mesh`es with normals and
    the place on the pattern as `primvars:st`; hair, trails, streamlines, springs and arrows are `BasisCurves`. What
    does not change from a frame to the next is written once. Something that is not there in a frame is invisible.
    """
    from pxr import Tf

    try:
        _write(frames, path, about)
    except Tf.ErrorException as error:
        raise OSError(errno.EIO, f"USD cannot write it ({error})") from error


def _write(frames: Iterable[Frame], path: Path, about: About) -> None:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(about.fps)
    stage.SetFramesPerSecond(about.fps)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    place = None if about.camera is None else _camera(stage, about.camera)
    prims: dict[tuple[str, str], _Prim] = {}
    unsaved = 0
    for k, frame in enumerate(frames):
        if k == 0:
            stage.SetStartTimeCode(frame.number)
        stage.SetEndTimeCode(frame.number)
        _add(stage, prims, frame)
        if place is not None and about.moved is not None:
            place.Set(_placed(about.moved(frame)), frame.number)
        unsaved += len(frame.ids)
        if unsaved >= SAVED_AFTER:
            stage.GetRootLayer().Save()
            unsaved = 0
    stage.GetRootLayer().Save()


def _add(stage: Any, prims: dict[tuple[str, str], _Prim], frame: Frame) -> None:
    """One frame more."""
    wanted: list[tuple[str, Drawable | None]] = [("particles", None)]
    wanted += [(d.name, d) for d in frame.drawables if not (isinstance(d, Points) and d.vertices is None)]
    seen = set()
    for name, drawable in wanted:
        kind = "particles" if drawable is None else drawable.kind
        if (kind, name) not in prims:
            prims[kind, name] = _Prim(stage, name, kind, frame.number)
        prim = prims[kind, name]
        prim.put(_of_particles(frame) if drawable is None else _of(drawable, frame), frame.number)
        seen.add((kind, name))
    for key, prim in prims.items():
        prim.show(key in seen, frame.number)


class _Prim:
    """Something in the stage, whose values are written when they change."""

    def __init__(self, stage: Any, name: str, kind: str, number: int) -> None:
        from pxr import Tf, UsdGeom

        path = base = f"/World/{Tf.MakeValidIdentifier(name)}"
        k = 1
        while stage.GetPrimAtPath(path):
            k += 1
            path = f"{base}_{k}"
        self._prim = getattr(UsdGeom, SCHEMAS[kind]).Define(stage, path).GetPrim()
        self._values: dict[str, _Value] = {}
        self._start, self._first, self._visible = stage.GetStartTimeCode(), number, True
        if SCHEMAS[kind] == "Mesh":
            self._prim.GetAttribute("subdivisionScheme").Set(UsdGeom.Tokens.none)
            self._prim.GetAttribute("doubleSided").Set(True)
        elif SCHEMAS[kind] == "BasisCurves":
            self._prim.GetAttribute("type").Set(UsdGeom.Tokens.linear)
        if number > self._start:  # it comes later
            visibility = self._prim.GetAttribute("visibility")
            visibility.Set(UsdGeom.Tokens.invisible, self._start)
            visibility.Set(UsdGeom.Tokens.inherited, number)

    def put(self, values: dict[str, Array], number: int) -> None:
        """The values of a frame, by names of attributes."""
        from pxr import UsdGeom

        points = values["points"]
        if len(points):
            wide = values.get("widths", np.zeros(1, np.float32))
            extent = UsdGeom.Points.ComputeExtent(points, np.broadcast_to(wide, len(points)).copy())
            values = {**values, "extent": np.array(extent, np.float32)}
        for name, value in values.items():
            if name not in self._values:
                self._values[name] = _Value(self._attribute(name), self._first)
            self._values[name].put(value, number)

    def show(self, visible: bool, number: int) -> None:
        """Whether it is there in this frame."""
        from pxr import UsdGeom

        if visible != self._visible:
            self._visible = visible
            token = UsdGeom.Tokens.inherited if visible else UsdGeom.Tokens.invisible
            visibility = self._prim.GetAttribute("visibility")
            if not visibility.GetNumTimeSamples():
                visibility.Set(UsdGeom.Tokens.inherited, self._start)
            visibility.Set(token, number)

    def _attribute(self, name: str) -> Any:
        """The attribute of a name; colours and patterns are primvars, one value for each corner as their name says."""
        from pxr import Sdf, UsdGeom

        primvars = UsdGeom.PrimvarsAPI(self._prim)
        kinds = {
            "displayColor": (Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex),
            "displayOpacity": (Sdf.ValueTypeNames.FloatArray, UsdGeom.Tokens.vertex),
            "st": (Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying),
        }
        if name in kinds:
            return primvars.CreatePrimvar(name, *kinds[name]).GetAttr()
        attribute = self._prim.GetAttribute(name)
        if name in ("widths", "normals"):
            attribute.SetMetadata("interpolation", UsdGeom.Tokens.vertex)
        return attribute


class _Value:
    """An attribute that keeps a value until it has another: readers interpolate between the times that are written."""

    def __init__(self, attribute: Any, number: int) -> None:
        self._attribute = attribute
        self._last: Array | None = None
        self._seen = self._written = number

    def put(self, value: Array, number: int) -> None:
        last = self._last
        if last is None or last.shape != value.shape or last.tobytes() != value.tobytes():
            if last is not None and self._written < self._seen:
                self._attribute.Set(last, self._seen)
            self._attribute.Set(value, number)
            self._last, self._written = value, number
        self._seen = number


def _of_particles(frame: Frame) -> dict[str, Array]:
    radii, colors = radii_and_colors(frame)
    return {
        "points": _single(frame.positions),
        "ids": np.ascontiguousarray(frame.ids, np.int64),
        "velocities": _single(frame.velocities),
        "widths": 2 * radii,
        **_colored(colors, len(radii)),
    }


def _of(drawable: Drawable, frame: Frame) -> dict[str, Array]:
    match drawable:
        case Points():
            return _balls(drawable)
        case Triangles():
            return _mesh(drawable, frame)
        case Curves():
            rows = np.asarray(drawable.index)
            return _lines(drawable, frame, rows, np.diff(drawable.offsets), drawable.width, drawable.color)
        case Segments():
            pairs = np.asarray(drawable.pairs)
            width, color = _twice(drawable.width, 0), _twice(drawable.color, 1)
            return _lines(drawable, frame, pairs.ravel(), np.full(len(pairs), 2), width, color)
        case Arrows():
            ends = np.stack([drawable.vertices, drawable.vertices + drawable.vectors], axis=1).reshape(-1, 3)
            count = len(drawable.vertices)
            return {
                "points": _single(ends),
                "curveVertexCounts": np.full(count, 2, np.int32),
                "widths": _each(_twice(drawable.width, 0), 2 * count),
                **_colored(_twice(drawable.color, 1), 2 * count),
            }


def _balls(points: Points) -> dict[str, Array]:
    """Points with places of their own."""
    assert points.vertices is not None
    vertices = points.vertices if points.index is None else points.vertices[points.index]
    n = len(vertices)
    return {
        "points": _single(vertices),
        "widths": _each(2 * np.asarray(points.radius), n),
        **_colored(points.color, n),
    }


def _mesh(mesh: Triangles, frame: Frame) -> dict[str, Array]:
    """A mesh without the particles that it does not touch, so that births elsewhere leave it as it is."""
    faces = np.asarray(mesh.faces, np.int64)
    rows, corners = np.unique(faces, return_inverse=True)
    corners = corners.reshape(-1, 3)
    places = _single((frame.positions if mesh.vertices is None else mesh.vertices)[rows])
    color = np.asarray(mesh.color)
    values = {
        "points": places,
        "faceVertexIndices": corners.ravel().astype(np.int32),
        "faceVertexCounts": np.full(len(corners), 3, np.int32),
        **_colored(color if color.ndim == 1 else color[rows], len(rows)),
    }
    if mesh.vertices is None:
        values["velocities"] = _single(frame.velocities[rows])
    if mesh.smooth:
        values["normals"] = _single(normals(places, corners))
    if mesh.uv is not None:
        values["st"] = np.asarray(mesh.uv, np.float32).reshape(-1, 2)
    return values


def _lines(
    drawable: Curves | Segments, frame: Frame, rows: Array, counts: Array, width: Floats | float, color: Any
) -> dict[str, Array]:
    own = drawable.vertices is not None
    values = {
        "points": _single((drawable.vertices if drawable.vertices is not None else frame.positions)[rows]),
        "curveVertexCounts": np.asarray(counts, np.int32),
        "widths": _each(width, len(rows)),
        **_colored(color, len(rows)),
    }
    return values if own else values | {"velocities": _single(frame.velocities[rows])}


def _single(values: Any) -> Array:
    """What USD stores of coordinates."""
    return np.ascontiguousarray(values, np.float32)


def _each(value: Any, n: int) -> Array:
    return _single(np.broadcast_to(value, n))


def _twice(value: Any, single: int) -> Any:
    """The value of each line for both of its ends; one value for all has `single` dimensions."""
    array = np.asarray(value)
    return array if array.ndim == single else np.repeat(array, 2, axis=0)


def _colored(color: Any, n: int) -> dict[str, Array]:
    light = np.broadcast_to(np.asarray(color, np.float32), (n, 4))
    return {"displayColor": _single(light[:, :3]), "displayOpacity": _single(light[:, 3])}


def _camera(stage: Any, camera: Camera) -> Any:
    """Add a camera; returns where it says its place, None if that is not known."""
    from pxr import Gf, UsdGeom

    if camera.position is None or camera.target is None:
        return None
    prim = UsdGeom.Camera.Define(stage, "/World/camera")
    place = prim.AddTransformOp()
    place.Set(_placed(camera))
    prim.GetVerticalApertureAttr().Set(APERTURE)
    prim.GetHorizontalApertureAttr().Set(APERTURE * WIDE)
    prim.GetFocalLengthAttr().Set(APERTURE / (2 * math.tan(math.radians(camera.fov) / 2)))
    prim.GetClippingRangeAttr().Set(Gf.Vec2f(0.01, 1e5))
    return place


def _placed(camera: Camera) -> Any:
    """The matrix from a camera to the world."""
    from pxr import Gf

    eye, target, up = (Gf.Vec3d(*vector) for vector in (camera.position or (), camera.target or (), camera.up))
    look = Gf.Matrix4d().SetLookAt(eye, target, up)
    return look.GetInverse()
