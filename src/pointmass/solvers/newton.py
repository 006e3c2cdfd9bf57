"""Newton's method for the equation of an implicit stage, y = z + gamma F(t, y).

An order 2 system is solved for its velocities: x = z_x + gamma v holds to the bit from the first iteration on. Where
forces have a potential, the equation says that a function of the velocities has its least value, M |v - z|^2 / 2 plus
the potential at z_x + gamma v: Newton's method goes downhill on it, however folded a cloth is. Compiled
kernels make the same iterations, island by island, so everything here is a maximum or a sum over an island, or a line
of arithmetic for each entry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import Diverged
from pointmass.solvers.base import Array, Clock, System
from pointmass.solvers.islands import Mask, largest, moved, number_of, total
from pointmass.solvers.linear import LinearSolver, diagonal, direct, rows_of, solve

ROUNDINGS = 32.0  # of the state; a correction this small changes nothing
HALVINGS = 20
GROWTH = 1e3  # of a residual, where nothing says how far to go
TURN = 0.5  # A step may go beyond the lowest point, up to this part of the slope at which it began.
BOLD = 35  # iterations in which factors of the exact matrix are trusted
LESS, LEAST = 0.25, 0.05  # what becomes of the share after a direction that curves downwards, and below which it is 0
MORE, AGAIN = 1.5, 0.02  # what becomes of it after one without


@dataclass(frozen=True)
class Solution:
    """What Newton's method found.

    Attributes
    ----------
    y : the state, shape (dim,).
    iterations, inner : of Newton's method and of the linear solver, counted for each island.
    unsolved : islands that are not solved, shape (islands,).
    tried : iterations of those when they were given up, shape (islands,).
    """

    y: Array
    iterations: int
    inner: int
    unsolved: Mask
    tried: NDArray[np.intp]

    def failure(self, system: System, t: Clock) -> Diverged:
        """The error for the first island that is not solved at time t."""
        island = int(np.flatnonzero(self.unsolved)[0])
        when = float(np.broadcast_to(t, system.islands.shape)[system.islands == island][0])
        return Diverged(
            f"the equations of an implicit step are not solved after {self.tried[island]} Newton iterations at"
            f" t = {when:.6g} s (island {island}): use a smaller dt or a larger tolerance",
            time=when,
        )


@final
@dataclass(frozen=True)
class Newton:
    """How stage equations are solved: each island on its own, and left alone once it is solved.

    An island is solved when its residual is small against z and gamma F, or when the last correction was the round-off
    of its state: |dv| against |v| + |x|/gamma, for a force cannot be more exact than the places that it is computed
    from.

    The first iteration takes the matrix that is positive definite by itself (`share` 0, see `System.jacobian`). The
    others begin with the exact one, and with less of it wherever that curves downwards: what pushes would be stretched
    by its own bending. A step whose end rises too steeply is halved. Where matrices are factorised, and for single
    particles, the exact one comes first, and nobody asks where it leads: stiff chains, which no way downhill follows
    for long, are solved in a few iterations. If they are not, they begin again.

    Attributes
    ----------
    linear : solver of the linear systems of islands of more than one particle.
    tolerance : residual over the size of z and gamma F.
    max_iterations : corrections before giving up.
    once : take a single linearised step and do not look at the residual (Baraff and Witkin 1998).
    """

    linear: LinearSolver
    tolerance: float
    max_iterations: int
    once: bool

    def solve(self, system: System, t: Clock, z: Array, gamma: Array, guess: Array) -> Solution:
        """The y that solves the stage.

        Parameters
        ----------
        t : time at the stage [s], a number or shape (dim,).
        z : known part, shape (dim,).
        gamma : factor of F for each entry [s], shape (dim,).
        guess : where to begin, shape (dim,).
        """
        stage = _Stage(system, t, z, gamma, guess)
        active, unsolved = np.ones(stage.n, np.bool_), np.zeros(stage.n, np.bool_)
        tried = np.full(stage.n, self.max_iterations)
        bold = ((self.linear is direct) | stage.alone) & stage.second & (not self.once)
        share, begins = np.where(bold, 1.0, 0.0), np.ones(stage.n, np.bool_)
        iterations = inner = 0
        for k in range(self.max_iterations):
            if k == BOLD and bold.any():
                stage.restart(active & bold)
                share, begins, bold = np.where(bold, 0.0, share), bold, np.zeros(stage.n, np.bool_)
            load = np.where(active[stage.islands], stage.linearise(share, begins), 0.0)
            size = stage.largest(load)
            lost = ~np.isfinite(size)
            unsolved, tried = unsolved | lost, np.where(lost, k, tried)
            active &= (size > 0.0) & ~lost
            load = np.where(active[stage.islands], load, 0.0)
            iterations += int(active.sum())
            delta, count, definite = solve(self.linear, stage.blocks, stage.gamma, load, stage.free, system)
            inner += count
            if self.once:
                return Solution(stage.state(delta), iterations, inner, unsolved, tried)
            while (again := active & ~bold & (share > 0.0) & ~(definite & stage.falls(load, delta))).any():
                share = np.where(again, np.where(LESS * share < LEAST, 0.0, LESS * share), share)
                stage.linearise(share, np.zeros(stage.n, np.bool_))
                less = np.where(again[stage.islands], load, 0.0)
                other, count, definite = solve(self.linear, stage.blocks, stage.gamma, less, stage.free, system)
                delta = np.where(again[stage.islands], other, delta)
                definite |= ~again
                iterations, inner = iterations + int(again.sum()), inner + count
            active &= ~self._search(stage, load, delta, active, size, bold | begins)
            if not active.any():
                return Solution(stage.y, iterations, inner, unsolved, tried)
            share = np.where(bold | begins, 1.0, np.minimum(MORE * share + AGAIN, 1.0))
            begins = np.zeros(stage.n, np.bool_)
        return Solution(stage.y, iterations, inner, unsolved | active, tried)

    def _search(self, stage: _Stage, load: Array, delta: Array, active: Mask, size: Array, bold: Mask) -> Mask:
        """Take the full step, or on islands where it goes too far the first of its halves where it does not; returns
        which islands are solved. What is bold goes too far only where its residual grows too much."""
        part = np.ones(stage.n)
        quiet, slope = stage.roundoff(delta), stage.work(load, delta)
        downhill = (slope > 0.0) & ~bold & stage.second
        for _ in range(HALVINGS):
            trial = stage.state(part[stage.islands] * delta)
            residual = stage.residual(trial)
            now, allowed = stage.largest(residual), self.tolerance * stage.size(trial)
            short = np.where(downhill, stage.work(residual, delta) <= TURN * slope, now < GROWTH * size)
            worse = active & ~(short | (now <= allowed) | quiet)
            if not worse.any():
                break
            part = np.where(worse, 0.5 * part, part)
        stage.accept(trial, residual)
        result: Mask = (now <= allowed) | quiet
        return result


def left(system: System, t: Clock, z: Array, gamma: Array, y: Array) -> Array:
    """What y leaves of a stage, over the size of its terms on the island, for each unknown, shape (m,)."""
    stage = _Stage(system, t, z, gamma, y)
    size = stage.size(y)[stage.islands]
    result: Array = stage.residual(y) / np.where(size > 0.0, size, 1.0)
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
    alone : islands of one particle, shape (islands,).
    second : whether the system has order 2.
    """

    def __init__(self, system: System, t: Clock, z: Array, gamma: Array, guess: Array) -> None:
        self.system, self.t = system, t
        self.second = system.order == 2
        m = len(z) // system.order
        self.gamma, self.islands, self._z, self._place = gamma[-m:], system.islands[-m:], z[-m:], z[:m]
        self.n = number_of(self.islands)
        self.y, self._m = guess, m
        self._step = largest(self.gamma, self.islands, self.n)
        self._guess, self._residual = guess, self.residual(guess)
        self.alone = np.bincount(self.islands, minlength=self.n) == 3
        self._alone = rows_of(self.alone, self.islands)

    def residual(self, y: Array) -> Array:
        """u - z - gamma F(t, y) of the unknowns u, shape (m,)."""
        slope = self.system.deriv_eval(self.t, y)
        self._precision = float(np.finfo(np.result_type(slope, np.float32)).eps)  # a float32 system has no finer F
        result: Array = y[-self._m :] - self._z - self.gamma * slope[-self._m :]
        return result

    def restart(self, mask: Mask) -> None:
        """Go back to where some islands began."""
        self.y = np.where(mask[self.system.islands], self._guess, self.y)
        self._residual = self.residual(self.y)

    def linearise(self, share: Array, begins: Mask) -> Array:
        """Evaluate the Jacobian with the share of each island; the right side of the linear system, shape (m,).

        Of islands that begin, positions do not belong to the velocities yet.
        """
        m, exact = self._m, not self.second or bool((share == 1.0).all())
        jacobian = self.system.jacobian(self.t, self.y, None if exact else share[self.system.islands])
        if not self.second:
            self.blocks: tuple[Any, Any] = None, jacobian
            self.free = np.ones(m, np.bool_)
            return -self._residual
        self.blocks = jacobian[m:, :m], jacobian[m:, m:]
        if not begins.any():
            return -self._residual
        self.free = jacobian[:m, m:].diagonal() > 0.5  # 1, or 0 for pinned entries, up to the error of differences
        self._mass = np.where(self.free, self.system.inertia, 0.0)
        moves = self.free & begins[self.islands]
        gap = np.where(moves, self._place + self.gamma * self.y[m:] - self.y[:m], 0.0)
        pull = self.blocks[0] @ gap
        own, part = diagonal(self.blocks[0], self._alone), gap[self._alone]
        pull[self._alone] = own[:, :, 0] * part[:, :1] + own[:, :, 1] * part[:, 1:2] + own[:, :, 2] * part[:, 2:]
        result: Array = self.gamma * pull - self._residual
        return result

    def state(self, delta: Array) -> Array:
        """The state whose unknowns are `delta` further."""
        u = moved(delta, self.y[-self._m :], self.y[-self._m :] + delta)
        if not self.second:
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
        if self.second:
            change, state = self._step * change, self._step * state + self.largest(self.y[: self._m])
        result: Mask = change <= noise * state
        return result

    def largest(self, values: Array) -> Array:
        """Largest size of each island, NaN where one is."""
        return largest(values, self.islands, self.n)

    def work(self, load: Array, delta: Array) -> Array:
        """M load . delta of each island: how fast its potential falls; 0 for order 1."""
        return total(self._mass * load * delta, self.islands, self.n) if self.second else np.zeros(self.n)

    def falls(self, load: Array, delta: Array) -> Mask:
        """Islands that a correction takes downhill, and those that know no hill: single particles, order 1."""
        result: Mask = (self.work(load, delta) > 0.0) | self.alone | (not self.second)
        return result
