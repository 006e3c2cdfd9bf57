"""How the 3x3 blocks of a sparse matrix lie in a kernel, so that its product with a vector runs in vector lanes.

Rows are taken in slices of `LANES`. Where many rows of a slice have a block in the column that is equally far from
them, as in whatever is numbered row by row, those blocks are a run: they lie side by side, their columns do so by
themselves, and nothing is looked up. All other blocks are listed row by row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.forces import Incidence

LANES = 64  # rows of a slice
FEWEST = LANES // 2  # blocks of a run: more bytes for each than when it is looked up, but no index
PARTS = ("ends", "other", "block", "runs", "start", "fill")

Whole = NDArray[np.integer]


@dataclass(frozen=True)
class Kind:
    """Blocks of one shape.

    Attributes
    ----------
    name : of its arrays in the kernel: the parts of a `Layout`, K (blocks as elements make them) and R (those in runs).
    relative : whether a block is symmetric, and multiplies the difference of what its two ends have.
    families : numbers of the families of elements.
    """

    name: str
    relative: bool
    families: tuple[int, ...]

    @property
    def size(self) -> int:
        """Numbers of a block."""
        return 6 if self.relative else 9

    @property
    def arrays(self) -> list[str]:
        """Names of the parts of its layout."""
        return [f"{self.name}_{part}" for part in PARTS]


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the blocks of a kind are; rows, columns and blocks are numbered within their island.

    Attributes
    ----------
    ends : start of each row in `other` and `block`, which have the blocks that are in no run, shape (rows + 1,).
    other : column of a block.
    block : number of a block.
    runs : start of each slice in `start`, shape (slices + 1,).
    start : column that belongs to the first row of the slice in a run; may be up to `LANES` outside.
    fill : block of each lane of a run, -1 where there is none, shape (runs * LANES,).
    most : runs of an island at most.
    """

    ends: Whole
    other: Whole
    block: Whole
    runs: Whole
    start: Whole
    fill: Whole
    most: int

    @property
    def arrays(self) -> list[Whole]:
        """What the kernel reads, in order."""
        return [getattr(self, part) for part in PARTS]


def slices(first: Whole) -> NDArray[np.int64]:
    """First slice of each island, shape (islands + 1,), from the first rows."""
    return np.concatenate([[0], np.cumsum(-(-np.diff(first) // LANES))]).astype(np.int64)


def layout(first: Whole, families: Sequence[tuple[Incidence, int]], relative: bool) -> Layout:
    """Find the runs.

    Parameters
    ----------
    first : first row of each island, shape (islands + 1,).
    families : incidence and nodes of an element of each.
    relative : whether an element is one block for both of its rows, or one for each two of its nodes.
    """
    row, other, block = _entries(first, families, relative)
    island = np.searchsorted(first, row, side="right") - 1
    begin, n = slices(first), int(np.diff(first).max(initial=1))
    local = row - first[island]
    piece, lane = begin[island] + local // LANES, local % LANES
    key = (piece * (2 * n) + (other - local) + n) * LANES + lane
    order = np.argsort(key, kind="stable")
    key = key[order]
    rank = _counted(np.diff(key, prepend=-1) != 0)  # of blocks with the same ends
    line = key // LANES * (int(rank.max(initial=0)) + 1) + rank
    by = np.argsort(line, kind="stable")
    order, line = order[by], line[by]
    starts = np.flatnonzero(np.diff(line, prepend=-1))
    counts = np.diff(np.append(starts, len(line)))
    enough = (counts >= FEWEST) & (np.diff(first)[island[order[starts]]] >= LANES)
    heads = order[starts[enough]]
    inside = order[np.repeat(enough, counts)]
    fill = np.full((len(heads), LANES), -1, np.int32)
    fill[np.repeat(np.arange(len(heads)), counts[enough]), lane[inside]] = block[inside]
    runs = np.concatenate([[0], np.cumsum(np.bincount(piece[heads], minlength=begin[-1]))]).astype(np.int64)
    rest = np.ones(len(row), np.bool_)
    rest[inside] = False
    ends = np.searchsorted(row[rest], np.arange(first[-1] + 1), side="left").astype(np.int64)
    start = (other - lane)[heads].astype(np.int32)
    most = int(np.diff(runs[begin]).max(initial=0))
    return Layout(ends, other[rest].astype(np.int32), block[rest].astype(np.int32), runs, start, fill.ravel(), most)


def _entries(first: Whole, families: Sequence[tuple[Incidence, int]], relative: bool) -> tuple[Whole, Whole, Whole]:
    """Row in the kernel, column and number of every block, by rows."""
    before = np.zeros(len(first) - 1, np.int64)  # blocks of each island in the families so far
    found = []
    for one, nodes in families:
        row = np.repeat(np.arange(first[-1]), np.diff(one.ends))
        island = np.searchsorted(first, row, side="right") - 1
        element, node = np.divmod(one.entries.astype(np.int64), nodes)
        place = nodes * (one.start[island] + element)
        if relative:
            found.append((row, one.nodes[place + (node ^ 1)], before[island] + element))
            before += np.diff(one.start)
        else:
            numbers = (before[island] + nodes * one.entries)[:, None] + np.arange(nodes)
            columns = one.nodes[place[:, None] + np.arange(nodes)]
            found.append((np.repeat(row, nodes), columns.ravel(), numbers.ravel()))
            before += nodes**2 * np.diff(one.start)
    row, other, block = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(row, kind="stable")
    return row[order], other[order], block[order]


def _counted(new: NDArray[np.bool_]) -> Whole:
    """0, 1, 2, ... from each place where something new begins."""
    at = np.arange(len(new))
    return at - np.maximum.accumulate(np.where(new, at, 0)) if len(new) else at
