"""What bodies that are blocks of particles have in common: places, names of their parts, neighbours, surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array, number
from pointmass.tracing import functions as fn

Ids = NDArray[np.int64]
Step = tuple[int, int, int]  # from a particle to its neighbour along x, y and z
SIDES = {"left": (0, 0), "right": (0, -1), "bottom": (1, 0), "top": (1, -1), "back": (2, 0), "front": (2, -1)}
FLAT = ([2, 1], [0, 2], [0, 1])  # axes of the pattern on a face across x, y and z: from left to right, and up
STEPS: tuple[Step, ...] = tuple(
    d for d in product((-1, 0, 1), (-1, 0, 1), (-1, 0, 1)) if d > (0, 0, 0)
)  # to half of all neighbours


@dataclass(frozen=True)
class Block:
    """Particles in rows along x, y and z; z runs fastest.

    Attributes
    ----------
    counts : of particles along each side, at least 2.
    size : lengths of the sides [m].
    """

    counts: tuple[int, int, int]
    size: tuple[float, float, float]

    @property
    def cell(self) -> NDArray[np.float64]:
        """Sides of a cell [m]."""
        return np.asarray(np.array(self.size) / (np.array(self.counts) - 1))

    @property
    def number(self) -> Ids:
        """Number of each particle, shape `counts`."""
        return np.arange(math.prod(self.counts)).reshape(self.counts)

    @property
    def grid(self) -> Ids:
        """Which particle along x, y and z each is, shape (n, 3)."""
        return np.ascontiguousarray(np.indices(self.counts).reshape(3, -1).T)

    @property
    def straight(self) -> NDArray[np.float64]:
        """Particles around the origin, with sides along the axes [m], shape (n, 3)."""
        return np.asarray((self.grid - (np.array(self.counts) - 1) / 2) * self.cell)

    @property
    def share(self) -> NDArray[np.float64]:
        """Cells that belong to each particle, shape (n,): 1, half on a face, a quarter at an edge, an eighth."""
        return np.asarray(_shared(self.grid, (0, 0, 0), self.counts))

    def steps(self, length: int) -> list[Step]:
        """Steps along so many of the axes: 1 = edges of cells, 2 = diagonals of faces, 3 = of the body."""
        return [d for d in STEPS if sum(map(abs, d)) == length]

    def pairs(self, step: Step) -> tuple[Ids, NDArray[np.float64]]:
        """Particles that are a step apart, shape (k, 2), and the part of each pair that lies in cells, shape (k,):
        1, half on a face of the block, a quarter at an edge."""
        shift = np.array(step)
        first = self.grid[((self.grid + shift >= 0) & (self.grid + shift < self.counts)).all(axis=1)]
        stride = np.array([self.counts[1] * self.counts[2], self.counts[2], 1])
        return np.stack([first @ stride, (first + shift) @ stride], axis=1), _shared(first, step, self.counts)

    def places(self, center: Any, tilt: Any) -> NDArray[np.float64]:
        """Particles in space [m], shape (n, 3).

        Parameters
        ----------
        center : of the block [m].
        tilt : turn about z and then about x by this angle [degrees].
        """
        return finite_array("center", center, (3,)) + _turned(self.straight, number("tilt", tilt, unit="degrees"))

    @property
    def parts(self) -> dict[str, Ids]:
        """Particles of each part that has a name."""
        n = self.number
        faces = {name: np.take(n, end, axis=axis) for name, (axis, end) in SIDES.items()}
        corners = {name: face[[0, 0, -1, -1], [0, -1, 0, -1]] for name, face in faces.items()}
        return {
            **{name: face.ravel() for name, face in faces.items()},
            "surface": np.unique(np.concatenate([face.ravel() for face in faces.values()])),
            **{f"{name} corners": corners[name] for name in ("top", "bottom")},
            "corners": np.concatenate([corners["bottom"], corners["top"]]),
        }

    @property
    def triangles(self) -> tuple[Ids, NDArray[np.float64]]:
        """Of the surface: corners, counter-clockwise seen from outside, shape (k, 3), and their places on the pattern,
        shape (k, 3, 2), which covers each of the six faces."""
        found = [self._face(axis, end) for axis, end in SIDES.values()]
        return np.concatenate([corners for corners, _ in found]), np.concatenate([uv for _, uv in found])

    def _face(self, axis: int, end: int) -> tuple[Ids, NDArray[np.float64]]:
        """Two triangles of each cell of one face."""
        n = np.take(self.number, end, axis=axis)
        if (axis == 1) == (end == -1):  # x cross z is -y: that face looks outwards at its other end
            n = n.T
        a, b, c, d = n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]
        corners = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2).reshape(-1, 3)
        part = self.grid / (np.array(self.counts) - 1)
        return corners, part[corners][:, :, FLAT[axis]]


def block(counts: Any, size: Any) -> Block:
    """A block of these counts and this size [m], checked."""
    along = finite_array("counts", counts, (3,))
    if (along < 2).any() or (along != np.floor(along)).any():
        raise InvalidInput(
            f"counts = {counts} is not allowed: along each side a lattice has a whole number of particles, at least 2"
        )
    sides = finite_array("size", size, (3,))
    if (sides <= 0).any():
        raise InvalidInput(f"size = {size} is not allowed: each side must be greater than 0 [m]")
    (i, j, k), (x, y, z) = (int(c) for c in along), (float(s) for s in sides)
    return Block((i, j, k), (x, y, z))


def _shared(places: Ids, step: Step, counts: tuple[int, int, int]) -> NDArray[np.float64]:
    """Part of the cells around it that each has, if it does not run along an axis and begins at an end of that."""
    result = np.ones(len(places))
    for axis, along in enumerate(step):
        if along == 0:
            result *= np.where(np.isin(places[:, axis], (0, counts[axis] - 1)), 0.5, 1.0)
    return result


def _turned(x: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """Points turned about z, then about x; no matrix product, whose rounding depends on the machine."""
    c, s = fn.cos(math.radians(degrees)), fn.sin(math.radians(degrees))
    a, b = c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]
    return np.stack([a, c * b - s * x[:, 2], s * b + c * x[:, 2]], axis=1)
