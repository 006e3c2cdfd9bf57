"""What emitters of all shapes have in common: when, in which directions, how fast, for how long.

A shape says where, and what the normal is there: see `point`, `line`, `nozzle`, `sphere`, `box`, `mesh`.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.collisions.collider import lengths, unit
from pointmass.collisions.motion import Motion
from pointmass.emitters.chance import Chance, Quantity, Spread
from pointmass.emitters.emitter import CHILDREN, NOBODY, Array, Birth, Emitter, Parents
from pointmass.emitters.schedule import Bursts, Curve, Numbers, Schedule, Steady
from pointmass.errors import InvalidInput, number, shown, unknown
from pointmass.laws.parameter import Parameter, Vector
from pointmass.particles import attribute_name
from pointmass.tracing import functions as fn

BLOCK = 256  # births that are drawn at once
FASTEST = 1e9  # births per second
MOST = 2 ** (CHILDREN - 2)  # births that have ids, of each of the schedules

SPEED = Spread(5.0, 0.5)

Axis = Vector | str
Rate = float | str | Callable[[Any], Any]
Event = Literal["birth", "death", "impact", "trail"]


@dataclass(frozen=True, eq=False)
class Draws:
    """What chance has decided about some births, whenever they are.

    Attributes
    ----------
    place : relative to the emitter [m], shape (k, 3).
    velocity : likewise [m/s], shape (k, 3).
    lifetime : [s], shape (k,).
    columns : by name, shape (k,) each.
    """

    place: Array
    velocity: Array
    lifetime: Array
    columns: dict[str, Array]

    def take(self, rows: slice) -> Draws:
        """Some of them."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        return Draws(self.place[rows], self.velocity[rows], self.lifetime[rows], columns)


