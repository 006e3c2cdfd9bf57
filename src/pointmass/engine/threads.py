"""Spreads independent work over threads.

Kernels of many islands release the interpreter's lock, so plain threads serve: a kernel that is parallel by itself
takes twice as long to compile. What a thread gets has no influence on the result.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

PIECES = 8  # for each thread, so that one who is late does not keep all waiting


def spread(work: Callable[[int, int], object], count: int, grain: int) -> None:
    """Call `work(first, last)` on pieces of range(count), each of `grain` items or more, by the threads of Numba."""
    import numba

    threads = numba.get_num_threads()
    pieces = min(PIECES * threads, count // grain)
    if threads == 1 or pieces < 2:
        work(0, count)
        return
    ends = [count * k // pieces for k in range(pieces + 1)]
    for done in [_pool(os.getpid(), threads).submit(work, a, b) for a, b in pairwise(ends)]:
        done.result()


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork: each process has its own."""
    return ThreadPoolExecutor(threads, "pointmass")
