"""Pairs of particles within a cut-off, found by sorting the particles into cells."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]
FEW = 64  # particles of which all pairs are looked at
FAR = 2**20  # cells along an axis; what lies farther out shares the last one


def pairs_within(
    x: Array, cutoff: float, box: Sequence[float] | None = None, others: Array | None = None
) -> tuple[Rows, Rows]:
    """All ordered pairs (i, j), i != j, that are nearer than a cut-off.

    Parameters
    ----------
    x : positions [m], shape (n, 3).
    cutoff : [m]; at most half of the smallest side of the box.
    box : sides of a periodic box [m]; distances are those of the nearest images. None = no box.
    others : positions of the second ones [m], shape (k, 3); i = j is then a pair like any other. None = `x`.

    Returns
    -------
    i, j : shape (pairs,) each, by i, and for each i by j.
    """
    found = []
    y = x if others is None else others
    for i, j in _all(len(x), len(y)) if max(len(x), len(y)) <= FEW else _beside(x, y, cutoff, box):
        near = squared(x[i], nearest(x[i], y[j], box)) < x.dtype.type(cutoff) ** 2
        if others is None:
            near &= i != j
        found.append((i[near], j[near]))
    i, j = (np.concatenate([pair[k] for pair in found]) for k in (0, 1))
    by_row = np.lexsort((j, i))
    return i[by_row], j[by_row]


def nearest(x1: Array, x2: Array, box: Sequence[float] | None) -> Array:
    """The image of x2 in a periodic box that is nearest to x1, shape (..., 3)."""
    if box is None:
        return x2
    side = np.asarray(box, x1.dtype)
    with np.errstate(all="ignore"):
        result: Array = x2 + side * np.floor((x1 - x2) / side + x1.dtype.type(0.5))
    return result


def squared(x1: Array, x2: Array) -> Array:
    """Squares of the distances of two sets of points [m^2]."""
    with np.errstate(all="ignore"):
        d = x1 - x2
        result: Array = d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1] + d[..., 2] * d[..., 2]
    return result


def _all(n: int, others: int) -> Iterator[tuple[Rows, Rows]]:
    """All pairs of n particles and so many others."""
    yield np.repeat(np.arange(n), others), np.tile(np.arange(others), n)


def _beside(x: Array, y: Array, cutoff: float, box: Sequence[float] | None) -> Iterator[tuple[Rows, Rows]]:
    """Pairs whose cells are the same or touch, one direction after the other."""
    size = cutoff * (1 + 1e-5)  # a trifle larger, whatever is rounded
    counts = np.full(3, FAR) if box is None else np.clip(np.asarray(box) // size, 1, FAR).astype(np.int64)
    cells = _cells(x, size, box, counts)
    key = _key(_cells(y, size, box, counts))
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    for offset in product(*(range(-1, 2) if count > 2 else range(count) for count in counts)):
        beside = cells + np.array(offset)
        if box is not None:
            beside %= counts
        start, end = (np.searchsorted(ordered, _key(beside), side=s) for s in ("left", "right"))
        many = end - start
        i = np.repeat(np.arange(len(x)), many)
        yield i, order[np.arange(len(i)) - np.repeat(np.cumsum(many) - many, many) + np.repeat(start, many)]


def _cells(x: Array, size: float, box: Sequence[float] | None, counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cell of each particle, shape (n, 3)."""
    wide = np.where(np.isfinite(x), x, 0).astype(np.float64)
    if box is None:
        place = wide / size + FAR / 2
    else:
        side = np.asarray(box)
        place = (wide / side - np.floor(wide / side)) * counts
    return np.clip(np.floor(place), 0, counts - 1).astype(np.int64)


def _key(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number for each cell; cells beyond the edge have keys of their own."""
    result: NDArray[np.int64] = ((cells[:, 2] + 1) * (FAR + 2) + cells[:, 1] + 1) * (FAR + 2) + cells[:, 0] + 1
    return result
