"""Balls on a floor and an incline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import scatter
from pointmass.collisions import Plane, Polygon
from pointmass.forces import Gravity, QuadraticDrag
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import Leapfrog


@dataclass(frozen=True, kw_only=True)
class Bounce(ShippedScene):
    """Balls of many sizes fall on an incline and a floor, bounce, slide and come to rest."""

    name = "bounce"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "marbles": {"balls": 400, "radius": 0.03, "radius_range": 0.01, "restitution": 0.6, "friction": 0.1},
        "moon": {"gravity": 1.62, "air": 0.0, "restitution": 0.85},
        "ice": {"friction": 0.0, "restitution": 0.3, "slope": 12.0},
    }

    balls: int = knob(60, "how many balls", low=1, high=100000)
    radius: float = knob(0.07, "mean radius of a ball", unit="m", low=0.001, high=10)
    radius_range: float = knob(0.04, "half-range of the radius", unit="m", low=0, high=10)
    height: float = knob(2.0, "least height at the start, or the radius of a ball", unit="m", low=0, high=1000)
    restitution: float = knob(0.75, "of floor and incline", low=0, high=1)
    friction: float = knob(0.25, "of floor and incline", low=0, high=10)
    slope: float = knob(30.0, "of the incline", unit="degrees", low=0, high=80)
    air: float = knob(0.002, "air drag c of f = -c |v| v", unit="kg/m", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=1000)
    seed: int = knob(3, "another one gives other balls", low=0, high=2**31)

    def build(self) -> Scene:
        """Balls above a ramp that stands on a floor."""
        a = np.radians(self.slope)
        foot, run = np.array([-0.4, 0.0, 0.0]), 2.2
        top = foot + run * np.array([-np.cos(a), np.sin(a), 0.0])
        deep = np.array([0.0, 0.0, 1.1])
        ramp = [foot - deep, foot + deep, top + deep, top - deep]
        spread = min(self.radius_range, 0.9 * self.radius)
        lowest = max(self.height, self.radius + spread)
        material = {"restitution": self.restitution, "friction": self.friction}
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 120,
            frames=360,
            solver=Leapfrog(),
            bodies=[
                scatter(
                    self.balls,
                    (-0.9, lowest + 0.6, 0.0),
                    (2.6, 1.2, 1.7),
                    m=0.05,
                    radius=self.radius,
                    radius_range=spread,
                    seed=self.seed,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), QuadraticDrag(self.air)],
            colliders=[Plane(**material), Polygon(np.round(ramp, 12), thickness=0.02, **material)],  # type: ignore[arg-type]
            camera=Camera(azimuth=22.0, elevation=16.0),
            look=Look(color_by="id", palette="spectrum", color_range=(0.0, 1.0), collider_color="#4a5568"),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """No ball goes below the floor, and none gains energy."""
        lowest = min(float(f.positions[:, 1].min()) for f in frames)
        expect(lowest > 0, f"a ball's centre came {-lowest:.2g} m below the floor")
        energy = np.array([f.quantities["energy"] for f in frames])
        gain = float(np.diff(energy).max(initial=0.0))
        expect(gain <= 1e-9 * energy[0], f"the balls gained {gain:.2g} of their {energy[0]:.2g} J between two frames")
