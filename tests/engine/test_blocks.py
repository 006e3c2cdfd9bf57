"""Where the blocks of a matrix are: each once, in its row and column."""

from __future__ import annotations

import numpy as np
import pytest

from pointmass.engine.blocks import LANES, Layout, layout, slices
from pointmass.engine.forces import incidence

FIRST = np.array([0, 150, 153, 160])  # a large island, and two that are too small for runs


def lattice() -> np.ndarray:
    """Springs between neighbours, next neighbours and some at random, of the large island, and a few of the others."""
    rng = np.random.default_rng(4)
    i = np.arange(150)
    far = [np.c_[i[:-d], i[d:]] for d in (1, 12, 2)]
    odd = rng.integers(0, 150, (40, 2))
    odd = odd[odd[:, 0] != odd[:, 1]]
    small = np.array([[150, 151], [151, 152], [152, 150], [153, 159]])
    return np.concatenate([*far, far[0][20:90], odd, small])  # some neighbours are joined twice


def entries(found: Layout) -> list[tuple[int, int, int]]:
    """(row in the kernel, column, block) of all that a kernel would read."""
    result = []
    for row in range(FIRST[-1]):
        for entry in range(found.ends[row], found.ends[row + 1]):
            result.append((row, int(found.other[entry]), int(found.block[entry])))
    begin = slices(FIRST)
    for island in range(len(FIRST) - 1):
        for piece in range(begin[island], begin[island + 1]):
            for run in range(found.runs[piece], found.runs[piece + 1]):
                row = FIRST[island] + LANES * (piece - begin[island])
                for lane in range(LANES):
                    block = int(found.fill[LANES * run + lane])
                    if block >= 0:
                        result.append((row + lane, int(found.start[run]) + lane, block))
    return sorted(result)


@pytest.mark.parametrize("relative", [True, False])
def test_every_block_is_read_once_in_its_row_and_column(relative: bool) -> None:
    pairs = lattice()
    one, two = pairs[: len(pairs) // 2], pairs[len(pairs) // 2 :]
    found = layout(FIRST, [(incidence(part, FIRST), 2) for part in (one, two)], relative)
    wanted = []
    count = [0, 0, 0]
    for part in (one, two):
        for pair in part:
            island = int(np.searchsorted(FIRST, pair[0], side="right")) - 1
            local = pair - FIRST[island]
            for a in range(2):
                columns = [1 - a] if relative else [0, 1]
                for b in columns:
                    number = count[island] + (0 if relative else 2 * a + b)
                    wanted.append((int(pair[a]), int(local[b]), number))
            count[island] += 1 if relative else 4
    assert entries(found) == sorted(wanted)
    assert found.runs[-1] == found.runs[slices(FIRST)[1]] == found.most > 0
    assert (found.start >= -LANES).all()
    assert (found.start <= 150).all()
