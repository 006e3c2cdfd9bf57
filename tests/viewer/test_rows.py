"""Pages name particles by rows of frames that may be old."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.errors import InvalidInput
from pointmass.viewer import rows
from pointmass.viewer.rows import Rows


def test_a_particle_is_found_in_frames_of_long_ago_while_the_particles_stay_the_same() -> None:
    known = Rows()
    for sequence in range(1, 10_000):
        known.add(sequence, np.array([7, 3, 5]) if sequence < 9_000 else np.array([3, 5, 9]))
    assert [known.id(1, row) for row in range(3)] == [7, 3, 5]
    assert (known.id(8_999, 0), known.id(9_000, 0), known.id(9_999, 2)) == (7, 3, 9)
    for sequence, row in ((0, 0), (10_000, 0), (9_999, 3)):
        with pytest.raises(InvalidInput, match=f"row {row} of frame {sequence} is not allowed: there is no such"):
            known.id(sequence, row)


def test_what_is_remembered_of_births_and_deaths_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "MOST", 1000)
    known = Rows()
    for sequence in range(500):
        known.add(sequence, np.arange(sequence, sequence + 100))
    assert known.id(500 - rows.FEWEST, 0) == 500 - rows.FEWEST
    with pytest.raises(InvalidInput, match="there is no such particle any more"):
        known.id(499 - rows.FEWEST, 0)
