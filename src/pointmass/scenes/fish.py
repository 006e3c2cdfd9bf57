"""A fish that swims to a goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import fish, points
from pointmass.bodies.fish import NODES
from pointmass.controllers import Swim
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler

SUBSTEPS = 16  # of a sixtieth of a second: what the light ends of the tail need in the water
DRAG = 1333.0  # of the water for each metre of the fish, so that all sizes swim alike [N s/m^4]
SECONDS = 10.0


@dataclass(frozen=True, kw_only=True)
class FishScene(ShippedScene):
    """An artificial fish of 23 masses, 91 springs and 12 muscles swims to a goal."""

    name = "fish"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "muscles": {"skin": False},
        "hurry": {"frequency": 3.5, "amplitude": 0.25},
        "climb": {"goal_y": 0.35, "goal_z": 0.2},
        "small": {"length": 0.08, "goal_x": 0.3, "goal_y": 0.02, "goal_z": 0.2},
    }

    length: float = knob(0.3, "of the fish", unit="m", low=0.05, high=2)
    amplitude: float = knob(0.2, "of the beat, as a part of a muscle", low=0.05, high=0.3)
    frequency: float = knob(2.0, "of the beat", unit="1/s", low=0.5, high=4)
    turn: float = knob(0.2, "sharpest turn, as a part of a muscle", low=0.05, high=0.3)
    goal_x: float = knob(0.9, "of the goal; the fish begins at 0 and looks along x", unit="m", low=-10, high=10)
    goal_y: float = knob(0.1, "of the goal, upwards", unit="m", low=-10, high=10)
    goal_z: float = knob(0.7, "of the goal, to the right", unit="m", low=-10, high=10)
    skin: bool = knob(
        True, "whether the skin is drawn, or the springs, with muscles red where short and blue where long"
    )

    @property
    def goal(self) -> tuple[float, float, float]:
        """[m]."""
        return self.goal_x, self.goal_y, self.goal_z

    def _camera(self) -> Camera:
        """From the side of the way to the goal, so that the fish crosses the picture from left to right."""
        level = math.hypot(self.goal_x, self.goal_z)
        aside = (-self.goal_z / level, self.goal_x / level) if level else (0.0, 1.0)
        away = 1.3 * max(math.hypot(level, self.goal_y), 2.0 * self.length)
        x, y, z = (0.45 * g for g in self.goal)
        return Camera(position=(x + away * aside[0], y + 0.35 * away, z + away * aside[1]), target=(x, y, z), fov=34.0)

    def build(self) -> Scene:
        """The fish and a mark at its goal."""
        mark = Look(size=0.06 * self.length, color="#ffd75e")
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / SUBSTEPS,
            frames=round(60 * SECONDS),
            solver=SymplecticEuler(),
            bodies=[fish(length=self.length, drag=DRAG * self.length, detail=2), points([self.goal], pinned=[0])],
            names=["fish", "goal"],
            controllers=[Swim("fish", self.goal, self.amplitude, self.frequency, self.turn)],
            camera=self._camera(),
            look=Look(
                surfaces=self.skin,
                springs=not self.skin,
                spring_width=0.012 * self.length,
                particles="solid",
                size=0.016 * self.length,
                color="#e8772e",
                pattern="stripes",
                pattern_color="#fff4e2",
                pattern_count=7,
                groups={"goal": mark},
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """The fish holds together, and it comes near its goal if it has the time."""
        last = frames[-1]
        x = last.positions[:NODES]
        wide = float(np.linalg.norm(np.ptp(x, axis=0)))
        expect(wide < 1.5 * self.length, f"the fish, {self.length} m long, is {wide:.3g} m across")
        gone = float(np.linalg.norm(x[0] - frames[0].positions[0]))
        most = self.length * (1.0 + 4.0 * last.time)  # lengths a second that no fish of these reaches
        expect(gone < most, f"the fish is {gone:.3g} m from where it began after {last.time:.3g} s")
        way = [float(np.linalg.norm(f.positions[0] - self.goal)) for f in frames]
        begin = 3.0  # until it has turned [s]
        if last.time > begin and way[0] > 2 * self.length and self.amplitude * self.frequency >= 0.2:
            nearest = min(way)
            speed = 0.3 * self.length  # of a lazy one
            allowed = max(self.length, way[0] - speed * (last.time - begin))
            expect(
                nearest < allowed, f"the fish came as near as {nearest:.3g} m to its goal, {way[0]:.3g} m away at first"
            )
