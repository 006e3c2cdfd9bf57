"""What every emitter is: a schedule of births, each at its own time and place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.impacts import Impacts
from pointmass.collisions.swept import Paths
from pointmass.description import Described

Array = NDArray[np.floating[Any]]
CHILDREN = 40  # bits of an id that count the births of one emitter; the rest name the emitter
HASHED = 2**62  # numbers from here on are ids by themselves


@dataclass(frozen=True, eq=False)
class Birth:
    """Particles that are born in a stretch of time.

    Attributes
    ----------
    time : of each birth [s], shape (k,), ascending if they have no parents.
    number : of each birth, counted from the emitter's start, shape (k,): with the emitter's index it makes the id; or
        an id itself, if it is at least 2^62.
    x, v : positions [m] and velocities [m/s], shape (k, 3).
    lifetime : [s], shape (k,); inf = for ever.
    columns : mass [kg], radius [m] and other columns by name, each a number or of shape (k,).
    """

    time: Array
    number: NDArray[np.int64]
    x: Array
    v: Array
    lifetime: Array
    columns: dict[str, Any]

    def ids(self, emitter: int) -> NDArray[np.int64]:
        """Ids that no other particle of the run has or will have."""
        return np.where(self.number < HASHED, (np.int64(emitter + 1) << CHILDREN) + self.number, self.number)

    def take(self, rows: NDArray[np.intp] | slice) -> Birth:
        """Some of them."""
        columns = {name: self.column(name)[rows] for name in self.columns}
        arrays = (self.time[rows], self.number[rows], self.x[rows], self.v[rows], self.lifetime[rows])
        return Birth(*arrays, columns)

    def parted(self, times: Array) -> list[Birth]:
        """Those between each two of some times that follow each other, if all are in order of time."""
        ends = np.searchsorted(self.time, times).tolist()
        return [self.take(slice(a, b)) for a, b in pairwise(ends)]

    def column(self, name: str) -> Array:
        """A column, of the number that particles have by default if the emitter does not set it, shape (k,)."""
        return np.broadcast_to(self.columns.get(name, 1.0 if name == "m" else 0.0), self.time.shape)

    @property
    def death(self) -> Array:
        """When each dies [s], shape (k,)."""
        return self.time + self.lifetime


NOBODY = Birth(np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), {})


@dataclass(frozen=True, eq=False)
class Parents:
    """Particles of one emitter in a stretch of time, for an emitter that follows them.

    Attributes
    ----------
    ids : shape (k,).
    birth, death : of each [s], shape (k,); a death before its time, by a surface or in a zone, is at the end.
    newborn : whether each was born in this stretch, shape (k,).
    paths : of each, from the beginning of the stretch, or its birth if that is later, to the end.
    impacts : on surfaces; their rows are those of the parents.
    step : number of the stretch.
    """

    ids: NDArray[np.int64]
    birth: Array
    death: Array
    newborn: NDArray[np.bool_]
    paths: Paths
    impacts: Impacts
    step: int


class Emitter(Described, ABC):
    """A source of particles.

    Attributes
    ----------
    name : by which others can follow it.
    of : name of the emitter whose particles it follows, "" if it follows nobody.
    attributes_made : names of the particle attributes that it sets.
    at_impacts : whether particles that it follows have children where they hit surfaces.
    """

    name: str = ""
    of: str = ""
    attributes_made: tuple[str, ...] = ()
    at_impacts: bool = False

    @abstractmethod
    def births(self, t0: float, t1: float, seed: int, stream: str) -> Birth:
        """The particles born in [t0, t1): the same ones however a run is cut into stretches.

        Parameters
        ----------
        seed : of the scene.
        stream : the emitter's own name in it: other emitters draw other numbers.
        """

    def offspring(self, parents: Parents, t0: float, t1: float, seed: int, stream: str) -> Birth:
        """The particles that parents have in a step from t0 to t1, for an emitter that follows others."""
        return NOBODY

    def awaits(self, parents: Parents, t1: float, perilous: bool) -> NDArray[np.bool_]:
        """Of which parents it needs the paths until t1, shape (k,).

        Parameters
        ----------
        perilous : whether parents may die before their time.
        """
        return np.zeros(len(parents.ids), bool)
