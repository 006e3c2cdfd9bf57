"""Takes every island of a system from its own clock to a common end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from pointmass.errors import Diverged, InvalidInput
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.control import control_of
from pointmass.solvers.islands import Islands, Mask, chosen_memory, number_of

SET_BACKS = 10_000  # how often one island may be set back on the way to the end
NEARLY = 1.01  # a step this much longer reaches the end: take it rather than leave a splinter

Prepare = Callable[[Array, Array, Array], Array]
Correct = Callable[[Step, Array], tuple[Array, Array, Mask]]


@dataclass
class Stats:
    """The work of a run.

    Attributes
    ----------
    steps : steps of the solver, all islands at once, trials that were rejected included.
    rejected : trials that were rejected, or implicit ones whose equations were not solved, counted for each island.
    evaluations : of deriv_eval, for all islands at once.
    iterations : of Newton's method, counted for each island.
    cg_iterations : of conjugate gradients, counted for each island.
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    iterations: int = 0
    cg_iterations: int = 0

    def __add__(self, other: Stats) -> Stats:
        return Stats(
            self.steps + other.steps,
            self.rejected + other.rejected,
            self.evaluations + other.evaluations,
            self.iterations + other.iterations,
            self.cg_iterations + other.cg_iterations,
        )


def advance(
    system: System,
    solver: Solver,
    t0: float,
    t1: float,
    y: Array,
    memory: Memory,
    *,
    clock: Array | None = None,
    prepare: Prepare | None = None,
    correct: Correct | None = None,
) -> tuple[Array, Memory, Stats]:
    """The state at t1, to which every island comes exactly.

    A solver with fixed steps takes what is left in one step; an adaptive one takes as many as its control wants.
    Islands that have arrived get h = 0 and keep their bits. While all clocks agree, the system and the solver see t
    and h as numbers, else as arrays of shape (dim,).

    Parameters
    ----------
    t0, t1 : start and end [s].
    y : state at the start, shape (dim,).
    memory : what the last call returned, or ``{}``.
    clock : where each island begins, in [t0, t1], shape (islands,); t0 if None.
    prepare : called before each trial, ``prepare(clock, h, y) -> y``, with the clock and the step of each island, shape
        (islands,), 0 where none is made. A rejected trial is prepared again with a shorter step.
    correct : called after each step that some island keeps, ``correct(step, h) -> (y, clock, reset)``. `h` is the
        length of the step of each island, shape (islands,), 0 where none was made or it was rejected; there `step`
        stands still. It returns the state, a clock for each island (one before the end of the step sets the island
        back to it, anything else, NaN too, leaves it alone), and a bool for each island whose solver starts anew.

    Returns
    -------
    y, memory, stats
        The state at t1, shape (dim,), the memory for the next call, and the work done.

    Raises
    ------
    InvalidInput
        The run would go backwards, or a clock is outside [t0, t1].
    Diverged
        The state is no longer finite, no step is short enough, or an island is set back without end.
    """
    run = _Run(system, solver, t0, t1, y, memory, clock)
    with np.errstate(all="ignore"):  # what overflows is found and named below
        while (run.clock < t1).any():
            run.step(prepare, correct)
    run.stats.evaluations = run.system.evaluations
    return run.y, run.memory, run.stats


