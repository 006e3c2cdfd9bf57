"""A snake."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body, points, snake
from pointmass.bodies.gaits import GAITS
from pointmass.collisions import Mesh, Plane
from pointmass.controllers import Steer
from pointmass.forces import Gravity
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob, stiffest, substeps
from pointmass.solvers import SymplecticEuler

SLENDER = 1 / 24  # width over length
HEAVY = 0.35  # mass over length cubed [kg/m^3]
FIRM = 1000.0  # stiffness of a spring over length squared [N/m^3]: muscles then bear as many weights of the snake
FAR = 2.0  # distance of the apple, in lengths
FOOD = 0.06  # radius of what it heads for [m]
PEG = 0.035  # radius of a peg [m]
APART = 0.3  # distance of pegs [m]
ROWS = 5  # of pegs
SIDES = 12  # of a peg
LOW = -0.21  # where the floor is drawn, in widths: just below the skin


def crawler_scene(scene: Any, kind: str, body: Body, **more: Any) -> Scene:
    """The scene of a body that crawls on the floor, the step, and what all of them have in common."""
    solver = SymplecticEuler()
    return Scene(
        name=scene.name,
        summary=scene.summary(),
        dt=1 / 60 / max(8, substeps(solver, *stiffest(body))),
        frames=480,
        solver=solver,
        forces=[Gravity()],
        bodies=[body, *more.pop("bodies", ())],
        names=[kind, *more.pop("names", ())],
        **more,
    )


def crawled(frames: Sequence[Frame], count: int, width: float) -> np.ndarray:
    """The way of the middle of a body [m], which lies on the floor all the time.

    Raises
    ------
    CheckFailed
        It sank, flew away, or came apart.
    """
    low, high = (f(float(f(fr.positions[:count, 1])) for fr in frames) for f in (min, max))
    expect(low > -0.5 * width, f"the body sank {-low:.2g} m into the ground")
    expect(high < 12 * width, f"the body rose {high:.2g} m above the ground")
    stretch = max(frame.quantities["stretch"] for frame in frames)
    expect(stretch < 0.8, f"a spring of the body is {100 * stretch:.0f}% too long or too short")
    middle = [frame.positions[:count].mean(axis=0) for frame in (frames[0], frames[-1])]
    return np.asarray(middle[1] - middle[0])


def _pegs(places: Sequence[tuple[float, float]], tall: float) -> tuple[list[list[float]], list[list[int]]]:
    """Prisms from below the floor to a height, as one mesh."""
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    up = np.array([0.0, tall, 0.0])
    ring = PEG / np.cos(np.pi / SIDES) * np.stack([np.cos(angles), 0 * angles, -np.sin(angles)], axis=1)
    one = np.concatenate([ring - up, ring + up, [[0, -tall, 0], [0, tall, 0]]])
    i, j, low, high = np.arange(SIDES), (np.arange(SIDES) + 1) % SIDES, 2 * SIDES, 2 * SIDES + 1
    sides = [(i, j, j + SIDES), (i, j + SIDES, i + SIDES), (j, i, 0 * i + low), (i + SIDES, j + SIDES, 0 * i + high)]
    faces = np.concatenate([np.stack(corners, axis=1) for corners in sides])
    vertices = np.concatenate([one + np.array([x, 0.0, z]) for x, z in places])
    return vertices.tolist(), np.concatenate([faces + len(one) * k for k in range(len(places))]).tolist()


@dataclass(frozen=True, kw_only=True)
class SnakeScene(ShippedScene):
    """A snake winds its way to an apple."""

    name = "snake"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "rectilinear": {"gait": "rectilinear", "amplitude": 0.2, "waves": 1.0, "steering": 0.0},
        "sidewinding": {"gait": "sidewinding", "waves": 2.0, "steering": 0.0},
        "concertina": {"gait": "concertina", "amplitude": 0.4, "waves": 0.5, "frequency": 0.6, "steering": 0.0},
        "pegs": {"pegs": 30, "sideways": 0.1, "backward": 0.1, "waves": 2.0, "steering": 0.0},
        "python": {"length": 2.4, "segments": 30, "frequency": 0.7},
    }

    gait: str = knob("serpentine", "how it moves", choices=tuple(GAITS))
    segments: int = knob(24, "cubes that it consists of", low=4, high=60)
    length: float = knob(1.2, "of the snake; a longer one is thicker, too", unit="m", low=0.6, high=3.0)
    amplitude: float = knob(0.25, "how much muscles shorten and lengthen, relative", low=0.0, high=0.4)
    waves: float = knob(1.5, "on the body", low=0.5, high=2.0)
    frequency: float = knob(1.0, "of the waves", unit="1/s", low=0.1, high=2.0)
    forward: float = knob(0.1, "friction forwards", low=0.0, high=1.0)
    backward: float = knob(0.5, "friction backwards", low=0.0, high=2.0)
    sideways: float = knob(0.5, "friction sideways", low=0.0, high=2.0)
    steering: float = knob(0.08, "how much shorter the muscles of one side are in a bend", low=0.0, high=0.2)
    apple: float = knob(
        24.0, "direction to the apple: 0 is straight on, 90 to the left", unit="degrees", low=-180, high=180
    )
    pegs: int = knob(0, "against which it can push", low=0, high=60)

    @property
    def width(self) -> float:
        """Of the snake [m]."""
        return SLENDER * self.length

    @property
    def place(self) -> tuple[float, float]:
        """Where the apple lies, x and z [m]."""
        angle = math.radians(self.apple)
        return FAR * self.length * math.cos(angle), -FAR * self.length * math.sin(angle)

    def body(self) -> Body:
        """The snake, straight at the start."""
        return snake(
            self.segments,
            self.length,
            self.width,
            gait=self.gait,
            amplitude=self.amplitude,
            waves=self.waves,
            frequency=self.frequency,
            center=(0.0, self.width / 2, 0.0),
            mass=HEAVY * self.length**3,
            stiffness=FIRM * self.length**2,
            forward=self.forward,
            backward=self.backward,
            sideways=self.sideways,
        )

    def places(self) -> list[tuple[float, float]]:
        """Where pegs stand: in rows on both sides of the snake and before it."""
        column, row = np.divmod(np.arange(self.pegs), ROWS)
        x = -0.5 * self.length + APART * (column + 0.5 * (row % 2))
        z = (row - 0.5 * (ROWS - 1)) * 0.87 * APART
        beside = np.abs(z) < PEG + self.width
        z = np.where(beside, np.where(column % 2, 1, -1) * (PEG + 1.2 * self.width), z)
        return [(float(a), float(b)) for a, b in zip(x, z, strict=True)]

    def build(self) -> Scene:
        """The snake and the apple on the floor, and pegs if there are any."""
        x, z = self.place
        apple = points([(x, FOOD, z)], radius=FOOD, pinned=[0])
        pegs = [Mesh(_pegs(self.places(), 3 * self.width), restitution=0.0, friction=0.1)] if self.pegs else []
        controllers = []
        if self.steering:
            goal = (x, 0.0, z)
            controllers = [Steer("snake", goal, self.steering, arrival=2 * FOOD, delay=0.5 / self.frequency)]
        middle = 0.5 * x - 0.2 * self.length, 0.5 * z
        far = (0.6 + 0.5 * FAR) * self.length
        return crawler_scene(
            self,
            "snake",
            self.body(),
            bodies=[apple],
            names=["apple"],
            colliders=[Plane((0.0, LOW * self.width, 0.0)), *pegs],
            controllers=controllers,
            camera=Camera(
                position=(middle[0], 0.9 * far, middle[1] + 1.15 * far), target=(middle[0], 0.0, middle[1]), fov=34.0
            ),
            look=Look(
                groups={
                    "snake": Look(color="#7d9a3c", pattern="checker", pattern_color="#2f3d16", pattern_count=48),
                    "apple": Look(color="#d6352b"),
                },
                collider_color="#cbb894",
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """It lies on the ground, comes on in the direction of its head, and no peg is in it."""
        count = 4 * (self.segments + 1)
        way = crawled(frames, count, self.width)
        grips = self.forward < 0.5 * self.backward and 0.2 <= self.sideways <= 1.0
        if grips and self.gait in ("serpentine", "rectilinear") and self.amplitude >= 0.15 and not self.steering:
            expect(way[0] > 0, f"the snake went {way[0]:.3g} m along the direction of its head")
        for x, z in self.places():
            gaps = np.hypot(frames[-1].positions[:count, 0] - x, frames[-1].positions[:count, 2] - z)
            expect(float(gaps.min()) > 0.99 * PEG, f"the peg at x = {x:.2f} m, z = {z:.2f} m is in the snake")
