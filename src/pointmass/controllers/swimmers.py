"""The body of fish as a brain has it: where it is and looks, and the motor controllers that drive its muscles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.fish import GRAPH, NODES, NOSE, RINGS, SHAPE
from pointmass.collisions.collider import directions, lengths
from pointmass.controllers.controller import elements_of
from pointmass.errors import InvalidInput
from pointmass.forces.fins import Fins
from pointmass.forces.muscles import Muscles
from pointmass.laws.elements import ElementForce
from pointmass.laws.force import Rows
from pointmass.particles import Particles
from pointmass.system import ParticleSystem
from pointmass.tracing import functions as fn  # the same bits on every machine

Array = NDArray[np.float64]
MUSCLES = len(GRAPH["muscles"])
SEGMENTS = np.repeat([0, 1, 2], 4)  # of a fish's muscles, from the head
SIDES = np.tile([1.0, -1.0, -1.0, 1.0], 3)  # 1 on the left, -1 on the right
TURNS = (SEGMENTS < 2) * 1.0  # the two front segments turn
SWIMS = (SEGMENTS > 0) * 1.0  # and the two rear ones swim
LAG = math.pi / 2  # of a segment's beat behind that in front of it: a quarter of a period
FLAT, LEAST, MOST = math.pi / 2, math.pi / 4, 3 * math.pi / 4  # angles of the fins: level, diving, climbing
BRAKE = math.pi
SMOOTH = 0.15  # time in which muscles follow what they are told [s]
STEADY = 0.3  # over which the wriggling of a heading is smoothed [s]
FULL_TURN = math.radians(40.0)  # off by this, a fish turns as sharply as it can
CLIMB = 1.5  # angle of the fins for each angle by which it should climb


class Swimmers:
    """All fish of some bodies.

    Attributes
    ----------
    kind : number of the body of each, in the order of their names, shape (n,).
    ids : id of each fish's nose, shape (n,).
    length : of each when its muscles are idle [m], shape (n,).

    Raises
    ------
    InvalidInput
        A name that is no body of fish.
    """

    def __init__(self, system: ParticleSystem, names: Sequence[str]) -> None:
        p = system.particles
        found: list[NDArray[np.int64]] = []
        self._muscles: list[tuple[ElementForce, Rows, slice]] = []  # with the numbers of those of a body, and its fish
        self._fins: list[tuple[ElementForce, Rows, slice]] = []
        first = 0
        for name in names:
            mine = p.id[p.select(name)]
            fish, rest = divmod(len(mine), NODES)
            for kind, each, own in ((Muscles, MUSCLES, self._muscles), (Fins, 1, self._fins)):
                parts = elements_of(system, kind, mine)
                if rest or len(parts) != 1 or len(parts[0][1]) != each * fish:
                    raise InvalidInput(f"{name!r} has no muscles and fins of fish: it must be a body made by pm.fish()")
                own.append((*parts[0], slice(first, first + fish)))
            found.append(mine.reshape(fish, NODES))
            first += fish
        self._nodes = np.concatenate(found)
        self._rows = -1, np.zeros(0, np.intp)
        self.ids = self._nodes[:, NOSE]
        self.kind = np.repeat(np.arange(len(names)), [len(part) for part in found])
        first_muscle = np.linalg.norm(SHAPE[GRAPH["muscles"][0, 0]] - SHAPE[GRAPH["muscles"][0, 1]])
        rests = [force.settings(p, system.t, rows)["rest"][0] for force, rows, _ in self._muscles]
        self.length = np.concatenate([rest[::MUSCLES] for rest in rests]).astype(np.float64) / first_muscle

    def __len__(self) -> int:
        return len(self.ids)

    def rows(self, p: Particles) -> NDArray[np.intp]:
        """Rows of the nodes of each fish, shape (n, 23)."""
        if self._rows[0] != p.version:
            self._rows = p.version, p.rows(self._nodes)
        return self._rows[1]

    def pose(self, p: Particles) -> tuple[Array, Array, Array, Array]:
        """Nose, middle, velocity of the middle, and unit vector along the body of each, each of shape (n, 3)."""
        rows = self.rows(p)
        x, v = p.x[rows].astype(np.float64), p.v[rows].astype(np.float64)
        trunk = RINGS[1:3].ravel()
        axis = x[:, NOSE] - x[:, RINGS[2]].mean(axis=1)
        return x[:, NOSE], x[:, trunk].mean(axis=1), v[:, trunk].mean(axis=1), directed(axis)

    def rest(self) -> dict[str, Array]:
        """What `drive` remembers, at the start: phase of the beat [rad], time [s], beat, turn."""
        n = len(self)
        return {name: np.zeros(n) for name in ("phase", "since", "beat", "rate", "turn")}

    def drive(
        self, memory: dict[str, Any], t: float, amplitude: Array, frequency: Array, turn: Array, angle: Array
    ) -> None:
        """Set muscles and fins for the time from t on.

        The phase goes on where it is when the frequency changes, and amplitude and turn follow within SMOOTH.

        Parameters
        ----------
        memory : as `rest` made it.
        amplitude : of the beat, as a part of the muscles' lengths, shape (n,).
        frequency : [1/s], shape (n,).
        turn : how much shorter the muscles of the left are, and those of the right longer, as a part; shape (n,).
        angle : of the fins [rad], shape (n,).
        """
        gone = t - memory["since"]
        share = np.minimum(gone / SMOOTH, 1.0)
        memory["phase"] = (memory["phase"] + 2 * math.pi * memory["rate"] * gone) % (2 * math.pi)
        memory["beat"] = memory["beat"] + share * (amplitude - memory["beat"])
        memory["turn"] = memory["turn"] + share * (turn - memory["turn"])
        memory["rate"], memory["since"] = frequency.copy(), np.full(len(self), t)
        start = memory["phase"] - 2 * math.pi * frequency * t
        values = {
            "offset": -memory["turn"][:, None] * (SIDES * TURNS),
            "amplitude": memory["beat"][:, None] * (SIDES * SWIMS),
            "frequency": np.repeat(frequency[:, None], MUSCLES, axis=1),
            "phase": start[:, None] - LAG * SEGMENTS,
        }
        for force, rows, part in self._muscles:
            force.put(rows, **{name: value[part].ravel() for name, value in values.items()})
        for force, rows, part in self._fins:
            force.put(rows, angle=angle[part])

    def steer(self, heading: Array, way: Array) -> tuple[Array, Array]:
        """How much each should turn, from -1 (right) to 1 (left), and the angle of its fins, to head along `way`.

        Parameters
        ----------
        heading : unit vectors, shape (n, 3).
        way : directions of any length, shape (n, 3); 0 = as it goes.
        """
        across = heading[:, 2] * way[:, 0] - heading[:, 0] * way[:, 2]
        along = heading[:, 0] * way[:, 0] + heading[:, 2] * way[:, 2]
        turn = np.clip(fn.atan2(across, along) / FULL_TURN, -1.0, 1.0)
        level = np.sqrt(way[:, 0] ** 2 + way[:, 2] ** 2)
        climb = fn.atan2(way[:, 1], level) - fn.atan2(heading[:, 1], np.sqrt(heading[:, 0] ** 2 + heading[:, 2] ** 2))
        return np.asarray(turn), np.clip(FLAT + CLIMB * climb, LEAST, MOST)


def directed(a: Array) -> Array:
    """Rows as unit vectors; 0 stays 0."""
    return np.asarray(directions(a, lengths(a), np.zeros(3)), np.float64)
