"""A disc that emits particles: a nozzle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter, around
from pointmass.errors import InvalidInput, number


@dataclass(eq=False, repr=False)
class Nozzle(ShapedEmitter):
    """Particles evenly spread over a disc at right angles to the direction.

    Parameters
    ----------
    radius : of the disc [m], at least 0.
    """

    radius: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        number("radius", self.radius, at_least=0, unit="m")
        if self._axis is None:
            raise InvalidInput("direction = 'normal' is not allowed for a nozzle, whose disc follows it: give numbers")

    def spot(self, u: Array) -> tuple[Array, Array]:
        normal = np.broadcast_to(np.asarray(self._axis), (len(u), 3))
        return self.radius * np.sqrt(u[:, :1]) * around(normal, u[:, 1]), normal
