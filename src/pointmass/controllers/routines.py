"""The eight behaviour routines of fish: where each wants to go, and how fast (Tu & Terzopoulos, SIGGRAPH 1994)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.controllers import intention as order
from pointmass.controllers.swimmers import directed

Array = NDArray[np.float64]
CALM, BRISK, FULL = 0.4, 0.7, 1.0  # speeds, of the highest
FARTHER = 1.4  # are the seven nearest neighbours than the nearest one, in the mean
STRAY = 0.35  # how far a wandering fish strays from its way at a look


@dataclass
class Seen:
    """What n fish perceive at one look.

    Attributes
    ----------
    nose, middle, heading : shape (n, 3) [m].
    length : shape (n,) [m].
    home, range : middle and radius of the water in which they stay [m].
    wall, normal : distance of the nearest obstacle on the way [m], and the direction away from all that are near.
    neighbours, apart : nearest fish in view and their distances, shape (n, k); inf where there are fewer.
    kin : which of these are of one's own body.
    threats, danger : numbers and distances of predators that are seen.
    predators : places of all predators, which `threats` counts.
    meal, meal_at, meal_place : the nearest thing to eat, its distance and place; inf = none.
    mate_at, mate_place : likewise, the nearest of its own body.
    suits : whether the water is neither too cold nor too warm; `warmer` : direction to where it suits better.
    """

    nose: Array
    middle: Array
    heading: Array
    length: Array
    home: Array
    range: float
    neighbours: NDArray[np.intp] = field(default_factory=lambda: np.zeros((0, 0), np.intp))
    apart: Array = field(default_factory=lambda: np.zeros((0, 0)))
    kin: Any = None
    threats: NDArray[np.intp] = field(default_factory=lambda: np.zeros((0, 0), np.intp))
    danger: Array = field(default_factory=lambda: np.zeros((0, 0)))
    predators: Array = field(default_factory=lambda: np.zeros((0, 3)))
    suits: Any = True

    def __post_init__(self) -> None:
        n = len(self.length)
        self.wall, self.normal = np.full(n, np.inf), np.zeros((n, 3))
        self.meal, self.meal_at, self.meal_place = np.full(n, -1), np.full(n, np.inf), np.zeros((n, 3))
        self.mate_at, self.mate_place = np.full(n, np.inf), np.zeros((n, 3))
        self.warmer = np.zeros((n, 3))


def ways(doing: NDArray[np.int64], seen: Seen, wish: Array, chance: Array, spacing: Array) -> tuple[Array, Array]:
    """Where each fish wants to go, of any length, shape (n, 3), and its speed from 0 to 1, shape (n,).

    Parameters
    ----------
    doing : the routine of each.
    wish : where it wanted to go last, unit vectors.
    chance : two numbers from 0 to 1 for each.
    spacing : of a school [m], shape (n,).
    """
    wander = _wander(seen, wish, chance)
    school, pace = _school(seen, wander, spacing)
    routines: dict[int, tuple[Array, Any]] = {
        order.AVOID_OBSTACLE: (_along_wall(seen), CALM),
        order.AVOID_FISH: (_apart(seen), BRISK),
        order.EAT: (seen.meal_place - seen.nose, BRISK),
        order.MATE: (seen.mate_place - seen.nose, BRISK),
        order.LEAVE: (seen.warmer, BRISK),
        order.WANDER: (wander, CALM),
        order.ESCAPE: (_escape(seen, wander), FULL),
        order.SCHOOL: (school, pace),
    }
    way, speed = np.zeros_like(wander), np.zeros(len(doing))
    for routine, (to, fast) in routines.items():
        mine = doing == routine
        way[mine], speed[mine] = to[mine], np.broadcast_to(fast, speed.shape)[mine]
    hunts = (doing == order.EAT) & (seen.meal_at > 1.5 * seen.length)
    speed[hunts] = FULL
    speed[(doing == order.EAT) & (seen.meal_at < 0.7 * seen.length)] = CALM
    return way, speed


def _homewards(seen: Seen) -> Array:
    """Towards home, 0 well within and 1 at its edge."""
    to = seen.home - seen.middle
    far = np.sqrt((to * to).sum(axis=1)) / seen.range
    return np.asarray(np.clip(2.0 * far - 1.0, 0.0, 1.5)[:, None] * directed(to))


def _wander(seen: Seen, wish: Array, chance: Array) -> Array:
    """On as before, straying a little, and rather level, and back where home ends."""
    right = directed(np.stack([-wish[:, 2], np.zeros(len(wish)), wish[:, 0]], axis=1))
    aside = STRAY * (2 * chance - 1)
    rise = np.zeros_like(wish)
    rise[:, 1] = 0.4 * aside[:, 1]
    level = wish * (1.0, 0.8, 1.0)
    return np.asarray(level + aside[:, :1] * right + rise + 0.5 * _homewards(seen))


def _along_wall(seen: Seen) -> Array:
    """Along the obstacle, and the more away from it the nearer it is."""
    into = np.minimum((seen.heading * seen.normal).sum(axis=1), 0.0)
    along = seen.heading - into[:, None] * seen.normal
    push = np.clip(1.5 - seen.wall / seen.length, 0.2, 1.5)
    return np.asarray(along + push[:, None] * seen.normal)


def _pushes(seen: Seen, reach: Array) -> Array:
    """Away from neighbours, each the more the nearer it is, and 0 beyond `reach`, shape (n, 3)."""
    if not seen.apart.shape[1]:
        return np.zeros_like(seen.middle)
    to = seen.middle[:, None] - seen.middle[seen.neighbours]
    near = np.maximum(seen.apart, 1e-9)
    weight = np.where(np.isfinite(near), np.maximum(reach[:, None] / near - 1.0, 0.0), 0.0)
    d = np.where(np.isfinite(near), near, 1.0)
    return np.asarray((weight[..., None] * to / d[..., None]).sum(axis=1))


def _apart(seen: Seen) -> Array:
    """Away from whom it nearly touches."""
    return np.asarray(seen.heading + _pushes(seen, seen.length))


def _escape(seen: Seen, wander: Array) -> Array:
    """Away from all predators that it sees, the nearest first."""
    if not seen.danger.shape[1]:
        return wander
    to = seen.middle[:, None] - seen.predators[seen.threats]
    there = np.isfinite(seen.danger)
    d = np.where(there, np.maximum(seen.danger, 1e-9), 1.0)
    away = (np.where(there, 1.0 / d**2, 0.0)[..., None] * to).sum(axis=1)
    return np.asarray(directed(away) + 0.3 * seen.heading + 0.3 * _homewards(seen))


def _school(seen: Seen, wander: Array, spacing: Array) -> tuple[Array, Array]:
    """After its kin: their way, nearer where they are far and away where they are near; alone it wanders."""
    count = seen.apart.shape[1]
    if not count:
        return wander, np.full(len(wander), CALM)
    d = np.where(seen.kin, seen.apart, np.inf)
    there = np.isfinite(d)
    many = there.sum(axis=1)
    share = there / np.maximum(many, 1)[:, None]
    to = seen.middle[seen.neighbours] - seen.middle[:, None]
    far = np.where(there, np.maximum(d, 1e-9), 1.0)
    gap = np.clip(1.0 - FARTHER * spacing[:, None] / far, -2.0, 1.0)  # below 0: too near
    pull = (share * gap)[..., None] * to / far[..., None]
    together = (share[..., None] * seen.heading[seen.neighbours]).sum(axis=1)
    way = together + 0.8 * pull.sum(axis=1) + 0.35 * directed(wander) + 0.35 * _homewards(seen)
    ahead = (pull.sum(axis=1) * seen.heading).sum(axis=1)  # others are ahead: faster
    pace = np.clip(0.6 + 0.5 * ahead, 0.2, 1.0)
    return np.where((many > 0)[:, None], way, wander), np.where(many > 0, pace, BRISK)
