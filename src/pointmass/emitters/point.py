"""A point that emits particles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter
from pointmass.random import on_sphere


@dataclass(eq=False, repr=False)
class PointEmitter(ShapedEmitter):
    """Particles from a point; its normals go in all directions alike."""

    def spot(self, u: Array) -> tuple[Array, Array]:
        return np.zeros((len(u), 3)), on_sphere(u[:, :2])
