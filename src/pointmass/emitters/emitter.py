"""What every emitter is: a schedule of births, each at its own time and place."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.description import Described

Array = NDArray[np.floating[Any]]
CHILDREN = 40  # bits of an id that count the births of one emitter; the rest name the emitter


@dataclass(frozen=True, eq=False)
class Birth:
    """Particles that are born in a stretch of time.

    Attributes
    ----------
    time : of each birth [s], shape (k,), ascending.
    number : of each birth, counted from the emitter's start, shape (k,): with the emitter's index it makes the id.
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
        return (np.int64(emitter + 1) << CHILDREN) + self.number


class Emitter(Described, ABC):
    """A source of particles."""

    @abstractmethod
    def births(self, t0: float, t1: float, seed: int, stream: str) -> Birth:
        """The particles born in [t0, t1): the same ones however a run is cut into stretches.

        Parameters
        ----------
        seed : of the scene.
        stream : the emitter's own name in it: other emitters draw other numbers.
        """