@final
class _Run:
    """State, clocks and memory on the way from t0 to t1."""

    def __init__(
        self, system: System, solver: Solver, t0: float, t1: float, y: Array, memory: Memory, clock: Array | None
    ) -> None:
        self.system, self.solver, self.end, self.y = _Counted(system), solver, t1, y
        self.islands: Islands = system.islands
        n = number_of(self.islands)
        self.clock = np.full(n, float(t0)) if clock is None else np.array(clock, np.float64)
        if not t0 <= t1:
            raise InvalidInput(f"t1 = {t1} is not allowed: it must not come before t0 = {t0}")
        if self.clock.shape != (n,) or not ((self.clock >= t0) & (self.clock <= t1)).all():
            raise InvalidInput(f"clock must have one value in [{t0}, {t1}] for each of the {n} islands")
        self.memory = {**solver.start(system), **memory}
        self.control = control_of(solver)
        self.set_backs = np.zeros(n, np.intp)
        self.stats = Stats()

    def step(self, prepare: Prepare | None, correct: Correct | None) -> None:
        """One trial of every island that has not arrived."""
        left = self.end - self.clock
        wanted = self._wanted(left)
        last = wanted * NEARLY >= left
        h = np.where(last, left, wanted)
        if prepare is not None:
            self.y = prepare(self.clock, h, self.y)
        trial = self._trial(h)
        kept, control = self._judge(trial, h, wanted)
        self._check_finite(trial, kept)
        self.memory = {**chosen_memory(kept, self.islands, trial.memory, self.memory), **control}
        before = self.clock
        self.clock = np.where(kept, np.where(last, self.end, before + h), before)
        step = trial if kept.all() else _only(trial, kept[self.islands])
        self.y = step.y1
        if correct is not None and kept.any():
            self._correct(correct, step, before, np.where(kept, h, 0.0))

    def _wanted(self, left: Array) -> Array:
        if self.control is None:
            return left
        h: Array = self.memory["h_next"]
        if (unknown := (left > 0.0) & ~(h > 0.0)).any():
            h = np.where(unknown, self.control.first_step(self.system, self.clock, self.y, left), h)
        return np.where(left > 0.0, h, 0.0)

    def _trial(self, h: Array) -> Step:
        common = (h == h[0]).all() and (self.clock == self.clock[0]).all()
        t: Clock = float(self.clock[0]) if common else self.clock[self.islands]
        length: Clock = float(h[0]) if common else h[self.islands]
        trial = self.solver.step(self.system, t, self.y, length, self.memory)
        self.stats.steps += 1
        self.stats.rejected += trial.rejected
        self.stats.iterations += trial.iterations
        self.stats.cg_iterations += trial.cg_iterations
        return trial

    def _judge(self, trial: Step, h: Array, wanted: Array) -> tuple[Mask, Memory]:
        if self.control is None:
            return h > 0.0, {}
        kept, memory = self.control.judge(trial, h, wanted, self.islands, self.memory)
        rejected = (h > 0.0) & ~kept
        self.stats.rejected += int(rejected.sum())
        self.control.check(rejected, memory["h_next"], self.clock, self.end)
        return kept, memory

    def _check_finite(self, trial: Step, kept: Mask) -> None:
        bad = np.flatnonzero(kept[self.islands] & ~np.isfinite(trial.y1))
        if len(bad):
            t = float(self.clock[self.islands[bad[0]]])
            other = "" if self.solver.implicit else " or an implicit solver"
            raise Diverged(
                f"entry {bad[0]} of y is no longer finite after a step of {self.solver.name} from t = {t:.6g} s:"
                f" use a smaller dt{other}",
                time=t,
            )

    def _correct(self, correct: Correct, step: Step, before: Array, h: Array) -> None:
        self.y, given, reset = correct(step, h)
        back = (h > 0.0) & (given < before + h)
        self.set_backs += back
        self._check_set_backs(back, given, before)
        self.clock = np.where(back, given, self.clock)
        if reset.any():
            self.memory = chosen_memory(reset, self.islands, self.solver.start(self.system), self.memory)

    def _check_set_backs(self, back: Mask, given: Array, before: Array) -> None:
        if early := np.flatnonzero(back & (given < before)).tolist():
            i = early[0]
            raise InvalidInput(f"correct set island {i} back to {given[i]} s, before its step began at {before[i]} s")
        if piled := np.flatnonzero(self.set_backs > SET_BACKS).tolist():
            t = float(before[piled[0]])
            raise Diverged(
                f"island {piled[0]} was set back {SET_BACKS} times on its way to t = {self.end:.6g} s and is still at"
                f" t = {t:.6g} s: its collisions pile up, so use a smaller dt or let it rest",
                time=t,
            )


def _only(step: Step, kept: Mask) -> Step:
    """The step with the other entries at rest, mask of shape (dim,)."""
    h = np.where(kept, step.h, 0.0)
    inside = step.dense

    def dense(theta: Clock) -> Array:
        return np.where(kept, inside(theta), step.y0)

    return replace(step, h=h, y1=np.where(kept, step.y1, step.y0), dense=dense)


@final
class _Counted:
    """A system that counts its evaluations."""

    def __init__(self, system: System) -> None:
        self._system = system
        self.evaluations = 0
        self.dim, self.order = system.dim, system.order
        self.islands = system.islands

    @property
    def velocity_dependent(self) -> bool:
        return self._system.velocity_dependent  # contacts come and go between steps

    @property
    def inertia(self) -> Array:
        return self._system.inertia

    def deriv_eval(self, t: Clock, y: Array) -> Array:
        self.evaluations += 1
        return self._system.deriv_eval(t, y)

    def jacobian(self, t: Clock, y: Array, share: Array | None = None) -> Any:
        return self._system.jacobian(t, y, share)

    def external(self, t: Clock, y: Array) -> Array:
        self.evaluations += 1
        return self._system.external(t, y)

    def relaxed(self, t: Clock, h: Array, x: Array, rise: Array, sweeps: int) -> Array:
        return self._system.relaxed(t, h, x, rise, sweeps)
