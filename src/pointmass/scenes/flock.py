"""Flocks and schools."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import scatter
from pointmass.collisions import Capsule, Collider, Plane, Sphere
from pointmass.forces import Avoid, Cruise, Flee, Flocking, Seek
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler

ROOM = 1.6  # radius of the space in which they live, relative to that of the flock if it were spread evenly
AGILE = 3.0  # largest acceleration, in cruising speeds per second
FASTER = 1.3  # speed of a predator, relative to that of the flock
THICK = 0.05  # radius of a pillar, relative to the room
LOOKED_AT = 500  # animals of which the check asks for their neighbours
TURN = 2.399963  # golden angle, by which pillars are apart [rad]


@dataclass(frozen=True, kw_only=True)
class Flock(ShippedScene):
    """Birds keep apart, fly as their neighbours do and stay together, around pillars and away from a falcon."""

    name = "flock"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "starlings": {"animals": 6000, "pillars": 0, "cohesion": 1.6, "field_of_view": 300.0},
        "bait_ball": {
            **{"kind": "fish", "animals": 4000, "predators": 3, "pillars": 0, "speed": 3.0, "sight": 1.2, "apart": 0.5},
            **{"separation": 8.0, "alignment": 1.5, "cohesion": 3.0},
        },
        "geese": {
            **{"animals": 90, "pillars": 0, "speed": 14.0, "sight": 9.0, "apart": 3.0},
            **{"alignment": 3.0, "field_of_view": 240.0},
        },
    }

    kind: str = knob("birds", "what they are drawn as", choices=("birds", "fish"))
    animals: int = knob(2000, "how many", low=2, high=200000)
    predators: int = knob(1, "that hunt them", low=0, high=50)
    pillars: int = knob(6, "that stand in their way", low=0, high=24)
    speed: float = knob(8.0, "at which they cruise", unit="m/s", low=0.1, high=100)
    sight: float = knob(2.5, "distance within which they see each other", unit="m", low=0.1, high=50)
    apart: float = knob(1.0, "distance that they keep", unit="m", low=0.1, high=50)
    separation: float = knob(30.0, "acceleration away from somebody very near", unit="m/s^2", low=0, high=500)
    alignment: float = knob(2.0, "rate at which they take on their neighbours' velocity", unit="1/s", low=0, high=20)
    cohesion: float = knob(1.0, "acceleration for each metre to their neighbours' middle", unit="1/s^2", low=0, high=50)
    field_of_view: float = knob(270.0, "full angle in which they see", unit="degrees", low=10, high=360)
    seed: int = knob(1, "another one gives another start", low=0, high=2**31)

    @property
    def room(self) -> float:
        """Radius of the space in which they live [m]."""
        return ROOM * self.apart * math.cbrt(max(self.animals, 50))

    @property
    def middle(self) -> tuple[float, float, float]:
        """Of that space [m]."""
        return 0.0, 0.85 * self.room, 0.0

    def obstacles(self) -> list[Collider]:
        """The ground, and pillars that are neither in the middle nor at the edge."""
        surface: dict[str, Any] = {"restitution": 0.4, "friction": 0.0, "contact": "discrete"}  # all are thick
        room = self.room
        result: list[Collider] = [Plane(**surface)]
        for k in range(self.pillars):
            away = room * math.sqrt(0.25 + 0.6 * (k + 0.5) / self.pillars)
            x, z = away * math.cos(TURN * k + 0.5), away * math.sin(TURN * k + 0.5)
            foot, top = (x, -0.1 * room, z), (x, room * (0.7 + 0.5 * ((k * 5) % 7) / 7), z)
            result.append(Capsule(foot, top, radius=THICK * room, **surface))
        return result

    def build(self) -> Scene:
        """Everybody begins in a direction of his own; all like to be in the middle of their room."""
        room, speed = self.room, self.speed
        middle, obstacles = self.middle, self.obstacles()
        hunted = self.predators > 0
        forces: list[Any] = [
            Flocking(
                self.sight,
                self.apart,
                self.separation,
                self.alignment,
                self.cohesion,
                self.field_of_view,
                limit=AGILE * speed,
                on="flock",
            ),
            Seek(middle, speed, 0.3, arrival=0.6 * room, on="flock"),
            Cruise(speed, 1.5, limit=AGILE * speed, on="flock"),
            Avoid([Sphere(middle, radius=room, inside=True), *obstacles], 5 * speed, self.apart, horizon=0.8),
        ]
        if hunted:
            forces += [
                Flee("predators", 6 * speed, max(4 * self.apart, 0.25 * room), 320.0, on="flock"),
                Flee("flock", -2 * speed, room, on="predators"),
                Cruise(FASTER * speed, 1.5, limit=AGILE * speed, on="predators"),
            ]
        kind: Any = self.kind
        size = 0.4 * self.apart
        side = 0.6 * room
        above = (0.0, 1.4 * room, 0.0)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / math.ceil(2 * speed / 60 / (0.5 * THICK * room)),  # nobody steps through a pillar
            frames=900,
            dtype="float32",
            seed=self.seed,
            solver=SymplecticEuler(),
            bodies=[
                scatter(self.animals, middle, (side, side, side), speed=speed, seed=self.seed),
                *[scatter(self.predators, above, (side, 0.0, side), speed=speed, seed=self.seed + 1)] * hunted,
            ],
            names=["flock", *["predators"] * hunted],
            forces=forces,
            colliders=obstacles,
            camera=Camera(position=(0.0, 0.5 * room, 3.1 * room), target=(0.0, 0.82 * room, 0.0), fov=38.0),
            look=Look(
                particles=kind,
                size=size,
                color="#cfe0f5",
                collider_color="#3c4a63",
                groups={"predators": Look(particles=kind, size=2.2 * size, color="#ff8a3c")} if hunted else None,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is in an obstacle or has left; after some seconds neighbours go one way, and keep apart."""
        last = frames[-1]
        for obstacle in self.obstacles():
            depth = -float(obstacle.distance(last.positions, last.time).min())
            expect(depth < 1e-3 * self.room, f"an animal is {depth:.3g} m deep in a {obstacle.name.lower()}")
        away = float(np.linalg.norm(last.positions - self.middle, axis=1).max())
        most = 1.5 * self.room + self.speed
        expect(away < most, f"an animal is {away:.3g} m from the middle of a room with a radius of {self.room:.3g} m")
        crowded = self.animals >= 30 and self.sight >= 2 * self.apart and self.field_of_view >= 180
        if last.time < 2 or not crowded or self.alignment < 1 or self.separation < self.speed:
            return
        x, v = last.positions[: self.animals], last.velocities[: self.animals]
        some = np.arange(0, len(x), -(-len(x) // LOOKED_AT))
        distance = np.linalg.norm(x[some, None] - x, axis=2)
        near = np.argsort(distance, axis=1)[:, 1:7]
        apart = float(np.median(np.take_along_axis(distance, near[:, :1], axis=1)))
        expect(
            0.2 * self.apart < apart < 2 * self.sight,
            f"neighbours are {apart:.3g} m apart, and they should keep about {self.apart:.3g} m",
        )
        heading = v / np.linalg.norm(v, axis=1, keepdims=True)
        order = float(
            np.linalg.norm(np.concatenate([heading[some, None], heading[near]], axis=1).mean(axis=1), axis=1).mean()
        )
        expect(order > 0.7, f"the polarisation of neighbours is {order:.2f}, and it should be near 1")
