"""Who was in which row of the frames that pages may still show."""

from __future__ import annotations

from collections import deque

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.frame import Ints

FEWEST = 64  # runs of frames with the same particles that are kept
MOST = 4_000_000  # ids that are kept beyond them


class Rows:
    """Ids by frame and row; frames one after another with the same particles share them.

    So a page that draws one picture in a minute can still name a particle in it, unless particles are born and die.
    """

    def __init__(self) -> None:
        self._runs: deque[tuple[int, int, Ints]] = deque()  # first and last frame, and their ids

    def add(self, sequence: int, ids: Ints) -> None:
        """Remember a frame, later than all others."""
        if self._runs and np.array_equal(self._runs[-1][2], ids):
            first, _, ids = self._runs.pop()
        else:
            first = sequence
        self._runs.append((first, sequence, ids))
        while len(self._runs) > FEWEST and sum(len(run[2]) for run in self._runs) > MOST:
            self._runs.popleft()

    def id(self, sequence: int, row: int) -> int:
        """Of the particle in a row of a frame.

        Raises
        ------
        InvalidInput
            There is none, or it was too long ago.
        """
        for first, last, ids in self._runs:
            if first <= sequence <= last and row < len(ids):
                return int(ids[row])
        raise InvalidInput(f"row {row} of frame {sequence} is not allowed: there is no such particle any more")
