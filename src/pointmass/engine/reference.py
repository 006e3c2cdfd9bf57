"""The reference engine: the solver's step, then what the colliders make of it, until every island has arrived.

The solver makes its step. Each particle's path is cast against the colliders; at its first hit it responds. A
particle that is an island of its own is stepped again by its solver over what is left of the step. One that others
pull on goes on straight with its new velocity; what it gains of their pull by arriving elsewhere than its solver
reckoned is taken off its rebound, so that bodies of springs bounce without gaining energy.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Collider, directions, lengths, rows_dot
from pointmass.collisions.contact import Contacts
from pointmass.collisions.discrete import bounce
from pointmass.collisions.impacts import Impacts
from pointmass.collisions.response import respond
from pointmass.collisions.swept import Paths, first_hit
from pointmass.errors import PointmassError
from pointmass.motions import Motions
from pointmass.particles import Array
from pointmass.solvers.advance import Stats, advance
from pointmass.solvers.base import Memory, Solver, Step
from pointmass.system import ParticleSystem

Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]
MOST_EVENTS = 8  # impacts of one particle in one step; then it rests until the step ends
KILLED = 2**32  # is added to its impacts where one is its last
EVICTIONS = 16  # passes that put back what other surfaces pushed into one


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch of the last step: everybody between the clocks `t` and `t + h`, shape (dim,).

    Attributes
    ----------
    step : as the solver made it.
    moved : what the colliders did to its end, shape (dim,); 0 for islands that were set back to go on from there.
    """

    step: Step
    t: Array
    h: Array
    moved: Array | float


