"""A box: a block to bounce off, or a room to bounce in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, Response
from pointmass.collisions.laws import all_of, along, any_of
from pointmass.collisions.plane import Plane
from pointmass.errors import InvalidInput, finite_array
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, absolute, length, maximum, minimum, where
from pointmass.tracing.program import Vector as Triplet

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
    restitution, friction, eps, contact, response : as for every collider.
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
        response: Response = "bounce",
    ) -> None:
        super().__init__(center, restitution, friction, eps, contact, response)
        self.half = 0.5 * finite_array("size", size, (3,))
        if (self.half <= 0).any():
            raise InvalidInput(f"size = {size} is not allowed: the edges of a box must be greater than 0 [m]")
        self.walls = [self._wall(axis, side) for axis in range(3) for side in (-1.0, 1.0)] if inside else []

    @property
    def surfaces(self) -> Sequence[Collider]:
        return self.walls or (self,)

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        *half, sign = shape
        q, out = _beyond(x, half)
        deepest = maximum(maximum(q[0], q[1]), q[2])
        return sign * (length(out) + minimum(deepest, 0.0))

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        *half, sign = shape
        q, out = _beyond(x, half)
        first = (q[1] <= q[0]) & (q[2] <= q[0])
        second = ~first & (q[2] <= q[1])
        face = (where(first, 1.0, 0.0), where(second, 1.0, 0.0), where(first | second, 0.0, 1.0))
        n = along(out, length(out), face)
        return Triplet(sign * where(p < 0.0, -a, a) for p, a in zip(x, n, strict=True))

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """All beyond one of the faces; a room is made of planes."""
        *half, sign = shape
        beyond = [all_of(h + room < s * p[k] for p in points) for k, h in enumerate(half) for s in (1.0, -1.0)]
        return any_of(beyond) & (sign > 0.0)

    @property
    def shape(self) -> tuple[float, ...]:
        return (*self.half.tolist(), -1.0 if self.walls else 1.0)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * self.half
        return corners, np.array(FACES, np.int32)

    def _wall(self, axis: int, side: float) -> Plane:
        wall = Plane(normal=-side * np.eye(3)[axis], **self.material)
        wall.motion, wall.offset = self.motion, -float(self.half[axis])
        return wall


def _beyond(x: Triple, half: Sequence[Number]) -> tuple[Triplet, Triplet]:
    """How far a point is beyond the faces along each axis, and the same with 0 for within."""
    q = Triplet(absolute(a) - h for a, h in zip(x, half, strict=True))
    return q, Triplet(maximum(a, 0.0) for a in q)
