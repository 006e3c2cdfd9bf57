"""The lecture's collision test at the end of a step: within eps of the wall, and heading in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, rows_dot
from pointmass.collisions.response import respond


def bounce(
    surface: Collider, x: Array, v: Array, t: Array, radius: Array, moved: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Respond where (X - P) . N < eps and N . V < 0; in place. Returns who did.

    What has sunk in is put back on the surface, so that a soft bounce cannot leave it stuck below. A fast particle
    can jump through a thin wall between two tests: that is what `contact="swept"` is for.
    """
    gap = surface.distance(x, t) - radius
    hit = moved & (gap < surface.eps)
    if hit.any():
        rows = np.flatnonzero(hit)
        normal, motion = surface.normal(x[rows], t[rows]), surface.velocity(t[rows])
        hit[rows] = rows_dot(normal, v[rows] - motion) < 0
        rows, normal = rows[hit[rows]], normal[hit[rows]]
        motion = surface.velocity(t[rows])
        v[rows] = respond(v[rows], normal, motion, *surface.impact)
        x[rows] -= np.where(gap[rows] < 0, gap[rows], 0)[:, None] * normal
    return hit
