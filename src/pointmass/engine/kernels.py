"""Kernels that are the same for all systems."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from pointmass.engine.threads import spread

BLOCK = 1024  # particles whose ages stay in the first cache


def grow_old(age: Any, lived: Any) -> None:
    """Add one stretch of time after the other to all ages, as step by step: the same roundings."""
    kernel = _grow_old()
    spread(lambda lo, hi: kernel(age, lived, lo, hi), len(age), 64 * BLOCK)


@cache
def _grow_old() -> Any:
    from numba import njit

    def grow(age: Any, lived: Any, lo: int, hi: int) -> None:
        for start in range(lo, hi, BLOCK):
            some = age[start : min(start + BLOCK, hi)]
            first, same = some[0], True
            for i in range(len(some)):
                same &= some[np.uintp(i)] == first
            if same:  # those of one age stay so
                for k in range(len(lived)):
                    first += lived[k]
                some[:] = first
                continue
            many = len(lived) // 4 * 4
            for k in range(0, many, 4):  # four for each visit to the cache
                a, b, c, d = lived[k], lived[k + 1], lived[k + 2], lived[k + 3]
                for i in range(len(some)):
                    j = np.uintp(i)
                    some[j] = (((some[j] + a) + b) + c) + d
            for k in range(many, len(lived)):
                more = lived[k]
                for i in range(len(some)):
                    some[np.uintp(i)] += more

    return njit(grow, cache=True, nogil=True, error_model="numpy")
