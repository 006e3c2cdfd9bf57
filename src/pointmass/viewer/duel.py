"""A duel: the same scene under several solvers or steps at once, and how far each is from a fine reference."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from time import perf_counter

import numpy as np

from pointmass.errors import Diverged, InvalidInput, number
from pointmass.frame import Camera, Frame
from pointmass.scene import Scene
from pointmass.simulation import Simulation
from pointmass.solvers import RK4, Solver, find_solver
from pointmass.viewer import composing, shading
from pointmass.viewer.inputs import Drop, Hold, Input, Lead, Push, Shoot, Solve
from pointmass.viewer.live import Live
from pointmass.viewer.messages import Contender, Parameter, Switch, Vector, vector
from pointmass.viewer.setup import Setup
from pointmass.viewer.springs import Limits
from pointmass.viewer.subject import Subject

MOST = 4
FINE = 16  # steps of the reference in the shortest of the others
STEADY = 0.25  # of the limit of its solver that its step may take
FAR = 20.0  # sizes of the scene from the reference, beyond which nothing can be seen of somebody
APART = 1.4  # sizes of the scene from one to the next
RECENT = 0.1  # weight of the newest frame in the mean cost
COLORS = ("#56b4e9", "#e69f00", "#2fc79a", "#e58fc0")  # told apart without colour vision, too (Okabe and Ito)
REFERENCE, REFERENCE_COLOR = "reference", "#c9d1dc"


@dataclass(frozen=True)
class Entry:
    """Who takes part: a name, a solver, and its step [s], None = that of the scene."""

    name: str
    solver: Solver
    dt: float | None

    def subject(self, subject: Subject) -> Subject:
        """The scene under this solver."""

        def build(settings: object) -> Scene:
            scene = subject.build(settings)  # type: ignore[arg-type]
            return scene.changed(solver=self.solver, dt=self.dt or scene.dt)

        return replace(subject, build=build)


def entries(text: str) -> list[Entry]:
    """Those that a text such as "euler,rk4@1/120" names.

    Raises
    ------
    InvalidInput
        A solver that is not known, a step that is no positive number, one twice, none or more than four.
    """
    names = [part.strip() for part in text.split(",")]
    if not 1 <= len(names) <= MOST or len(set(names)) < len(names) or not all(names):
        raise InvalidInput(
            f"--duel {text!r} is not allowed: name one to {MOST} different solvers, such as euler,rk4@0.01"
        )
    result = []
    for name in names:
        solver, at, step = name.partition("@")
        dt = number(f"step of {solver} in --duel", _step(step), above=0, unit="s") if at else None
        result.append(Entry(name, find_solver(solver)(), dt))
    return result


def _step(text: str) -> object:
    return float(Fraction(text)) if re.fullmatch(r"[1-9]\d{0,8}/[1-9]\d{0,8}", text) else text


@dataclass
class _Side:
    """One that runs.

    Attributes
    ----------
    frame : the newest.
    error : distance of its particles from those of the reference in it [m].
    cost : mean of what a frame takes [s].
    ended : why it does not go on.
    """

    name: str
    color: str
    live: Live
    frame: Frame
    error: float = math.nan
    cost: float = 0.0
    ended: str = ""
    offset: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = field(default_factory=lambda: np.zeros(3))

    def begin(self) -> None:
        self.frame, self.ended = self.live.start(), ""

    def advance(self, speed: float) -> None:
        """One frame; who diverges makes no more."""
        if self.ended:
            return
        begun = perf_counter()
        try:
            frame = self.live.advance(speed)
        except Diverged as error:
            self.ended = str(error)
            return
        took = perf_counter() - begun
        self.cost = took if self.cost == 0.0 else (1 - RECENT) * self.cost + RECENT * took
        self.frame = frame or self.frame


class Duel:
    """Plays a subject under several solvers, and under RK4 with a fine step: the reference, which is the last one."""

    frames = None
    timeline = None

    def __init__(self, subject: Subject, parts: Sequence[Entry]) -> None:
        lives = [(entry.name, Live(entry.subject(subject))) for entry in parts]
        shortest = min(live.dt for _, live in lives)
        lives.append((REFERENCE, Live(Entry(REFERENCE, RK4(), _fine(subject, shortest)).subject(subject))))
        colors = [*COLORS[: len(parts)], REFERENCE_COLOR]
        self._sides = [
            _Side(name, color, live, live.start()) for (name, live), color in zip(lives, colors, strict=True)
        ]
        self.name, self.summary = subject.name, subject.summary
        self.fps = self._first.fps
        self.beside = True
        self._composer = composing.Composer()
        self._holds = 0  # number of the side at whose place the cursor is
        self._number = 0
        self._compare()
        self._place()

    @property
    def _first(self) -> Live:
        return self._sides[0].live

    @property
    def solver(self) -> str:
        return "duel"

    @property
    def dt(self) -> float:
        return self._first.dt

    @property
    def camera(self) -> Camera:
        camera = self._first.camera
        return _turned_to(camera) if self.beside else camera

    @property
    def grabs(self) -> bool:
        return self._first.grabs

    @property
    def held(self) -> int:
        row = self._sides[self._holds].live.held
        return row if row < 0 else row + sum(len(side.frame.positions) for side in self._sides[: self._holds])

    @property
    def target(self) -> Vector:
        side = self._sides[self._holds]
        return vector(np.add(side.live.target, side.offset))

    @property
    def sims(self) -> Sequence[Simulation]:
        return [side.live.sim for side in self._sides]

    @property
    def parameters(self) -> list[Parameter]:
        return self._first.parameters

    @property
    def presets(self) -> list[str]:
        return self._first.presets

    @property
    def solvers(self) -> list[str]:
        return []

    @property
    def switches(self) -> list[Switch]:
        return self._first.switches

    @property
    def wind(self) -> Vector | None:
        return self._first.wind

    @property
    def setup(self) -> Setup:
        return self._first.setup

    @property
    def picked(self) -> list[int]:
        return self._first.picked

    @picked.setter
    def picked(self, particles: list[int]) -> None:
        self._first.picked = particles

    @property
    def pinned(self) -> bool:
        return self._first.pinned

    @property
    def contenders(self) -> Sequence[Contender]:
        return [
            Contender(
                name=side.name,
                color=side.color,
                error=None if side is self._sides[-1] else side.error,
                energy=side.frame.quantities.get("energy"),
                cost=side.cost,
                ended=side.ended,
            )
            for side in self._sides
        ]

    def arrange(self, beside: bool) -> Frame | None:
        """Draw them beside each other, or in one place."""
        self.beside = beside
        self._place()
        return self._frame()

    def start(self) -> Frame:
        for side in self._sides:
            side.begin()
        self._number = 0
        self._compare()
        self._place()
        return self._frame()

    def advance(self, speed: float) -> Frame | None:
        for side in self._sides:
            side.advance(speed)
        self._compare()
        self._end_those_who_are_far()
        self._number += 1
        return self._frame()

    def look(self) -> Frame | None:
        for side in self._sides:
            if not side.ended:
                side.frame = side.live.look() or side.frame
        self._compare()
        self._number += 1
        return self._frame()

    def prepare(self, what: Input) -> Callable[[], None] | None:
        jobs = [job for side in self._sides if (job := side.live.prepare(what)) is not None]

        def compile_all() -> None:
            for job in jobs:
                job()

        return compile_all if jobs else None

    def undoing(self, what: Input) -> Input | None:
        return self._first.undoing(what)

    def recommended(self) -> Callable[[], float]:
        return lambda: 0.0

    def text(self) -> str:
        raise InvalidInput("a duel cannot be copied as a scene: view the scene alone")

    def preset(self, name: str) -> Input | None:
        return self._first.preset(name)

    def apply(self, what: Input) -> Frame | None:
        """All take it; who begins anew makes all begin."""
        if isinstance(what, Solve):
            raise InvalidInput("the solvers of a duel are those that it began with: name others with --duel")
        if isinstance(what, Hold):
            self._holds = self._nearest(what)
        if isinstance(what, (Hold, Lead)):
            what = replace(what, target=vector(np.subtract(what.target, self._sides[self._holds].offset)))
        if isinstance(what, (Drop, Push, Shoot)):
            what = replace(what, place=vector(np.subtract(what.place, self._offset_at(what.place))))
        anew = [side.live.apply(what) is not None for side in self._sides]
        return self.start() if any(anew) else None

    def _nearest(self, what: Hold) -> int:
        """Whose particle it is: all have one of that id."""

        def far(side: _Side) -> float:
            rows = np.flatnonzero(side.frame.ids == what.particle)
            if not len(rows):
                return math.inf
            return float(np.linalg.norm(side.frame.positions[rows[0]] + side.offset - what.target))

        return int(np.argmin([far(side) for side in self._sides]))

    def _offset_at(self, place: Vector) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Of the side whose middle is nearest to a place."""

        def far(side: _Side) -> float:
            return float(np.linalg.norm(side.frame.positions.mean(axis=0) + side.offset - place))

        return min((side for side in self._sides if len(side.frame.positions)), key=far, default=self._sides[0]).offset

    def _place(self) -> None:
        """Find the places of all."""
        size = self._size()
        azimuth = math.radians(_turned_to(self._first.camera).azimuth)
        right = np.array([math.cos(azimuth), 0.0, -math.sin(azimuth)])
        for k, side in enumerate(self._sides):
            side.offset = right * (APART * max(size, 1e-3) * k) if self.beside else np.zeros(3)

    def _size(self) -> float:
        """Of the scene, as it begins [m]."""
        x = self._first.sim.system.particles.x
        return float(np.linalg.norm(np.ptp(x, axis=0))) if len(x) > 1 else 1.0

    def _compare(self) -> None:
        truth = self._sides[-1].frame
        for side in self._sides[:-1]:
            side.error = distance(side.frame, truth)

    def _end_those_who_are_far(self) -> None:
        far = FAR * max(self._size(), shading.extent(self._sides[-1].frame.positions))
        for side in self._sides[:-1]:
            if not side.ended and side.error > far:
                side.ended = f"its particles are {side.error:.3g} m from where they should be"

    def _frame(self) -> Frame:
        parts = [
            composing.Part(side.name, side.color, side.offset, self._shown(side), ghost=side is self._sides[-1])
            for side in self._sides
        ]
        time = max(side.frame.time for side in self._sides)
        return self._composer.frame(parts, self._number, time, self.beside)

    def _shown(self, side: _Side) -> Frame:
        """What is drawn of one: nothing of who has ended, whose particles are where they do not widen the picture."""
        if not side.ended:
            return _still(side.frame)
        truth = self._sides[-1].frame.positions
        middle = truth.mean(axis=0) if len(truth) else np.zeros(3)
        return replace(side.frame, positions=np.tile(middle, (len(side.frame.positions), 1)), drawables=())


