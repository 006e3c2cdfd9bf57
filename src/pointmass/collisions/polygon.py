"""A finite flat polygon, tilted as you like: a ramp, a table."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, directions, lengths, rows_dot
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.laws.parameter import Vector


class Polygon(Collider):
    """A convex flat plate with two sides. Particles bounce off its faces and fall off its edges.

    Parameters
    ----------
    vertices : corners in order around it [m], shape (k, 3), k at least 3, flat and convex.
    thickness : of the plate [m], greater than 0; the vertices are in its middle and its rim is round.
    shift : moves the whole plate [m]; a function of t.
    restitution, friction, eps, contact : as for every collider.
    """

    place: ClassVar[str] = "shift"

    def __init__(
        self,
        vertices: Any,
        *,
        thickness: float = 2e-3,
        shift: Vector = (0.0, 0.0, 0.0),
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
    ) -> None:
        super().__init__(shift, restitution, friction, eps, contact)
        self.vertices = finite_array("vertices", vertices, (None, 3))
        self.half = 0.5 * number("thickness", thickness, above=0, unit="m")
        self.direction, self.outward = self._frame()

    def local_distance(self, x: Array) -> Array:
        return lengths(x - self._nearest(x)) - self.half

    def local_normal(self, x: Array) -> Array:
        d = x - self._nearest(x)
        return directions(d, lengths(d), self.direction)

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        k = len(self.vertices)
        lift = self.half * self.direction
        fan = np.array([[0, i, i + 1] for i in range(1, k - 1)])
        rim = [[[i, (i + 1) % k, k + i], [(i + 1) % k, k + (i + 1) % k, k + i]] for i in range(k)]
        faces = np.concatenate([fan, fan[:, ::-1] + k, np.array(rim)[:, :, ::-1].reshape(-1, 3)])
        return np.concatenate([self.vertices + lift, self.vertices - lift]), faces.astype(np.int32)

    def _frame(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Unit normal, and for each edge the unit vector that points out of the polygon in its plane."""
        p = self.vertices
        edges = np.roll(p, -1, axis=0) - p
        area = 0.5 * np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0) if len(p) else np.zeros(3)
        size = float(np.linalg.norm(area))
        span = float(np.abs(p - p.mean(axis=0)).max()) if len(p) else 0.0
        if len(p) < 3 or size <= 1e-12 * span * span or (np.abs(edges).max(axis=1) == 0).any():
            raise InvalidInput("vertices of a polygon must be at least 3 different points that are not on one line")
        n = area / size
        if np.abs((p - p[0]) @ n).max() > 1e-6 * span:
            raise InvalidInput("vertices of a polygon must lie in one plane: split it into triangles")
        outward = np.cross(edges, n)
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        if (np.einsum("ekj,ej->ek", p[None] - p[:, None], outward) > 1e-6 * span).any():
            raise InvalidInput("vertices of a polygon must go around it in order and it must be convex: split it")
        return n, outward

    def _depths(self, x: Array) -> Array:
        """How far points are outside of each edge, shape (k, edges)."""
        return np.stack([rows_dot(x - p, o) for p, o in zip(self.vertices, self.outward, strict=True)], axis=1)

    def _nearest(self, x: Array) -> Array:
        """Nearest points of the polygon, shape (k, 3)."""
        n = self.direction
        best = x - rows_dot(x - self.vertices[0], n)[:, None] * n
        outside = (self._depths(x) > 0).any(axis=1)
        distance = np.where(outside, np.inf, -1.0)
        for a, b in zip(self.vertices, np.roll(self.vertices, -1, axis=0), strict=True):
            along = np.clip(rows_dot(x - a, b - a) / rows_dot(b - a, b - a), 0, 1)[:, None]
            point = a + along * (b - a)
            d2 = rows_dot(x - point, x - point)
            closer = d2 < distance
            best, distance = np.where(closer[:, None], point, best), np.where(closer, d2, distance)
        return best
