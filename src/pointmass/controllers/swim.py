"""Fish that swim to a goal, or as they are told."""

from __future__ import annotations

import numpy as np

from pointmass.controllers.controller import Controller
from pointmass.controllers.swimmers import BRAKE, FLAT, LEAST, STEADY, Swimmers, directed
from pointmass.errors import number
from pointmass.laws.parameter import Parameter, Vector
from pointmass.system import ParticleSystem


class Swim(Controller):
    """Has all fish of a body beat with their tails, and turn, or head for a goal.

    The two rear segments beat, each a quarter of a period behind that in front of it, the left in antiphase to the
    right; the two front ones bend to turn, and the fins turn to climb or dive (Tu & Terzopoulos, SIGGRAPH 1994).

    Parameters
    ----------
    on : name of the body.
    goal : for which they head [m], three numbers, formulas or functions of t; None = nowhere.
    amplitude : of the beat, as a part of the length of a muscle, in [0, 0.4].
    frequency : of the beat [1/s], in [0, 10].
    turn : without a goal: how much shorter the muscles of the left are, in [-0.4, 0.4]; below 0 those of the right.
        With a goal: the most that is used, to either side.
    angle : of the fins without a goal [rad], from pi/4 to pi; pi/2 = level, less dives, more climbs, pi brakes.
    arrival : distance from the goal at which a fish stops beating, as a part of its length.
    period : as for every controller.

    Raises
    ------
    InvalidInput
        A number that is not allowed, a goal inside an obstacle.
    """

    def __init__(
        self,
        on: str = "fish",
        goal: Vector | None = None,
        amplitude: float = 0.2,
        frequency: float = 2.0,
        turn: float = 0.0,
        angle: float = FLAT,
        arrival: float = 0.5,
        period: float = 0.05,
    ) -> None:
        super().__init__(period)
        self.on = on
        self.goal = None if goal is None else Parameter("goal", goal, vector=True, unit="m")
        self.amplitude = number("amplitude", amplitude, at_least=0, at_most=0.4)
        self.frequency = number("frequency", frequency, at_least=0, at_most=10, unit="1/s")
        self.turn = number("turn", turn, at_least=-0.4, at_most=0.4)
        self.angle = number("angle", angle, at_least=LEAST, at_most=BRAKE, unit="rad")
        self.arrival = number("arrival", arrival, at_least=0)

    def bind(self, system: ParticleSystem, seed: int) -> None:
        """Find the fish, and see that their goal can be reached."""
        self._fish = Swimmers(system, [self.on])
        self.memory = self._fish.rest()
        self.memory["heading"] = self._fish.pose(system.particles)[3]
        if self.goal is not None:
            self.check_goal(system, self.goal)

    def control(self, system: ParticleSystem, t: float) -> None:
        """Beat, and turn."""
        fish, n = self._fish, len(self._fish)
        turn, angle, amplitude = np.full(n, self.turn), np.full(n, self.angle), np.full(n, self.amplitude)
        nose, _, _, axis = fish.pose(system.particles)
        heading = self.smooth("heading", axis, STEADY)
        if self.goal is not None:
            way = np.array(self.goal.at(t), np.float64) - nose
            part, angle = fish.steer(directed(heading), way)
            turn = abs(self.turn or 0.2) * part
            amplitude[np.sqrt((way * way).sum(axis=1)) < self.arrival * fish.length] = 0.0
        fish.drive(self.memory, t, amplitude, np.full(n, self.frequency), turn, angle)
