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
FRICTION = 0.2  # of the ground
MIDDLE = 4  # drops of the middle jet for each of another one
LOWER = 0.75  # speed in the jets of the ring, relative to the one in the middle


@dataclass(frozen=True, kw_only=True)
class Fountain(ShippedScene):
    """Drops of light shoot up from a ring of jets around a tall one, lean in the wind, and splash on the ground."""

    name = "fountain"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "geyser": {
            **{"jets": 1, "rate": 4000.0, "speed": 14.0, "speed_range": 4.0, "cone": 4.0},
            **{"lifetime": 3.4, "wind": 2.0},
        },
        "drizzle": {
            **{"jets": 1, "rate": 250.0, "speed": 4.5, "speed_range": 1.5, "cone": 35.0},
            **{"lifetime": 1.4, "wind": 0.3},
        },
        "storm": {"wind": 9.0, "drag": 0.6, "rate": 2500.0, "restitution": 0.15},
    }

    rate: float = knob(1500.0, "drops per second, of all jets together", unit="1/s", low=1, high=1e6)
    jets: int = knob(9, "one in the middle, the others in a ring around it", low=1, high=100)
    ring: float = knob(0.75, "radius of the ring", unit="m", low=0.05, high=100)
    lean: float = knob(9.0, "of the jets of the ring, inwards; below 0, outwards", unit="degrees", low=-80, high=80)
    speed: float = knob(6.5, "of the middle jet's drops; the ring's have 0.75 of it", unit="m/s", low=0.1, high=1000)
    speed_range: float = knob(0.3, "half-range of the speed", unit="m/s", low=0, high=100)
    cone: float = knob(5.0, "half-angle of each jet", unit="degrees", low=0, high=90)
    lifetime: float = knob(1.8, "of a drop", unit="s", low=0.1, high=1000)
    drag: float = knob(0.1, "rate at which the air stops a drop", unit="1/s", low=0, high=100)
    wind: float = knob(1.0, "of the air, along x", unit="m/s", low=-100, high=100)
    restitution: float = knob(0.35, "of the ground", low=0, high=1)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.01, high=1000)

    def build(self) -> Scene:
        """Nozzles on the ground."""
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 120,
            frames=300,
            solver=Leapfrog(),
            emitters=[self._jet(k) for k in range(self.jets)],
            forces=[Gravity((0.0, -self.gravity, 0.0)), Wind((self.wind, 0.0, 0.0), self.drag * DROP)],
            colliders=[Plane(restitution=self.restitution, friction=FRICTION)],
            camera=Camera(azimuth=12.0, elevation=9.0),
            look=Look(
                particles="glow",
                size=0.016,
                color_by="speed",
                color_range=(0.0, 0.9 * self.speed),
                palette="ice",
                brightness=0.9,
                trails=0.09,
                collider_color="#303a4a",
            ),
        )

    def _jet(self, k: int) -> Nozzle:
        """The jet in the middle, or one of the ring."""
        x, z, share, part = 0.0, 0.0, 1.0, MIDDLE
        direction = (0.0, 1.0, 0.0)
        if k:
            angle, lean = 2 * math.pi * (k - 1) / (self.jets - 1), math.radians(self.lean)
            x, z, share, part = math.cos(angle), math.sin(angle), LOWER, 1
            direction = (-math.sin(lean) * x, math.cos(lean), -math.sin(lean) * z)
        return Nozzle(
            (self.ring * x, 0.02, self.ring * z),
            direction=direction,
            rate=self.rate * part / (self.jets - 1 + MIDDLE),
            speed=Spread(share * self.speed, share * min(self.speed_range, self.speed)),
            cone=self.cone,
            radius=0.02,
            lifetime=Spread(self.lifetime, 0.2 * self.lifetime),
            mass=DROP,
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
