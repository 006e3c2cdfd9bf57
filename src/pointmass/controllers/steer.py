"""Turning a body that crawls or swims."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pointmass.collisions.collider import unit
from pointmass.controllers.controller import Controller, elements_of
from pointmass.errors import InvalidInput, number
from pointmass.forces.muscles import Muscles
from pointmass.laws.parameter import Parameter, Vector
from pointmass.particles import Particles
from pointmass.system import ParticleSystem


class Steer(Controller):
    """Makes a body head for a goal: the muscles of the side to which it should turn are shorter, those of the other
    side longer.

    The part is turn = most a / (|a| + tolerance), for an angle `a` between the direction from tail to head, smoothed
    over `delay`, and that to the goal. It is added to the muscles' offsets, with a minus on the inner side.

    Parameters
    ----------
    on : name of the body: it has the groups "head", "tail", "left" and "right".
    goal : [m], three numbers, formulas or functions of t.
    most : largest change of a muscle's length, as a part of it, in [0, 0.5].
    tolerance : angle at which half of that is used [degrees], above 0.
    arrival : distance from the head at which it is content and goes straight [m].
    delay : over which the wriggling of its heading is smoothed [s].
    up : axis about which it turns.
    period : as for every controller.

    Notes
    -----
    Miller (SIGGRAPH 1988) steers snakes so, by hand.
    """

    def __init__(
        self,
        on: str,
        goal: Vector = (1.0, 0.0, 0.0),
        most: float = 0.1,
        tolerance: float = 20.0,
        arrival: float = 0.0,
        delay: float = 0.5,
        up: Any = (0.0, 1.0, 0.0),
        period: float = 0.05,
    ) -> None:
        super().__init__(period)
        self.on = on
        self.goal = Parameter("goal", goal, vector=True, unit="m")
        self.most = number("most", most, at_least=0, at_most=0.5)
        self.tolerance = math.radians(number("tolerance", tolerance, above=0, unit="degrees"))
        self.arrival = number("arrival", arrival, at_least=0, unit="m")
        self.delay = number("delay", delay, at_least=0, unit="s")
        self.up = unit("up", up)

    def bind(self, system: ParticleSystem, seed: int) -> None:
        """Find the body's muscles, and see that the goal can be reached."""
        p = system.particles
        mine = self._ids(p, "")
        found = elements_of(system, Muscles, mine)
        if not found:
            raise InvalidInput(f"controller steer needs muscles, and body {self.on!r} has none")
        left, right = self._ids(p, "left"), self._ids(p, "right")
        self._muscles = []
        for force, rows in found:
            offset = force.parameters["offset"]
            offset.each(len(force.ids), force.name)
            side = np.isin(rows, force.among(left)) * 1.0 - np.isin(rows, force.among(right))
            self._muscles.append((force, rows, side, np.array(offset.components[0].value)[rows]))
        self.check_goal(system, self.goal)
        self._ends = self._ids(p, "head"), self._ids(p, "tail")
        self.memory = {"heading": self._heading(p)}

    def control(self, system: ParticleSystem, t: float) -> None:
        """Bend towards the goal."""
        p = system.particles
        heading = self.smooth("heading", self._heading(p), self.delay)
        way = np.array(self.goal.at(t), np.float64) - p.x[p.rows(self._ends[0])].mean(axis=0)
        turn = 0.0
        if float(np.linalg.norm(way)) > self.arrival:
            across = np.cross(heading, way)
            angle = math.atan2(float(self.up @ across), float(heading @ way - (self.up @ heading) * (self.up @ way)))
            turn = self.most * angle / (abs(angle) + self.tolerance)
        for force, rows, side, offset in self._muscles:
            force.put(rows, offset=offset - turn * side)

    def _heading(self, p: Particles) -> Any:
        head, tail = (p.x[p.rows(ids)].mean(axis=0, dtype=np.float64) for ids in self._ends)
        return (head - tail) / np.linalg.norm(head - tail)

    def _ids(self, p: Particles, part: str) -> Any:
        """Of the particles of the body, or of a part of it."""
        return p.id[p.select(f"{self.on} {part}".strip())]
