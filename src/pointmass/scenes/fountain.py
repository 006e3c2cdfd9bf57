"""A fountain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pointmass.collisions import Plane
from pointmass.emitters import Nozzle, Spread
from pointmass.forces import Gravity, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import Leapfrog

DROP = 1e-3  # mass of a drop [kg]


@dataclass(frozen=True, kw_only=True)
class Fountain(ShippedScene):
    """Drops of light shoot up in a cone, lean in the wind, and splash on the ground."""

    name = "fountain"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "geyser": {"rate": 4000.0, "speed": 14.0, "speed_range": 4.0, "cone": 4.0, "lifetime": 3.4, "wind": 2.0},
        "drizzle": {"rate": 250.0, "speed": 4.5, "speed_range": 1.5, "cone": 35.0, "lifetime": 1.4, "wind": 0.3},
        "storm": {"wind": 9.0, "drag": 0.6, "rate": 1500.0, "restitution": 0.15},
    }

    rate: float = knob(700.0, "drops per second", unit="1/s", low=1, high=1e6)
    speed: float = knob(6.5, "speed at the nozzle", unit="m/s", low=0.1, high=1000)
    speed_range: float = knob(0.5, "half-range of the speed", unit="m/s", low=0, high=100)
    cone: float = knob(11.0, "half-angle of the jet", unit="degrees", low=0, high=90)
    lifetime: float = knob(2.2, "of a drop", unit="s", low=0.1, high=1000)
    drag: float = knob(0.1, "rate at which the air stops a drop", unit="1/s", low=0, high=100)
    wind: float = knob(1.0, "of the air, along x", unit="m/s", low=-100, high=100)
    restitution: float = knob(0.35, "of the ground", low=0, high=1)
    friction: float = knob(0.2, "of the ground", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.01, high=1000)

    def build(self) -> Scene:
        """A nozzle on the ground."""
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 120,
            frames=300,
            solver=Leapfrog(),
            emitters=[
                Nozzle(
                    (0.0, 0.02, 0.0),
                    rate=self.rate,
                    speed=Spread(self.speed, min(self.speed_range, self.speed)),
                    cone=self.cone,
                    radius=0.02,
                    lifetime=Spread(self.lifetime, 0.2 * self.lifetime),
                    mass=DROP,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), Wind((self.wind, 0.0, 0.0), self.drag * DROP)],
            colliders=[Plane(restitution=self.restitution, friction=self.friction)],
            camera=Camera(azimuth=12.0, elevation=9.0),
            look=Look(
                particles="glow",
                size=0.022,
                color_by="speed",
                color_range=(0.0, 0.9 * self.speed),
                palette="ice",
                brightness=0.9,
                trails=0.09,
                collider_color="#303a4a",
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is below the ground or above v^2/2g, and once it runs there are rate x lifetime drops."""
        lowest = min(float(f.positions[:, 1].min(initial=0.0)) for f in frames)
        expect(lowest >= -1e-9, f"a drop sank {-lowest:.2g} m into the ground")
        top = (self.speed + self.speed_range) ** 2 / (2 * self.gravity) + 0.021
        highest = max(float(f.positions[:, 1].max(initial=0.0)) for f in frames)
        expect(highest <= top, f"a drop rose to {highest:.3f} m, higher than v^2/2g = {top:.3f} m")
        last = frames[-1]
        if last.time > 1.3 * self.lifetime:
            count, wanted = len(last.ids), self.rate * self.lifetime
            spread = 5 * math.sqrt(wanted) + 2
            expect(abs(count - wanted) < spread, f"{count} drops are alive, not rate x lifetime = {wanted:.0f}")
