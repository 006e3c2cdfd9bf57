"""Spreads independent work over threads.

Kernels of many islands release the interpreter's lock, so plain threads serve: a kernel that is parallel by itself
takes twice as long to compile. What a thread gets has no influence on the result.
"""

from __future__ import annotations

import os
import sys
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

from pointmass.errors import InvalidInput, whole_number

LINE = 64  # bytes of memory that go to and from a processor together
PIECES = 8  # for each thread, so that one who is late does not keep all waiting


def spread(work: Callable[[int, int], object], count: int, grain: int) -> None:
    """Call `work(first, last)` on pieces of range(count), each of `grain` items or more, by the threads of Numba.

    The caller is one of them: it need not wait until others wake up, which takes longer than a small piece.
    """
    import numba

    threads = numba.get_num_threads()
    pieces = min(PIECES * threads, count // grain)
    if threads == 1 or pieces < 2:
        work(0, count)
        return
    ends = [count * k // pieces for k in range(pieces + 1)]
    left = deque(pairwise(ends))

    def take() -> None:
        while True:
            try:
                first, last = left.popleft()
            except IndexError:  # all are taken
                return
            work(first, last)

    others = [_pool(os.getpid(), threads).submit(take) for _ in range(min(threads, pieces) - 1)]
    try:
        take()
    finally:
        for other in others:
            if not other.cancel():  # who has not begun yet finds nothing to do
                other.result()


def use_threads(threads: int | None) -> None:
    """Let kernels run on so many threads, whatever the environment asks for; None = as it does.

    Raises
    ------
    InvalidInput
        Not a whole number of at least 1.
    """
    heed_environment()
    if threads is not None:
        _use(whole_number("threads", threads, at_least=1))


@cache
def heed_environment() -> None:
    """As many threads as POINTMASS_THREADS says, from the first kernel on.

    Raises
    ------
    InvalidInput
        It is not a whole number of at least 1.
    """
    given = os.environ.get("POINTMASS_THREADS", "")
    if given and not (given.isdigit() and int(given) > 0):
        raise InvalidInput(f"POINTMASS_THREADS = {given} is not allowed: it must be a whole number, at least 1")
    if given:
        _use(int(given))


def _use(threads: int) -> None:
    if "numba" not in sys.modules:
        os.environ["NUMBA_NUM_THREADS"] = str(threads)
        return
    import numba

    # Once Numba is imported, there cannot be more than it has.
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads do not survive a fork: each process has its own."""
    return ThreadPoolExecutor(threads, "pointmass")
