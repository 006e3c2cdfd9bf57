"""Newton's method for the equation of an implicit stage, y = z + gamma F(t, y).

An order 2 system is solved for its velocities: x = z_x + gamma v holds to the bit from the first iteration on. Compiled
kernels make the same iterations, island by island, so everything here is a maximum over an island or a line of
arithmetic for each entry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, Clock, System
from pointmass.solvers.islands import Islands, Mask, largest, moved, number_of
from pointmass.solvers.linear import LinearSolver, diagonal, rows_of, solve

ROUNDINGS = 32.0  # of the state; a correction this small changes nothing
HALVINGS = 20
GROWTH = 1e3  # A stiff link that turns is stretched to second order, and the next iteration takes it back: chains 1e5
# times stiffer than their step resolves take 6 iterations a step, and do not converge if no growth is allowed at all.


@final
@dataclass(frozen=True)
class Newton:
    """How stage equations are solved: each island on its own, and left alone once it is solved.

    An island is solved when its residual is small against z and gamma F, or when the last correction was the round-off
    of its state: |dv| against |v| + |x|/gamma, for a force cannot be more exact than the places that it is computed
    from.

    Attributes
    ----------
    linear : solver of the linear systems of islands of more than one particle.
    tolerance : residual over the size of z and gamma F.
    max_iterations : linear systems before giving up.
    once : take a single linearised step and do not look at the residual (Baraff and Witkin 1998).
    """

    linear: LinearSolver
    tolerance: float
    max_iterations: int
    once: bool

    def solve(self, system: System, t: Clock, z: Array, gamma: Array, guess: Array) -> tuple[Array, int, int]:
        """The y that solves the stage, and the iterations of Newton's method and of the linear solver.

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
        stage = _Stage(system, t, z, gamma, guess)
        active = np.ones(stage.n, np.bool_)
        iterations = inner = 0
        for _ in range(self.max_iterations):
            load = np.where(active[stage.islands], stage.linearise(), 0.0)
            size = stage.largest(load)
            if not np.isfinite(size).all():
                raise stage.failure(int(np.flatnonzero(~np.isfinite(size))[0]), 0)
            active &= size > 0.0
            iterations += int(active.sum())
            delta, count = solve(self.linear, stage.blocks, stage.gamma, load, stage.free, system)
            inner += count
            if self.once:
                return stage.state(delta), iterations, inner
            active &= ~self._search(stage, delta, active, size)
            if not active.any():
                return stage.y, iterations, inner
        raise stage.failure(int(np.flatnonzero(active)[0]), self.max_iterations)

    def _search(self, stage: _Stage, delta: Array, active: Mask, size: Array) -> Mask:
        """Take the full step, or on islands where the residual grows too much the first of its halves where it does
        not; returns which islands are solved."""
        part = np.ones(stage.n)
        for _ in range(HALVINGS):
            trial = stage.state(part[stage.islands] * delta)
            residual = stage.residual(trial)
            now, allowed = stage.largest(residual), self.tolerance * stage.size(trial)
            worse = active & ~((now < GROWTH * size) | (now <= allowed))
            if not worse.any():
                break
            part = np.where(worse, 0.5 * part, part)
        stage.accept(trial, residual)
        result: Mask = (now <= allowed) | stage.roundoff(delta)
        return result


@final
class _Stage:
    """One equation y = z + gamma F(t, y), and where Newton's method is.

    Attributes
    ----------
    y : the state, shape (dim,).
    blocks : A and B of the Jacobian there (order 1: None and J).
    free : unknowns that are not pinned, shape (m,).
    gamma, islands : of each unknown, shape (m,).
    """

    def __init__(self, system: System, t: Clock, z: Array, gamma: Array, guess: Array) -> None:
        self.system, self.t = system, t
        self._second = system.order == 2
        m = len(z) // system.order
        self.gamma, self.islands, self._z, self._place = gamma[-m:], system.islands[-m:], z[-m:], z[:m]
        self.n = number_of(self.islands)
        self.y, self._m = guess, m
        self._step = largest(self.gamma, self.islands, self.n)
        self._residual = self.residual(guess)
        self._fresh = True
        alone = np.bincount(self.islands, minlength=self.n) == 3
        self._alone = rows_of(alone, self.islands)

    def residual(self, y: Array) -> Array:
        """u - z - gamma F(t, y) of the unknowns u, shape (m,)."""
        slope = self.system.deriv_eval(self.t, y)
        self._precision = float(np.finfo(np.result_type(slope, np.float32)).eps)  # a float32 system has no finer F
        result: Array = y[-self._m :] - self._z - self.gamma * slope[-self._m :]
        return result

    def linearise(self) -> Array:
        """Evaluate the Jacobian; the right side of the linear system, shape (m,)."""
        jacobian, m = self.system.jacobian(self.t, self.y), self._m
        if not self._second:
            self.blocks: tuple[Any, Any] = None, jacobian
            self.free = np.ones(m, np.bool_)
            return -self._residual
        self.blocks = jacobian[m:, :m], jacobian[m:, m:]
        if not self._fresh:
            return -self._residual
        self._fresh = False
        self.free = jacobian[:m, m:].diagonal() > 0.5  # 1, or 0 for pinned entries, up to the error of differences
        gap = np.where(self.free, self._place + self.gamma * self.y[m:] - self.y[:m], 0.0)
        pull = self.blocks[0] @ gap
        own, part = diagonal(self.blocks[0], self._alone), gap[self._alone]
        pull[self._alone] = own[:, :, 0] * part[:, :1] + own[:, :, 1] * part[:, 1:2] + own[:, :, 2] * part[:, 2:]
        result: Array = self.gamma * pull - self._residual
        return result

    def state(self, delta: Array) -> Array:
        """The state whose unknowns are `delta` further."""
        u = moved(delta, self.y[-self._m :], self.y[-self._m :] + delta)
        if not self._second:
            return u
        x = np.where(self.free, self._place + self.gamma * u, self.y[: self._m])
        return np.concatenate([x, u])

    def accept(self, y: Array, residual: Array) -> None:
        """Go to a state."""
        self.y, self._residual = y, residual

    def size(self, y: Array) -> Array:
        """Size of z and of what a state adds to it, for each island."""
        return self.largest(self._z) + self.largest(y[-self._m :] - self._z)

    def roundoff(self, delta: Array) -> Mask:
        """Islands where a correction is round-off of the state."""
        noise = ROUNDINGS * self._precision
        change, state = self.largest(delta), self.largest(self.y[-self._m :])
        if self._second:
            change, state = self._step * change, self._step * state + self.largest(self.y[: self._m])
        result: Mask = change <= noise * state
        return result

    def largest(self, values: Array) -> Array:
        """Largest size of each island, NaN where one is."""
        return largest(values, self.islands, self.n)

    def failure(self, island: int, iterations: int) -> Diverged:
        """The error for an island that is not solved."""
        islands: Islands = self.system.islands
        t = np.broadcast_to(self.t, islands.shape)[islands == island]
        return Diverged(
            f"the equations of an implicit step are not solved after {iterations} Newton iterations at"
            f" t = {t[0]:.6g} s (island {island}): use a smaller dt or a larger tolerance",
            time=float(t[0]),
        )
