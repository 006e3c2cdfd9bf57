"""What the machine can do: clock, multiply-adds, memory bandwidth. Printed above every table."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

CHAIN = 50_000_000  # links of the dependent chain
PASSES = 20_000  # over an array that fits the first cache
TRIAD = 2**24  # numbers in each of the three arrays: 128 MiB
FUSED = 16  # multiply-adds on a number between its load and its store
REPEATS = 5


@dataclass(frozen=True)
class Machine:
    """Ceilings, each the best of some runs.

    Attributes
    ----------
    clock : [1/s].
    fma : multiply-adds of one thread and of all, each on one number [1/s], by precision.
    triad : bytes moved by a[i] = b[i] + s c[i] by one thread and by all [bytes/s].
    """

    processor: str
    threads: int
    clock: float
    fma: dict[str, tuple[float, float]]
    triad: tuple[float, float]

    def limit(self, slots: float, traffic: float, double: bool = False) -> float:
        """The most units of work in a second that need so many multiply-adds and bytes each: the roofline."""
        bounds = [self.fma["float64" if double else "float32"][1] / slots] if slots else []
        bounds += [self.triad[1] / traffic] if traffic else []
        return min(bounds) if bounds else np.nan

    def lines(self) -> list[str]:
        """The probe in words."""
        (one32, all32), (one64, all64) = self.fma["float32"], self.fma["float64"]
        load = os.getloadavg() if hasattr(os, "getloadavg") else (np.nan,) * 3
        return [
            f"{self.processor}, {self.threads} threads, clock {self.clock / 1e9:.2f} GHz, load {load[0]:.1f}",
            f"multiply-adds: float32 {one32 / 1e9:.0f}e9/s on 1 thread, {all32 / 1e9:.0f}e9/s on {self.threads}; "
            f"float64 {one64 / 1e9:.0f}e9/s and {all64 / 1e9:.0f}e9/s",
            f"triad: {self.triad[0] / 1e9:.0f} GB/s on 1 thread, {self.triad[1] / 1e9:.0f} GB/s on {self.threads}",
        ]


def probe(threads: int) -> Machine:
    """Measure, in a process of its own, so that no pool of threads is left behind."""
    before = os.environ.get("NUMBA_NUM_THREADS")
    os.environ["NUMBA_NUM_THREADS"] = str(threads)
    try:
        with get_context("spawn").Pool(1) as pool:
            return pool.apply(_measured, (threads,))
    finally:
        os.environ.pop("NUMBA_NUM_THREADS")
        if before is not None:
            os.environ["NUMBA_NUM_THREADS"] = before


def _measured(threads: int) -> Machine:
    import numba

    chain, fma, triad = _kernels()
    a, b, c = (np.full(TRIAD, value) for value in (0.0, 1.0, 2.0))

    def of_threads(count: int, work: float, function: Callable[..., Any], *args: Any) -> float:
        numba.set_num_threads(count)
        return work / _best(lambda: function(*args))

    counts = (1, threads)
    rates = {}
    for dtype in ("float32", "float64"):
        x = np.full((threads, 2048), 0.5, dtype)
        rates[dtype] = tuple(of_threads(k, k * 2048.0 * FUSED * PASSES, fma, x[:k], PASSES) for k in counts)
    return Machine(
        processor=_processor(),
        threads=threads,
        clock=2.0 * CHAIN / _best(lambda: chain(CHAIN, 12345, 678910)),
        fma=rates,
        triad=tuple(of_threads(k, 24.0 * TRIAD, triad, a, b, c, 0.5) for k in counts),
    )


def _kernels() -> tuple[Callable[..., Any], ...]:
    from numba import njit, prange

    @njit
    def chain(links: int, mask: int, step: int) -> int:
        # An exclusive or between the additions: a compiler has no formula for the end of this chain.
        x = 0
        for _ in range(links):
            x = (x ^ mask) + step
        return x

    @njit(parallel=True, fastmath={"contract"}, error_model="numpy")
    def fma(x: Any, passes: int) -> None:
        for row in prange(x.shape[0]):
            line = x[row]
            half = line.dtype.type(0.5)
            for _ in range(passes):
                for i in range(line.shape[0]):
                    z = line[i]
                    y = z * half + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    y = y * z + half
                    line[i] = y * half + half

    @njit(parallel=True, fastmath={"contract"}, error_model="numpy")
    def triad(a: Any, b: Any, c: Any, s: float) -> None:
        for i in prange(a.shape[0]):
            a[i] = b[i] + s * c[i]

    return chain, fma, triad


def _best(function: Callable[[], Any]) -> float:
    """Shortest time of some calls, the first one not counted [s]."""
    seconds = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        function()
        seconds.append(time.perf_counter() - start)
    return min(seconds[1:])


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    facts = {k.strip(): v.strip() for k, _, v in (line.partition(":") for line in lines)}
    name = facts.get("model name", platform.machine())
    return f"{name} (family {facts['cpu family']}, model {facts['model']})" if "cpu family" in facts else name
