"""Splitting methods: kicks that change v and drifts that change x, one loop that reads their lengths."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.dense import hermite
from pointmass.solvers.islands import moved


class Substep(NamedTuple):
    """A kick, a drift and a kick, as fractions of h.

    The opening kick takes the v it finds. The closing one asks for the acceleration at the v it leads to; if the
    acceleration depends on v, that is an equation for v. Such a substep is its own mirror image when both kicks are
    equal, so compositions of it keep their order with drag.
    """

    opening: float
    drift: float
    closing: float


class Splitting(Solver):
    """Kicks and drifts in turn; x'' = f/m only.

    Attributes
    ----------
    substeps : in the order they are taken; drifts, and kicks, add up to 1.
    passes : fixed-point passes for a closing kick, `v <- v_before + k h a(t, x, v)`, if a depends on v.

    Raises
    ------
    InvalidInput
        When a leaf is defined whose kicks or drifts do not add up to 1.

    Notes
    -----
    Hairer, Lubich and Wanner, Geometric Numerical Integration, sec. II.4 and II.5. Kicks see the time that the drifts
    have reached. `evaluations` counts laws that do not depend on v, where a kick and the next share one.
    """

    substeps: ClassVar[tuple[Substep, ...]]
    moves_masses: ClassVar[bool] = True
    passes: int = 1
    _times: ClassVar[tuple[tuple[float, float], ...]]

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        reached = np.cumsum([substep.drift for substep in cls.substeps])
        kicks = sum(substep.opening + substep.closing for substep in cls.substeps)
        if abs(reached[-1] - 1.0) > 1e-15 or abs(kicks - 1.0) > 1e-15:
            raise InvalidInput(f"the drifts of {cls.name} add up to {reached[-1]} and its kicks to {kicks}, not to 1")
        ends = [*(float(time) for time in reached[:-1]), 1.0]
        cls._times = tuple(zip([0.0, *ends[:-1]], ends, strict=True))
        cls.evaluations = 1 + sum(substep.closing != 0.0 for substep in cls.substeps)

    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h."""
        if system.order != 2:
            raise InvalidInput(f"{self.name} needs x'' = f/m, but this system has order {system.order}: use rk4")
        n = len(y) // 2
        length = np.broadcast_to(np.asarray(h, y.dtype), y.shape)
        hx, hv = length[:n], length[n:]
        x, v = y[:n], y[n:]
        f0 = slope = system.deriv_eval(t, y)
        led, lead = f0[:n] != v, f0[:n]  # where the system moves x on its own: pinned or led by hand
        fresh = True
        for (opening, drift, closing), (before, after) in zip(self.substeps, self._times, strict=True):
            if not fresh:
                slope = system.deriv_eval(t + before * h, np.concatenate([x, v]))
            v = v + opening * hv * slope[n:]
            x = x + drift * hx * np.where(led, lead, v)
            fresh = closing != 0.0 and not system.velocity_dependent
            if closing != 0.0:
                v, slope = self._closing_kick(system, t + after * h, x, v, closing * hv)
        y1 = moved(h, y, np.concatenate([x, v]))
        end = cache(lambda: system.deriv_eval(t + h, y1))
        return Step(t, h, y, y1, hermite(length, y, y1, lambda: (f0, end())), memory)

    def _closing_kick(self, system: System, t: Clock, x: Array, before: Array, kick: Array) -> tuple[Array, Array]:
        """The velocity after a kick that uses the acceleration there, and the last slope evaluated."""
        v = before
        for _ in range(self.passes if system.velocity_dependent else 1):
            slope = system.deriv_eval(t, np.concatenate([x, v]))
            v = before + kick * slope[len(x) :]
        return v, slope
