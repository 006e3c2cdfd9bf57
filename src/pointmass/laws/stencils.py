"""Elements that are shifts of a stencil on a row-major grid of particles: cloth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.laws.elements import ElementForce
from pointmass.particles import Particles

Rows = NDArray[np.intp]
FARTHEST = 4  # rows or columns between the nodes of an element
SMALLEST = 16  # rows and columns of what is looked at as a grid


@dataclass(frozen=True)
class Turns:
    """How shifts of a stencil take turns along one axis: those at k go together if k // step % count is the same."""

    step: int
    count: int


@dataclass(frozen=True, eq=False)
class Stencil:
    """Elements of a force that are shifts of each other over the whole grid.

    Attributes
    ----------
    shifts : (row, column) of each node, seen from the corner of the element's box.
    own : number in the force of the element at each corner, shape (m - rows, n - columns).
    """

    force: ElementForce
    shifts: tuple[tuple[int, int], ...]
    own: Rows

    @property
    def box(self) -> tuple[int, int]:
        """Rows and columns between the first and the last node."""
        return max(r for r, _ in self.shifts), max(c for _, c in self.shifts)

    @property
    def turns(self) -> tuple[Turns, Turns]:
        """Turns of rows and of columns, in which no two elements share a particle."""
        beside = {abs(c - d) for r, c in self.shifts for q, d in self.shifts if q == r} - {0}
        return _turns({r for r, _ in self.shifts} - {0}), _turns(beside)

    def colours(self) -> Rows:
        """The colour of the element at each corner, by the turns of rows and then of columns."""
        down, right = self.turns
        row, column = np.arange(self.own.shape[0]), np.arange(self.own.shape[1])
        turn: Rows = (row // down.step % down.count * right.count)[:, None] + column // right.step % right.count
        return turn


@dataclass(frozen=True, eq=False)
class Grid:
    """An island as a grid of m x n particles, row by row."""

    members: Rows
    m: int
    n: int
    stencils: list[Stencil]


def grid(forces: Sequence[ElementForce], particles: Particles, members: Rows) -> Grid | None:
    """The grid that an island is for some forces, if it is one; `members` are its particles, row by row."""
    place = np.full(len(particles), -1, np.intp)
    place[members] = np.arange(len(members))
    found = []
    for force in forces:
        rows = force.rows(particles)
        mine = np.flatnonzero(place[rows[:, 0]] >= 0)
        if len(mine):  # others are those of other islands
            found.append((force, place[rows[mine]], mine))
    distances = [np.unique(abs(nodes[:, 1:] - nodes[:, :1])) for _, nodes, _ in found]
    if not distances or max(map(len, distances)) > 4 * FARTHEST**2:
        return None
    near = {(int(d) + k) // r for d in np.concatenate(distances) for k in (-1, 0, 1) for r in range(1, FARTHEST + 1)}
    for n in sorted(near):
        m = len(members) // n if n >= SMALLEST else 0
        if m >= SMALLEST and m * n == len(members):
            stencils = _stencils(found, m, n)
            if stencils is not None:
                return Grid(members, m, n, stencils)
    return None


def _stencils(found: list[tuple[ElementForce, Rows, Rows]], m: int, n: int) -> list[Stencil] | None:
    """The elements as stencils that cover the whole of a grid of a given width; None if they do not."""
    result = []
    for force, nodes, own in found:
        rows, columns = nodes // n, nodes % n
        top, left = rows.min(axis=1), columns.min(axis=1)
        shifts = np.stack([rows - top[:, None], columns - left[:, None]], axis=2)
        if shifts.max(initial=0) > FARTHEST:
            return None
        kinds, which = np.unique(shifts.reshape(len(nodes), -1), axis=0, return_inverse=True)
        for k, kind in enumerate(kinds):
            stencil = tuple((int(r), int(c)) for r, c in kind.reshape(-1, 2))
            box = np.max(stencil, axis=0)
            mine = np.flatnonzero(which.ravel() == k)
            corners = np.full((m - box[0], n - box[1]), -1, np.intp)
            corners[top[mine], left[mine]] = own[mine]
            if len(mine) != corners.size or (corners < 0).any():
                return None
            result.append(Stencil(force, stencil, corners))
    return result


def _turns(distances: set[int]) -> Turns:
    """Turns of elements that share a particle at these distances, and at no other than their multiples."""
    step = int(np.gcd.reduce(list(distances))) if distances else 1
    return Turns(step, max(distances, default=0) // step + 1)
