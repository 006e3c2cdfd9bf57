"""Places spread evenly over the inside of a closed triangle mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pointmass.emitters.emitter import Array
from pointmass.meshes import TriangleMesh

COLUMNS = 16, 256  # least and most along an axis
PAIRS = 2**22  # of places or columns and triangles that are looked at in one go


class Solid:
    """The inside of a closed mesh, as vertical columns that hold it and the triangles over each.

    A place in a column, from its lowest to its highest triangle, is inside if more surfaces that look up than such that
    look down are above it. So a place that is even over all columns, and is inside, is even over the solid.

    Attributes
    ----------
    filled : which part of the columns is inside.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        corners = mesh.corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._origin = low.min(axis=0)[[0, 2]]
        self._extent = high.max(axis=0)[[0, 2]] - self._origin
        self._side = int(np.clip(4 * np.sqrt(len(corners)), *COLUMNS))
        first, wide = self._under(low, high)
        while wide.prod(axis=1).sum() > PAIRS and self._side > 1:  # large triangles are over many columns
            self._side //= 2
            first, wide = self._under(low, high)
        side, count = self._side, wide.prod(axis=1)
        triangle = np.repeat(np.arange(len(corners)), count)
        k = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)
        column = (first[triangle, 0] + k // wide[triangle, 1]) * side + first[triangle, 1] + k % wide[triangle, 1]
        order = np.argsort(column, kind="stable")
        self._triangles = triangle[order]
        self._start = np.searchsorted(column[order], np.arange(side * side + 1))
        bottom, top = np.full(side * side, np.inf), np.full(side * side, -np.inf)
        np.minimum.at(bottom, column, low[triangle, 1])
        np.maximum.at(top, column, high[triangle, 1])
        height = np.where(top > bottom, top - bottom, 0.0)
        self._bottom, self._height, self._before = bottom, height, np.cumsum(height)
        self.filled = abs(mesh.volume) / float(self._before[-1] * self._extent.prod() / side**2)
        self._prepare(corners)

    def _under(self, low: Array, high: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The first column under each triangle, and how many there are, along both axes, shape (k, 2)."""
        first, last = (np.clip(self._cells(p[:, [0, 2]]), 0, self._side - 1) for p in (low, high))
        first, last = np.maximum(first - 1, 0), np.minimum(last + 1, self._side - 1)  # whatever was rounded
        return first, last - first + 1

    def _cells(self, places: Array) -> NDArray[np.intp]:
        cells: NDArray[np.intp] = np.floor((places - self._origin) / self._extent * self._side).astype(np.intp)
        return cells

    def _prepare(self, corners: Array) -> None:
        """For each triangle its sides seen from above, each always in the same direction, whichever triangle asks."""
        a, b = corners, np.roll(corners, -1, axis=1)
        swap = (a[..., 0] > b[..., 0]) | ((a[..., 0] == b[..., 0]) & (a[..., 2] > b[..., 2]))
        self._from, self._to = (
            np.where(swap[..., None], b, a)[..., [0, 2]],
            np.where(swap[..., None], a, b)[..., [0, 2]],
        )
        self._swap, self._y = swap, np.roll(corners[:, :, 1], 1, axis=1)  # opposite to each side

    def places(self, u: Array) -> Array:
        """Places that are even over the columns, from four numbers in [0, 1) each, shape (k, 4)."""
        spot = u[:, 3] * self._before[-1]
        column = np.minimum(np.searchsorted(self._before, spot, side="right"), len(self._before) - 1)
        corner = np.stack([column // self._side, column % self._side], axis=1)
        x, z = (self._origin + (corner + u[:, [0, 2]]) / self._side * self._extent).T
        return np.stack([x, self._bottom[column] + u[:, 1] * self._height[column], z], axis=1)

    def holds(self, x: Array) -> NDArray[np.bool_]:
        """Whether places are inside, shape (k,)."""
        cells = self._cells(x[:, [0, 2]])
        inside = ((cells >= 0) & (cells < self._side)).all(axis=1)
        column = np.where(inside, cells[:, 0] * self._side + cells[:, 1], 0)
        count = np.where(inside, self._start[column + 1] - self._start[column], 0)
        ends, result, lo = np.cumsum(count), np.zeros(len(x), bool), 0
        while lo < len(x):
            before = ends[lo] - count[lo]
            hi = max(lo + 1, int(np.searchsorted(ends, before + PAIRS, side="right")))
            result[lo:hi] = self._over(x[lo:hi], column[lo:hi], count[lo:hi]) > 0
            lo = hi
        return result

    def _over(self, x: Array, column: NDArray[np.intp], count: NDArray[np.intp]) -> NDArray[np.int64]:
        """How many triangles above each place look up, less those that look down, shape (k,)."""
        whose = np.repeat(np.arange(len(x)), count)
        k = np.arange(len(whose)) - np.repeat(np.cumsum(count) - count, count)
        t, p = self._triangles[self._start[column][whose] + k], x[whose]
        side = self._to[t] - self._from[t]
        off = p[:, None, [0, 2]] - self._from[t]
        turn = (
            side[..., 1] * off[..., 0] - side[..., 0] * off[..., 1]
        )  # above 0 where p is to the left, seen from above
        left = (turn >= 0) != self._swap[t]
        within = left.all(axis=1) | ~left.any(axis=1)
        weight = np.abs(turn)
        y = (weight * self._y[t]).sum(axis=1) / np.where(within, weight.sum(axis=1), 1)
        above = within & (y > p[:, 1])
        look = np.where(left[:, 0], 1, -1)
        return np.bincount(whose, np.where(above, look, 0), len(x)).round().astype(np.int64)
