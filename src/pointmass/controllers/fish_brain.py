"""The brain of artificial fish: senses, mental state, intention, behaviour, for all fish at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.controllers import intention as order
from pointmass.controllers import mental_state as mental
from pointmass.controllers import senses
from pointmass.controllers.controller import Controller
from pointmass.controllers.routines import Seen, ways
from pointmass.controllers.swimmers import BRAKE, STEADY, Swimmers, directed
from pointmass.errors import InvalidInput, finite_array, number, unknown
from pointmass.laws.formula import Formula
from pointmass.particles import Particles
from pointmass.system import ParticleSystem

Array = NDArray[np.float64]
KINDS = ("prey", "predator", "pacifist")
HABITS = ("none", "when afraid", "always")
UNITS = 8.0  # of distance in a body length, in which stimuli are counted
BITE = 0.25  # distance of the nose from food at which it is eaten, in body lengths
CATCH = 0.5  # and from the middle of prey, in lengths of the predator
TRIES = 64  # places that are looked at for one who comes anew
NEIGHBOURS = 7  # that a fish minds
COOLING = 20.0  # after a mating, in which nobody is tempted [s]


class FishBrain(Controller):
    """Gives fish senses, needs and behaviour (Tu & Terzopoulos, Artificial Fishes, SIGGRAPH 1994).

    An eye at the nose sees what is within `sight` and at less than 150 degrees from the body's axis, unless a collider
    stands in between; food is smelt all around. From hunger, libido and fear an intention follows, and from that one of
    eight routines: to avoid an obstacle or a fish, to eat, mate, leave, wander, escape or school. What is eaten comes
    again elsewhere, food in `feeding` and fish in `home`, so that there are always as many.

    Parameters
    ----------
    on : name of a body of fish, or of several.
    kinds : of each body: "prey" fears predators, "predator" eats prey, "pacifist" does neither; one for all, or a list.
    food : name of the group of particles that prey and pacifists eat; "" = none.
    schools : who swims together with others of its body: "none", "when afraid" or "always" (for want of other wishes);
        one for all, or a list.
    sight : how far they see [m].
    smell : how far they smell food [m].
    home : middle [m] and radius [m] of the water in which they stay, four numbers.
    feeding : middle and edges of the box in which food comes again [m], six numbers; None = the upper half of home.
    temperature : of the water, a formula of x, y, z and t [degrees C].
    comfort : lowest and highest temperature that suits them [degrees C].
    appetite : meals that fill.
    mood : seconds since the last meal and the last mating at the start, at most, each by chance [s].
    reach : D0, distance of a predator at which its fear is 1, in body lengths.
    afraid, panic : fear f0 that counts, and f1 of one predator beyond which a school does not help.
    urge : hunger or libido r that counts, in [0, 0.5].
    spacing : of a school, in body lengths.
    amplitude, frequency : of the beat at full speed, as for `Swim`; [1/s].
    turn : sharpest turn, as for `Swim`.
    vigour : speed of each body, as a part of that; one for all, or a list.
    period : as for every controller.

    Attributes
    ----------
    memory : "intention" has the number of each fish's routine (`pointmass.controllers.intention.NAMES`), "eaten" how
        many meals it has had, "caught" how often it was one, "mated" how often it has.

    Notes
    -----
    Formulas and their constants are in `mental_state`; where sources differ or are silent these are defaults of ours:
    reach, spacing, speeds, and that stimuli count distances in eighths of a body length.
    """

    def __init__(
        self,
        on: str | Sequence[str] = "fish",
        kinds: str | Sequence[str] = "prey",
        food: str = "",
        schools: str | Sequence[str] = "when afraid",
        sight: float = 2.0,
        smell: float = 3.0,
        home: Any = (0.0, 0.0, 0.0, 3.0),
        feeding: Any = None,
        temperature: str = "20",
        comfort: Any = (15.0, 25.0),
        appetite: float = 5.0,
        mood: float = 200.0,
        reach: float = 2.0,
        afraid: float = 0.3,
        panic: float = 0.7,
        urge: float = 0.3,
        spacing: float = 1.0,
        amplitude: float = 0.2,
        frequency: float = 2.5,
        turn: float = 0.2,
        vigour: Any = 1.0,
        period: float = 0.1,
    ) -> None:
        super().__init__(period)
        self.on = [on] if isinstance(on, str) else list(on)
        self.kinds = self._of_bodies("kinds", kinds, KINDS)
        self.schools = self._of_bodies("schools", schools, HABITS)
        self.food = food
        self.sight = number("sight", sight, above=0, unit="m")
        self.smell = number("smell", smell, at_least=0, unit="m")
        place = finite_array("home", home, (4,))
        self.home, self.range = place[:3], number("radius of home", place[3], above=0, unit="m")
        box = finite_array("feeding", feeding, (6,)) if feeding is not None else None
        half = np.array([1.0, 0.5, 1.0]) * self.range
        self.feeding = (place[:3] + np.array([0.0, 0.5 * self.range, 0.0]), half) if box is None else (box[:3], box[3:])
        self.temperature = Formula(temperature, ("x", "y", "z", "t"), what="temperature")
        low, high = finite_array("comfort", comfort, (2,))
        if low >= high:
            raise InvalidInput(f"comfort = {list(comfort)} is not allowed: the lowest must be below the highest")
        self.comfort = float(low), float(high)
        self.appetite = number("appetite", appetite, above=0)
        self.mood = number("mood", mood, at_least=0, unit="s")
        self.reach = number("reach", reach, above=0)
        self.afraid = number("afraid", afraid, at_least=0, at_most=1)
        self.panic = number("panic", panic, at_least=self.afraid, at_most=1)
        self.urge = number("urge", urge, at_least=0, at_most=0.5)
        self.spacing = number("spacing", spacing, above=0)
        self.amplitude = number("amplitude", amplitude, at_least=0, at_most=0.4)
        self.frequency = number("frequency", frequency, above=0, at_most=10, unit="1/s")
        self.turn = number("turn", turn, at_least=0, at_most=0.4)
        every = [vigour] * len(self.on) if isinstance(vigour, (int, float)) else vigour
        self.vigour = finite_array("vigour", every, (len(self.on),))
        if (self.vigour < 0).any() or (self.vigour > 1).any():
            raise InvalidInput(f"vigour = {vigour} is not allowed: each must be from 0 to 1")

    def bind(self, system: ParticleSystem, seed: int) -> None:
        """Find the fish and their food."""
        p = system.particles
        self._fish = fish = Swimmers(system, self.on)
        self._seed = seed
        self._food = p.id[p.select(self.food)] if self.food else np.zeros(0, np.int64)
        kinds = np.array([KINDS.index(kind) for kind in self.kinds])[fish.kind]
        self._prey, self._predator = kinds == 0, kinds == 1
        self._habit = np.array([HABITS.index(habit) for habit in self.schools])[fish.kind]
        n = len(fish)
        ages = self.mood * random.uniform(seed, "fish", fish.ids, "mood")
        zero = np.zeros(n)
        self.memory = {
            **fish.rest(),
            "heading": fish.pose(p)[3],
            "wish": fish.pose(p)[3],
            "intention": np.full(n, order.WANDER),
            "meals": self.appetite * random.uniform(seed, "fish", fish.ids, "meals")[:, 0],
            "eaten": zero.copy(),
            "meal": system.t - ages[:, 0],
            "mating": system.t - ages[:, 1],
            "mated": zero.copy(),
            "caught": zero.copy(),
            "dropped": np.zeros(len(self._food)),
            "looks": np.zeros(1),
        }

    def control(self, system: ParticleSystem, t: float) -> None:
        """Look, feel, decide, and swim."""
        p, fish, memory = system.particles, self._fish, self.memory
        nose, middle, _, axis = fish.pose(p)
        heading = directed(self.smooth("heading", axis, STEADY))
        look = int(memory["looks"][0])
        memory["looks"] = memory["looks"] + 1
        food = p.x[p.rows(self._food)].astype(np.float64)
        seen = self._look(system, t, nose, middle, heading, axis, food)
        chance = random.uniform(self._seed, "fish", fish.ids, f"look {look}")
        doing = self._decide(seen, middle, t, chance[:, 0])
        memory["intention"] = doing
        way, speed = ways(doing, seen, memory["wish"], chance, self.spacing * fish.length)
        way = np.where((way == 0).all(axis=1, keepdims=True), heading, way)
        speed = speed * self.vigour[fish.kind]
        memory["wish"] = directed(way)
        turn, angle = fish.steer(heading, way)
        facing = (heading * memory["wish"]).sum(axis=1)
        angle = np.where((doing == order.AVOID_OBSTACLE) & (facing < 0), BRAKE, angle)
        beat = self.amplitude * np.sqrt(speed)
        fish.drive(memory, t, beat, self.frequency * (0.3 + 0.7 * speed), self.turn * turn, angle)
        self._eat(system, t, seen, look)

    # ------------------------------------------------------------------------------------------------ inside

    def _of_bodies(self, name: str, value: str | Sequence[str], allowed: Sequence[str]) -> list[str]:
        """One of the allowed words for each body."""
        words = [value] * len(self.on) if isinstance(value, str) else list(value)
        if not self.on or len(words) != len(self.on):
            raise InvalidInput(f"{name} has {len(words)} entries for {len(self.on)} bodies: give one for each")
        for word in words:
            if word not in allowed:
                raise unknown(f"value of {name}:", word, allowed)
        return words

    def _look(
        self, system: ParticleSystem, t: float, nose: Array, middle: Array, heading: Array, axis: Array, food: Array
    ) -> Seen:
        """Everything that each fish perceives."""
        fish = self._fish
        n, length = len(fish), fish.length
        seen = Seen(nose=nose, middle=middle, heading=heading, length=length, home=self.home, range=self.range)
        seen.neighbours, seen.apart = self._mates(middle, axis)
        surfaces = [surface for obstacle in system.colliders for surface in obstacle.surfaces]
        away = np.zeros((n, 3))
        for ahead in (0.0, 0.5, 1.0, 2.0):
            point = nose + (ahead * length)[:, None] * heading
            for surface in surfaces:
                d = surface.distance(point, t) + 0.5 * ahead * length  # what is farther ahead matters less
                seen.wall = np.minimum(seen.wall, d)
                away += np.maximum(1.0 - d / length, 0.0)[:, None] * surface.normal(point, t)
        seen.normal = directed(away)
        seen.predators = middle[self._predator]
        seen.threats, seen.danger = self._targets(system, t, seen, axis, self._prey, seen.predators, 4)
        eaters = ~self._predator
        self._choose(seen, *self._targets(system, t, seen, axis, eaters, food, 8, self.smell), food)
        prey = np.flatnonzero(self._prey)
        self._choose(seen, *self._targets(system, t, seen, axis, self._predator, middle[prey], 8), middle[prey])
        degrees = np.broadcast_to(self.temperature(_at(middle, t)), n)
        seen.suits = (degrees >= self.comfort[0]) & (degrees <= self.comfort[1])
        if not seen.suits.all():
            seen.warmer = self._gradient(middle, length, t) * np.where(degrees < self.comfort[0], 1.0, -1.0)[:, None]
        return seen

    def _gradient(self, x: Array, length: Array, t: float) -> Array:
        """Of the temperature, by what is felt half a length to both sides."""
        result = np.zeros_like(x)
        for k in range(3):
            step = np.zeros_like(x)
            step[:, k] = 0.5 * length
            result[:, k] = self.temperature(_at(x + step, t)) - self.temperature(_at(x - step, t))
        return directed(result)

    def _mates(self, middle: Array, axis: Array) -> tuple[NDArray[np.intp], Array]:
        """The nearest fish in view of each, and their distances; those out of view are infinitely far."""
        found, d = senses.nearest(middle, middle, NEIGHBOURS + 1, self.sight)
        found, d = found[:, 1:], d[:, 1:].copy()  # the first is oneself
        if found.shape[1]:
            view = senses.in_view(middle[:, None], axis[:, None], middle[found], self.sight)
            d[~view] = np.inf
        return found, d

    def _targets(
        self,
        system: ParticleSystem,
        t: float,
        seen: Seen,
        axis: Array,
        who: NDArray[np.bool_],
        targets: Array,
        most: int,
        smell: float = 0.0,
    ) -> tuple[NDArray[np.intp], Array]:
        """Numbers of targets that each of `who` perceives and their distances, inf where it does not."""
        n, k = len(who), min(most, len(targets))
        found, d = np.zeros((n, k), np.intp), np.full((n, k), np.inf)
        rows = np.flatnonzero(who)
        if not k or not len(rows):
            return found, d
        eye = seen.nose[rows]
        found[rows], d[rows] = senses.nearest(eye, targets, k, max(self.sight, smell))
        place = targets[found[rows]]
        there = np.isfinite(d[rows])
        view = there & senses.in_view(eye[:, None], axis[rows][:, None], place, self.sight)
        i, j = np.nonzero(view)
        view[i, j] = ~senses.hidden(eye[i], place[i, j], system.colliders, t)
        d[rows] = np.where(view | (there & (d[rows] < smell)), d[rows], np.inf)
        return found, d

    def _choose(self, seen: Seen, found: NDArray[np.intp], d: Array, targets: Array) -> None:
        """Note the nearest meal of those who perceive one."""
        if not d.shape[1]:
            return
        best = d.argmin(axis=1)
        every = np.arange(len(d))
        some = np.isfinite(d[every, best])
        seen.meal = np.where(some, found[every, best], seen.meal)
        seen.meal_at = np.where(some, d[every, best], seen.meal_at)
        seen.meal_place = np.where(some[:, None], targets[found[every, best]], seen.meal_place)

    def _decide(self, seen: Seen, middle: Array, t: float, coin: Array) -> NDArray[np.int64]:
        """The routine of each."""
        memory, length = self.memory, self._fish.length
        unit = length / UNITS
        digested = t - memory["meal"] > 1 / mental.P0
        memory["meals"] = np.where(digested, 0.0, memory["meals"])
        tasty = mental.stimulus(unit / np.maximum(seen.meal_at, 1e-9), *mental.FOOD)
        hungry = mental.hunger(memory["meals"], t - memory["meal"], self.appetite, tasty)
        hungry = np.where(np.isfinite(seen.meal_at), hungry, 0.0)  # nothing to eat in sight: nothing to be done
        kin = self._fish.kind[seen.neighbours] == self._fish.kind[:, None]
        mates = np.where(kin, seen.apart, np.inf)
        every = np.arange(len(length))
        seen.mate_at = mates.min(axis=1, initial=np.inf)
        if mates.shape[1]:
            seen.mate_place = middle[seen.neighbours[every, mates.argmin(axis=1)]]
        lovely = mental.stimulus(unit / np.maximum(seen.mate_at, 1e-9), *mental.MATE)
        loving = mental.libido(t - memory["mating"], hungry, lovely * (t - memory["mating"] > COOLING))
        loving = np.where(np.isfinite(seen.mate_at), loving, 0.0)
        fear, greatest = mental.fear(seen.danger / length[:, None], self.reach)
        seen.kin = kin
        before = np.where(np.isin(memory["intention"], (order.EAT, order.MATE)), memory["intention"], -1)
        doing = order.intention(
            seen.wall < seen.length,
            (seen.apart < 0.5 * length[:, None]).any(axis=1) & ~self._predator,
            fear,
            greatest,
            hungry,
            loving,
            before,
            seen.suits,
            self._habit > 0,
            coin,
            afraid=self.afraid,
            panic=self.panic,
            urge=self.urge,
        )
        idle = (doing == order.WANDER) & (self._habit == HABITS.index("always")) & ~self._predator
        return np.where(idle, order.SCHOOL, doing)

    def _eat(self, system: ParticleSystem, t: float, seen: Seen, look: int) -> None:
        """Meals, matings, and those who come anew."""
        p, memory, length = system.particles, self.memory, self._fish.length
        eats = ~self._predator & (seen.meal_at < BITE * length) & (memory["intention"] == order.EAT)
        catches = self._predator & (seen.meal_at < CATCH * length)
        memory["eaten"] = memory["eaten"] + eats + catches
        memory["meals"] = memory["meals"] + eats + catches
        memory["meal"] = np.where(eats | catches, t, memory["meal"])
        mated = (memory["intention"] == order.MATE) & (seen.mate_at < 0.8 * length)
        memory["mating"], memory["mated"] = np.where(mated, t, memory["mating"]), memory["mated"] + mated
        memory["intention"] = np.where(mated | eats | catches, order.WANDER, memory["intention"])  # that is done
        gone = np.unique(seen.meal[eats])
        if len(gone):
            memory["dropped"][gone] += 1
            u = [random.uniform(self._seed, "food", self._food[gone], f"{look} {axis}")[:, 0] for axis in "xyz"]
            rows = p.rows(self._food[gone])
            p.x[rows] = self.feeding[0] + (np.stack(u, axis=1) - 0.5) * self.feeding[1]
            p.v[rows] = 0.0
        for k in np.unique(seen.meal[catches]):
            self._anew(p, system, int(np.flatnonzero(self._prey)[k]), t, look)

    def _anew(self, p: Particles, system: ParticleSystem, k: int, t: float, look: int) -> None:
        """One that was caught comes again far from all predators, outside of obstacles, as it was, if there is room."""
        rows, memory = self._fish.rows(p)[k], self.memory
        ids = int(self._fish.ids[k]) + np.arange(TRIES) * 2**40
        way = random.direction(self._seed, "fish", ids, f"anew {look}")
        out = 0.9 * self.range * np.cbrt(random.uniform(self._seed, "fish", ids, f"anew far {look}")[:, :1])
        places = self.home + out * way
        hunters = self._fish.pose(p)[1][self._predator]
        far = np.sqrt(((places[:, None] - hunters[None]) ** 2).sum(axis=2)).min(axis=1)
        for obstacle in system.colliders:
            far = np.where(obstacle.distance(places, t) < self._fish.length[k], -1.0, far)
        if far.max() >= 0:
            p.x[rows] += (places[far.argmax()] - p.x[rows].mean(axis=0)).astype(p.dtype)
        p.v[rows] = 0.0
        memory["caught"][k] += 1


def _at(x: Array, t: float) -> dict[str, Any]:
    return {"x": x[:, 0], "y": x[:, 1], "z": x[:, 2], "t": t}
