"""How long the next step of each island may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, Memory, Solver, Step, System
from pointmass.solvers.islands import Islands, Mask, number_of, rms
from pointmass.tracing import functions as fn
from pointmass.tracing.functions import Number

TINY = float(np.finfo(np.float64).tiny)
CLOCK_ULPS = 16.0  # a step this many roundings of its clock long no longer moves it reliably


@final
@dataclass(frozen=True)
class PIController:
    """Proportional and integral control of the step, for each island on its own.

    Attributes
    ----------
    rtol, atol : tolerated local error, relative and absolute (in the units of y).
    order : of the method; the error of a step falls as h^order.
    beta : weight of the previous error.
    safety, shrink, grow : factor on the step, and its limits.
    floor : the previous error counts at least this much.

    Notes
    -----
    Gustafsson, ACM Trans. Math. Softw. 17 (1991), 533; the constants are those of DOPRI5 in Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, sec. II.4 and IV.2. The memory has, for each island: `h_next`
    [s] (0: not chosen yet), `error_old` and `rejected`. `scale`, `factor`, `retreat`, `short` and `first` are laws:
    they take arrays or symbols, so that compiled kernels print the same text and round alike.
    """

    rtol: float
    atol: float
    order: int
    beta: float = 0.04
    safety: float = 0.9
    shrink: float = 0.2
    grow: float = 10.0
    floor: float = 1e-4

    def start(self, n: int) -> Memory:
        """Memory for n islands that have not moved yet."""
        return {"h_next": np.zeros(n), "error_old": np.full(n, self.floor), "rejected": np.zeros(n, np.bool_)}

    def norm(self, error: Array, y0: Array, y1: Array, islands: Islands) -> Array:
        """Error over tolerance, root mean square of each island; NaN and infinity stay."""
        return rms(error / self.scale(np.maximum(np.abs(y0), np.abs(y1))), islands, number_of(islands))

    def judge(self, step: Step, h: Array, wanted: Array, islands: Islands, memory: Memory) -> tuple[Mask, Memory]:
        """Which islands keep the step, and what the control remembers of it.

        Parameters
        ----------
        step : the trial, with its error.
        h : length of the trial of each island [s]; 0 where none was made, and nothing changes there.
        wanted : length that was asked for, longer than h where the end of the run cut it.
        islands : of each entry of y, shape (dim,).
        memory : as at the start of the trial.
        """
        assert step.error is not None
        error = self.norm(step.error, step.y0, step.y1, islands)
        tried, accepted = h > 0.0, error <= 1.0  # NaN is not accepted
        longer = h * self.factor(error, memory["error_old"])
        longer = np.where(memory["rejected"], np.minimum(longer, h), longer)
        longer = np.where(h < wanted, np.maximum(longer, wanted), longer)
        new = {
            "h_next": np.where(accepted, longer, h * self.retreat(error)),
            "error_old": np.where(accepted, np.maximum(error, self.floor), memory["error_old"]),
            "rejected": ~accepted,
        }
        return accepted & tried, {key: np.where(tried, value, memory[key]) for key, value in new.items()}

    def check(self, rejected: Mask, h_next: Array, clock: Array, end: float) -> None:
        """Raise `Diverged` if an island was rejected down to steps that its clock cannot resolve."""
        least = CLOCK_ULPS * np.finfo(np.float64).eps * np.maximum(np.abs(clock), abs(end))
        stuck = np.flatnonzero(rejected & (h_next < least))
        if len(stuck):
            i = int(stuck[0])
            raise Diverged(
                f"no step at t = {clock[i]:.6g} s is short enough for rtol = {self.rtol:g} and atol = {self.atol:g}"
                f" (island {i}): the forces have a jump or a singularity there, or the tolerances are too small",
                time=float(clock[i]),
            )

    def first_step(self, system: System, t: Array, y: Array, left: Array) -> Array:
        """A step to begin with for each island [s], from the size of y, y' and y''.

        Hairer, Norsett and Wanner, sec. II.4: an explicit Euler step of a hundredth of y / y' shows the second
        derivative, and a step whose terms of that order are a hundredth of the tolerance is proposed. Nothing is asked
        beyond the time that is `left`, where forces may mean nothing.
        """
        islands = system.islands
        n, scale = number_of(islands), self.scale(np.abs(y))
        slope = system.deriv_eval(_common(t, islands), y)
        d0, d1 = rms(y / scale, islands, n), rms(slope / scale, islands, n)
        short = self.short(d0, d1, left)
        there = system.deriv_eval(_common(t + short, islands), y + short[islands] * slope)
        d2 = rms((there - slope) / scale, islands, n) / short
        result: Array = self.first(short, d1, d2)
        return result

    def scale(self, size: Number) -> Number:
        """The tolerated error of a number of that size."""
        return fn.maximum(self.atol + self.rtol * size, TINY)

    def factor(self, error: Number, before: Number) -> Number:
        """How much longer the next step may be after one with this error over tolerance that was accepted."""
        slow = fn.pow(error, self._exponent) / fn.pow(before, self.beta) / self.safety
        return 1.0 / fn.minimum(fn.maximum(slow, 1.0 / self.grow), 1.0 / self.shrink)

    def retreat(self, error: Number) -> Number:
        """How much shorter the next trial must be after one with this error over tolerance that was rejected."""
        slow = fn.pow(error, self._exponent) / self.safety
        return fn.where(fn.absolute(slow) < np.inf, fn.maximum(self.shrink, 1.0 / slow), self.shrink)

    def short(self, d0: Number, d1: Number, left: Number) -> Number:
        """The step that shows the second derivative [s], from the sizes of y and y' over tolerance."""
        step = fn.where(d0 < 1e-5, 1e-6, 0.01 * d0 / fn.maximum(d1, 1e-5))
        return fn.minimum(fn.where(d1 >= 1e-5, step, 1e-6), left)

    def first(self, short: Number, d1: Number, d2: Number) -> Number:
        """The first step [s], from the sizes of y' and y'' over tolerance."""
        bend = fn.maximum(d1, d2)
        curved = fn.pow(0.01 / fn.maximum(bend, 1e-15), 1.0 / self.order)
        h = fn.where(bend > 1e-15, curved, fn.maximum(1e-6, short * 1e-3))
        return fn.where(fn.absolute(h) < np.inf, fn.minimum(100.0 * short, h), short)

    @property
    def _exponent(self) -> float:
        return 1.0 / self.order - 0.75 * self.beta


def control_of(solver: Solver) -> PIController | None:
    """What sets the steps of a solver; None if it takes them as they are given."""
    control: PIController | None = getattr(solver, "control", None)
    return control


def _common(values: Array, islands: Islands) -> float | Array:
    """One number if all islands agree, else one for each entry of y: systems with one clock need not know arrays."""
    return float(values[0]) if (values == values[0]).all() else values[islands]
