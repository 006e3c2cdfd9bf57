"""The pin-hole projection, and a camera that finds its own place."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import Arrows, Camera, Drawable, Floats, Frame, Points, Triangles

Vector = NDArray[np.float64]

MARGIN = 1.12  # the picture is this much larger than what must be seen
MANY = 1000  # a cloud with more rows than this is measured by its percentiles
PERCENTILES = (1.0, 99.0)
FARTHEST = 1e12  # [m]
_STEPS = np.array([d for d in np.ndindex(5, 5, 5) if max(abs(k - 2) for k in d) == 2], np.float64) - 2.0
DIRECTIONS = _STEPS / np.linalg.norm(_STEPS, axis=1)[:, None]  # 98 of them, evenly spread
CLOSEST = 0.05  # part of its distance to which a camera comes near
NEAR = 0.002  # nearest visible depth, as a fraction of the distance from the eye to the target


@dataclass(frozen=True, eq=False)
class View:
    """A camera that stands: world coordinates to view coordinates to pixels.

    View coordinates are x to the right, y up and z away from the eye [m]. Pixel (i, j) covers [i, i+1) x [j, j+1),
    j downwards.

    Attributes
    ----------
    eye : position [m], shape (3,).
    axes : rows are the unit vectors right, up and forward, shape (3, 3).
    focal : distance of the image plane [pixels].
    width, height : size of the picture [pixels].
    near : things nearer than this depth are not drawn [m].
    """

    eye: Vector
    axes: Vector
    focal: float
    width: int
    height: int
    near: float

    def see(self, positions: Floats) -> Vector:
        """View coordinates of world positions, shape (n, 3)."""
        # Written out, because a BLAS product may round differently on another number of threads.
        return turn(np.asarray(positions, dtype=np.float64) - self.eye, self.axes)

    def project(self, seen: Vector) -> Vector:
        """Pixel coordinates of view coordinates, shape (n, 2); only meaningful where z > 0."""
        scale = self.focal / seen[:, 2]
        return np.stack((0.5 * self.width + scale * seen[:, 0], 0.5 * self.height - scale * seen[:, 1]), axis=1)


def turn(vectors: Vector, axes: Vector) -> Vector:
    """Components of `vectors`, shape (n, 3), along the rows of `axes`, shape (3, 3)."""
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    return np.stack([x * a[0] + y * a[1] + z * a[2] for a in axes], axis=1)


def look(camera: Camera, size: tuple[int, int]) -> View:
    """The view of a camera whose position and target are known."""
    eye = np.asarray(camera.position, dtype=np.float64)
    target = np.asarray(camera.target, dtype=np.float64)
    forward = target - eye
    distance = math.dist(eye, target)
    width, height = size
    focal = 0.5 * height / math.tan(math.radians(camera.fov) / 2.0)
    return View(eye, _axes(forward / distance, camera.up), focal, width, height, NEAR * distance)


def moved(camera: Camera, frame: Frame) -> Camera:
    """A camera whose position and target are known, at the time of a frame: see `Camera.path` and what follows there.

    It depends on nothing but the frame, so that films can be made in parts.
    """
    if not moves(camera):
        return camera
    eye, target = np.array(camera.position, np.float64), np.array(camera.target, np.float64)
    if len(camera.path):
        eye, target = _on_path(np.asarray(camera.path, np.float64), frame.time)
    offset = eye - target
    distance = float(np.linalg.norm(offset))
    offset *= max(distance - camera.dolly * frame.time, CLOSEST * distance) / distance
    angle = math.radians(camera.orbit * frame.time)
    up = direction(camera.up)
    along = up * (offset @ up)
    aside = offset - along
    offset = along + math.cos(angle) * aside + math.sin(angle) * np.cross(up, aside)
    rows = np.flatnonzero(frame.ids == (-1 if camera.follow is None else camera.follow))
    if len(rows) and np.isfinite(frame.positions[rows[0]]).all():
        target = frame.positions[rows[0]].astype(np.float64)
    return replace(camera, position=_triple(target + offset), target=_triple(target))


def moves(camera: Camera) -> bool:
    """Whether a camera is elsewhere at another time."""
    return bool(len(camera.path) or camera.dolly or camera.orbit or camera.follow is not None)


def _on_path(rows: Vector, time: float) -> tuple[Vector, Vector]:
    """Position and target between the rows of a path."""
    if len(rows) == 1:
        return rows[0, 1:4], rows[0, 4:]
    from scipy.interpolate import PchipInterpolator  # on first use: it takes a while

    place = PchipInterpolator(rows[:, 0], rows[:, 1:])(np.clip(time, rows[0, 0], rows[-1, 0]))
    return place[:3], place[3:]


def fit_camera(frames: Iterable[Frame], camera: Camera | None = None, size: tuple[int, int] = (1280, 720)) -> Camera:
    """The camera with its position and target filled in, so that the whole scene is in the picture.

    Everything drawn at the particles' positions counts, in all frames, and so do arrows, points and curves with
    vertices of their own. A cloud of more than 1000 points counts from the 1st to the 99th percentile of each axis, so
    one runaway does not shrink the rest. A mesh with its own vertices (a floor) counts only where it is near the rest.

    Parameters
    ----------
    frames : what is to be seen; read once.
    camera : what it has already is kept.
    size : width and height of the picture [pixels]; only their ratio matters.

    Returns
    -------
    Camera : with `position` and `target`.
    """
    camera = camera or Camera()
    if len(camera.path):
        place = np.asarray(camera.path[0], np.float64)
        return replace(camera, position=_triple(place[1:4]), target=_triple(place[4:]))
    if camera.position is not None and camera.target is not None:
        return camera
    return placed(interesting(frames), camera, size)


def placed(spots: Vector, camera: Camera, size: tuple[int, int] = (1280, 720)) -> Camera:
    """The same for balls that must be in the picture; they are those of `interesting`."""
    balls, radii = spots[:, :3], spots[:, 3]
    low, high = balls.min(axis=0), balls.max(axis=0)
    size_of_all = float(np.linalg.norm(high - low))
    # A lone particle shall not fill the picture, nor may the camera end inside it.
    radii = radii + 0.02 * size_of_all
    if size_of_all <= 4.0 * float(radii.max()):
        radii = radii + max(1.5 * float(radii.max()), 1e-3 * float(np.abs(balls).max()), 1e-6)
    middle = 0.5 * (low + high)
    if camera.position is not None:
        away = middle - np.asarray(camera.position)
        target = middle if np.linalg.norm(away) > 0.0 else middle - _to_eye(camera)
        return replace(camera, target=_triple(target))
    axes = _axes(-_to_eye(camera), camera.up)
    slope = math.tan(math.radians(camera.fov) / 2.0) / MARGIN
    slopes = (slope * size[0] / size[1], slope)
    if camera.target is not None:
        target = np.asarray(camera.target, dtype=np.float64)
        distance = _distance(turn(balls - target, axes), radii, slopes)
        return replace(camera, position=_triple(target - distance * axes[2]))
    place = _place(turn(balls - middle, axes), radii, slopes)
    # Aim at the middle of the scene's depth on the optical axis.
    target = middle + place[0] * axes[0] + place[1] * axes[1]
    return replace(camera, position=_triple(target + place[2] * axes[2]), target=_triple(target))


def breadth(spots: Vector, camera: Camera) -> float:
    """Tangent of half the angle to the sides that holds what must be in the picture, of a camera that stands."""
    view = look(camera, (1, 1))
    seen = view.see(spots[:, :3])
    ahead = seen[:, 2] > view.near
    sides = (np.abs(seen[ahead, 0]) + spots[ahead, 3]) / seen[ahead, 2]
    return MARGIN * float(sides.max(initial=0.0))


def _axes(forward: Vector, up: tuple[float, float, float]) -> Vector:
    """Right, up, forward for a unit vector `forward`; another `up` is taken when the two are parallel."""
    right = np.cross(forward, direction(up))
    length = float(np.linalg.norm(right))
    if not length > 1e-9:
        right = np.cross(forward, (0.0, 0.0, -1.0) if abs(forward[2]) < 0.9 else (1.0, 0.0, 0.0))
        length = float(np.linalg.norm(right))
    right = right / length
    return np.stack((right, np.cross(right, forward), forward))


def direction(vector: tuple[float, float, float]) -> Vector:
    """The direction of a vector of any length but zero."""
    rows = np.asarray(vector, dtype=np.float64)
    rows = rows / np.abs(rows).max()
    result: Vector = rows / np.linalg.norm(rows)
    return result


def _to_eye(camera: Camera) -> Vector:
    """Unit vector from the scene to an automatic camera: azimuth about the camera's up, 0 looks along -z."""
    up = direction(camera.up)
    back = np.array((0.0, 0.0, 1.0)) - up[2] * up
    if np.linalg.norm(back) < 1e-6:
        back = np.array((0.0, -1.0, 0.0)) + up[1] * up
    back = back / np.linalg.norm(back)
    side = np.cross(up, back)
    azimuth, elevation = math.radians(camera.azimuth), math.radians(camera.elevation)
    flat = math.cos(azimuth) * back + math.sin(azimuth) * side
    result: Vector = math.cos(elevation) * flat + math.sin(elevation) * up
    return result


