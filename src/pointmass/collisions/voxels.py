"""A coarse grid around a mesh: how far it is at least, and one of its triangles that are near."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array

PER_TRIANGLE = 8  # voxels
FEWEST, MOST = 30_000, 300_000
LONGEST = 256  # voxels along an axis


class Voxels:
    """Cubes that cover the box of a mesh, and one cube more on all sides.

    Attributes
    ----------
    origin : lower corner [m], shape (3,).
    size : of a cube [m].
    counts : cubes along each axis, shape (3,).
    bounds : lower bound of the signed distance of each cube's middle [m], exact where the mesh may pass through the
        cube, and -1 deep in the solid; z runs fastest. A point of the cube is as much nearer as it is from the middle.
    hints : a triangle near each cube's middle.

    Parameters
    ----------
    corners : of the triangles [m], shape (n, 3, 3).
    distance : the signed distance of points.
    half : half the thickness of a sheet [m].
    """

    def __init__(self, corners: Array, distance: Callable[[Array], Array], half: float) -> None:
        from scipy.ndimage import distance_transform_edt, label, maximum_position

        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        sides = np.maximum(high - low, (high - low).max() / LONGEST)
        target = float(np.clip(PER_TRIANGLE * len(corners), FEWEST, MOST))
        self.size = max(float((sides.prod() / target) ** (1 / 3)), float(sides.max() / LONGEST))
        self.counts = np.ceil((high - low) / self.size).astype(int) + 2
        self.origin = 0.5 * (low + high) - 0.5 * self.size * self.counts
        places, owners, apart = _samples(corners, 0.5 * self.size)
        cubes = np.floor((places - self.origin) / self.size).astype(int)
        taken = np.full(self.counts, -1)
        taken[tuple(cubes.T)] = owners
        away, nearest = distance_transform_edt(taken < 0, return_indices=True)
        self.hints = taken[tuple(nearest)].ravel()
        # A point and the sample that it is nearest to are each up to half a diagonal from the middles of their cubes.
        half_diagonal = 0.5 * np.sqrt(3) * self.size
        least = away * self.size - 2 * half_diagonal - apart
        # What is connected through cubes that the mesh does not pass lies on one side of it.
        parts, count = label(least > 0)
        free = np.ones(count + 1, bool)
        if count:
            found = np.array(maximum_position(least, parts, np.arange(1, count + 1)))
            free[1:] = distance(self._middles(found)) > 0
        bounds = np.where(free[parts], least + half_diagonal - half, -1.0)
        near = np.argwhere(least <= half)
        bounds[tuple(near.T)] = distance(self._middles(near))
        self.bounds: NDArray[np.float64] = bounds.ravel()

    def _middles(self, cubes: NDArray[np.intp]) -> Array:
        """Of cubes, shape (k, 3)."""
        result: Array = self.origin + self.size * (cubes + 0.5)
        return result


def _samples(corners: Array, spacing: float) -> tuple[Array, NDArray[np.intp], float]:
    """Points of the triangles, whose they are, and how far a point of the mesh is from one of them at most [m]."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    cuts = np.maximum(np.ceil(longest / spacing), 1).astype(int)
    places, owners = [], []
    for k in np.unique(cuts):
        i, j = (a.ravel() for a in np.meshgrid(np.arange(k + 1), np.arange(k + 1)))
        i, j = i[i + j <= k], j[i + j <= k]
        weights = np.stack([k - i - j, i, j], axis=1) / k
        rows = np.flatnonzero(cuts == k)
        places.append((weights @ corners[rows]).reshape(-1, 3))
        owners.append(np.repeat(rows, len(weights)))
    # The pieces of a triangle are like it, and a point of one is at most 1/sqrt(3) of its longest side from a corner.
    return np.concatenate(places), np.concatenate(owners), float((longest / cuts).max() / np.sqrt(3))