@dataclass(eq=False)
class ReferenceEngine:
    """Advances a particle system by steps of its solver.

    Attributes
    ----------
    memory : what the solver remembers between steps.
    stats : work done so far.
    died : rows of the particles that a surface killed in the last step, to be taken away.
    watched : whether impacts are to be told.
    motions : of pinned particles.
    """

    system: ParticleSystem
    solver: Solver
    memory: Memory = field(default_factory=dict)
    stats: Stats = field(default_factory=Stats)
    died: Rows = field(default_factory=lambda: np.zeros(0, np.intp))
    watched: bool = False
    motions: Motions = field(default_factory=Motions)

    def __post_init__(self) -> None:
        surfaces = surfaces_of(self.system)
        self._swept = [s for s in surfaces if s.contact == "swept"]
        self._discrete = [s for s in surfaces if s.contact == "discrete"] if self.system.order == 2 else []
        self._walls = [*self._swept, *self._discrete]
        self._last_hits = np.array([1 + KILLED * (s.response == "kill") for s in self._swept], np.int64)
        self._contacts = Contacts(surfaces, self.system.order, self.solver.implicit)
        self._pieces: list[Piece] = []
        self._seen: list[Impacts] = []
        self._ids = self.system.particles.id
        self._islands = self.system.island_of_particle
        self._left = self._touchable()

    def step(self, t0: float, t1: float, births: Array | None = None) -> None:
        """Take the system from t0 to t1.

        Parameters
        ----------
        births : clock at which each particle begins [s], in [t0, t1], shape (n,); None = all at t0. A particle that is
            born between begins there and makes a first, shorter step.

        Raises
        ------
        Diverged
            A number is no longer finite, or the solver cannot take its step. The system keeps its state.
        """
        system = self.system
        self._pieces, self._seen = [], []
        self.memory = self._fitted_memory()
        self._lead(t0, t1)
        self._ids, self._islands = system.particles.id, system.island_of_particle
        self._events = np.zeros(len(self._ids), np.int64)
        self._ground = np.zeros((len(self._ids), 3))  # velocity of the surface that each hit last
        self._alone = np.bincount(self._islands)[self._islands] == 1
        clock = None if births is None else self._island_clock(births)
        self._began = system.particles.x.copy(), np.full(len(self._ids), t0) if births is None else births
        hooks: dict[str, Any] = {"correct": self._watch}
        if system.colliders:
            hooks = {"prepare": self._prepare, "correct": self._collide}
        try:
            y, self.memory, stats = advance(
                system, self.solver, t0, t1, system.get_state(), self.memory, clock=clock, **hooks
            )
        except PointmassError:
            self.memory = {}
            raise
        finally:
            system.filter = None
        self.stats = self.stats + stats
        self.died = np.flatnonzero(self._events >= KILLED)
        system.set_state(y, t1)
        self.motions.put(system.particles, system.particles.x, system.particles.v, t1)
        if self.memory:
            self._left = self._touchable()

    def _lead(self, t0: float, t1: float) -> None:
        """Put pins that move where the solver sees them in a step; they have always been there, as far as it knows."""
        p = self.system.particles
        rows = self.motions.put_in_step(p, t0, t1)
        if len(rows) and "y_before" in self.memory:
            before = self.memory["y_before"] = self.memory["y_before"].copy()
            for entries, column in zip(_by_particle(before, self.system.order), (p.x, p.v), strict=False):
                entries[rows] = column[rows]

    @property
    def impacts(self) -> Impacts:
        """Those of the last step, if it was `watched`."""
        return Impacts.of(self._seen)

    def recall(self) -> Memory:
        """A copy of what the solver remembers, for the particles as they are now."""
        memory = {**self.solver.start(self.system), **self._fitted_memory()}
        return {name: values.copy() for name, values in memory.items()}

    def remember(self, memory: Memory, work: Stats) -> None:
        """Go on from steps that somebody else made."""
        self.memory, self.stats = memory, self.stats + work
        self._ids, self._islands = self.system.particles.id, self.system.island_of_particle
        if memory:
            self._left = self._touchable()

    def left(self) -> Any:
        """What is known between two steps, to `leave` it again."""
        return self.memory, self.stats, self._ids, self._islands, self._left

    def leave(self, left: Any) -> None:
        """Know again what was known then."""
        self.memory, self.stats, self._ids, self._islands, self._left = left

    def state_at(self, t: float) -> Array:
        """State of the present particles at a time within the last step, shape (dim,); nothing is changed.

        Positions follow the cubics that are cast against the colliders (a flow: the solver's dense output). Particles
        that were born later are where they will be born.
        """
        system = self.system
        state = system.get_state()
        if t >= system.t or not self._pieces:
            return state
        y = self._pieces[0].step.y0
        for piece in self._pieces:
            theta = np.clip((t - piece.t) / np.where(piece.h > 0, piece.h, 1), 0, 1)
            inside = (piece.h > 0) & (piece.t <= t)
            y = np.where(inside, self._between(piece, theta) + theta * piece.moved, y)
        then, now = _match(self._ids, system.particles.id)
        _by_particle(state, system.order)[:, now] = _by_particle(y, system.order)[:, then]
        return state

    def _between(self, piece: Piece, theta: Array) -> Array:
        """What the solver's step says about the fractions theta of a piece, shape (dim,)."""
        if self.system.order == 1:
            return piece.step.dense(theta)
        (x0, v0), (x1, v1) = _by_particle(piece.step.y0, 2), _by_particle(piece.step.y1, 2)
        one = slice(0, 3 * len(x0), 3)  # clocks are the same for all numbers of a particle
        path = Paths(x0, v0, x1, v1, piece.t[one], piece.h[one], np.zeros(len(x0)))
        return np.concatenate([path.position(theta[one]).ravel(), path.velocity(theta[one]).ravel()])

    def _touchable(self) -> Array:
        """What a hand may change of each particle between two steps: state and pin, shape (order + 1, n, 3)."""
        p = self.system.particles
        pins = np.broadcast_to(p.pinned[:, None], p.x.shape)
        return np.concatenate([_by_particle(self.system.get_state(), self.system.order), pins[None]])

    def _fitted_memory(self) -> Memory:
        """What the solver remembers, carried over births, deaths and new links: each particle keeps its own.

        An island in which somebody was moved, pushed or pinned from outside starts anew.
        """
        if not self.memory:
            return {}
        system = self.system
        ids, islands = system.particles.id, system.island_of_particle
        now_is = self._touchable()
        if self._ids is ids and self._islands is islands and np.array_equal(now_is, self._left):
            return self.memory
        then, now = _match(self._ids, ids)
        touched = islands[now[(now_is[:, now] != self._left[:, then]).any(axis=(0, 2))]]
        kept = ~np.isin(islands[now], touched)
        then, now = then[kept], now[kept]
        fresh = self.solver.start(system)
        for name, new in fresh.items():
            old = self.memory[name]
            if len(new) == system.dim:
                _by_particle(new, system.order)[:, now] = _by_particle(old, system.order)[:, then]
            else:
                new[islands[now]] = old[self._islands[then]]
        return fresh

    # ------------------------------------------------------------------------------------------------ hooks

    def _prepare(self, clock: Array, h: Array, y: Array) -> Array:
        """Before each piece: who stands on what."""
        system, contacts = self.system, self._contacts
        y = y.copy()
        x, v = system.split(y)
        t = clock[self._islands]
        p = system.particles
        system.filter = None

        def acceleration() -> Array:
            system.clear_forces()
            system.calculate_forces(t, x, v)
            return p.f * p.w[:, None] if system.order == 2 else p.f.copy()

        length = h[self._islands]
        braking = np.where(self._alone, 0.0, self.solver.braking * length)
        contacts.find(x, v, p.m, acceleration, t, p.radius, (length > 0) & ~p.pinned, braking)
        system.filter = contacts if contacts.standing else None
        return y

    def _watch(self, step: Step, h: Array) -> tuple[Array, Array, Mask]:
        """After each piece without colliders: keep it for looks in between."""
        self._keep(step, h, 0.0)
        return step.y1, np.full(len(h), np.nan), np.zeros(len(h), bool)

    def _keep(self, step: Step, h: Array, moved: Array | float) -> None:
        length = np.tile(np.repeat(h[self._islands], 3), self.system.order)
        if self.system.order == 1:
            step.dense(0.5)  # asks for the slopes now: later the contacts are others
        self._pieces.append(Piece(step, np.broadcast_to(step.t, len(length)), length, moved))

    def _collide(self, step: Step, h: Array) -> tuple[Array, Array, Mask]:
        """After each piece: who stood is brought back to the surface, who hits something responds."""
        system, p, islands = self.system, self.system.particles, self._islands
        clock, reset = np.full(len(h), np.nan), np.zeros(len(h), bool)
        length = h[islands]
        start = np.broadcast_to(step.t, system.dim)[: 3 * len(p) : 3]
        end = start + length
        y = step.y1.copy()
        x, v = system.split(y)
        self._contacts.settle(x, v, end, length, p.radius)
        moved = (length > 0) & ~p.pinned
        doomed = np.zeros(len(p), bool)
        bounced: list[Impacts] = []
        for surface in self._discrete:
            before = v.copy() if self.watched else v
            hit = bounce(surface, x, v, end, p.radius, moved)
            reset[islands[hit]] = True
            doomed |= hit & (surface.response == "kill")
            if self.watched:
                bounced.append(Impacts.at(surface, np.flatnonzero(hit), end[hit], x[hit], before[hit], v[hit]))
        if self._swept:
            paths, planned = self._paths(step, x, v, start, length), (x.copy(), v.copy())
            rows = self._impacts(paths, np.flatnonzero(moved), x, v, clock)
            reset[islands[rows]] = True
            linked = np.unique(rows[~self._alone[rows] & ~self._tired(rows)])
            if len(linked):
                self._pay(linked, paths.v1[linked], planned, x, v, end)
        now = np.where(np.isnan(clock[islands]), end, clock[islands])
        self._events[doomed & (now == end)] += KILLED  # who hit something earlier on does not come to the end
        self._seen += [part.take((now == end)[part.rows]) for part in bounced]
        self._evict(x, v, now, moved)
        fix = y - step.y1
        _by_particle(fix, system.order)[:, ~np.isnan(clock[islands])] = 0
        self._keep(step, h, fix)
        system.filter = None  # what stands next is found before the next piece
        return y, clock, reset

    # ------------------------------------------------------------------------------------------------ impacts

    def _paths(self, step: Step, x: Array, v: Array, start: Array, length: Array) -> Paths:
        """The cubics of particles that are islands of their own; others, and those of a flow, go straight."""
        x0, v0 = self.system.split(step.y0)
        chord = (x - x0) / np.where(length > 0, length, 1)[:, None]
        curved = (self._alone & (self.system.order == 2))[:, None]
        v0, v = np.where(curved, v0, chord), np.where(curved, v, chord)
        return Paths(x0, v0, x, v, start, length, self.system.particles.radius)

    def _pay(self, rows: Rows, chord: Array, planned: tuple[Array, Array], x: Array, v: Array, end: Array) -> None:
        """Take what linked particles gained in their impacts off their rebounds; `v` in place.

        A particle whose velocity u jumps by J arrives at x, not at x1. It keeps what its solver adds to u, v1 - u: that
        is m (v1 - u) . J more kinetic energy, and f . (x - x1) less potential energy, with f the mean of both places:
        exact where forces are linear.

        Parameters
        ----------
        chord : velocity u of each row before its impacts [m/s], shape (k, 3).
        planned : x1, v1, where the solver came, shape (n, 3) each.
        """
        x1, v1 = planned
        jump, closing = v[rows] - chord, v1[rows] - chord
        v[rows] += closing
        t, n = np.tile(np.repeat(end, 3), 2), 3 * len(x)
        slopes = [self.system.deriv_eval(t, np.concatenate([p.ravel(), q.ravel()])) for p, q in ((x1, v1), (x, v))]
        a = 0.5 * (slopes[0] + slopes[1])[n:].reshape(-1, 3)[rows]
        gain = np.maximum(rows_dot(closing, jump) - rows_dot(a, x[rows] - x1[rows]), 0)
        away = directions(jump, lengths(jump), np.zeros(3))
        speed = rows_dot(v[rows] - self._ground[rows], away)
        left = np.where(speed > 0, np.sqrt(np.maximum(speed * speed - 2 * gain, 0)), speed)
        v[rows] -= (speed - left)[:, None] * away

    def _tired(self, rows: Rows) -> Mask:
        """Who has hit so much in this step, or so badly, that it rests until the end."""
        result: Mask = self._events[rows] > MOST_EVENTS
        return result

    def _impacts(self, paths: Paths, rows: Rows, x: Array, v: Array, clock: Array) -> Rows:
        """Cast the paths and respond until nobody hits anything; returns who did. `x`, `v`, `clock` in place."""
        paths, everyone = paths.take(rows), []
        while len(rows):
            theta, which = self._first_hits(paths, rows)
            hit = np.isfinite(theta)
            if not hit.any():
                break
            everyone.append(rows[hit])
            rows, paths = self._respond(rows[hit], paths.take(hit), theta[hit], which[hit], x, v, clock)
        return np.concatenate(everyone) if everyone else rows[:0]

    def _first_hits(self, paths: Paths, rows: Rows) -> tuple[Array, Rows]:
        """Earliest hit of each path, and the number of the surface."""
        theta, which = np.full(len(rows), np.inf), np.zeros(len(rows), np.intp)
        for k, surface in enumerate(self._swept):
            standing = self._contacts.on(surface)
            if len(standing):
                free = np.ones(len(self._ids), bool)
                free[standing] = False
                look = np.flatnonzero(free[rows])
                hit = np.full(len(rows), np.inf)
                hit[look] = first_hit(surface, paths.take(look))
            else:
                hit = first_hit(surface, paths)
            earlier = hit < theta
            theta, which = np.where(earlier, hit, theta), np.where(earlier, k, which)
        return theta, which

    def _respond(
        self, rows: Rows, paths: Paths, theta: Array, which: Rows, x: Array, v: Array, clock: Array
    ) -> tuple[Rows, Paths]:
        """Put particles at their impact with their new velocity; returns those that fly on within this piece."""
        place, speed, now = paths.position(theta), paths.velocity(theta), paths.time(theta)
        end = paths.t0 + paths.h
        self._events[rows] += self._last_hits[which]
        tired = self._tired(rows)
        for k in np.unique(which):
            surface, at = self._swept[k], which == k
            normal, motion = surface.normal(place[at], now[at]), surface.velocity(now[at])
            before = speed[at]
            speed[at] = respond(before, normal, motion, *surface.impact)
            if self.watched:
                self._seen.append(Impacts.at(surface, rows[at], now[at], place[at], before, speed[at]))
            self._ground[rows[at]] = motion
            rest = at & tired
            speed[rest] = surface.velocity(end[rest])
            place[rest] += surface.at(end[rest]) - surface.at(now[rest])
        x[rows], v[rows] = place, speed
        alone = self._alone[rows]
        back = alone & ~tired
        clock[self._islands[rows[back]]] = now[back]
        fly = ~alone & ~tired & (now < end)
        left = (end - now)[fly]
        target = place[fly] + left[:, None] * speed[fly]
        x[rows[fly]] = target
        return rows[fly], Paths(place[fly], speed[fly], target, speed[fly], now[fly], left, paths.radius[fly])

    def _evict(self, x: Array, v: Array, t: Array, moved: Mask) -> None:
        """Put out those whom one surface, or the end of their patience, pushed into another one; in place.

        Who began the step inside may stay as deep. Where surfaces leave no room at all, as in a closing press,
        somebody stays inside.
        """
        radius, rows = self.system.particles.radius, np.flatnonzero(moved)
        for _ in range(EVICTIONS):
            clean = np.ones(len(rows), bool)
            for surface in self._walls:
                clean &= self._evict_from(surface, rows, x, v, t, radius)
            rows = rows[~clean]
            if not len(rows):
                return
        self._send_back(x, v, t, rows)

    def _evict_from(self, surface: Collider, rows: Rows, x: Array, v: Array, t: Array, radius: Array) -> Mask:
        """Put particles out of one surface, in place; who was outside of it, but for round-off."""
        gap = surface.distance(x[rows], t[rows]) - radius[rows]
        inside, clean = gap < 0, np.ones(len(rows), bool)
        rows, gap = rows[inside], gap[inside]
        if len(rows):
            sunk = np.minimum(gap - self._depth(surface, rows), 0)
            normal = surface.normal(x[rows], t[rows])
            away = respond(v[rows], normal, surface.velocity(t[rows]), 0.0, 0.0)
            out = (sunk < 0)[:, None]
            x[rows] = np.where(out, x[rows] - sunk[:, None] * normal, x[rows])
            v[rows] = np.where(out, away, v[rows])
            clean[inside] = ~(sunk < -_roundoff(x[rows]))
        return clean

    def _send_back(self, x: Array, v: Array, t: Array, rows: Rows) -> None:
        """Whom surfaces push to and fro in a narrow corner rests where it was when the step began."""
        for surface in self._walls:
            gap = surface.distance(x[rows], t[rows]) - self.system.particles.radius[rows]
            stuck = gap < self._depth(surface, rows) - _roundoff(x[rows])
            x[rows[stuck]] = self._began[0][rows[stuck]]
            v[rows[stuck]] = surface.velocity(t[rows[stuck]])

    def _depth(self, surface: Collider, rows: Rows) -> Array:
        """How deep in a surface particles were when the step began [m], at most 0, shape (k,)."""
        x, clock = self._began
        depth: Array = surface.distance(x[rows], clock[rows]) - self.system.particles.radius[rows]
        return np.minimum(depth, 0)

    def _island_clock(self, births: Array) -> Array:
        clock = np.full(int(self._islands.max(initial=-1)) + 1, -np.inf)
        np.maximum.at(clock, self._islands, births)
        return clock


def surfaces_of(system: ParticleSystem) -> list[Collider]:
    """The surfaces of all colliders in the order in which they act: those of swept contact first."""
    surfaces = [s for c in system.colliders for s in c.surfaces]
    return sorted(surfaces, key=lambda s: s.contact == "discrete")


def _roundoff(x: Array) -> Array:
    """Round-off of a distance at each row of positions."""
    result: Array = 64 * np.finfo(x.dtype).eps * (1 + np.abs(x).max(axis=1))
    return result


def _by_particle(y: Array, order: int) -> Array:
    """A vector of shape (dim,) seen as (order, n, 3)."""
    return y.reshape(order, -1, 3)


def _match(old: NDArray[np.int64], new: NDArray[np.int64]) -> tuple[Rows, Rows]:
    """Rows in `old` and in `new` of the ids that are in both."""
    _, then, now = np.intersect1d(old, new, assume_unique=True, return_indices=True)
    return then, now
