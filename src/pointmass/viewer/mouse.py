"""The spring between a particle and the cursor: Witkin's mouse spring."""

from __future__ import annotations

import math

import numpy as np

from pointmass.forces import Harmonic
from pointmass.simulation import Simulation
from pointmass.viewer.messages import Vector

RATE = 10.0  # of its motion, sqrt(k_m / m) [1/s]: what hangs on it is m g / k_m = 0.1 m below the cursor
STIFFEST = 0.4  # h sqrt(k / m) of all that a user brings in, where the solver is not implicit; 0.83 would be the limit
MOST_DAMPED = 0.8  # h k_d / m likewise


class MouseSpring(Harmonic):
    """`Harmonic` under a name of its own."""


class Mouse:
    """Draws one particle of a simulation to a place.

    It is stiff enough to lift all that hangs together with the particle: k_m = RATE^2 M with M the mass of what is free
    in its island, critically damped, and both as much weaker as the step of an explicit solver demands.

    Attributes
    ----------
    particle : id of who is held, or None.
    target : where it is drawn to [m].
    """

    def __init__(self, sim: Simulation) -> None:
        last = sim.system.forces[-1] if sim.system.forces else None
        self._sim, self._spring = sim, last if isinstance(last, MouseSpring) else None
        self.particle: int | None = None
        self.target: Vector = (0.0, 0.0, 0.0)

    @property
    def works(self) -> bool:
        """Whether there are masses that it can pull."""
        return self._spring is not None

    @property
    def row(self) -> int:
        """Of who is held, or -1: it may have died."""
        if self.particle is None:
            return -1
        return int(self._sim.system.particles.rows(np.array([self.particle]))[0])

    def hold(self, particle: int, target: Vector) -> None:
        """Take a particle by its id; nothing happens if it has died."""
        self.particle, self.target = particle, target
        row = self.row
        if self._spring is None or row < 0:
            self.particle = None
            return
        k_m, k_d = self._strength(row)
        on = np.zeros(len(self._sim.system.particles), bool)
        on[row] = True
        self._spring.on = on
        self._spring.set(k_s=k_m, k_d=k_d, center=target)

    def lead(self, target: Vector) -> None:
        """Draw it to another place."""
        self.target = target
        if self._spring is not None and self.particle is not None:
            self._spring.set(center=target)

    def let_go(self) -> None:
        """Hold nobody."""
        self.particle = None
        if self._spring is not None:
            self._spring.on = np.zeros(len(self._sim.system.particles), bool)
            self._spring.set(k_s=0.0, k_d=0.0)

    def _strength(self, row: int) -> tuple[float, float]:
        """k_m [N/m] and k_d [N s/m]."""
        system = self._sim.system
        p, islands = system.particles, system.island_of_particle
        m, free = float(p.m[row]), (islands == islands[row]) & ~p.pinned
        hanging = max(float(p.m[free].sum(dtype=np.float64)), m)
        k_m = RATE**2 * hanging
        k_d = 2.0 * math.sqrt(k_m * hanging)
        if not self._sim.solver.implicit:
            h = self._sim.dt
            k_m, k_d = min(k_m, m * (STIFFEST / h) ** 2), min(k_d, m * MOST_DAMPED / h)
        return k_m, k_d
