"""A box: a block to bounce off, or a room to bounce in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, directions, lengths
from pointmass.collisions.plane import Plane
from pointmass.errors import InvalidInput, finite_array
from pointmass.laws.parameter import Vector

FACES = [  # two triangles for each face, counter-clockwise seen from outside
    *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
    *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
]


class Box(Collider):
    """A block with faces along the axes, or with `inside` a room of six walls.

    Parameters
    ----------
    center : [m]; a function of t moves it.
    size : lengths of the edges [m], each greater than 0.
    inside : whether the free space is inside.
    restitution, friction, eps, contact : as for every collider.
    """

    def __init__(
        self,
        center: Vector = (0.0, 0.0, 0.0),
        size: Any = (1.0, 1.0, 1.0),
        *,
        inside: bool = False,
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
    ) -> None:
        super().__init__(center, restitution, friction, eps, contact)
        self.half = 0.5 * finite_array("size", size, (3,))
        if (self.half <= 0).any():
            raise InvalidInput(f"size = {size} is not allowed: the edges of a box must be greater than 0 [m]")
        self.walls = [self._wall(axis, side) for axis in range(3) for side in (-1.0, 1.0)] if inside else []

    @property
    def surfaces(self) -> Sequence[Collider]:
        return self.walls or (self,)

    def local_distance(self, x: Array) -> Array:
        if self.walls:
            nearest: Array = np.min(self.half - np.abs(x), axis=1)
            return nearest
        q: Array = np.abs(x) - self.half
        inside: Array = np.minimum(q.max(axis=1), 0)
        return lengths(np.maximum(q, 0)) + inside

    def local_normal(self, x: Array) -> Array:
        q: Array = np.abs(x) - self.half
        out = np.maximum(q, 0)
        face = np.eye(3)[np.argmax(q, axis=1)]
        n = -face if self.walls else directions(out, lengths(out), face)
        return np.where(x < 0, -n, n)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * self.half
        return corners, np.array(FACES, np.int32)

    def _wall(self, axis: int, side: float) -> Plane:
        wall = Plane(
            normal=-side * np.eye(3)[axis],
            restitution=self.restitution,
            friction=self.friction,
            eps=self.eps,
            contact=self.contact,
        )
        wall.motion, wall.offset = self.motion, -float(self.half[axis])
        return wall
