"""Work on the bands of a picture by several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


def each(work: Callable[[int], None], count: int) -> None:
    """Call `work(i)` once for each i below `count`, by as many threads as Numba may use.

    Kernels release the interpreter's lock, so plain threads serve: against a parallel kernel this halves the time to
    compile, lets an idle thread take the next band, and survives a fork. `work` must write to its own rows only; then
    the bytes do not depend on the number of threads.
    """
    import numba

    threads = min(numba.get_num_threads(), count)
    work(0)  # compiles, if nothing has yet
    if threads == 1:
        for i in range(1, count):
            work(i)
        return
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(work, i) for i in range(1, count)]:
            done.result()
