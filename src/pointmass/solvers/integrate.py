"""From an initial value to a solution on a grid of times: the solvers without particles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from pointmass.errors import InvalidInput, finite_array, number
from pointmass.solvers.advance import Stats, advance
from pointmass.solvers.base import Array, Memory, Solver, Step, System
from pointmass.solvers.events import Event, first_root
from pointmass.solvers.islands import Mask, number_of
from pointmass.solvers.registry import as_solver

PIECES = 4  # parts of each step in which an event is looked for
ON_GRID = 1e-9  # of a step: a time this close to its end is on it


@final
@dataclass(frozen=True, eq=False)
class Interval:
    """The solution from one grid time to the next: steps that each island took on its own.

    Attributes
    ----------
    start, end : of the interval [s].
    y0, y1 : state at both ends, shape (dim,).
    steps : accepted ones, in order; islands that did not move have h = 0.
    """

    start: float
    end: float
    y0: Array
    y1: Array
    steps: tuple[Step, ...]

    def at(self, t: float) -> Array:
        """The state at t in [start, end], shape (dim,)."""
        if t >= self.end:
            return self.y1
        y = self.y0
        for step in self.steps:
            theta = (t - step.t) / np.where(np.equal(step.h, 0.0), 1.0, step.h)
            inside = np.greater(step.h, 0.0) & (theta >= 0.0) & (theta <= 1.0 + ON_GRID)  # clocks have round-off
            if inside.any():
                y = np.where(inside, step.dense(np.clip(theta, 0.0, 1.0)), y)
        return y

    def knots(self) -> Array:
        """Times at which a step of some island begins or ends, cut into pieces."""
        starts = [np.unique(np.where(np.equal(step.h, 0.0), self.start, step.t)) for step in self.steps]
        knots = np.unique(np.concatenate([*starts, [self.start, self.end]]))
        parts = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(PIECES) / PIECES
        return np.append(parts.ravel(), self.end)


@final
@dataclass(frozen=True, eq=False)
class Solution:
    """What `integrate` returns.

    Attributes
    ----------
    t : grid times, and the time of the terminal event if one came, shape (k,) [s].
    y : states, shape (k, dim).
    t_events, y_events : for each event its times, shape (e,), and the states there, shape (e, dim). They lie on the
        side of the root where g is no longer negative, or has just become so.
    stats : the work done.
    intervals : for `at`; empty unless dense output was asked for.
    """

    t: Array
    y: Array
    t_events: tuple[Array, ...]
    y_events: tuple[Array, ...]
    stats: Stats
    intervals: tuple[Interval, ...] = ()

    def at(self, t: ArrayLike) -> Array:
        """The state at t: shape (dim,) for a number, (k, dim) for an array of k times.

        Raises
        ------
        InvalidInput
            There is no dense output, or t is outside the run.
        """
        if not self.intervals:
            raise InvalidInput("the solution has no dense output: call integrate with dense=True")
        times = np.asarray(t, np.float64)
        if not ((times >= self.t[0]) & (times <= self.t[-1])).all():
            raise InvalidInput(f"t = {times} is not allowed: the solution goes from {self.t[0]} to {self.t[-1]} s")
        starts = [interval.start for interval in self.intervals]
        index = np.searchsorted(starts, times.ravel(), side="right") - 1
        states = [self.intervals[i].at(float(time)) for i, time in zip(index, times.ravel(), strict=True)]
        return np.reshape(states, (*times.shape, self.y.shape[1]))


def integrate(
    system: System,
    solver: Solver | str,
    t_span: tuple[float, float],
    dt: float,
    y0: ArrayLike | None = None,
    *,
    events: Sequence[Event] = (),
    dense: bool = False,
) -> Solution:
    """The solution of an initial value problem on the grid t0 + k dt, and at the end of the span.

    Parameters
    ----------
    solver : or its name, such as "rk4".
    t_span : start and end [s].
    dt : distance of the grid [s], and the step of a solver with fixed steps; an adaptive one takes several, or one.
    y0 : state at the start, shape (dim,); that of the system (its `get_state`) if None.
    events : looked for on the dense output of every step.
    dense : keep what `Solution.at` needs.

    Raises
    ------
    InvalidInput
        An argument cannot be used.
    Diverged
        As `advance`.
    """
    solver = as_solver(solver)
    if getattr(system, "colliders", ()):
        raise InvalidInput("integrate knows no collisions: run a system with colliders in a Simulation")
    times = _grid(t_span, number("dt", dt, above=0.0, unit="s"))
    y = _initial(system, y0)
    memory: Memory = solver.start(system)
    stats, states, intervals = Stats(), [y], []
    found: list[list[tuple[float, Array]]] = [[] for _ in events]
    for k, (start, end) in enumerate(pairwise(times.tolist())):
        interval, memory, work = _advance(system, solver, start, end, y, memory)
        stats, y = stats + work, interval.y1
        stop = _happenings(interval, events, found)
        if dense:
            intervals.append(interval)
        states.append(y if stop is None else interval.at(stop))
        if stop is not None:
            times = np.append(times[: k + 1], stop)
            break
    return Solution(
        times,
        np.array(states),
        tuple(np.array([t for t, _ in each]) for each in found),
        tuple(np.array([state for _, state in each]).reshape(-1, system.dim) for each in found),
        stats,
        tuple(intervals),
    )


def _grid(t_span: tuple[float, float], dt: float) -> Array:
    t0, t1 = finite_array("t_span", t_span, (2,)).tolist()
    if not t0 < t1:
        raise InvalidInput(f"t_span = {t_span} is not allowed: its end must come after its start")
    whole = max(int(np.ceil((t1 - t0) / dt - ON_GRID)), 1)
    return np.append(t0 + dt * np.arange(whole), t1)


def _initial(system: System, y0: ArrayLike | None) -> Array:
    if y0 is None:
        get_state = getattr(system, "get_state", None)
        if get_state is None:
            raise InvalidInput("y0 is missing, and this system has no state of its own: give y0")
        y0 = get_state()
    return finite_array("y0", y0, (system.dim,))


def _advance(
    system: System, solver: Solver, start: float, end: float, y: Array, memory: Memory
) -> tuple[Interval, Memory, Stats]:
    steps: list[Step] = []
    islands = number_of(system.islands)
    leave, none = np.full(islands, np.nan), np.zeros(islands, np.bool_)

    def collect(step: Step, h: Array) -> tuple[Array, Array, Mask]:
        steps.append(step)
        return step.y1, leave, none

    y1, memory, stats = advance(system, solver, start, end, y, memory, correct=collect)
    return Interval(start, end, y, y1, tuple(steps)), memory, stats


def _happenings(interval: Interval, events: Sequence[Event], found: list[list[tuple[float, Array]]]) -> float | None:
    """Adds what happened in the interval to `found`; the time of the first terminal event."""
    if not events:
        return None
    knots = interval.knots()
    times = [_crossings(interval, event, knots) for event in events]
    ends = [each[0] for event, each in zip(events, times, strict=True) if event.terminal and len(each)]
    stop = min(ends, default=None)
    for each, record in zip(times, found, strict=True):
        record.extend((t, interval.at(t)) for t in each if stop is None or t <= stop)
    return stop


def _crossings(interval: Interval, event: Event, knots: Array) -> list[float]:
    """Times at which an event happens, after the start of the interval and up to its end."""

    def g(times: Array) -> Array:
        return np.array([event.g(float(t), interval.at(float(t))) for t in times])

    positive = g(knots) >= 0.0
    changes = np.diff(positive.astype(np.intp))
    wanted = np.flatnonzero(changes if event.direction == 0 else changes == event.direction)
    if not len(wanted):
        return []
    _, after, _, _ = first_root(g, knots[wanted], knots[wanted + 1])
    return [float(t) for t in after]
