"""A nozzle: a steady stream from a small disc, within a cone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.collisions.collider import unit
from pointmass.emitters.emitter import CHILDREN, Array, Birth, Emitter
from pointmass.errors import InvalidInput, finite_array, number

BLOCK = 256  # births that are drawn at once
MOST = 2.0**CHILDREN  # births that have ids
NOTHING = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)


class Nozzle(Emitter):
    """Particles at a steady rate, evenly spread over a disc and over a cone of directions.

    Birth k happens at start + k / rate, whatever the step and the frame rate: nothing clumps.

    Parameters
    ----------
    position : centre of the disc [m].
    direction : axis of the cone.
    rate : births per second [1/s], greater than 0 and at most 1e9.
    speed, speed_range : mean and half-range of the speed [m/s] (Reeves 1983).
    cone : half-angle of the cone [degrees], in [0, 180].
    radius : of the disc [m], at least 0.
    lifetime, lifetime_range : mean and half-range of the lifetime [s]; inf = for ever.
    mass : of each particle [kg], greater than 0.
    size : radius of each particle [m], at least 0.
    start, stop : when it is open [s].
    """

    def __init__(
        self,
        position: Any = (0.0, 0.0, 0.0),
        direction: Any = (0.0, 1.0, 0.0),
        *,
        rate: float = 100.0,
        speed: float = 5.0,
        speed_range: float = 0.5,
        cone: float = 10.0,
        radius: float = 0.0,
        lifetime: float = math.inf,
        lifetime_range: float = 0.0,
        mass: float = 0.01,
        size: float = 0.0,
        start: float = 0.0,
        stop: float = math.inf,
    ) -> None:
        self.position = finite_array("position", position, (3,))
        self.direction = unit("direction", direction)
        self.rate = number("rate", rate, above=0, at_most=1e9, unit="1/s")
        self.speed = number("speed", speed, at_least=0, unit="m/s")
        self.speed_range = number("speed_range", speed_range, at_least=0, at_most=self.speed, unit="m/s")
        self.cone = number("cone", cone, at_least=0, at_most=180, unit="degrees")
        self.radius = number("radius", radius, at_least=0, unit="m")
        self.lifetime = math.inf if lifetime == math.inf else number("lifetime", lifetime, above=0, unit="s")
        self.lifetime_range = number("lifetime_range", lifetime_range, at_least=0, unit="s")
        self.mass = number("mass", mass, above=0, unit="kg")
        self.size = number("size", size, at_least=0, unit="m")
        self.start = number("start", start, at_least=-MOST / self.rate, unit="s")
        self.stop = math.inf if stop == math.inf else number("stop", stop, above=self.start, unit="s")
        if self.lifetime_range >= self.lifetime:
            raise InvalidInput(
                f"lifetime_range = {lifetime_range} is not allowed: it must be less than lifetime = {lifetime} [s]"
            )
        self._kept: tuple[tuple[int, int, str], tuple[Array, Array, Array]] | None = None

    def births(self, t0: float, t1: float, seed: int, stream: str) -> Birth:
        k = np.arange(self._first(t0), self._first(min(t1, self.stop)), dtype=np.int64)
        drawn = [self._block(int(b), seed, stream) for b in np.unique(k // BLOCK)] if len(k) else [NOTHING]
        mine = slice(int(k[0] % BLOCK), int(k[0] % BLOCK) + len(k)) if len(k) else slice(0)
        x, v, lifetime = (np.concatenate(parts)[mine] for parts in zip(*drawn, strict=True))
        return Birth(self.start + k / self.rate, k, x, v, lifetime, {"m": self.mass, "radius": self.size})

    def _block(self, block: int, seed: int, stream: str) -> tuple[Array, Array, Array]:
        """Places, velocities and lifetimes of BLOCK successive births; the last block is kept."""
        key = block, seed, stream
        if self._kept is None or self._kept[0] != key:
            self._kept = key, self._draw(np.arange(block * BLOCK, (block + 1) * BLOCK), seed, stream)
        return self._kept[1]

    def _draw(self, k: NDArray[np.int64], seed: int, stream: str) -> tuple[Array, Array, Array]:
        axes = self._axes()
        spot = random.uniform(seed, stream, k, "place")
        aim = random.uniform(seed, stream, k, "direction")
        r, a = self.radius * np.sqrt(spot[:, 0]), 2 * np.pi * spot[:, 1]
        height = 1 - aim[:, 0] * (1 - math.cos(math.radians(self.cone)))
        across, b = np.sqrt(np.maximum(1 - height * height, 0)), 2 * np.pi * aim[:, 1]
        speed = random.spread(seed, stream, k, "speed", self.speed, self.speed_range)
        lifetime = np.full(len(k), self.lifetime)
        if self.lifetime_range:
            lifetime = random.spread(seed, stream, k, "lifetime", self.lifetime, self.lifetime_range)
        x = self.position + np.outer(r * np.cos(a), axes[0]) + np.outer(r * np.sin(a), axes[1])
        way = np.outer(across * np.cos(b), axes[0]) + np.outer(across * np.sin(b), axes[1])
        return x, speed[:, None] * (way + np.outer(height, self.direction)), lifetime

    def _first(self, t: float) -> int:
        """Number of the first birth that is not before t."""
        if t <= self.start:
            return 0
        k = max(0, math.floor((t - self.start) * self.rate) - 1)
        while self.start + k / self.rate < t:
            k += 1
        return k

    def _axes(self) -> tuple[Array, Array]:
        helper = np.eye(3)[int(np.argmin(np.abs(self.direction)))]
        a = np.cross(self.direction, helper)
        a /= np.linalg.norm(a)
        return a, np.cross(self.direction, a)
