"""Implicit methods of one stage."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from pointmass.errors import number, unknown, whole_number
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.dense import straight
from pointmass.solvers.islands import chosen_memory, moved
from pointmass.solvers.linear import ConjugateGradients, direct
from pointmass.solvers.newton import Newton, Solution, left

LOOSE, TIGHT = 0.1, 1e-10  # relative residual of the linear systems, with and without iterations after them


class Implicit(Solver):
    """Y = z + gamma F(t + c h, Y) is solved by Newton's method; y1 lies on the line from y through Y.

    Parameters
    ----------
    linear_solver : "cg" for conjugate gradients, which leave what is not symmetric (some damping) to Newton's method;
        "direct" for factors of the matrix, "auto" for what is faster. The reference path takes LU factors, compiled
        steps eliminate chains; of larger islands, "auto" takes conjugate gradients, which agree to the tolerances, and
        "direct" the reference path. Single particles and systems of order 1 are always solved directly.
    newton : "full" until the equation is solved, "one" for a single linearised step (Baraff and Witkin 1998), which
        leaves out of the matrix what could make it indefinite (Choi and Ko 2002).
    tolerance : residual of the equation, relative to the size of its terms.
    max_iterations : corrections for one step; if they do not do, it is divided into two, and those again, up to 64
        parts. `Stats.rejected` counts the divisions.
    cg_tolerance : relative residual of the conjugate gradients; by default 0.1, from where the next iteration goes on
        (Dembo, Eisenstat and Steihaug, SIAM J. Numer. Anal. 19 (1982), 400), and 1e-10 for a single step.

    Attributes
    ----------
    c : where the stage lies in the step.
    history : memory entries, shape (dim,), on which the next step depends linearly, as it does on y.
    """

    implicit: ClassVar[bool] = True
    evaluations: ClassVar[int] = 2
    divisions: ClassVar[int] = 6  # of a step into halves, one within the other
    c: ClassVar[float] = 1.0
    history: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        linear_solver: Literal["auto", "direct", "cg"] = "auto",
        newton: Literal["full", "one"] = "full",
        tolerance: float = 1e-10,
        max_iterations: int = 50,
        cg_tolerance: float | None = None,
    ) -> None:
        if linear_solver not in ("auto", "direct", "cg"):
            raise unknown("linear_solver", linear_solver, ("auto", "direct", "cg"))
        if newton not in ("full", "one"):
            raise unknown("newton", newton, ("full", "one"))
        self.linear_solver, self.newton = linear_solver, newton
        self.tolerance = number("tolerance", tolerance, above=0.0)
        self.max_iterations = whole_number("max_iterations", max_iterations, at_least=1)
        loose = LOOSE if newton == "full" else TIGHT
        self.cg_tolerance = loose if cg_tolerance is None else number("cg_tolerance", cg_tolerance, above=0.0)
        # "one" step shows what it leaves out of the matrix: both paths leave out the same
        symmetric = linear_solver == "cg" or (linear_solver == "auto" and newton == "one")
        self._gradients = ConjugateGradients(self.cg_tolerance) if symmetric else None

    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h."""
        return self._step(system, t, y, h, memory or self.start(system), self.divisions)

    @property
    def braking(self) -> float:
        return self.c

    def _step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory, divisions: int) -> Step:
        """One step; islands whose equations are not solved make two of half the length."""
        step, found = self._whole(system, t, y, h, memory)
        if not found.unsolved.any():
            return step
        if divisions == 0:
            raise found.failure(system, t + self.c * h)
        mine = found.unsolved[system.islands]
        half = np.where(mine, 0.5 * np.asarray(h), 0.0)
        one = self._step(system, t, y, half, memory, divisions - 1)
        two = self._step(system, t + half, one.y1, half, one.memory, divisions - 1)
        y1 = np.where(mine, two.y1, step.y1)
        return Step(
            *(t, h, y, y1),
            straight(h, y, y1, system.order == 2),
            chosen_memory(found.unsolved, system.islands, two.memory, step.memory),
            iterations=step.iterations + one.iterations + two.iterations,
            cg_iterations=step.cg_iterations + one.cg_iterations + two.cg_iterations,
            rejected=int(found.unsolved.sum()) + one.rejected + two.rejected,
        )

    def _whole(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> tuple[Step, Solution]:
        """One step as it is, and what became of its equations."""
        length = np.broadcast_to(np.asarray(h, y.dtype), y.shape)
        z, gamma = self._stage(y, length, memory)
        linear = direct if self._gradients is None or system.order == 1 else self._gradients
        newton = Newton(linear, self.tolerance, self.max_iterations, self.newton == "one")
        found = newton.solve(system, t + self.c * h, z, gamma, y)
        rise = found.y - y
        y1 = moved(h, y, found.y if self.c == 1.0 else moved(rise, y, y + rise / self.c))
        dense = straight(h, y, y1, system.order == 2)
        after = self._remember(y, length, memory)
        if system.order == 2:
            velocities = np.arange(len(y)) >= len(y) // 2
            after = {**after, "rise": moved(h, memory["rise"], np.where(velocities, rise, 0.0))}
        return Step(t, h, y, y1, dense, after, iterations=found.iterations, cg_iterations=found.inner), found

    def residual(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory, y1: Array) -> Array:
        """Y - z - gamma F(t + c h, Y), as if the step was not divided."""
        length = np.broadcast_to(np.asarray(h, y.dtype), y.shape)
        z, gamma = self._stage(y, length, memory or self.start(system))
        return left(system, t + self.c * h, z, gamma, y1 if self.c == 1.0 else y + self.c * (y1 - y))

    def start(self, system: System) -> Memory:
        """No step before. The `rise` of the velocities to the last stage is where compiled gradients begin."""
        return {"rise": np.zeros(system.dim)} if system.order == 2 else {}

    def _stage(self, y: Array, h: Array, memory: Memory) -> tuple[Array, Array]:
        """z and gamma, shape (dim,)."""
        return y, self.c * h

    def _remember(self, y: Array, h: Array, memory: Memory) -> Memory:
        """Memory for the next step, from the start of this one."""
        return memory
