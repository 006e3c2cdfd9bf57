"""What was measured over a run: a growing table of numbers, of which each page gets what it has not seen."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.viewer.messages import Column

MOST = 6000  # rows that are remembered
Mark = tuple[int, int]  # generation, and rows of it, that a page has got


@dataclass(frozen=True, eq=False)
class Rows:
    """Some rows of a track: the time [s] and a number for each column, shape (k, 1 + columns)."""

    name: str
    generation: int
    columns: list[Column]
    data: NDArray[Any]
    end: int

    @property
    def mark(self) -> Mark:
        """What a page has seen that has got these."""
        return self.generation, self.end


class Track:
    """A table with a row for each look; one thread adds, others read."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.columns: list[Column] = []
        self._generation = 0
        self._rows: deque[list[float]] = deque(maxlen=MOST)
        self._count = 0
        self._lock = threading.Lock()

    def begin(self, columns: Sequence[Column]) -> None:
        """Forget all, and have these columns."""
        with self._lock:
            self.columns = list(columns)
            self._generation += 1
            self._rows.clear()
            self._count = 0

    def add(self, time: float, values: Sequence[float]) -> None:
        """Add a row; a time that is not after the last one begins anew."""
        if self._rows and time < self._rows[-1][0]:
            self.begin(self.columns)
        with self._lock:
            self._rows.append([time, *values])
            self._count += 1

    def since(self, mark: Mark | None) -> Rows:
        """The rows that somebody has not got."""
        with self._lock:
            seen = mark[1] if mark is not None and mark[0] == self._generation else 0
            fresh = min(self._count - seen, len(self._rows))
            rows = [self._rows[k] for k in range(len(self._rows) - fresh, len(self._rows))]
            data = np.array(rows, np.float64).reshape(fresh, 1 + len(self.columns))
            return Rows(self.name, self._generation, self.columns, data, self._count)
