"""Norms over islands, added up in the order of the entries: an island's bits do not depend on its neighbours.

Memory entries have shape (dim,) or (islands,). The two cannot be confused: an island of an order 2 system has at least
two entries, and islands of a single entry are numbered in the order of the entries.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.solvers.base import Array, Clock, Memory

Islands = NDArray[np.intp]
Mask = NDArray[np.bool_]


def number_of(islands: Islands) -> int:
    """How many islands there are; they are counted from 0."""
    return int(islands.max()) + 1 if len(islands) else 0


def total(values: Array, islands: Islands, n: int) -> Array:
    """Sum over each of the n islands, shape (n,)."""
    result: Array = np.bincount(islands, weights=values, minlength=n).astype(np.float64, copy=False)
    return result


def rms(values: Array, islands: Islands, n: int) -> Array:
    """Root of the mean square over each of the n islands, shape (n,)."""
    entries = np.maximum(np.bincount(islands, minlength=n), 1)
    result: Array = np.sqrt(total(values * values, islands, n) / entries)
    return result


def largest(values: Array, islands: Islands, n: int) -> Array:
    """Largest absolute value of each of the n islands, shape (n,); NaN where one entry is NaN."""
    result = np.zeros(n)
    np.maximum.at(result, islands, np.abs(values))
    return result


def moved(h: Clock, y0: Array, y1: Array) -> Array:
    """y1, but y0 to the bit where h is 0 (adding 0 would turn -0 into 0, and 0 times infinity is NaN)."""
    result: Array = np.where(np.equal(h, 0.0), y0, y1)
    return result


def chosen(mask: Mask, islands: Islands, there: NDArray[Any], elsewhere: NDArray[Any]) -> NDArray[Any]:
    """The memory entry `there` on the islands of mask, and `elsewhere` on the others."""
    by_entry = there.shape == islands.shape
    result: NDArray[Any] = np.where(mask[islands] if by_entry else mask, there, elsewhere)
    return result


def chosen_memory(mask: Mask, islands: Islands, there: Memory, elsewhere: Memory) -> Memory:
    """`chosen` for every entry of a memory; an entry that only one of the two has is taken as it is."""
    both = there.keys() & elsewhere.keys()
    merged = {key: chosen(mask, islands, there[key], elsewhere[key]) for key in sorted(both)}
    return {**elsewhere, **there, **merged}
