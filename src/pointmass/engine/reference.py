"""The reference engine: the solver's step, then what the colliders make of it, until every island has arrived.

The solver makes its step. Each particle's path is cast against the colliders; at its first hit it responds. A particle that is
an island of its own is stepped again by its solver over what is left of the step; one that others pull on finishes
the step ballistically with its new velocity.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.contact import Contacts
from pointmass.collisions.discrete import bounce
from pointmass.collisions.response import respond
from pointmass.collisions.swept import Paths, first_hit
from pointmass.particles import Array
from pointmass.solvers.advance import Stats, advance
from pointmass.solvers.base import Memory, Solver, Step
from pointmass.system import ParticleSystem

MOST_EVENTS = 8  # impacts of one particle in one step; then it rests until the step ends


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the last step: where everybody was between the clocks `t` and `t + h`, shape (dim,)."""

    step: Step
    t: Array
    h: Array


@dataclass(eq=False)
class ReferenceEngine:
    """Advances a particle system by steps of its solver.

    Attributes
    ----------
    memory : what the solver remembers between steps.
    pieces : of the last step, for looks in between.
    stats : work done so far.
    """

    system: ParticleSystem
    solver: Solver
    memory: Memory = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)
    stats: Stats = field(default_factory=Stats)

    def __post_init__(self) -> None:
        self._known: tuple[NDArray[np.int64], NDArray[np.intp]] | None = None
        surfaces = [s for c in self.system.colliders for s in c.surfaces]
        self.swept = [s for s in surfaces if s.contact == "swept"]
        self.discrete = [s for s in surfaces if s.contact == "discrete"]
        self.contacts = Contacts(surfaces, self.system.order, self.solver.implicit) if surfaces else None

    def step(self, t0: float, t1: float, births: Array | None = None) -> None:
        """Take the system from t0 to t1.

        Parameters
        ----------
        births : clock at which each particle begins [s], in [t0, t1], shape (n,); None = all at t0. A particle that is
            born between begins there and makes a first, shorter step.

        Raises
        ------
        Diverged
            A number is no longer finite, or the solver cannot take its step.
        """
        system = self.system
        self.pieces = []
        self._fit_memory()
        self._events = np.zeros(len(system.particles), np.intp)
        self._alone = np.bincount(system.island_of_particle)[system.island_of_particle] == 1
        clock = None if births is None else self._island_clock(births)
        hooks = {"prepare": self._prepare, "correct": self._correct} if self.contacts else {"correct": self._keep_piece}
        system.filter = self.contacts
        try:
            y, self.memory, stats = advance(
                system, self.solver, t0, t1, system.get_state(), self.memory, clock=clock, **hooks
            )
        finally:
            system.filter = None
        self.stats = self.stats + stats
        self._end, self._known = t1, (system.particles.id, system.island_of_particle)
        system.set_state(y, t1)

    def state_at(self, t: float) -> Array:
        """State at a time within the last step: dense output, shape (dim,); nothing is changed."""
        if t >= self._end or not self.pieces:
            return self.system.get_state()
        y = self.pieces[0].step.y0
        for piece in self.pieces:
            theta = (t - piece.t) / np.where(piece.h > 0, piece.h, 1)
            inside = (piece.h > 0) & (theta >= 0)
            y = np.where(inside, piece.step.dense(np.clip(theta, 0, 1)), y)
        return y

    def _fit_memory(self) -> None:
        """Carry what the solver remembers over births and deaths: each particle, and each island, keeps its own."""
        p = self.system.particles
        if not self.memory or self._known is None or self._known[0] is p.id:
            return
        ids, old_islands = self._known
        islands = self.system.island_of_particle
        then, now = _match(ids, p.id)
        fresh = self.solver.start(self.system)
        for name, new in fresh.items():
            old = self.memory[name]
            if len(new) == self.system.dim:
                shape = (self.system.order, -1, 3)
                new.reshape(shape)[:, now] = old.reshape(shape)[:, then]
            else:
                new[islands[now]] = old[old_islands[then]]
        self.memory = fresh

    # ------------------------------------------------------------------------------------------------ hooks

    def _prepare(self, clock: Array, h: Array, y: Array) -> Array:
        """Before each piece: who stands on what."""
        assert self.contacts is not None
        system = self.system
        y = y.copy()
        x, v = system.split(y)
        islands = system.island_of_particle
        t = clock[islands]

        def acceleration() -> Array:
            system.clear_forces()
            system.filter = None
            system.calculate_forces(t, x, v)
            system.filter = self.contacts
            p = system.particles
            return p.f / p.m[:, None] if system.order == 2 else p.f.copy()

        moving = (h[islands] > 0) & ~system.particles.pinned
        self.contacts.find(x, v, system.particles.m, acceleration, t, system.particles.radius, moving)
        return y

    def _keep_piece(self, step: Step, h: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        n = len(h)
        islands = self.system.islands
        dim = len(islands)
        self.pieces.append(Piece(step, np.broadcast_to(step.t, dim), h[islands]))
        return step.y1, np.full(n, np.nan), np.zeros(n, bool)

    def _correct(self, step: Step, h: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """After each piece: impacts."""
        assert self.contacts is not None
        system, p = self.system, self.system.particles
        _, clock, reset = self._keep_piece(step, h)
        islands = system.island_of_particle
        length = h[islands]
        start = np.broadcast_to(step.t, system.dim)[: 3 * len(p) : 3]
        y = step.y1.copy()
        x, v = system.split(y)
        self.contacts.settle(x, v, start + length, p.radius)
        moved = (length > 0) & ~p.pinned
        for surface in self.discrete:
            if system.order == 2:
                bounce(surface, x, v, start + length, p.radius, moved)
        rows = np.flatnonzero(moved) if self.swept else np.zeros(0, np.intp)
        paths = self._paths(step, x, v, start, length).take(rows)
        while len(rows):
            theta, which = self._first_hits(paths, rows)
            hit = np.isfinite(theta)
            rows, paths, theta, which = rows[hit], paths.take(hit), theta[hit], which[hit]
            rows, paths = self._respond(rows, paths, theta, which, x, v, clock)
        reset[islands[moved & np.isfinite(clock[islands])]] = True
        return (np.concatenate([x.ravel(), v.ravel()]) if system.order == 2 else x.ravel()), clock, reset

    # ------------------------------------------------------------------------------------------------ impacts

    def _paths(self, step: Step, x: Array, v: Array, start: Array, length: Array) -> Paths:
        """The cubics of all particles; those of a flow, which has no velocities, are straight."""
        x0, v0 = self.system.split(step.y0)
        if self.system.order == 1:
            v0 = (x - x0) / np.where(length > 0, length, 1)[:, None]
            return Paths(x0, v0, x, v0, start, length)
        return Paths(x0, v0, x, v, start, length)

    def _first_hits(self, paths: Paths, rows: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
        """Earliest hit of each path, and the number of the surface."""
        assert self.contacts is not None
        theta, which = np.full(len(rows), np.inf), np.zeros(len(rows), np.intp)
        for k, surface in enumerate(self.swept):
            bound = [s.rows for s in self.contacts.standing if s.surface is surface]
            look = ~np.isin(rows, bound[0]) if bound else np.ones(len(rows), bool)
            hit = np.full(len(rows), np.inf)
            hit[look] = first_hit(surface, paths.take(look), self.system.particles.radius[rows[look]])
            earlier = hit < theta
            theta, which = np.where(earlier, hit, theta), np.where(earlier, k, which)
        return theta, which

    def _respond(
        self, rows: NDArray[np.intp], paths: Paths, theta: Array, which: NDArray[np.intp], x: Array, v: Array, clock: Array
    ) -> tuple[NDArray[np.intp], Paths]:
        """Put particles at their impact with their new velocity; returns those that fly on within this piece."""
        place, speed, now = paths.position(theta), paths.velocity(theta), paths.t0 + theta * paths.h
        end = paths.t0 + paths.h
        rest = np.zeros(len(rows), bool)
        self._events[rows] += 1
        for k in np.unique(which):
            surface, at = self.swept[k], which == k
            normal, motion = surface.normal(place[at], now[at]), surface.velocity(now[at])
            tired = self._events[rows[at]] > MOST_EVENTS
            after = respond(speed[at], normal, motion, surface.restitution, surface.friction)
            stopped = respond(speed[at], normal, motion, 0.0, surface.friction)
            speed[at] = np.where(tired[:, None], stopped, after)
            rest[at] = tired
        alone = self._alone[rows]
        x[rows], v[rows] = place, speed
        back = alone & ~rest
        clock[self.system.island_of_particle[rows[back]]] = now[back]
        fly = ~alone & ~rest & (now < end)
        left = (end - now)[fly]
        target = place[fly] + left[:, None] * speed[fly]
        x[rows[fly]] = target
        return rows[fly], Paths(place[fly], speed[fly], target, speed[fly], now[fly], left)

    def _island_clock(self, births: Array) -> Array:
        islands = self.system.island_of_particle
        clock = np.full(int(islands.max(initial=-1)) + 1, -np.inf)
        np.maximum.at(clock, islands, births)
        return clock


def _match(old: NDArray[np.int64], new: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows in `old` and in `new` of the ids that are in both."""
    _, then, now = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return then, now
