"""What bodies of revolution have in common: an axis between two points, and a mesh around it."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.collisions.collider import Array, Collider, unit
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.tracing.functions import Number, Triple, dot, scale, sub
from pointmass.tracing.program import Vector as Triplet

AROUND = 64  # corners of a circle


class Round(Collider):
    """A body around a piece of an axis, with one radius: see `Capsule` and `Cylinder`.

    Attributes
    ----------
    middle, direction, half : of the axis: its middle [m], a unit vector along it, half its length [m].
    radius : [m].
    sign : 1 if the free space is outside, -1 if it is inside.
    """

    bulges: ClassVar[bool]
    smooth: ClassVar[bool] = True
    place: ClassVar[str] = "shift"
    middle: Array
    direction: Array
    half: float

    def _around(self, a: Any, b: Any, radius: float, inside: bool) -> None:
        """Lie around the axis from `a` to `b`."""
        self.middle, self.direction, self.half = axis_between(a, b)
        self.radius = number("radius", radius, above=0, unit="m")
        self.bulges = not inside  # type: ignore[misc]  # a property of this body
        self.sign = -1.0 if inside else 1.0

    @property
    def shape(self) -> tuple[float, ...]:
        """The middle of the axis, its direction, half its length, the radius, the side of the free space."""
        return (*self.middle.tolist(), *self.direction.tolist(), self.half, self.radius, self.sign)


def axis_between(a: Any, b: Any) -> tuple[Array, Array, float]:
    """Middle, direction and half the length of the axis from `a` to `b` [m].

    Raises
    ------
    InvalidInput
        The two are not finite, or at the same place.
    """
    a, b = finite_array("a", a, (3,)), finite_array("b", b, (3,))
    half = 0.5 * float(np.linalg.norm(b - a))
    if not half > 0:
        raise InvalidInput(f"a and b must be two different points [m], but both are {a.tolist()}: use a sphere")
    return 0.5 * (a + b), unit("b - a", b - a), half


def on_axis(x: Triple, middle: Triple, direction: Triple) -> tuple[Number, Triplet]:
    """How far along the axis a point is from the middle [m], and its way from the axis."""
    d = sub(x, middle)
    along = dot(d, direction)
    return along, sub(d, scale(along, direction))


def revolved(radius: ArrayLike, height: ArrayLike) -> tuple[Array, NDArray[np.int32]]:
    """Corners and triangles of a closed surface around the y axis.

    Parameters
    ----------
    radius, height : of its profile from the upper end to the lower one [m]; the radius is 0 at both ends, and only
        there. A point that comes twice makes a sharp edge.
    """
    r, h = np.asarray(radius, np.float64), np.asarray(height, np.float64)
    ends = np.outer(h[[0, -1]], (0.0, 1.0, 0.0))
    r, h = r[1:-1], h[1:-1]
    angle = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
    rings = np.stack(np.broadcast_arrays(np.outer(r, np.cos(angle)), h[:, None], np.outer(r, np.sin(angle))), axis=-1)
    i, j = np.meshgrid(np.flatnonzero((np.diff(r) != 0) | (np.diff(h) != 0)), np.arange(AROUND), indexing="ij")
    here, right = i * AROUND + j, i * AROUND + (j + 1) % AROUND
    quads = np.stack([here, right, right + AROUND, here + AROUND], axis=-1).reshape(-1, 4)
    k, last = np.arange(AROUND), (len(r) - 1) * AROUND
    top = np.stack([np.full(AROUND, r.size * AROUND), (k + 1) % AROUND, k], axis=1)
    bottom = np.stack([np.full(AROUND, r.size * AROUND + 1), last + k, last + (k + 1) % AROUND], axis=1)
    faces = np.concatenate([top, quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], bottom])
    return np.concatenate([rings.reshape(-1, 3), ends]), faces.astype(np.int32)


def turned(corners: Array, direction: Array) -> Array:
    """Corners with the y axis turned to a direction, a unit vector."""
    side = np.cross(np.eye(3)[int(np.argmin(np.abs(direction)))], direction)
    side /= np.linalg.norm(side)
    result: Array = corners @ np.stack([side, direction, np.cross(side, direction)])
    return result
