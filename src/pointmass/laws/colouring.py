"""Elements sorted into colours: those of one colour share no particle, and can be looked at in any order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.intp]
BITS = 52  # of a word of which floats tell the highest


def coloured(rows: Rows, n: int) -> Rows:
    """The colour of each element, counted from 0, shape (e,).

    Parameters
    ----------
    rows : particles of each element, shape (e, k).
    n : number of particles.

    Notes
    -----
    Jones and Plassmann, A parallel graph coloring heuristic (1993): of the elements that have no colour yet, those that
    come first at all their particles, by a hash of their number, take the lowest that is not taken there; beyond the
    bits of a word, the one after the highest.
    """
    e = len(rows)
    rank = np.empty(e, np.int64)
    rank[np.argsort(_hash(e), kind="stable")] = np.arange(e)
    colour = np.zeros(e, np.intp)
    taken = np.zeros(n, np.uint64)  # colours at a particle, a bit for each
    beyond = np.full(n, BITS)  # the first one that has no bit and is not taken
    waiting = np.arange(e)
    while len(waiting):
        mine, own = rows[waiting], rank[waiting]
        first = np.full(n, e)
        np.minimum.at(first, mine.ravel(), np.repeat(own, rows.shape[1]))
        chosen = (first[mine] == own[:, None]).all(axis=1)
        some = mine[chosen]
        used = np.bitwise_or.reduce(taken[some], axis=1)
        lowest = ~used & (used + np.uint64(1))
        few = used < np.uint64(2**BITS - 1)
        found = np.where(few, np.log2(np.where(few, lowest, 1)).astype(np.intp), beyond[some].max(axis=1))
        colour[waiting[chosen]] = found
        taken[some] |= np.where(few, lowest, 0)[:, None]
        beyond[some] = np.maximum(beyond[some], found[:, None] + 1)
        waiting = waiting[~chosen]
    return colour


def colour_starts(colours: Rows) -> Rows:
    """Where each colour begins among elements in the order of their colours, and the end."""
    return np.searchsorted(colours, np.arange(colours.max(initial=-1) + 2))


def _hash(count: int) -> NDArray[np.uint64]:
    """Scrambled whole numbers (Vigna, splitmix64, 2015)."""
    z = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))
