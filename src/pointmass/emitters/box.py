"""A box that emits particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter
from pointmass.emitters.sphere import Where, check_where
from pointmass.errors import InvalidInput, finite_array


@dataclass(eq=False, repr=False)
class BoxEmitter(ShapedEmitter):
    """Particles evenly spread over a box along the axes; its normals are those of the nearest face.

    Parameters
    ----------
    sides : lengths of its edges [m], greater than 0, but for one that may be 0; the position is in the middle.
    where : "volume" or "surface".
    """

    sides: tuple[float, float, float] = (1.0, 1.0, 1.0)
    where: Where = "volume"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._sides = finite_array("sides", self.sides, (3,))
        check_where(self.where)
        if (self._sides < 0).any() or np.sum(self._sides == 0) > 1:
            raise InvalidInput(f"sides = {self.sides} is not allowed: they must be greater than 0 [m], one may be 0")

    def spot(self, u: Array) -> tuple[Array, Array]:
        place = (u[:, :3] - 0.5) * self._sides
        if self.where == "surface":
            face, side = self._faces(u[:, 3])
        else:
            gap = self._sides / 2 - np.abs(place)
            face = np.argmin(gap, axis=1)
            side = np.where(np.take_along_axis(place, face[:, None], axis=1)[:, 0] < 0, -1.0, 1.0)
        normal = np.zeros_like(place)
        np.put_along_axis(normal, face[:, None], side[:, None], axis=1)
        if self.where == "surface":
            place = np.where(normal != 0, normal * self._sides / 2, place)
        return place, normal

    def _faces(self, u: Array) -> tuple[NDArray[np.intp], Array]:
        """The axis of a face, and on which side of it: as often as it has area."""
        a, b, c = self._sides
        area = np.cumsum([b * c, c * a, a * b])
        spot = 2 * u * area[-1]
        turned = np.where(spot < area[-1], spot, spot - area[-1])
        face = np.minimum(np.searchsorted(area, turned, side="right"), 2)  # of what is rounded to the whole, the last
        return face, np.where(spot < area[-1], -1.0, 1.0)
