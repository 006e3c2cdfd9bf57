"""Implicit methods of one stage."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from pointmass.errors import number, unknown, whole_number
from pointmass.solvers.base import Array, Clock, Memory, Solver, Step, System
from pointmass.solvers.dense import straight
from pointmass.solvers.islands import moved
from pointmass.solvers.linear import ConjugateGradients, direct
from pointmass.solvers.newton import Newton


class Implicit(Solver):
    """Y = z + gamma F(t + c h, Y) is solved by Newton's method; y1 lies on the line from y through Y.

    Parameters
    ----------
    linear_solver : "cg" for conjugate gradients, which leave what is not symmetric (some damping) to Newton's method;
        "direct" for factors of the matrix, "auto" for what is faster. The reference path takes LU factors, compiled
        steps eliminate chains; of larger islands, "auto" takes conjugate gradients, which agree to the tolerances, and
        "direct" the reference path. Single particles and systems of order 1 are always solved directly.
    newton : "full" until the equation is solved, "one" for a single linearised step (Baraff and Witkin 1998).
    tolerance : residual of the equation, relative to the size of its terms.
    max_iterations : linear systems for one step.
    cg_tolerance : relative residual of the conjugate gradients.

    Attributes
    ----------
    c : where the stage lies in the step.
    history : memory entries, shape (dim,), on which the next step depends linearly, as it does on y.
    """

    implicit: ClassVar[bool] = True
    evaluations: ClassVar[int] = 2
    c: ClassVar[float] = 1.0
    history: ClassVar[tuple[str, ...]] = ()

    def __init__(
        self,
        linear_solver: Literal["auto", "direct", "cg"] = "auto",
        newton: Literal["full", "one"] = "full",
        tolerance: float = 1e-10,
        max_iterations: int = 50,
        cg_tolerance: float = 1e-10,
    ) -> None:
        if linear_solver not in ("auto", "direct", "cg"):
            raise unknown("linear_solver", linear_solver, ("auto", "direct", "cg"))
        if newton not in ("full", "one"):
            raise unknown("newton", newton, ("full", "one"))
        self.linear_solver, self.newton = linear_solver, newton
        self.tolerance = number("tolerance", tolerance, above=0.0)
        self.max_iterations = whole_number("max_iterations", max_iterations, at_least=1)
        self.cg_tolerance = number("cg_tolerance", cg_tolerance, above=0.0)
        # "one" step shows what it leaves out of the matrix: both paths leave out the same
        symmetric = linear_solver == "cg" or (linear_solver == "auto" and newton == "one")
        self._gradients = ConjugateGradients(self.cg_tolerance) if symmetric else None

    def step(self, system: System, t: Clock, y: Array, h: Clock, memory: Memory) -> Step:
        """The state at t + h."""
        memory = memory or self.start(system)
        length = np.broadcast_to(np.asarray(h, y.dtype), y.shape)
        z, gamma = self._stage(y, length, memory)
        linear = direct if self._gradients is None or system.order == 1 else self._gradients
        newton = Newton(linear, self.tolerance, self.max_iterations, self.newton == "one")
        stage, iterations, inner = newton.solve(system, t + self.c * h, z, gamma, y)
        rise = stage - y
        y1 = moved(h, y, stage if self.c == 1.0 else moved(rise, y, y + rise / self.c))
        dense = straight(h, y, y1, system.order == 2)
        after = self._remember(y, length, memory)
        if system.order == 2:
            velocities = np.arange(len(y)) >= len(y) // 2
            after = {**after, "rise": moved(h, memory["rise"], np.where(velocities, rise, 0.0))}
        return Step(t, h, y, y1, dense, after, iterations=iterations, cg_iterations=inner)

    def start(self, system: System) -> Memory:
        """No step before. The `rise` of the velocities to the last stage is where compiled gradients begin."""
        return {"rise": np.zeros(system.dim)} if system.order == 2 else {}

    def _stage(self, y: Array, h: Array, memory: Memory) -> tuple[Array, Array]:
        """z and gamma, shape (dim,)."""
        return y, self.c * h

    def _remember(self, y: Array, h: Array, memory: Memory) -> Memory:
        """Memory for the next step, from the start of this one."""
        return memory