@dataclass(eq=False, repr=False)
class ShapedEmitter(Emitter):
    """Particles that come from a shape, which may move, or from the particles of another emitter.

    Births happen at times of their own, whatever the step and the frame rate: nothing clumps. Numbers that differ from
    particle to particle are given as `pm.Spread(mean, half_range)` or `pm.Normal(mean, sd)`, in a scene file as
    { mean = 5, half_range = 0.5 } or { mean = 5, sd = 0.5 }.

    Parameters
    ----------
    position : of the shape [m]: three numbers, or formulas or a function of t. Relative to the parent, with `of`.
    direction : axis of the cone of directions, or "normal": the shape's own normal at each place, or with on = "impact"
        that of the surface which was hit.
    rate : births per second [1/s], at most 1e9: a number, or a formula or function of t; births are then equally far
        apart in its integral. 100 by default, if nothing else makes particles.
    per_distance : births per metre of the path of the position [1/m].
    bursts : pairs of a time [s] and how many are born then, in order.
    start, stop : when it is open [s].
    speed : relative to the emitter [m/s].
    cone : half-angle of the cone of directions [degrees], in [0, 180].
    inherit : which part of the emitter's velocity, or the parent's, particles have from their birth on.
    lifetime : [s]; inf = for ever.
    mass : of each particle [kg], greater than 0.
    size : radius of each particle [m], at least 0.
    attributes : further columns of particles by name, such as { temperature = 900 }.
    name : by which other emitters can follow this one.
    of : name of the emitter whose particles have these as children.
    on : "death", also that by a surface or in a zone; "birth"; "impact": whenever a parent hits a surface, with its
        velocity after that; or "trail": all along the path of each parent, where rate, bursts, start and stop go by
        the age of the parent instead of t.
    count : children of each parent at its death or birth, or of each of its impacts; a mean is rounded up or down by
        chance. 100 by default.
    above : speed into the surface, along its normal, from which on an impact makes children [m/s], at least 0; what
        comes to rest touches slowly, again and again.
    """

    position: Vector = (0.0, 0.0, 0.0)
    _: KW_ONLY
    direction: Axis = (0.0, 1.0, 0.0)
    rate: Rate | None = None
    per_distance: float = 0.0
    bursts: Sequence[tuple[float, int]] = ()
    start: float = 0.0
    stop: float = math.inf
    speed: Chance = SPEED
    cone: float = 10.0
    inherit: float = 1.0
    lifetime: Chance = math.inf
    mass: Chance = 0.01
    size: Chance = 0.0
    attributes: dict[str, Chance] | None = None
    name: str = ""
    of: str = ""
    on: Event = "death"
    count: Chance | None = None
    above: float = 0.3

    def __post_init__(self) -> None:
        self._motion = Motion(self.position, "position")
        self._axis = None if isinstance(self.direction, str) else unit("direction", self.direction)
        if isinstance(self.direction, str) and self.direction != "normal":
            raise InvalidInput(f"direction = {self.direction!r} is not allowed: it must be three numbers or 'normal'")
        self._edge = float(fn.cos(math.radians(number("cone", self.cone, at_least=0, at_most=180, unit="degrees"))))
        self._inherited = number("inherit", self.inherit)
        self._speed = Quantity("speed", self.speed, at_least=0, unit="m/s")
        self._lifetime = Quantity("lifetime", self.lifetime, above=0, unit="s", forever=True)
        if not isinstance(self.attributes, (Mapping, type(None))):
            raise InvalidInput(f"attributes must be numbers by name, not {shown(self.attributes)}")
        given = {attribute_name(name): value for name, value in (self.attributes or {}).items()}
        self._columns = {
            "m": Quantity("mass", self.mass, above=0, unit="kg"),
            "radius": Quantity("size", self.size, at_least=0, unit="m"),
        } | {name: Quantity(f"attributes.{name}", value) for name, value in given.items()}
        self.attributes_made = tuple(given)
        self._check_event()
        self.at_impacts = self.on == "impact"
        number("above", self.above, at_least=0, unit="m/s")
        self._schedules = self._made_schedules()
        self._count = Quantity("count", 100 if self.count is None else self.count, at_least=0, at_most=1e9)
        self._kept: dict[int, tuple[Any, Draws]] = {}

    @abstractmethod
    def spot(self, u: Array) -> tuple[Array, Array]:
        """Places relative to the position [m], and unit normals there, each of shape (k, 3).

        Parameters
        ----------
        u : four numbers in [0, 1) for each birth, shape (k, 4).
        """

    def places(self, seed: int, stream: str, ids: NDArray[np.int64]) -> tuple[Array, Array]:
        """Places and normals of births, by their ids: `spot` of four numbers for each."""
        u = [random.uniform(seed, stream, ids, purpose) for purpose in ("place", "place 2")]
        return self.spot(np.concatenate(u, axis=1))

    # ------------------------------------------------------------------------------------------------ without parents

    def births(self, t0: float, t1: float, seed: int, stream: str) -> Birth:
        if self.of:
            return NOBODY
        parts = [self._scheduled(which, t0, t1, seed, stream) for which in self._schedules]
        return parts[0] if len(parts) == 1 else _in_order_of_time(parts)

    def _scheduled(self, which: int, t0: float, t1: float, seed: int, stream: str) -> Birth:
        """Births of one of the schedules in [t0, t1)."""
        schedule = self._schedules[which]
        first, end = schedule.counts(np.array([t0, t1])).tolist()
        if end > MOST:
            raise InvalidInput(f"{end} births are more than an emitter may have: use several, or a lower rate")
        draws = self._drawn(which, first, max(first, end), seed, stream)
        time = schedule.times(np.arange(first, end))
        x = self._motion.place(time) + draws.place
        v = draws.velocity + self._inherited * self._motion.velocity(time)
        return Birth(time, which * MOST + np.arange(first, end), x, v, draws.lifetime, draws.columns)

    def _drawn(self, which: int, first: int, end: int, seed: int, stream: str) -> Draws:
        """Draws for successive births; those for some more are kept for the next time."""
        lo, hi = first // BLOCK * BLOCK, -(-end // BLOCK) * BLOCK
        key = seed, stream, lo, hi
        if which not in self._kept or self._kept[which][0] != key:
            self._kept[which] = key, self._draw(which * MOST + np.arange(lo, hi), seed, stream)
        return self._kept[which][1].take(slice(first - lo, end - lo))

    def _draw(self, ids: NDArray[np.int64], seed: int, stream: str, normals: Array | None = None) -> Draws:
        """Draws for births of some ids, where surfaces have these normals."""
        place, own = self.places(seed, stream, ids)
        normal = own if normals is None else normals
        axis = normal if self._axis is None else np.atleast_2d(self._axis)  # one for all needs one frame
        way = _within_cone(axis, self._edge, random.uniform(seed, stream, ids, "direction"))
        speed = self._speed.draw(seed, stream, ids)
        columns = {name: quantity.draw(seed, stream, ids) for name, quantity in self._columns.items()}
        return Draws(place, speed[:, None] * way, self._lifetime.draw(seed, stream, ids), columns)

    # ------------------------------------------------------------------------------------------------ with parents

    def awaits(self, parents: Parents, t1: float, perilous: bool) -> NDArray[np.bool_]:
        if self.on == "death" and not perilous:
            return parents.death <= t1
        return np.full(len(parents.ids), self.on != "birth")

    def offspring(self, parents: Parents, t0: float, t1: float, seed: int, stream: str) -> Birth:
        if self.on == "impact":
            return self._splashes(parents, seed, stream)
        parts = [part for part in self._events(parents, t0, t1, seed, stream) if len(part[0])]
        if not parts:
            return NOBODY
        whose, child, time = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        ids = random.hashed(seed, stream, parents.ids[whose], child)
        draws, path = self._draw(ids, seed, stream), parents.paths.take(whose)
        theta = np.clip((time - path.t0) / np.where(path.h > 0, path.h, 1), 0, 1)
        x = path.position(theta) + self._motion.place(time) + draws.place
        v = draws.velocity + self._inherited * (path.velocity(theta) + self._motion.velocity(time))
        return Birth(time, ids, x, v, draws.lifetime, draws.columns)

    def _splashes(self, parents: Parents, seed: int, stream: str) -> Birth:
        """The children of impacts, at most as late as their parents' deaths."""
        turns, impacts = parents.impacts.turn, parents.impacts
        ids = random.hashed(seed, f"{stream} step", parents.ids[impacts.rows], parents.step)
        ids = random.hashed(seed, f"{stream} impact", ids, turns)
        rows = np.flatnonzero((impacts.speed >= self.above) & (impacts.time <= parents.death[impacts.rows]))
        counts = self._count.whole(seed, stream, ids[rows])
        which, child = _children(rows, np.zeros(len(rows), np.int64), counts)
        ids, hit = random.hashed(seed, stream, ids[which], child), impacts.take(which)
        draws = self._draw(ids, seed, stream, hit.normal)
        x = hit.x + self._motion.place(hit.time) + draws.place
        v = draws.velocity + self._inherited * (hit.v + self._motion.velocity(hit.time))
        return Birth(hit.time, ids, x, v, draws.lifetime, draws.columns)

    def _events(
        self, parents: Parents, t0: float, t1: float, seed: int, stream: str
    ) -> list[tuple[NDArray[np.intp], Numbers, Array]]:
        """For each child its parent's row, its number among that parent's children, and when it is born."""
        if self.on != "trail":
            at = parents.death if self.on == "death" else parents.birth
            rows = np.flatnonzero(parents.death <= t1 if self.on == "death" else parents.newborn)
            counts = self._count.whole(seed, stream, parents.ids[rows])
            whose, child = _children(rows, np.zeros(len(rows), np.int64), counts)
            return [(whose, child, at[whose])]
        found: list[tuple[NDArray[np.intp], Numbers, Array]] = []
        for which, schedule in self._schedules.items():
            first = schedule.counts(t0 - parents.birth)
            end = schedule.counts(np.minimum(t1, parents.death) - parents.birth)
            whose, child = _children(np.arange(len(first)), first, end - first)
            time = parents.birth[whose] + schedule.times(child)
            found.append((whose, which * 2**30 + child, np.clip(time, np.maximum(t0, parents.birth[whose]), t1)))
        return found

    # ------------------------------------------------------------------------------------------------ checking

    def _check_event(self) -> None:
        """Refuse what means nothing for the event that makes the particles."""
        if self.on not in get_args(Event):
            raise unknown("value of on:", self.on, get_args(Event))
        for what in ("name", "of"):
            if not isinstance(getattr(self, what), str):
                raise InvalidInput(f"{what} must be the name of an emitter in quotes, not {shown(getattr(self, what))}")
        if not self.of:
            unused, case = ["on", "count", "above"], "without the name of an emitter in of"
        elif self.on == "trail":
            unused, case = ["count", "above", "per_distance"], "with on = 'trail', which goes by rate and bursts"
        else:
            unused, case = ["rate", "per_distance", "bursts", "start", "stop"], f"with on = {self.on!r}: give count"
            if self.on != "impact" and "above" in self.arguments:
                unused, case = ["above"], f"with on = {self.on!r}: it is for impacts"
        for name in unused:
            if name in self.arguments:
                raise InvalidInput(f"{name} means nothing {case}")

    def _made_schedules(self) -> dict[int, Schedule]:
        """What makes particles: the rate (0), bursts (1) and the way (2)."""
        start = number("start", self.start, unit="s")
        stop = math.inf if self.stop == math.inf else number("stop", self.stop, above=start, unit="s")
        found: dict[int, Schedule] = {}
        if not isinstance(self.bursts, (Sequence, np.ndarray)):
            raise InvalidInput(f"bursts must be pairs of a time [s] and a count, not {shown(self.bursts)}")
        alone = not len(self.bursts) and not self.per_distance
        rate = (100.0 if alone else 0.0) if self.rate is None else self.rate
        if callable(rate) or isinstance(rate, str):
            self._rate = Parameter("rate", rate, unit="1/s", at_least=0, at_most=FASTEST)
            if not self._rate.common:
                raise InvalidInput("rate may depend on t and nothing else")
            self._rate.at(start)
            found[0] = Curve(self._rate_at, start, stop)
        elif number("rate", rate, at_least=0, at_most=FASTEST, unit="1/s") > 0:
            number("start", start, at_least=-MOST / rate, unit="s")
            found[0] = Steady(float(rate), start, stop)
        if len(self.bursts):
            found[1] = Bursts(self.bursts, start, stop)
        if number("per_distance", self.per_distance, at_least=0, unit="1/m") > 0:
            if self._motion.fixed is not None:
                raise InvalidInput(
                    "per_distance needs a position that moves: write it as formulas of t, such as ['2*t', 0, 0]"
                )
            found[2] = Curve(self._rate_of_the_way, start, stop)
        if not found:
            raise InvalidInput(
                "rate = 0 is not allowed alone: give a rate greater than 0 [1/s], bursts or per_distance"
            )
        return found

    def _rate_at(self, t: Array) -> Array:
        """Births per second, shape (k,), for a rate that changes."""
        return np.broadcast_to(self._rate.at(t)[0], np.shape(t)).astype(np.float64)

    def _rate_of_the_way(self, t: Array) -> Array:
        """Births per second that births per metre come to, shape (k,)."""
        return np.broadcast_to(self.per_distance * lengths(self._motion.velocity(t)), np.shape(t))


