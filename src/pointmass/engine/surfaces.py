"""Prints the kernel that keeps triangles and edges between particles out of the colliders.

The laws of the colliders are printed as for particles (`contact`), the rest is `surfaces_text.py`. `SurfaceKernel` is
compiled once for each list of kinds of collider.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Collider
from pointmass.engine.contact import ContactText
from pointmass.engine.lookups import body_of
from pointmass.engine.printing import indented
from pointmass.engine.store import load
from pointmass.particles import Array

PRECISION = 1e-4  # of a triangle's longest edge: how much deeper a point may be than the one that is found
MOST_CUTS = 40  # of a piece of a triangle; each halves, on average, what is left of it
MOST_CORNERS = MOST_CUTS + 4  # of that part
MOST_QUARTERED = 3  # times
PIECE = 7  # numbers of a piece: its corners, and how often it was quartered
SIZES = {"CORNERS": 9, "ROOM": 3, "BEST": 3, "STACK": PIECE * (3 * MOST_QUARTERED + 4), "PART": 4 * MOST_CORNERS}
CONTACT = 15  # numbers of a contact: 3 rows, surface, 3 weights, normal, impulse, 3 of friction, rebound


class SurfaceKernel:
    """The compiled kernel for a list of surfaces and its memory.

    Parameters
    ----------
    surfaces : see `reference.surfaces_of`.
    dtype : of the state, "float64" or "float32".
    """

    def __init__(self, surfaces: Sequence[Collider], dtype: str) -> None:
        self.surfaces = list(surfaces)
        self.contact = ContactText(surfaces, 2, False, dtype)
        self.dtype = dtype
        self.text = "\n".join([self.contact.text, *_constants(), *self._bounds(), body_of("surfaces_text.py")])
        self._details = np.array([s.detail for s in surfaces])
        self._scratch = np.zeros(sum(SIZES.values()) + PIECE)
        self._near, self._contacts = np.zeros((64, 3), np.int64), np.zeros(0)

    def keep_out(
        self,
        x: Array,
        v: Array,
        start: tuple[Array, Array],
        w: Array,
        radius: Array,
        elements: NDArray[np.intp],
        thickness: float,
        times: tuple[float, float],
        rounds: int,
    ) -> int:
        """Push triangles out of the surfaces, in place; how often one was pushed.

        Parameters
        ----------
        x, v : shape (n, 3).
        start : x and v at the start of the step.
        w, radius : inverse masses, 0 for those that are held, and radii, shape (n,).
        elements : rows of the corners, shape (k, 3); an edge has its first end twice: (a, b, a).
        thickness : how far from a surface triangles have to stay [m].
        times : start and end of the step [s].
        rounds : most passes over all that is near.
        """
        table, memory, moved = self.contact.table(), np.zeros(self.contact.record), np.zeros(len(x), np.int64)
        numbers = (w, radius, elements, thickness, *times, rounds)
        while True:
            room = len(self._near)
            if len(self._contacts) < CONTACT * room * rounds:
                self._contacts = np.empty(CONTACT * room * rounds)
            found = (self._near, moved, self._contacts)
            near, pushed = self._function(table, memory, self._scratch, self._details, x, v, *start, *numbers, *found)
            if near <= room:
                return int(pushed)
            self._near = np.zeros((near + near // 2, 3), np.int64)

    @cached_property
    def _function(self) -> Any:
        return load("triangles and colliders", self.text, self.dtype).keep_out

    def _bounds(self) -> list[str]:
        """`bound_of`: a lower bound of the distance, at once."""
        lines = []
        for k, s in enumerate(self.surfaces):
            if s.lookup:
                lines += [f"if k == {k}:", f"    return {s.lookup}_bound(P, {k}, x, y, z)"]
        lines.append("return gap_of(P, C, 0, k, x, y, z)")
        return ["@njit(**FLAGS)", "def bound_of(P, C, k, x, y, z):", *indented(lines, 1), "", ""]


def _constants() -> list[str]:
    starts = np.cumsum([0, *SIZES.values()]).tolist()
    numbers: dict[str, float] = dict(zip(SIZES, starts, strict=False))
    numbers |= {"PRECISION": PRECISION, "MOST_CUTS": MOST_CUTS, "MOST_CORNERS": MOST_CORNERS, "PIECE": PIECE}
    numbers |= {"MOST_QUARTERED": MOST_QUARTERED, "CONTACT": CONTACT}
    return [f"{name} = {value!r}" for name, value in numbers.items()] + ["", ""]