def distance(frame: Frame, other: Frame) -> float:
    """Root mean square distance of the particles that both have [m]; NaN if there are none."""
    _, here, there = np.intersect1d(frame.ids, other.ids, assume_unique=True, return_indices=True)
    if not len(here):
        return math.nan
    gap = frame.positions[here].astype(np.float64) - other.positions[there]
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(np.einsum("ij,ij->i", gap, gap))))


def _fine(subject: Subject, shortest: float) -> float:
    """The step of the reference [s]: a part of the others', and well within what the springs allow."""
    dt = shortest / FINE
    sim = Entry(REFERENCE, RK4(), dt).subject(subject).build({}).simulation()
    share = float(Limits().of([sim]).value.max(initial=0.0)) if sim.system.order == 2 else 0.0
    return dt / max(1, math.ceil(share / STEADY))


def _still(frame: Frame) -> Frame:
    """Without what shows motion: trails keep places of their own, and would lie about those beside."""
    return replace(frame, drawables=tuple(d for d in frame.drawables if d.name != "trails"))


def _turned_to(camera: Camera) -> Camera:
    """A camera that looks from where this one looks, at whatever there is."""
    if camera.position is None or camera.target is None:
        return camera
    x, y, z = np.subtract(camera.position, camera.target)
    azimuth, elevation = math.degrees(math.atan2(x, z)), math.degrees(math.atan2(y, math.hypot(x, z)))
    return Camera(up=camera.up, fov=camera.fov, azimuth=azimuth, elevation=elevation)
