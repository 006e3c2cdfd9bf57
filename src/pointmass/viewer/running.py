"""A simulation made in Python, without a scene: it runs on from where it is, and takes what is done by hand."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy

from pointmass.errors import InvalidInput, number
from pointmass.frame import Camera, Frame
from pointmass.simulation import Simulation
from pointmass.viewer.inputs import Input
from pointmass.viewer.messages import Parameter, Switch
from pointmass.viewer.setup import Setup
from pointmass.viewer.simulated import Simulated, idle_forces


class Running(Simulated):
    """Plays a copy of a simulation; to begin again is to go back to where it was given.

    Parameters
    ----------
    sim : stays as it is.
    fps : frames per second of simulated time.
    """

    wind = None

    def __init__(self, sim: Simulation, *, fps: float = 60.0, name: str = "simulation", camera: Camera | None = None):
        self.name, self.summary = name, ""
        self.fps = number("fps", fps, above=0, unit="1/s")
        self.camera = camera or Camera()
        self.parameters: list[Parameter] = []
        self.presets: list[str] = []
        self.solvers: list[str] = []
        self.switches: list[Switch] = []
        self.setup = Setup()
        self._given = deepcopy(sim)
        if sim.system.order == 2:
            particles = self._given.system.particles
            for force in idle_forces(len(particles)):
                force.bind(particles)
                self._given.system.forces.append(force)
        self._begin()

    def _begin(self) -> None:
        self._play(deepcopy(self._given))

    def start(self) -> Frame:
        self._begin()
        return next(self.sim.frames(1, self.fps))

    def preset(self, name: str) -> Input | None:
        raise InvalidInput("a simulation has no presets: show the scene instead")

    def prepare(self, what: Input) -> Callable[[], None] | None:
        return None

    def recommended(self) -> Callable[[], float]:
        return lambda: 0.0

    def text(self) -> str:
        raise InvalidInput("a simulation cannot be copied as a scene: show the scene instead")

    def apply(self, what: Input) -> Frame | None:
        if not self._by_hand(what):
            raise InvalidInput("a simulation has no settings to change: show the scene instead")
        return None
