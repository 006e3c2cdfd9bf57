"""A sphere, from outside or inside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, Response
from pointmass.collisions.laws import all_of, along
from pointmass.collisions.revolution import AROUND, revolved
from pointmass.errors import number
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, dot, length, where


class Sphere(Collider):
    """A ball that particles bounce off, or with `inside` a bowl that holds them.

    Parameters
    ----------
    center : [m]; a function of t moves it.
    radius : [m], greater than 0.
    inside : whether the free space is inside.
    restitution, friction, eps, contact, response : as for every collider.
    """

    bulges: ClassVar[bool]
    smooth: ClassVar[bool] = True

    def __init__(
        self,
        center: Vector = (0.0, 0.0, 0.0),
        radius: float = 1.0,
        *,
        inside: bool = False,
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        super().__init__(center, restitution, friction, eps, contact, response)
        self.radius = number("radius", radius, above=0, unit="m")
        self.bulges = not inside  # type: ignore[misc]  # a property of this sphere
        self.sign = -1.0 if inside else 1.0

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        radius, sign = shape
        return sign * (length(x) - radius)

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        radial = along(x, length(x))
        return shape[1] * radial[0], shape[1] * radial[1], shape[1] * radial[2]

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """Beyond the tangent plane that the first point looks at; a bowl: all within."""
        radius, sign = shape
        first, outer, inner = points[0], radius + room, radius - room
        beyond = [dot(p, first) for p in points]
        far = all_of((d > 0.0) & (outer * outer * dot(first, first) < d * d) for d in beyond)
        within = all_of(dot(p, p) < inner * inner for p in points) & (inner > 0.0)
        return where(sign > 0.0, far, within)

    @property
    def shape(self) -> tuple[float, ...]:
        return self.radius, self.sign

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        latitude = np.linspace(0, np.pi, AROUND // 2 + 1)
        return revolved(self.radius * np.sin(latitude), self.radius * np.cos(latitude))
