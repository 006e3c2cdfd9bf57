"""Zones in which particles die, and what happens when there are too many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions import Box, Plane, Sphere
from pointmass.collisions.collider import Collider
from pointmass.description import Described
from pointmass.emitters.emitter import Birth
from pointmass.laws.parameter import Vector
from pointmass.particles import FIRST_FOREIGN_ID, Array, Particles

WhenFull = Literal["no birth", "oldest dies"]
WHEN_FULL: tuple[WhenFull, ...] = ("no birth", "oldest dies")


class Zone(Described):
    """Where particles die: those whose centre is in it at the end of a step are taken away.

    Who is born at that very moment, such as the children of those who die in the zone, has another step to leave it.

    Parameters
    ----------
    shape : of the zone: who is at a negative distance from it dies.
    """

    def __init__(self, shape: Collider) -> None:
        self.shape = shape

    def kills(self, x: Array, t: float) -> NDArray[np.bool_]:
        """Which of the points, shape (k, 3), are in the zone at time t, shape (k,)."""
        inside: NDArray[np.bool_] = np.any([surface.distance(x, t) < 0 for surface in self.shape.surfaces], axis=0)
        return inside


def killed(zones: Sequence[Zone], x: Array, t: float, born_before: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Who dies in a zone at time t, shape (k,): those who were born before. Who is born there may leave first."""
    inside = np.zeros(len(x), bool)
    for zone in zones:
        inside |= zone.kills(x, t)
    return inside & born_before


class SphereZone(Zone):
    """Particles that enter a ball die, or those that leave it.

    Parameters
    ----------
    center : [m], three numbers, or formulas or a function of t.
    radius : [m], greater than 0.
    outside : whether those die that are outside.
    """

    def __init__(self, center: Vector = (0.0, 0.0, 0.0), radius: float = 1.0, *, outside: bool = False) -> None:
        super().__init__(Sphere(center, radius, inside=outside))


class BoxZone(Zone):
    """Particles that enter a box along the axes die, or those that leave it.

    Parameters
    ----------
    center : [m], three numbers, or formulas or a function of t.
    size : lengths of the edges [m], each greater than 0.
    outside : whether those die that are outside.
    """

    def __init__(self, center: Vector = (0.0, 0.0, 0.0), size: Any = (1.0, 1.0, 1.0), *, outside: bool = False) -> None:
        super().__init__(Box(center, size, inside=outside))


class HalfSpaceZone(Zone):
    """Particles that come behind a plane die.

    Parameters
    ----------
    point : any point of the plane [m], three numbers, or formulas or a function of t.
    normal : direction of the side on which particles live.
    """

    def __init__(self, point: Vector = (0.0, 0.0, 0.0), normal: Any = (0.0, 1.0, 0.0)) -> None:
        super().__init__(Plane(point, normal))


ZONES: Mapping[str, type[Zone]] = {"sphere": SphereZone, "box": BoxZone, "half_space": HalfSpaceZone}


def with_room(born: Sequence[Birth], order: Sequence[int], room: int) -> list[Birth]:
    """The first births of a step that there is room for.

    Parameters
    ----------
    born : of each emitter.
    order : numbers of the emitters; of births at one time, those of the first emitter come first.
    room : how many may be born.
    """
    if sum(len(birth.number) for birth in born) <= room:
        return list(born)
    whose = np.concatenate([np.full(len(born[k].number), k) for k in order])
    row = np.concatenate([np.arange(len(born[k].number)) for k in order])
    first = np.argsort(np.concatenate([born[k].time for k in order]), kind="stable")[: max(room, 0)]
    return [birth.take(np.sort(row[first][whose[first] == k])) for k, birth in enumerate(born)]


def oldest(particles: Particles, count: int) -> NDArray[np.intp]:
    """Rows of so many of the oldest particles that emitters have made; those that there were at the start stay."""
    made = np.flatnonzero(particles.id >= FIRST_FOREIGN_ID)
    return made[np.argsort(-particles.age[made], kind="stable")][:count]