def _place(seen: Vector, radii: Vector, slopes: tuple[float, float]) -> Vector:
    """The place nearest to the scene from which all balls lie between the four planes of the picture.

    Exact: a ball at (x, z) lies under the plane of slope k through (c, d) when x - k z + r sqrt(1 + k^2) <= c - k d,
    so the largest left sides of two opposite planes give c and d.
    """
    place = np.zeros(3)
    depths = []
    for axis, k in enumerate(slopes):
        pad = radii * math.sqrt(1.0 + k * k)
        above = float(np.max(seen[:, axis] - k * seen[:, 2] + pad))
        below = float(np.max(-seen[:, axis] - k * seen[:, 2] + pad))
        place[axis] = 0.5 * (above - below)
        depths.append(-(above + below) / (2.0 * k))
    place[2] = min(*depths, -1e-9)
    return place


def _distance(seen: Vector, radii: Vector, slopes: tuple[float, float]) -> float:
    """How far to step back along the axis so that all balls are in the picture."""
    need = [
        float(np.max((np.abs(seen[:, axis]) + radii * math.sqrt(1.0 + k * k)) / k - seen[:, 2]))
        for axis, k in enumerate(slopes)
    ]
    return max(*need, 1e-9)


def interesting(frames: Iterable[Frame]) -> Vector:
    """Balls (x, y, z, radius) that the picture must show, shape (n, 4) with n >= 1."""
    spots: list[Vector] = []
    static: dict[str, Vector] = {}
    for frame in frames:
        for drawable in frame.drawables:
            if isinstance(drawable, Triangles) and drawable.vertices is not None:
                static[drawable.name] = _finite(drawable.vertices, 0.0)
            else:
                spots.append(_robust(_extent(drawable, frame), isinstance(drawable, Points)))
        if not frame.drawables:
            spots.append(_robust(_finite(frame.positions, 0.0), True))
    meshes = np.concatenate([np.zeros((0, 4)), *static.values()])
    found = np.concatenate([np.zeros((0, 4)), *spots])
    if not len(found):
        return meshes if len(meshes) else np.zeros((1, 4))
    return np.concatenate([found, _near(meshes, found)])


