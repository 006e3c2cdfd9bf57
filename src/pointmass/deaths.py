"""Who dies of age, and when."""

from __future__ import annotations

from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from pointmass.particles import Array


class Deaths:
    """The hours of death of many particles; asking who is due costs as much as those who are.

    Particles come in batches. Each is sorted, and a heap says which batch has the next death.
    """

    def __init__(self) -> None:
        self._batches: list[tuple[float, int, NDArray[np.int64], Array]] = []
        self._made = 0  # so many batches so far: a number for each, by which equal hours are ordered

    def __bool__(self) -> bool:
        return bool(self._batches)

    def add(self, ids: NDArray[np.int64], death: Array) -> None:
        """Know when some particles die [s], shape (k,); inf = never."""
        mortal = np.isfinite(death)
        order = np.argsort(death[mortal], kind="stable")
        self._push(ids[mortal][order], death[mortal][order])

    def due(self, t: float) -> NDArray[np.int64]:
        """Ids of those whose time has come by t [s]; they are forgotten."""
        found = [np.zeros(0, np.int64)]
        while self._batches and self._batches[0][0] <= t:
            _, _, ids, death = heappop(self._batches)
            count = int(np.searchsorted(death, t, side="right"))
            found.append(ids[:count])
            self._push(ids[count:], death[count:])
        return np.concatenate(found)

    def known(self) -> tuple[NDArray[np.int64], Array]:
        """Ids of all who are going to die, and when [s], in order: another one that is told them knows the same."""
        ids = np.concatenate([np.zeros(0, np.int64), *(batch[2] for batch in self._batches)])
        death = np.concatenate([np.zeros(0), *(batch[3] for batch in self._batches)])
        order = np.lexsort((ids, death))  # whichever batches they came in
        return ids[order], death[order]

    def _push(self, ids: NDArray[np.int64], death: Array) -> None:
        if len(ids):
            heappush(self._batches, (float(death[0]), self._made, ids, death))
            self._made += 1
