"""Smoke."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.collisions import Sphere
from pointmass.emitters import Nozzle, Spread
from pointmass.forces import Buoyancy, CurlNoise, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler

AIR, GRAVITY = 293.0, 9.81  # its temperature [K]; [m/s^2]
PUFF = 1e-3  # mass of a puff [kg]
CLEARANCE = 0.98  # from the fire to the ball [m]


@dataclass(frozen=True, kw_only=True)
class Smoke(ShippedScene):
    """Hot smoke rises, curls around a ball, spreads and thins out."""

    name = "smoke"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "thick": {"rate": 4000.0, "opacity": 0.25, "spread": 0.3},
        "wisp": {"rate": 900.0, "source": 0.05, "opacity": 0.1, "turbulence": 0.3, "whirl": 0.5},
        "ink": {"heat": -60.0, "source": 0.1, "turbulence": 0.25, "lifetime": 7.0},
    }

    rate: float = knob(2200.0, "puffs per second", unit="1/s", low=1, high=1e6)
    source: float = knob(0.18, "radius of the fire below", unit="m", low=0.001, high=100)
    heat: float = knob(
        140.0, "of the smoke at first, above that of the air; below, it sinks", unit="K", low=-250, high=2000
    )
    cooling: float = knob(0.45, "rate at which it cools", unit="1/s", low=0, high=100)
    response: float = knob(3.0, "rate at which smoke takes on the speed of the air", unit="1/s", low=0.01, high=1000)
    turbulence: float = knob(0.85, "root mean square speed of the air", unit="m/s", low=0, high=100)
    whirl: float = knob(0.75, "size of the largest whirls", unit="m", low=0.01, high=100)
    change: float = knob(0.6, "how often the whirls become others", unit="1/s", low=0, high=100)
    lifetime: float = knob(5.0, "until a puff is gone", unit="s", low=0.1, high=1000)
    spread: float = knob(0.27, "radius of a puff at its end", unit="m", low=0.001, high=100)
    opacity: float = knob(0.12, "of a puff in its middle", low=0.001, high=1)
    ball: float = knob(0.32, "radius of the ball in the way", unit="m", low=0.01, high=10)

    def build(self) -> Scene:
        """A fire below a ball; with smoke that sinks, above it."""
        way = self._way()
        solid = Sphere(self._middle(), self.ball, restitution=0.0, friction=0.0)
        air = CurlNoise(self.whirl, self.turbulence, self.change, octaves=2, seed=4, around=[solid])
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / math.ceil(self.response / 60),  # at most as long as the air needs to take a puff along
            frames=420,
            dtype="float32",
            solver=SymplecticEuler(),
            emitters=[
                Nozzle(
                    (0.0, 0.0, 0.0),
                    direction=(0.0, way, 0.0),
                    radius=self.source,
                    rate=self.rate,
                    speed=Spread(0.6, 0.3),
                    cone=25.0,
                    lifetime=Spread(self.lifetime, 0.3 * self.lifetime),
                    mass=PUFF,
                )
            ],
            forces=[
                Buoyancy(f"{AIR} + {self.heat}*exp(-{self.cooling}*age)", AIR),
                Wind(air, self.response * PUFF),
            ],
            colliders=[solid],
            camera=Camera(position=(0.0, way * 1.5, 7.0), target=(0.0, way * 1.55, 0.0), fov=34.0),
            look=Look(
                particles="smoke",
                size=self.spread,
                size_over_life=((0.0, 0.25), (1.0, 1.0)),
                color="#dfe3ea",
                opacity=self.opacity,
                opacity_over_life=((0.0, 0.0), (0.04, 1.0), (0.5, 0.45), (1.0, 0.0)),
            ),
        )

    def _way(self) -> float:
        """Of the smoke: up or down."""
        return 1.0 if self.heat >= 0 else -1.0

    def _middle(self) -> tuple[float, float, float]:
        """Of the ball: however large, it leaves the fire free."""
        return 0.08, self._way() * (CLEARANCE + self.ball), 0.0

    def check(self, frames: Sequence[Frame]) -> None:
        """No smoke is in the ball; warm smoke rises, cold smoke sinks; in the end there are rate x lifetime puffs."""
        way = self._way()
        last = frames[-1]
        gap = np.linalg.norm(last.positions - np.array(self._middle()), axis=1) - self.ball
        deepest = float(gap.min(initial=0.0))
        expect(deepest > -1e-3, f"smoke is {-deepest:.2g} m inside the ball")
        lift = abs(self.heat) * GRAVITY / AIR / self.response  # speed of the rise at first [m/s]
        reach = self.source + last.time * (0.9 + lift + 6 * self.turbulence)
        farthest = float(np.linalg.norm(last.positions, axis=1).max(initial=0.0))
        expect(farthest <= reach, f"smoke is {farthest:.2f} m away, and can have come {reach:.2f} m far")
        if last.time > 1.5 and abs(self.heat) > 40 and self.turbulence <= 1 and self.cooling < 1:
            rise = way * float(last.positions[:, 1].mean())
            expect(rise > 0.05, f"the smoke is at {rise:.2f} m in the mean, and should have come further")
        if last.time > 1.4 * self.lifetime:
            count, wanted = len(last.ids), self.rate * self.lifetime
            expect(abs(count - wanted) < 0.02 * wanted + 5, f"{count} puffs, not rate x lifetime = {wanted:.0f}")
