"""What bodies that are grids of particles have in common: places, names of their parts, neighbours, pins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import pin_parts
from pointmass.collisions.collider import unit
from pointmass.errors import InvalidInput, finite_array, floats, shown, whole_number
from pointmass.particles import Particles

Ids = NDArray[np.int64]
PARALLEL = 1e-6  # sine of the angle between two directions that span no plane


@dataclass(frozen=True)
class Sheet:
    """A flat grid of rows x cols points, row by row from its top left corner.

    Attributes
    ----------
    rows, cols : points along its height and width, at least 2.
    width, height : [m].
    """

    rows: int
    cols: int
    width: float
    height: float

    @property
    def cell(self) -> tuple[float, float]:
        """Width and height of a cell [m]."""
        return self.width / (self.cols - 1), self.height / (self.rows - 1)

    @property
    def number(self) -> Ids:
        """Number of each point, shape (rows, cols)."""
        return np.arange(self.rows * self.cols).reshape(self.rows, self.cols)

    @property
    def share(self) -> NDArray[np.float64]:
        """Cells that belong to each point, shape (rows, cols): 1, half at an edge, a quarter at a corner."""
        return np.outer(_ends_half(self.rows), _ends_half(self.cols))

    @property
    def uv(self) -> NDArray[np.float64]:
        """Place of each point on the pattern, from (0, 0) at the lower left to (1, 1), shape (rows cols, 2)."""
        v, u = np.meshgrid(np.linspace(1, 0, self.rows), np.linspace(0, 1, self.cols), indexing="ij")
        return np.stack([u.ravel(), v.ravel()], axis=1)

    @property
    def triangles(self) -> Ids:
        """Two of each cell, shape (k, 3), with the diagonal along every other way, counter-clockwise."""
        n = self.number
        a, b, c, d = n[:-1, :-1], n[:-1, 1:], n[1:, :-1], n[1:, 1:]
        corners = np.stack([np.stack([a, c, d], axis=-1), np.stack([a, d, b], axis=-1)], axis=2)
        return corners.reshape(-1, 3)

    def pairs(self, down: int, right: int) -> Ids:
        """Points that are so many rows and columns apart (columns may be below 0), shape (k, 2)."""
        n = self.number
        first = n[: self.rows - down, max(0, -right) : self.cols - max(0, right)]
        second = n[down:, max(0, right) : self.cols + min(0, right)]
        return np.stack([first.ravel(), second.ravel()], axis=1)

    def places(self, center: Any, right: Any, down: Any) -> NDArray[np.float64]:
        """Points in space [m], shape (rows cols, 3).

        Parameters
        ----------
        center : of the sheet [m].
        right, down : directions of its rows and of its columns; of `down` only what is at right angles to `right`.
        """
        along = unit("right", right)
        across = unit("down", down)
        across = across - (across @ along) * along
        if np.linalg.norm(across) < PARALLEL:
            raise InvalidInput(
                f"down = {shown(down)} is not allowed: it must not be parallel to right = {shown(right)}"
            )
        across /= np.linalg.norm(across)
        x = np.linspace(-0.5, 0.5, self.cols) * self.width
        y = np.linspace(-0.5, 0.5, self.rows) * self.height
        flat = x[None, :, None] * along + y[:, None, None] * across
        return finite_array("center", center, (3,)) + flat.reshape(-1, 3)

    @property
    def parts(self) -> dict[str, Ids]:
        """Points of each part that has a name."""
        n = self.number
        edges = {"top": n[0], "bottom": n[-1], "left": n[:, 0], "right": n[:, -1]}
        ends = {name: edge[[0, -1]] for name, edge in edges.items()}
        return {
            **{f"{name} edge": edge for name, edge in edges.items()},
            "side edges": np.concatenate([edges["left"], edges["right"]]),
            "edges": np.unique(np.concatenate(list(edges.values()))),
            **{f"{name} corners": both for name, both in ends.items()},
            "corners": np.concatenate([ends["top"], ends["bottom"]]),
            "middle": n[[self.rows // 2], [self.cols // 2]],
        }

    def tag(self, particles: Particles, pinned: Any) -> None:
        """Make groups of the parts, and pin those whose names are in `pinned`.

        Parameters
        ----------
        pinned : the name of a part, a list of names, or "none".
        """
        for name, rows in self.parts.items():
            particles.tag(name, rows)
        pin_parts(particles, pinned)


def sheet(rows: Any, cols: Any, size: Any) -> Sheet:
    """A grid of these counts and this size [m], checked; one number is the length of both sides."""
    m, n = whole_number("rows", rows, at_least=2), whole_number("cols", cols, at_least=2)
    sides = floats(size)
    if sides is None or sides.shape not in ((), (2,)) or not (np.isfinite(sides) & (sides > 0)).all():
        raise InvalidInput(
            f"size = {shown(size)} is not allowed: it must be one length greater than 0, or width and height [m]"
        )
    width, height = np.broadcast_to(sides, 2)
    return Sheet(m, n, float(width), float(height))


def _ends_half(count: int) -> NDArray[np.float64]:
    result = np.ones(count)
    result[[0, -1]] = 0.5
    return result
