"""What a fish perceives: an eye that sees 300 degrees around, unless something stands in between, and a nose."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Collider

Array = NDArray[np.float64]
BLIND = math.cos(math.radians(150.0))  # of the angle from the body's axis beyond which nothing is seen
RAY = 12  # points of a line of sight that are tested


def in_view(eye: Array, axis: Array, target: Array, radius: Array | float) -> NDArray[np.bool_]:
    """Whether targets, shape (..., 3), are nearer than `radius` and at less than 150 degrees from the axis."""
    way = target - eye
    d = np.sqrt((way * way).sum(axis=-1))
    return np.asarray((d < radius) & ((way * axis).sum(axis=-1) > BLIND * d))


def hidden(eye: Array, target: Array, obstacles: Sequence[Collider], t: float) -> NDArray[np.bool_]:
    """Whether an obstacle stands between eyes and targets, shape (k, 3) each."""
    result = np.zeros(len(eye), bool)
    if not len(eye):
        return result
    for part in (np.arange(RAY) + 0.5) / RAY:
        for obstacle in obstacles:
            result |= obstacle.distance(eye + part * (target - eye), t) < 0
    return result


def nearest(points: Array, targets: Array, most: int, radius: float) -> tuple[NDArray[np.intp], Array]:
    """Numbers of the nearest targets of each point and their distances, shape (n, k); inf where there are fewer.

    Parameters
    ----------
    most : k, or the count of targets if that is less.
    radius : beyond which nothing is looked for [m].
    """
    from scipy.spatial import cKDTree  # on first use: it takes a while

    k = min(most, len(targets))
    if not k:
        return np.zeros((len(points), 0), np.intp), np.zeros((len(points), 0))
    d, found = cKDTree(targets).query(points, k=np.arange(1, k + 1), distance_upper_bound=radius)
    return np.minimum(found, len(targets) - 1).astype(np.intp), np.asarray(d)