def frames(axis: Array) -> tuple[Array, Array]:
    """Two unit vectors at right angles to each axis and each other, shape (k, 3) each."""
    helper = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    a = np.cross(axis, helper)
    a = a / lengths(a)[:, None]
    return a, np.cross(axis, a)


def around(axis: Array, u: Array) -> Array:
    """Unit vectors at right angles to each axis, by a fraction u of a full turn, shape (k, 3)."""
    a, b = frames(axis)
    angle = 2 * np.pi * u
    result: Array = fn.cos(angle)[:, None] * a + fn.sin(angle)[:, None] * b
    return result


def _within_cone(axis: Array, edge: float, u: Array) -> Array:
    """Directions that are even over the cone around each axis, with the cosine `edge` of its half-angle."""
    height = 1 - u[:, 0] * (1 - edge)
    across = np.sqrt(np.maximum(1 - height * height, 0))
    result: Array = across[:, None] * around(axis, u[:, 1]) + height[:, None] * axis
    return result


def _children(rows: NDArray[np.intp], first: Numbers, count: Numbers) -> tuple[NDArray[np.intp], Numbers]:
    """Each row as often as it has children, and their numbers from `first` on."""
    ends = np.cumsum(count)
    return np.repeat(rows, count), np.arange(int(ends[-1]) if len(ends) else 0) + np.repeat(first - ends + count, count)


def _in_order_of_time(parts: Sequence[Birth]) -> Birth:
    order = np.argsort(np.concatenate([part.time for part in parts]), kind="stable")

    def merged(values: Sequence[Any]) -> Any:
        return np.concatenate(values)[order]

    columns = {name: merged([part.columns[name] for part in parts]) for name in parts[0].columns}
    names = ("time", "number", "x", "v", "lifetime")
    return Birth(**{name: merged([getattr(part, name) for part in parts]) for name in names}, columns=columns)
