"""A simulation that takes inputs between its steps, and remembers them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from hashlib import sha256

import numpy as np

from pointmass.errors import InvalidInput, unknown
from pointmass.frame import Camera, Frame
from pointmass.scene import Scene
from pointmass.simulation import Simulation
from pointmass.viewer.additions import change
from pointmass.viewer.adopt import Adoption
from pointmass.viewer.inputs import NUMBERS, Input, Recording, Restore, Turn, changed
from pointmass.viewer.messages import Parameter, Switch, Value, Vector
from pointmass.viewer.setup import Setup, solvers_for, switched_inside, switches_of
from pointmass.viewer.simulated import Simulated, idle_forces
from pointmass.viewer.subject import Subject, is_flow
from pointmass.viewer.wind import wind_of

MOST_ADVISED = 20_000  # particles, beyond which the largest stable step takes too long to find


class Live(Simulated):
    """Plays a subject's simulation.

    Attributes
    ----------
    recording : all that the run depends on, beside the subject.
    """

    def __init__(self, subject: Subject, setup: Setup | None = None) -> None:
        self._subject = subject
        self.name, self.summary = subject.name, subject.summary
        self.setup = setup or Setup()
        self._plan: tuple[Setup, Scene, Adoption] | None = None  # for the next settings
        self._begin(self._build(self.setup))

    def _build(self, setup: Setup) -> Scene:
        scene = self._as_set(setup)
        if is_flow(scene):
            return scene
        return scene.changed(forces=[*scene.forces, *idle_forces(sum(len(body.particles) for body in scene.bodies))])

    def _as_set(self, setup: Setup) -> Scene:
        return setup.of(self._subject.build(setup.parameters))

    def _begin(self, scene: Scene) -> None:
        self._play(scene.simulation())
        self._scene = scene
        self._earlier = 0  # steps that the present clock of the simulation does not count
        self.fps = scene.fps
        self.recording = Recording(self.setup)

    @property
    def settings(self) -> Mapping[str, Value]:
        """Parameters that are not as the scene was opened."""
        return self.setup.parameters

    @property
    def steps(self) -> int:
        """Steps of the run so far, of whatever length."""
        return self._earlier + self.sim.steps

    @property
    def camera(self) -> Camera:
        return self._scene.camera

    @property
    def parameters(self) -> list[Parameter]:
        return [replace(p, value=self.settings.get(p.name, p.value)) for p in self._subject.parameters]

    @property
    def presets(self) -> list[str]:
        return list(self._subject.presets)

    @property
    def solvers(self) -> list[str]:
        return solvers_for(self._scene)

    @property
    def switches(self) -> list[Switch]:
        return switches_of(self._subject.build(self.setup.parameters), self.setup)

    @property
    def wind(self) -> Vector | None:
        return wind_of(self._scene)

    def recommended(self) -> Callable[[], float]:
        solver, count = self.sim.solver, len(self.sim.system.particles)
        if count > MOST_ADVISED:
            return lambda: 0.0
        system = self.sim.system.part(np.arange(count))

        def find() -> float:
            try:
                with np.errstate(all="ignore"):  # steps far too long are tried, too
                    return system.stability(solver).largest_safe_dt
            except InvalidInput:
                return 0.0

        return find

    def text(self) -> str:
        setup = self.setup
        inside = switched_inside(self._subject.build(setup.parameters), setup)
        if inside is not None:
            raise InvalidInput(
                f"{inside} is a part of a body, and a scene file cannot switch it: switch it back to copy"
            )
        return self._as_set(setup).to_toml()

    def opened(self) -> str:
        """The scene as it was opened, as TOML."""
        return self._subject.build({}).to_toml()

    def digest(self) -> str:
        """A hash of the state now: of ids, positions and velocities."""
        system = self.sim.system
        return sha256(system.particles.id.tobytes() + system.get_state().tobytes()).hexdigest()

    def start(self) -> Frame:
        if self.sim.frames_seen or self.recording.inputs:
            self._begin(self._build(self.setup))
        return self._decorated(next(self.sim.frames(1, self.fps)))

    def preset(self, name: str) -> Input:
        presets = {"": {}, **self._subject.presets}
        if name not in presets:
            raise unknown(f"preset of scene {self.name}:", name, presets)
        defaults = {p.name: p.value for p in self._subject.parameters}
        return Turn({**defaults, **presets[name]})

    def undoing(self, what: Input) -> Input | None:
        return super().undoing(what) if self._changed(what) is None else Restore(self.setup)

    def apply(self, what: Input) -> Frame | None:
        before = self.steps
        if not self._by_hand(what) and not self._arrange(what):
            return self.start()
        self.recording.inputs.append((before, what))
        return None

    def prepare(self, what: Input) -> Callable[[], None] | None:
        if isinstance(what, NUMBERS) or not self.sim.engine.wanted:
            return None
        setup = self._changed(what)
        if setup is None:
            twin = self.sim.system.part(np.arange(len(self.sim.system.particles)))
            change(self.sim, twin, what)
            return self.sim.engine.of(twin, self.sim.solver).prepare
        _, adoption = self._planned(setup)
        return adoption.prepare() if adoption.compiles else None

    def _changed(self, what: Input) -> Setup | None:
        """The settings after an input, if it is about them."""
        known = [p.name for p in self._subject.parameters]
        for name in what.settings if isinstance(what, Turn) else ():
            if name not in known:
                raise unknown(f"parameter of scene {self.name}:", name, known)
        return changed(self.setup, what)

    def _planned(self, setup: Setup) -> tuple[Scene, Adoption]:
        """How the run takes other settings, kept until they change."""
        if self._plan is None or self._plan[0] != setup or not self._plan[2].belongs_to(self.sim):
            scene = self._build(setup)
            self._plan = setup, scene, Adoption(self.sim, self._scene, scene)
        return self._plan[1:]

    def _arrange(self, what: Input) -> bool:
        """Take other settings; False if the run cannot go on with them."""
        setup = self._changed(what)
        assert setup is not None
        scene, adoption = self._planned(setup)
        self._plan, self.setup = None, setup
        if not adoption.goes_on:
            self._begin(scene)
            return False
        made = self.sim.steps
        adoption.carry_out()
        self._earlier += made - self.sim.steps
        self._scene = scene
        if self._mouse.particle is not None:
            self._mouse.hold(self._mouse.particle, self._mouse.target)
        if self._sphere.radius > 0:
            self._sphere.again()
        return True


def replay(subject: Subject, recording: Recording, steps: int) -> Simulation:
    """The run of a recording once more, for so many steps: the same bits."""
    *_, live = replaying(subject, recording, steps)
    return live.sim


def replaying(subject: Subject, recording: Recording, steps: int, most: int | None = None) -> Iterator[Live]:
    """The run of a recording once more, step by step.

    Parameters
    ----------
    steps : how long.
    most : steps after which it is given again, None = at the end alone.
    """
    live = Live(subject, recording.setup)
    for before, what in [*recording.inputs, (steps, None)]:
        while live.steps < before:
            live.sim.step(min(before - live.steps, most or before))
            yield live
        if what is not None:
            live.apply(what)
    yield live
