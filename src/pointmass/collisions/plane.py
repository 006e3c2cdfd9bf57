"""A plane: floor, wall, incline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, Response, unit
from pointmass.collisions.laws import all_of
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, dot


class Plane(Collider):
    """The plane through `point`; particles stay on the side to which `normal` points.

    Parameters
    ----------
    point : any point of it [m]; a function of t moves it.
    normal : direction of the free side.
    restitution, friction, eps, contact, response : as for every collider.
    """

    bulges: ClassVar[bool] = False
    curved: ClassVar[bool] = False
    place: ClassVar[str] = "point"

    def __init__(
        self,
        point: Vector = (0.0, 0.0, 0.0),
        normal: Any = (0.0, 1.0, 0.0),
        *,
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        super().__init__(point, restitution, friction, eps, contact, response)
        self.direction = unit("normal", normal)
        self.offset = 0.0

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        return dot(x, shape[:3]) - shape[3]

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        return shape[:3]

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        return all_of(dot(p, shape[:3]) > shape[3] + room for p in points)

    @property
    def shape(self) -> tuple[float, ...]:
        return (*self.direction.tolist(), self.offset)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        helper = np.eye(3)[int(np.argmin(np.abs(self.direction)))]
        a = np.cross(helper, self.direction)
        a /= np.linalg.norm(a)
        b = np.cross(self.direction, a)
        corners = 0.5 * size * np.array([-a - b, a - b, a + b, b - a]) + self.offset * self.direction
        return corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)
