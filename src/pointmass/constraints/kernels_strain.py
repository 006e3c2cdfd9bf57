"""The kernel of strain limits."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np


def limit_lengths(rows: Any, least: Any, most: Any, w: Any, x: Any, sweeps: int) -> None:
    """Shorten pairs that are too long and lengthen those that are too short, one after the other; `x` in place.

    Parameters
    ----------
    rows : ends of each pair, shape (e, 2).
    least, most : lengths that are allowed [m], shape (e,), of the type of `x`.
    w : inverse masses, by which both ends share the way, shape (n,); 0 = held.
    x : positions [m], shape (n, 3).
    sweeps : times that all pairs are looked at, unless nothing is left to do.
    """
    _kernel()(rows, least, most, w, x, sweeps)


@cache
def _kernel() -> Any:
    from numba import njit

    def sweep(rows: Any, least: Any, most: Any, w: Any, x: Any, sweeps: int) -> None:
        for _ in range(sweeps):
            moved = False
            for e in range(len(rows)):
                i, j = np.uintp(rows[e, 0]), np.uintp(rows[e, 1])
                a, b, c = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
                length = np.sqrt(a * a + b * b + c * c)
                wanted = min(max(length, least[e]), most[e])
                free = w[i] + w[j]
                if wanted != length and length > 0 and free > 0:
                    moved = True
                    part = (length - wanted) / (length * free)
                    if w[i] > 0:
                        x[i, 0] -= w[i] * part * a
                        x[i, 1] -= w[i] * part * b
                        x[i, 2] -= w[i] * part * c
                    if w[j] > 0:
                        x[j, 0] += w[j] * part * a
                        x[j, 1] += w[j] * part * b
                        x[j, 2] += w[j] * part * c
            if not moved:
                break

    return njit(sweep, cache=True, nogil=True, error_model="numpy")
