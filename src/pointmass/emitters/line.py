"""A line that emits particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pointmass.collisions.collider import unit
from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter, around
from pointmass.errors import finite_array


@dataclass(eq=False, repr=False)
class LineEmitter(ShapedEmitter):
    """Particles evenly spread over a line; its normals are at right angles to it.

    Parameters
    ----------
    extent : from one end to the other [m]; the position is in the middle.
    """

    extent: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._extent, self._along = finite_array("extent", self.extent, (3,)), unit("extent", self.extent)

    def spot(self, u: Array) -> tuple[Array, Array]:
        place = (u[:, :1] - 0.5) * self._extent
        return place, around(np.broadcast_to(self._along, place.shape), u[:, 1])
