"""The lecture's collision test at the end of a step: within eps of the wall, and heading in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, rows_dot
from pointmass.collisions.response import respond


def bounce(surface: Collider, x: Array, v: Array, t: Any, radius: Array, moved: NDArray[np.bool_]) -> None:
    """Respond where (X - P) . N < eps and N . V < 0; in place.

    What has sunk in is put back on the surface, so that a soft bounce cannot leave it stuck below. A fast particle can jump
    through a thin wall between two tests: that is what `contact="swept"` is for.
    """
    gap = surface.distance(x, t) - radius
    normal, motion = surface.normal(x, t), surface.velocity(t)
    hit = moved & (gap < surface.eps) & (rows_dot(normal, v - motion) < 0)
    v[hit] = respond(v, normal, motion, surface.restitution, surface.friction)[hit]
    x[hit] -= np.minimum(gap, 0)[hit, None] * normal[hit]
