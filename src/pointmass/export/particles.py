"""How each particle of a frame looks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import srgb
from pointmass.frame import Frame, Points, Segments, Triangles


def radii_and_colors(frame: Frame) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Radius [m] of each particle, shape (n,), and its linear RGBA, shape (n, 4).

    A particle that is not drawn as a point, such as one of a cloth, has radius 0 and is white.
    """
    n = len(frame.ids)
    radii, colors = np.zeros(n, np.float32), np.ones((n, 4), np.float32)
    for points in frame.drawables:
        if isinstance(points, Points) and points.vertices is None:
            rows: Any = slice(None) if points.index is None else points.index
            radii[rows], colors[rows] = points.radius, points.color
    return radii, colors


def sticks(frame: Frame) -> NDArray[np.int64]:
    """Rows of the particles at both ends of each straight line between them, such as a spring, shape (k, 2)."""
    found = [d.pairs for d in frame.drawables if isinstance(d, Segments) and d.vertices is None]
    return np.concatenate([np.zeros((0, 2), np.int64), *(np.asarray(pairs, np.int64) for pairs in found)])


def surfaces(frame: Frame) -> list[Triangles]:
    """The meshes between particles, such as cloths."""
    return [d for d in frame.drawables if isinstance(d, Triangles) and d.vertices is None and len(d.faces)]


def lonely(frame: Frame) -> NDArray[np.int64]:
    """Rows of the particles that belong to no surface."""
    alone = np.ones(len(frame.ids), bool)
    for surface in surfaces(frame):
        alone[surface.faces] = False
    return np.flatnonzero(alone)


def normals(places: NDArray[np.floating[Any]], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean unit normals of places, shape (n, 3), weighed by the areas of their triangles; 0 where there is none."""
    a, b, c = (places[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    total = np.stack([np.bincount(faces.ravel(), np.repeat(across[:, k], 3), len(places)) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    result: NDArray[np.float64] = total / np.where(length == 0, 1, length)
    return result


def color_bytes(light: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """Linear RGBA as the bytes that files of pictures have."""
    rgb = srgb(np.clip(light[..., :3], 0, 1))
    return np.round(255 * np.concatenate([rgb, np.clip(light[..., 3:], 0, 1)], axis=-1)).astype(np.uint8)
