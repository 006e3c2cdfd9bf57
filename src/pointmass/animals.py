"""Small animals as a few triangles each that point where they go: birds flap their wings, fish their tails."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

GOLDEN = 0.6180339887498949  # neighbours in number are at far different moments of their beat


@dataclass(frozen=True)
class Shape:
    """An animal of size 1: half of its length, about.

    Attributes
    ----------
    corners : forward, to the right and upwards, shape (k, 3).
    beat : how far corners swing to either side, likewise.
    faces : rows of the corners, shape (f, 3).
    frequency : of the beat [Hz].
    """

    corners: tuple[tuple[float, float, float], ...]
    beat: tuple[tuple[float, float, float], ...]
    faces: tuple[tuple[int, int, int], ...]
    frequency: float


SHAPES = {
    "birds": Shape(  # beak, left wing, tail, right wing
        corners=((1.0, 0, 0), (-0.35, -1.15, 0.1), (-0.75, 0, 0), (-0.35, 1.15, 0.1)),
        beat=((0, 0, 0), (0, 0, 0.6), (0, 0, 0), (0, 0, 0.6)),
        faces=((0, 2, 1), (0, 3, 2)),
        frequency=3.0,
    ),
    "fish": Shape(  # mouth, back, root of the tail, belly, ends of the tail
        corners=((1.0, 0, 0), (0.1, 0, 0.4), (-0.65, 0, 0), (0.1, 0, -0.4), (-1.1, 0, 0.3), (-1.1, 0, -0.3)),
        beat=((0, 0.08, 0), (0, 0, 0), (0, 0.1, 0), (0, 0, 0), (0, 0.4, 0), (0, 0.4, 0)),
        faces=((0, 1, 2), (0, 2, 3), (2, 4, 5)),
        frequency=2.5,
    ),
}


def mesh(kind: str, x: Any, v: Any, ids: Any, t: float, size: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Corners and faces of all animals at time t, upright and with the head where they go.

    Parameters
    ----------
    kind : one of `SHAPES`.
    x, v : positions [m] and velocities [m/s], shape (n, 3); who is at rest looks along x.
    ids : shape (n,), which say where in its beat each is.
    size : about half of the length [m].

    Returns
    -------
    corners, faces : float32 of shape (n k, 3) and int32 of shape (n f, 3).
    """
    shape = SHAPES[kind]
    ahead = np.where((v == 0).all(axis=1, keepdims=True), (1.0, 0.0, 0.0), v)
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    steep = np.abs(ahead[:, 1:2]) > 0.999  # straight up or down: any side is as good
    right = np.cross(ahead, np.where(steep, (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    axes = np.stack([ahead, right, np.cross(right, ahead)], axis=1)
    moment = np.sin(2 * math.pi * (shape.frequency * t + GOLDEN * (ids % 2**20)))
    local = np.array(shape.corners) + moment[:, None, None] * np.array(shape.beat)
    corners = x[:, None, :] + size * local @ axes
    faces = np.array(shape.faces)[None] + len(shape.corners) * np.arange(len(x))[:, None, None]
    return corners.reshape(-1, 3).astype(np.float32), faces.reshape(-1, 3).astype(np.int32)