def _extent(drawable: Drawable, frame: Frame) -> Vector:
    """Corners of a drawable that it names, as balls."""
    if isinstance(drawable, Arrows):
        tails = np.asarray(drawable.vertices, dtype=np.float64)
        return _finite(np.concatenate([tails, tails + np.asarray(drawable.vectors)]), 0.0)
    corners = frame.positions if drawable.vertices is None else drawable.vertices
    if isinstance(drawable, Points):
        index = np.arange(len(corners)) if drawable.index is None else np.asarray(drawable.index)
        return _finite(corners[index], drawable.radius)
    names: Any = {"segments": "pairs", "curves": "index", "triangles": "faces"}[drawable.kind]
    return _finite(corners[np.unique(getattr(drawable, names))], 0.0)


def _finite(positions: Floats, radius: Floats | float) -> Vector:
    """Rows (x, y, z, radius) without those that are not finite, or hardly."""
    rows = np.empty((len(positions), 4))
    rows[:, :3] = positions
    rows[:, 3] = radius
    return rows[(np.abs(rows) < FARTHEST).all(axis=1)]


def _robust(rows: Vector, percentiles: bool) -> Vector:
    """Few balls that stand for many: those inside the percentiles, thinned to the outermost of each direction."""
    if len(rows) <= 64:
        return rows
    if percentiles and len(rows) > MANY:
        low, high = np.percentile(rows[:, :3], PERCENTILES, axis=0)
        rows = rows[((rows[:, :3] >= low) & (rows[:, :3] <= high)).all(axis=1)]
    if len(rows) <= MANY:
        return rows
    # A film has too many frames to keep all balls: the outermost in many directions stand for the hull.
    # One direction at a time: a table of all would be a hundred times as large as a cloud that is large already.
    x, y, z, radius = np.ascontiguousarray(rows.T)
    found = [int(np.argmax(d[0] * x + d[1] * y + d[2] * z + radius)) for d in DIRECTIONS]
    outermost: Vector = rows[np.unique(found)]
    return outermost


def _near(meshes: Vector, found: Vector) -> Vector:
    """Corners of static meshes within a box a little larger than the particles'; a floor's are far away."""
    low, high = (found[:, :3] - found[:, 3:]).min(axis=0), (found[:, :3] + found[:, 3:]).max(axis=0)
    room = 0.25 * float(np.linalg.norm(high - low))
    near: Vector = meshes[((meshes[:, :3] >= low - room) & (meshes[:, :3] <= high + room)).all(axis=1)]
    return near


def _triple(vector: Vector) -> tuple[float, float, float]:
    return (float(vector[0]), float(vector[1]), float(vector[2]))
