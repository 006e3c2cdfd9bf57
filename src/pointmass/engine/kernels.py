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
            for k in range(len(lived)):
                more = lived[k]
                for i in range(len(some)):
                    some[np.uintp(i)] += more

    return njit(grow, cache=True, nogil=True, error_model="numpy")
