"""How contestants race: each in a process of its own, in turns, and only with the right answer.

Pools of threads of different packages get in each other's way in one process, and some cannot be set up twice. So every
contestant lives in a worker that sleeps until it is told to go; one of them runs at a time.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from statistics import median
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

PATIENCE = 300.0  # a contestant that says nothing for so long is out [s]
GOAL = 0.06  # a turn lasts about so long [s], so that the clock and the wake-up of threads do not matter
MOST_FRAMES = 32  # of a turn
BUDGET = 4.0  # of one contestant in one race [s]; the slow ones get fewer turns
PAUSE = 0.02  # between turns [s]: threads that spin while they wait go to sleep
POOLS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Array = NDArray[np.floating[Any]]


class Missing(Exception):
    """What a contestant needs is not here; the message says what."""


class Contestant:
    """One way to do the work of a race. The constructor prepares it; what it needs, it imports there.

    Attributes
    ----------
    name : in the table.
    scheme : which of the references of a problem it is held against, where there are several.
    """

    name: ClassVar[str]
    scheme: ClassVar[str] = ""

    def __init__(self, problem: Any) -> None:
        self.problem = problem

    def frame(self) -> float | None:
        """Advance one frame; returns the time it took [s] if it has a better clock than the caller."""
        raise NotImplementedError

    def result(self) -> Array:
        """What the judge looks at, shape (n, 3): where the particles are now, unless the workload says otherwise."""
        raise NotImplementedError

    def note(self) -> str:
        """What else there is to say at the end of the race."""
        return ""


@dataclass(frozen=True)
class Judge:
    """Measures how wrong a contestant is after its first frame.

    Attributes
    ----------
    rows : of the particles to look at; None = all.
    error : from their positions, shape (k, 3), to a number.
    most : a larger error disqualifies.
    """

    rows: NDArray[np.intp] | None
    error: Callable[[Array], float]
    most: float


@dataclass(frozen=True)
class Race:
    """Equal work for all contestants.

    Attributes
    ----------
    title : of the table; races that follow each other with the same title share one.
    case : what distinguishes this race in it.
    make : builds the problem, in each worker.
    contestants : the first one is what the others are compared with.
    judge : (problem, scheme) -> Judge, from the float64 reference.
    unit : what is counted, such as "particle-steps".
    work : units in a frame.
    particles : how many there are.
    slots : operations on a multiply-add unit that one unit of work needs at least.
    traffic : bytes between memory and processor that one unit of work needs at least.
    double : whether the roofline is that of float64.
    """

    title: str
    case: str
    make: Callable[[], Any]
    contestants: Sequence[type[Contestant]]
    judge: Callable[[Any, str], Judge]
    unit: str
    work: float
    particles: int
    slots: float
    traffic: float = 0.0
    double: bool = False


@dataclass
class Result:
    """What a contestant did: seconds per frame of each turn, or why there are none.

    Attributes
    ----------
    first : to the end of the first frame, with all that is imported and compiled for it [s].
    memory : bytes by which the process grew from the start to the end of the first frame.
    """

    race: Race
    name: str
    seconds: list[float] = field(default_factory=list)
    first: float = 0.0
    memory: float = 0.0
    error: float = np.nan
    out: str = ""
    note: str = ""

    @property
    def best(self) -> float:
        """Shortest time for a frame [s]."""
        return min(self.seconds)

    @property
    def median(self) -> float:
        """Median time for a frame [s]."""
        return median(self.seconds)


def run(race: Race, turns: int, threads: int, only: str = "", say: Callable[[str], None] = print) -> list[Result]:
    """Hold a race.

    Parameters
    ----------
    turns : of the fastest; the slow ones make fewer.
    threads : for everybody.
    only : a part of the name of the contestants to start; all by default.
    say : gets a line about whoever is out.
    """
    problem = race.make()
    judges: dict[str, Judge] = {}
    results, started = [], []
    with _pools(threads):
        for kind in race.contestants:
            if only.lower() not in kind.name.lower():
                continue
            if kind.scheme not in judges:
                judges[kind.scheme] = race.judge(problem, kind.scheme)
            result = Result(race, kind.name)
            results.append(result)
            worker = _Worker(kind, race.make, judges[kind.scheme].rows)
            if _admitted(worker, judges[kind.scheme], result):
                started.append((worker, result))
            else:
                worker.stop()
                say(f"{kind.name}: {result.out}")
        _take_turns(started, turns, say)
    return results


def _admitted(worker: _Worker, judge: Judge, result: Result) -> bool:
    """Whether a contestant has finished its first frame, and was right."""
    try:
        result.first, result.memory, positions = worker.answer()
    except _Out as reason:
        result.out = str(reason)
        return False
    result.error = judge.error(positions) if np.isfinite(positions).all() else np.inf
    if not result.error <= judge.most:
        result.out = f"disqualified: its error is {result.error:.1e} and may be {judge.most:.0e}"
    return not result.out


def _take_turns(started: list[tuple[_Worker, Result]], turns: int, say: Callable[[str], None]) -> None:
    """Everybody in turn, until all have had theirs."""
    left = {}
    for worker, result in list(started):
        seconds = _go(worker, result, 1, say)  # warm by now: how long a frame takes
        if seconds is None:
            started.remove((worker, result))
            continue
        frames = max(1, min(MOST_FRAMES, round(GOAL / seconds)))
        left[worker] = (frames, min(turns, round(BUDGET / (frames * seconds))))
        if left[worker][1] < 2:  # one that takes so long is timed once
            left[worker] = (frames, 0)
            result.seconds.append(seconds)
    for turn in range(turns):
        for worker, result in list(started):
            frames, its_turns = left[worker]
            # Slow ones sit out some turns, spread over the race, so that a busy minute of the machine meets all.
            if (turn + 1) * its_turns // turns == turn * its_turns // turns:
                continue
            seconds = _go(worker, result, frames, say)
            if seconds is None:
                started.remove((worker, result))
            else:
                result.seconds.append(seconds)
    for worker, result in started:
        result.note = worker.note()
        worker.stop()


def _go(worker: _Worker, result: Result, frames: int, say: Callable[[str], None]) -> float | None:
    time.sleep(PAUSE)
    try:
        return worker.go(frames)
    except _Out as reason:
        result.out = str(reason)
        result.seconds.clear()
        say(f"{result.name}: {result.out}")
        worker.stop()
        return None


class _Out(Exception):
    """Why a contestant is out."""


class _Worker:
    """A process with one contestant."""

    def __init__(
        self, kind: type[Contestant], make: Callable[[], Any], rows: NDArray[np.intp] | None, patience: float = PATIENCE
    ) -> None:
        context = get_context("spawn")
        self._pipe, far = context.Pipe()
        self._patience = patience
        self._process = context.Process(target=_serve, args=(far, kind, make, rows), daemon=False)
        self._process.start()
        far.close()

    def answer(self) -> Any:
        """What the process has to say; raises `_Out` if it gave up."""
        if not self._pipe.poll(self._patience):
            raise _Out(f"it took longer than {self._patience:g} s")
        try:
            kind, *rest = self._pipe.recv()
        except EOFError:
            self._process.join()
            raise _Out(f"its process ended with code {self._process.exitcode}") from None
        if kind == "out":
            raise _Out(rest[0])
        return rest

    def go(self, frames: int) -> float:
        """Time for a frame [s]."""
        self._pipe.send(frames)
        (seconds,) = self.answer()
        return float(seconds)

    def note(self) -> str:
        """What the contestant has to say at the end."""
        self._pipe.send(0)
        try:
            return str(self.answer()[0])
        except _Out as reason:
            return str(reason)

    def stop(self) -> None:
        """End the process."""
        self._pipe.close()
        self._process.join(2.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _serve(pipe: Connection, kind: type[Contestant], make: Callable[[], Any], rows: NDArray[np.intp] | None) -> None:
    """Prepare a contestant, show what it makes of the first frame, then do as many as are asked for."""
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)  # peers are talkative
        os.dup2(nowhere.fileno(), 2)
    try:
        problem = make()
        before = _memory("VmRSS")
        start = time.perf_counter()
        contestant = kind(problem)
        contestant.frame()
        first = time.perf_counter() - start
        grown = _memory("VmHWM") - before
        positions = np.asarray(contestant.result(), np.float64)
        pipe.send(("ready", first, grown, positions if rows is None else positions[rows]))
        while frames := pipe.recv():
            own: float | None = 0.0
            start = time.perf_counter()
            for _ in range(frames):
                seconds = contestant.frame()
                own = None if seconds is None or own is None else own + seconds
            took = time.perf_counter() - start
            pipe.send(("took", (took if own is None else own) / frames))
        pipe.send(("note", contestant.note()))
    except EOFError:
        return
    except ModuleNotFoundError as error:
        pipe.send(("out", f"left out: {error.name} is not installed"))
    except Missing as error:
        pipe.send(("out", f"left out: {error}"))
    except Exception as error:  # whatever a peer raises, the race goes on
        pipe.send(
            ("out", f"failed: {type(error).__name__}: {str(error).strip().splitlines()[0] if str(error) else ''}")
        )


def _memory(what: str) -> float:
    """Memory of this process [bytes]: "VmRSS" now, "VmHWM" the most since then; nan where nobody tells."""
    try:
        if what == "VmRSS":
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return np.nan
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith(what)), np.nan)


@contextmanager
def _pools(threads: int) -> Any:
    """Workers that are started now get so many threads."""
    before = {name: os.environ.get(name) for name in POOLS}
    os.environ.update(dict.fromkeys(POOLS, str(threads)))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def against(reference: Array, scale: float, most: float, rows: NDArray[np.intp] | None = None) -> Judge:
    """A judge by the largest distance from where the particles should be, in units of `scale` [m]."""
    return Judge(rows, lambda x: float(np.linalg.norm(x - reference, axis=1).max() / scale), most)
