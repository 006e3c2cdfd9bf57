"""A capsule, from outside or inside: a rod with round ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Contact, Response
from pointmass.collisions.laws import all_of, along
from pointmass.collisions.revolution import AROUND, Round, on_axis, revolved, turned
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, dot, length, maximum, minimum, scale, sub, where
from pointmass.tracing.program import Vector as Triplet


class Capsule(Round):
    """All that is within a radius of a line between two points, or with `inside` the room in it.

    Parameters
    ----------
    a, b : ends of the line [m], two different points.
    radius : [m], greater than 0.
    inside : whether the free space is inside.
    shift : moves the whole capsule [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.
    """

    def __init__(
        self,
        a: Any = (0.0, 0.0, 0.0),
        b: Any = (0.0, 1.0, 0.0),
        radius: float = 0.25,
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

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        *_, radius, sign = shape
        return sign * (length(_from_line(x, shape)) - radius)

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        d = _from_line(x, shape)
        return scale(shape[-1], along(d, length(d)))

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """Beyond the tangent plane that the first point looks at; a room: all within."""
        *_, radius, sign = shape
        outer, inner = radius + room, radius - room
        first = _from_line(points[0], shape)
        nearest = sub(points[0], first)
        beyond = [dot(sub(p, nearest), first) for p in points]
        far = all_of((d > 0.0) & (outer * outer * dot(first, first) < d * d) for d in beyond)
        ways = [_from_line(p, shape) for p in points]
        within = all_of(dot(d, d) < inner * inner for d in ways) & (inner > 0.0)
        return where(sign > 0.0, far, within)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        quarter = np.linspace(0, np.pi / 2, AROUND // 4 + 1)
        latitude = np.concatenate([quarter, np.pi / 2 + quarter])
        shifts = np.repeat((self.half, -self.half), len(quarter))
        corners, faces = revolved(self.radius * np.sin(latitude), self.radius * np.cos(latitude) + shifts)
        return self.middle + turned(corners, self.direction), faces


def _from_line(x: Triple, shape: Triple) -> Triplet:
    """From the nearest point of the line to x."""
    direction, half = shape[3:6], shape[6]
    part, away = on_axis(x, shape[:3], direction)
    return away + scale(part - minimum(maximum(part, -half), half), direction)
