"""A cloth over a ball."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body
from pointmass.bodies.materials import MATERIALS
from pointmass.collisions import Plane, Sphere
from pointmass.forces import Gravity, PlateWind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import check_sheet, sheet, steps


@dataclass(frozen=True, kw_only=True)
class Drape(ShippedScene):
    """A cloth falls over a ball and drapes it in folds."""

    name = "drape"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "silk": {"material": "silk", "friction": 0.25},
        "leather": {"material": "leather"},
        "slips off": {"friction": 0.02, "aside": 0.25},
    }

    particles: int = knob(48, "along each side", low=8, high=512)
    side: float = knob(1.3, "of the cloth", unit="m", low=0.2, high=5)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    stretch: float = knob(0.0, "stiffness along the threads, 0 = of the material", unit="N/m", low=0, high=1e6)
    bend: float = knob(0.0, "bending stiffness, 0 = of the material", unit="N m", low=0, high=0.01)
    radius: float = knob(0.35, "of the ball", unit="m", low=0.05, high=2)
    height: float = knob(0.15, "of the cloth above the ball at the start", unit="m", low=0, high=2)
    aside: float = knob(0.0, "how far from the middle it falls", unit="m", low=-2, high=2)
    friction: float = knob(0.4, "of the ball and the floor", low=0, high=5)
    air: float = knob(1.2, "density of the air", unit="kg/m^3", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)

    def body(self) -> Body:
        """The cloth, flat above the ball and turned, so that a corner hangs towards the camera."""
        cell = self.side / (self.particles - 1)
        top = self._center + self.radius + 0.3 * cell + self.height
        return sheet(
            self.particles,
            self.side,
            self.side,
            self.material,
            self.stretch,
            self.bend,
            center=(self.aside, top, 0.0),
            right=(0.8, 0.0, 0.6),
            down=(-0.6, 0.0, 0.8),
        )

    @property
    def _center(self) -> float:
        """Height of the ball's centre [m]: the cloth hangs above the floor."""
        return max(self.radius, 0.75 * self.side - 0.6 * self.radius)

    def build(self) -> Scene:
        """The cloth, the ball and a floor."""
        body = self.body()
        solver, dt = steps(body)
        surface: dict[str, Any] = {"restitution": 0.0, "friction": self.friction}
        size = max(self.side, 2 * self.radius)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=240,
            solver=solver,
            bodies=[body],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                PlateWind("cloth", (0.0, 0.0, 0.0), density=self.air),
            ],
            colliders=[Sphere((0.0, self._center, 0.0), self.radius, **surface), Plane(**surface)],
            camera=Camera(
                position=(0.3 * size, self._center + 0.9 * size, 2.2 * size),
                target=(0.0, self._center - 0.2 * size, 0.0),
                fov=34.0,
            ),
            look=Look(
                color="#2f6f9f", pattern="checker", pattern_color="#dfe8ee", pattern_count=8, collider_color="#8d8576"
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is inside of the ball or of the floor, no energy comes from nowhere, and a cloth that lies on the
        middle of the ball with friction comes to rest."""
        body = self.body()
        check_sheet(body, frames)
        last = frames[-1]
        thick = float(body.particles.radius[0])
        ball = np.linalg.norm(last.positions - (0.0, self._center, 0.0), axis=1) - self.radius - thick
        deepest = float(min(ball.min(), last.positions[:, 1].min() - thick))
        expect(deepest > -1e-6, f"the cloth is {-deepest:.2g} m inside of the ball or of the floor")
        lost = frames[0].quantities["energy"] - last.quantities["energy"]
        expect(lost > -1e-6, f"the cloth gained {-lost:.2g} J")
        if self.friction >= 0.3 and abs(self.aside) < 0.1 * self.radius and last.time > 3.5:
            speed = float(np.median(np.linalg.norm(last.velocities, axis=1)))
            expect(speed < 0.1, f"half of the cloth still moves, faster than {speed:.2f} m/s")
