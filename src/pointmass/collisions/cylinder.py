"""A cylinder with flat ends: a block to bounce off, or a room to bounce in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, Response
from pointmass.collisions.laws import all_of, along
from pointmass.collisions.plane import Plane
from pointmass.collisions.revolution import Round, on_axis, revolved, turned
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, absolute, dot, length, maximum, minimum, scale, sqrt, sub, where
from pointmass.tracing.program import Vector as Triplet


class Cylinder(Round):
    """A round block between two points, or with `inside` a room of a tube and two flat ends.

    Parameters
    ----------
    a, b : middles of its ends [m], two different points.
    radius : [m], greater than 0.
    inside : whether the free space is inside.
    shift : moves the whole cylinder [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.
    """

    def __init__(
        self,
        a: Any = (0.0, 0.0, 0.0),
        b: Any = (0.0, 1.0, 0.0),
        radius: float = 0.5,
        *,
        inside: bool = False,
        shift: Vector = (0.0, 0.0, 0.0),
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        super().__init__(shift, restitution, friction, eps, contact, response)
        self._around(a, b, radius, inside)
        self.walls = [self._tube(a, b, radius), self._end(-1.0), self._end(1.0)] if inside else []

    @property
    def surfaces(self) -> Sequence[Collider]:
        return self.walls or (self,)

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        _, _, q, out = _beyond(x, shape)
        return shape[-1] * (_size(out) + minimum(maximum(*q), 0.0))

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        part, away, q, out = _beyond(x, shape)
        side = q[1] <= q[0]
        across, lengthwise = along(out, _size(out), (where(side, 1.0, 0.0), where(side, 0.0, 1.0)))
        n = scale(across, along(away, length(away))) + scale(where(part < 0.0, -lengthwise, lengthwise), shape[3:6])
        return scale(shape[-1], n)

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """Beyond the plane across the way from the block to the first point; a room: all within."""
        *_, half, radius, sign = shape
        part, away, _, out = _beyond(points[0], shape)
        lengthwise = where(part < 0.0, -out[1], out[1])
        first = scale(out[0], along(away, length(away))) + scale(lengthwise, shape[3:6])
        nearest = sub(points[0], first)
        beyond = [dot(sub(p, nearest), first) for p in points]
        far = all_of((d > 0.0) & (room * room * dot(first, first) < d * d) for d in beyond)
        ways = [on_axis(p, shape[:3], shape[3:6]) for p in points]
        inner = radius - room
        within = all_of((dot(d, d) < inner * inner) & (absolute(s) < half - room) for s, d in ways) & (inner > 0.0)
        return where(sign > 0.0, far, within)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        r, h = self.radius, self.half
        corners, faces = revolved((0, r, r, r, r, 0), (h, h, h, -h, -h, -h))
        return self.middle + turned(corners, self.direction), faces

    def _tube(self, a: Any, b: Any, radius: float) -> Cylinder:
        """The round wall alone: that of a room without ends."""
        tube = Cylinder(a, b, radius, **self.material)
        tube.motion, tube.half, tube.sign = self.motion, np.inf, -1.0
        tube.bulges = False  # type: ignore[misc]
        return tube

    def _end(self, side: float) -> Plane:
        """The wall of a room at one end of the axis."""
        wall = Plane(normal=-side * self.direction, **self.material)
        wall.motion, wall.offset = self.motion, float(wall.direction @ self.middle) - self.half
        return wall


def _beyond(x: Triple, shape: Triple) -> tuple[Number, Triplet, tuple[Number, Number], tuple[Number, Number]]:
    """Where a point is along the axis and across it, how far beyond the round face and the flat ones, and the same
    with 0 for within."""
    part, away = on_axis(x, shape[:3], shape[3:6])
    q = length(away) - shape[7], absolute(part) - shape[6]
    return part, away, q, (maximum(q[0], 0.0), maximum(q[1], 0.0))


def _size(out: tuple[Number, Number]) -> Number:
    return sqrt(out[0] * out[0] + out[1] * out[1])
