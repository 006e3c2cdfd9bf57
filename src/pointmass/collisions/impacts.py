"""Which particles have hit surfaces in a step: when, where and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Collider, rows_dot


@dataclass(frozen=True, eq=False)
class Impacts:
    """Impacts of one step.

    Attributes
    ----------
    rows : of the particles, shape (k,).
    time : [s], shape (k,).
    x : where the particles were then [m], shape (k, 3).
    v : velocities after the impact [m/s], shape (k, 3).
    normal : of the surface, to the free side, shape (k, 3).
    speed : into the surface before the impact, relative to it and along the normal [m/s], shape (k,).
    """

    rows: NDArray[np.intp]
    time: Array
    x: Array
    v: Array
    normal: Array
    speed: Array

    @classmethod
    def at(cls, surface: Collider, rows: NDArray[np.intp], time: Array, x: Array, before: Array, v: Array) -> Impacts:
        """Impacts on one surface, with the velocities before and after, shape (k, 3) each."""
        normal = surface.normal(x, time)
        into = -rows_dot(normal, before - surface.velocity(time))
        arrays = (np.array(a, np.float64) for a in (time, x, v, normal, into))
        return cls(rows, *arrays)

    @classmethod
    def of(cls, parts: Sequence[Impacts]) -> Impacts:
        """All of several lists, particle by particle and each one's in order of time."""
        if not parts:
            return NO_IMPACTS
        every = cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))
        return every.take(np.lexsort((every.time, every.rows)))

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_]) -> Impacts:
        """Some of them."""
        return Impacts(*(getattr(self, f.name)[which] for f in fields(self)))

    @property
    def turn(self) -> NDArray[np.int64]:
        """How many its particle had before in this step, shape (k,); they are particle by particle."""
        first = np.searchsorted(self.rows, self.rows)
        return np.arange(len(self.rows)) - first


NO_IMPACTS = Impacts(
    np.zeros(0, np.intp), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
)
