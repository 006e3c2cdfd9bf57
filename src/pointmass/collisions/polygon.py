"""A finite flat polygon, tilted as you like: a ramp, a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, Contact, Response
from pointmass.collisions.laws import all_of, along, any_of
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.laws.parameter import Vector
from pointmass.tracing.functions import Number, Triple, dot, length, maximum, minimum, scale, sub, where
from pointmass.tracing.program import Vector as Triplet


class Polygon(Collider):
    """A convex flat plate with two sides. Particles bounce off its faces and fall off its edges.

    Parameters
    ----------
    vertices : corners in order around it [m], shape (k, 3), k at least 3, flat and convex.
    thickness : of the plate [m], greater than 0; the vertices are in its middle and its rim is round.
    shift : moves the whole plate [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.
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
        response: Response = "bounce",
    ) -> None:
        super().__init__(shift, restitution, friction, eps, contact, response)
        self.vertices = finite_array("vertices", vertices, (None, 3))
        self.half = 0.5 * number("thickness", thickness, above=0, unit="m")
        self.direction, self.outward = self._frame()

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        return length(_from_nearest(x, shape)) - shape[-1]

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        d = _from_nearest(x, shape)
        return along(d, length(d), shape[-4:-1])

    @staticmethod
    def apart_law(points: Sequence[Triple], room: Number, *shape: Number) -> Any:
        """All above the plate, all below, or all beyond one of its edges."""
        corners, outward, normal, half = _parts(shape)
        sides = [(corners[0], normal), (corners[0], scale(-1.0, normal)), *zip(corners, outward, strict=True)]
        return any_of(all_of(half + room < dot(sub(p, c), n) for p in points) for c, n in sides)

    @property
    def shape(self) -> tuple[float, ...]:
        """The corners, the directions out of the edges, the normal, half the thickness."""
        return (*self.vertices.ravel().tolist(), *self.outward.ravel().tolist(), *self.direction.tolist(), self.half)

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


def _parts(shape: Triple) -> tuple[list[Triple], list[Triple], Triple, Number]:
    """Corners, directions out of the edges, normal, and half the thickness."""
    *triples, normal = (shape[k : k + 3] for k in range(0, len(shape) - 1, 3))
    return triples[: len(triples) // 2], triples[len(triples) // 2 :], normal, shape[-1]


def _from_nearest(x: Triple, shape: Triple) -> Triplet:
    """From the nearest point of the flat polygon to x."""
    corners, outward, normal, _ = _parts(shape)
    best = scale(dot(sub(x, corners[0]), normal), normal)
    outside = dot(sub(x, corners[0]), outward[0]) > 0.0
    for corner, out in zip(corners[1:], outward[1:], strict=True):
        outside = outside | (dot(sub(x, corner), out) > 0.0)
    nearest = where(outside, np.inf, -1.0)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        edge, way = sub(b, a), sub(x, a)
        part = minimum(maximum(dot(way, edge) / dot(edge, edge), 0.0), 1.0)
        d = sub(way, scale(part, edge))
        closer = dot(d, d) < nearest
        best, nearest = where(closer, d, best), where(closer, dot(d, d), nearest)
    return best
