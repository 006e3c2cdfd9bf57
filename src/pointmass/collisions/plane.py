"""A plane: floor, wall, incline."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, rows_dot, unit
from pointmass.laws.parameter import Vector


class Plane(Collider):
    """The plane through `point`; particles stay on the side to which `normal` points.

    Parameters
    ----------
    point : any point of it [m]; a function of t moves it.
    normal : direction of the free side.
    restitution, friction, eps, contact : as for every collider.
    """

    bulges: ClassVar[bool] = False
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
    ) -> None:
        super().__init__(point, restitution, friction, eps, contact)
        self.direction = unit("normal", normal)
        self.offset = 0.0

    def local_distance(self, x: Array) -> Array:
        return rows_dot(x, self.direction) - self.offset

    def local_normal(self, x: Array) -> Array:
        return np.broadcast_to(self.direction, x.shape)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        helper = np.eye(3)[int(np.argmin(np.abs(self.direction)))]
        a = np.cross(helper, self.direction)
        a /= np.linalg.norm(a)
        b = np.cross(self.direction, a)
        corners = 0.5 * size * np.array([-a - b, a - b, a + b, b - a]) + self.offset * self.direction
        return corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)
