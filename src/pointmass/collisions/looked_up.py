"""Surfaces whose distance is looked up in data: they take numbers, and the search among them, in place of laws."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider
from pointmass.errors import InvalidInput
from pointmass.tracing.functions import Number, Triple


class LookedUp(Collider):
    """A surface given by data: a mesh, a grid of distances.

    Its distance changes by at most the way between two points, but need be neither convex nor concave along a line:
    paths are marched along (`swept`). It has no bend: it is made of flat pieces, or taken to be.

    Attributes
    ----------
    lookup : name of the text in the engine that does what `look` does, for one point.
    data : what is looked up there, one array of float64; `shape` are the numbers that say what is where.
    """

    data: NDArray[np.float64]
    bulges: ClassVar[bool] = False

    @abstractmethod
    def look(self, x: Array) -> tuple[Array, Array]:
        """Signed distance [m], shape (k,), and its gradient, a unit vector, shape (k, 3), relative to the place."""

    def local_distance(self, x: Array) -> Array:
        return self.look(x)[0]

    def local_normal(self, x: Array) -> Array:
        return self.look(x)[1]

    def bending(self, x: Array, v: Array) -> Array:
        return np.zeros(len(x))

    @staticmethod
    def distance_law(x: Triple, *shape: Number) -> Number:
        raise _no_law()

    @staticmethod
    def normal_law(x: Triple, *shape: Number) -> Triple:
        raise _no_law()

    @property
    def laws(self) -> Any:
        raise _no_law()


def _no_law() -> InvalidInput:
    return InvalidInput("a mesh, a height field and a grid of distances have no formula: use spheres, boxes, capsules")
