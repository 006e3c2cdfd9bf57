"""Newton's method for the equation of an implicit stage, y = z + gamma F(t, y)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, Clock, System
from pointmass.solvers.islands import Islands, Mask, largest, moved, number_of
from pointmass.solvers.linear import LinearSolver

ROUNDINGS = 32.0  # of the largest product in J y; a residual this small is round-off
HALVINGS = 20
GROWTH = 1e3  # A stiff link that turns is stretched to second order, and the next iteration takes it back: chains 1e5
# times stiffer than their step resolves take 6 iterations a step, and do not converge if no growth is allowed at all.


@final
@dataclass(frozen=True)
class Newton:
    """How stage equations are solved: each island on its own, and left alone once it is solved.

    Attributes
    ----------
    linear : solver of the linear systems.
    tolerance : residual over the size of z and gamma F.
    max_iterations : linear systems before giving up.
    once : take a single linearised step and do not look at the residual (Baraff and Witkin 1998).
    """

    linear: LinearSolver
    tolerance: float
    max_iterations: int
    once: bool

    def solve(self, system: System, t: Clock, z: Array, gamma: Array, guess: Array) -> tuple[Array, int]:
        """The y that solves the stage, and the number of linear systems it took.

        Parameters
        ----------
        t : time at the stage [s], a number or shape (dim,).
        z : known part, shape (dim,).
        gamma : factor of F for each entry [s], shape (dim,).
        guess : where to begin, shape (dim,).

        Raises
        ------
        Diverged
            The iterations do not converge, or F is not finite.
        """
        stage = _Stage(system, t, z, gamma)
        y, r = guess, stage.residual(guess)
        active = stage.unsolved(r)
        for iteration in range(self.max_iterations):
            if not active.any():
                return y, iteration
            jacobian = system.jacobian(t, y)
            right = np.where(active[stage.islands], -r, 0.0)
            still = gamma * (abs(jacobian) @ np.ones(len(y))) == 0.0  # pinned, or h is 0: not even round-off
            delta = np.where(still, right, self.linear(jacobian, gamma, right, system))
            if self.once:
                return moved(delta, y, y + delta), 1
            allowed = stage.allowed(jacobian, y, r, self.tolerance)
            y, r = self._search(stage, y, delta, active, stage.excess(r, allowed), allowed)
            active &= ~(stage.excess(r, allowed) <= 1.0)
        if active.any():
            raise stage.failure(int(np.flatnonzero(active)[0]), self.max_iterations)
        return y, self.max_iterations

    def _search(
        self, stage: _Stage, y: Array, delta: Array, active: Mask, excess: Array, allowed: Array
    ) -> tuple[Array, Array]:
        """The full step, or on islands where the residual grows too much the first of its halves where it does not."""
        part = np.ones(stage.n)
        for _ in range(HALVINGS):
            trial = moved(delta, y, y + part[stage.islands] * delta)
            r = stage.residual(trial)
            now = stage.excess(r, allowed)
            worse = active & ~((now < GROWTH * excess) | (now <= 1.0))
            if not worse.any():
                break
            part = np.where(worse, 0.5 * part, part)
        return trial, r


@final
class _Stage:
    """One equation y = z + gamma F(t, y), and the size of its residual on each island."""

    def __init__(self, system: System, t: Clock, z: Array, gamma: Array) -> None:
        self.system, self.t, self.z, self.gamma = system, t, z, gamma
        self.islands: Islands = system.islands
        self.n = number_of(system.islands)
        velocity = (np.arange(len(z)) >= len(z) // 2) & (system.order == 2)
        self.groups: Islands = (system.islands + self.n * velocity).astype(np.intp)  # x and v have different units
        self.precision = float(np.finfo(np.float64).eps)

    def residual(self, y: Array) -> Array:
        """y - z - gamma F(t, y), shape (dim,)."""
        slope = self.system.deriv_eval(self.t, y)
        self.precision = float(np.finfo(np.result_type(slope, np.float32)).eps)  # a float32 system has no finer F
        r: Array = y - self.z - self.gamma * slope
        return r

    def unsolved(self, r: Array) -> Mask:
        """Islands with any residual at all; raises `Diverged` if one is not finite."""
        size = largest(r, self.islands, self.n)
        if not np.isfinite(size).all():
            raise self.failure(int(np.flatnonzero(~np.isfinite(size))[0]), 0)
        result: Mask = size != 0.0
        return result

    def allowed(self, jacobian: Any, y: Array, r: Array, tolerance: float) -> Array:
        """The residual each group may have: a part of z and gamma F, or the round-off of F, whichever is larger."""
        groups, n = self.groups, 2 * self.n
        size = largest(self.z, groups, n) + largest(y - self.z - r, groups, n)
        roundoff = np.abs(y) + self.gamma * (abs(jacobian) @ np.abs(y))
        noise = ROUNDINGS * self.precision * largest(roundoff, groups, n)
        return np.maximum(tolerance * size + noise, np.finfo(np.float64).tiny)

    def excess(self, r: Array, allowed: Array) -> Array:
        """Largest residual over what is allowed, for each island."""
        ratio = largest(r, self.groups, 2 * self.n) / allowed
        result: Array = np.maximum(ratio[: self.n], ratio[self.n :])
        return result

    def failure(self, island: int, iterations: int) -> Diverged:
        """The error for an island that is not solved."""
        t = np.broadcast_to(self.t, self.islands.shape)[self.islands == island]
        return Diverged(
            f"the equations of an implicit step are not solved after {iterations} Newton iterations at"
            f" t = {t[0]:.6g} s (island {island}): use a smaller dt or a larger tolerance",
            time=float(t[0]),
        )
