"""A cloth that hangs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pointmass.bodies import Body
from pointmass.bodies.materials import MATERIALS
from pointmass.forces import Gravity, PlateWind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import check_sheet, sheet, steps
from pointmass.tracing import functions as fn

HELD = ("top corners", "top edge", "corners", "side edges", "left edge", "middle")


@dataclass(frozen=True, kw_only=True)
class ClothScene(ShippedScene):
    """A cloth that is held at two corners swings down, and folds as it comes to rest."""

    name = "cloth"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "curtain": {"held": "top edge", "tilt": 25.0, "material": "silk", "width": 1.6},
        "hammock": {"held": "corners", "tilt": 90.0, "material": "denim"},
        "rubber": {"material": "rubber", "tilt": 60.0},
        "handkerchief": {"held": "middle", "tilt": 90.0, "width": 0.7, "height": 0.7},
    }

    particles: int = knob(48, "along the longer side", low=8, high=512)
    width: float = knob(1.0, "of the cloth", unit="m", low=0.1, high=10)
    height: float = knob(1.0, "of the cloth", unit="m", low=0.1, high=10)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    stretch: float = knob(0.0, "stiffness along the threads, 0 = of the material", unit="N/m", low=0, high=1e6)
    bend: float = knob(0.0, "bending stiffness, 0 = of the material", unit="N m", low=0, high=0.01)
    held: str = knob("top corners", "what is held", choices=HELD)
    tilt: float = knob(78.0, "at the start, 0 = it hangs, 90 = it lies", unit="degrees", low=-180, high=180)
    air: float = knob(1.2, "density of the air", unit="kg/m^3", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)

    def body(self) -> Body:
        """The cloth, with its upper edge at y = 0."""
        angle = math.radians(self.tilt)
        down = (0.0, -float(fn.cos(angle)), float(fn.sin(angle)))
        center = tuple(0.5 * self.height * d for d in down)
        return sheet(
            self.particles,
            self.width,
            self.height,
            self.material,
            self.stretch,
            self.bend,
            center=center,
            down=down,
            pinned=self.held,
        )

    def build(self) -> Scene:
        """The cloth in air at rest."""
        body = self.body()
        solver, dt = steps(body)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=300,
            solver=solver,
            bodies=[body],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                PlateWind("cloth", (0.0, 0.0, 0.0), density=self.air),
            ],
            camera=Camera(
                position=(0.8 * self.width, 0.3 * self.height, 1.0 * self.width + 1.2 * self.height),
                target=(0.0, -0.4 * self.height, 0.0),
                fov=34.0,
            ),
            look=Look(color="#b8323a", pattern="checker", pattern_color="#efe6d8", pattern_count=10),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """What is held stays, nothing is torn out of shape, and no energy comes from nowhere."""
        check_sheet(self.body(), frames)
        first, last = frames[0], frames[-1]
        gained = last.quantities["energy"] - first.quantities["energy"]
        scale = self.gravity * self.body().particles.m.sum() * (self.width + self.height)
        expect(gained <= 1e-3 * scale + 1e-9, f"the cloth gained {gained:.2g} J")
        if self.held in ("top corners", "top edge") and self.gravity > 1 and last.time > 2.0:
            low = float(last.positions[:, 1].min())
            expect(low < -0.6 * self.height, f"it hangs down by {-low:.2f} m only, with a height of {self.height} m")
