"""What players of one simulation have in common: what pages ask of it, and what a user does to it by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.frame import Frame
from pointmass.laws.force import Force
from pointmass.simulation import Simulation
from pointmass.viewer import additions
from pointmass.viewer.inputs import Addition, Hold, Input, Lead, LetGo, Push, Shoot, Vanish
from pointmass.viewer.messages import Contender, Vector
from pointmass.viewer.mouse import Mouse, MouseSpring
from pointmass.viewer.sphere import MovingSphere, Sphere


def idle_forces(count: int) -> list[Force]:
    """Forces by which a user pulls and pushes `count` particles: they touch nobody yet.

    They are there from the start, so that a grab changes numbers and compiles nothing. `Mouse` takes the last.
    """
    return [MovingSphere(), MouseSpring(0.0, on=np.zeros(count, bool))]


class Simulated:
    """The part of a `Player` that is about its simulation, which has the `idle_forces` if it has masses.

    Attributes
    ----------
    sim : the simulation.
    """

    frames = None
    timeline = None
    contenders: Sequence[Contender] = ()
    beside = False
    name: str
    fps: float

    def _play(self, sim: Simulation) -> None:
        """Begin with a simulation."""
        self.sim = sim
        self._mouse, self._sphere = Mouse(sim), Sphere(sim)
        self.picked: list[int] = []

    @property
    def solver(self) -> str:
        return self.sim.solver.name

    @property
    def dt(self) -> float:
        return self.sim.dt

    @property
    def grabs(self) -> bool:
        return self._mouse.works

    @property
    def held(self) -> int:
        return self._mouse.row

    @property
    def target(self) -> Vector:
        return self._mouse.target

    @property
    def pinned(self) -> bool:
        return additions.pinned(self.sim.system, self.picked)

    @property
    def sims(self) -> Sequence[Simulation]:
        return [self.sim]

    def advance(self, speed: float) -> Frame | None:
        return self._decorated(next(self.sim.frames(1, self.fps / speed)))

    def look(self) -> Frame | None:
        number = self.sim.frames_seen
        self.sim.frames_seen += 1
        return self._decorated(self.sim.frame(number))

    def arrange(self, beside: bool) -> Frame | None:
        return None

    def undoing(self, what: Input) -> Input | None:
        if isinstance(what, (Shoot, Vanish)):
            return self._sphere.undoing(what)
        return additions.undoing(self.sim.system, what)

    def _decorated(self, frame: Frame) -> Frame:
        """A frame with what the user has brought in."""
        return replace(frame, drawables=(*frame.drawables, *self._sphere.drawn(frame.time, frame.number)))

    def _by_hand(self, what: Input) -> bool:
        """Do what an input says to particles; False if it is about settings."""
        if isinstance(what, (Hold, Shoot, Push)) and not self.grabs:
            raise InvalidInput(f"nothing can be grabbed or pushed in {self.name}: a flow has no masses")
        match what:
            case Hold(particle, target):
                self._mouse.hold(particle, target)
            case Lead(target):
                self._mouse.lead(target)
            case LetGo():
                self._mouse.let_go()
            case Shoot(place, velocity, radius):
                self._sphere.shoot(place, velocity, radius)
            case Push(place, radius):
                self._sphere.lead(place, radius)
            case Vanish():
                self._sphere.vanish()
            case _ if isinstance(what, Addition):
                additions.change(self.sim, self.sim.system, what)
            case _:
                return False
        return True
