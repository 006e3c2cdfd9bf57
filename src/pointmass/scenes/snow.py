"""Snow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import scatter
from pointmass.collisions import Plane, Sphere
from pointmass.emitters import BoxEmitter
from pointmass.forces import Flutter, Gravity, Gust, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler

SIDE, HEIGHT = 9.0, 5.0  # of the air in which it snows [m]
FLAKE = 1e-5  # mass of a flake [kg]


@dataclass(frozen=True, kw_only=True)
class Snow(ShippedScene):
    """Flakes flutter down in a gusty wind, and stay lying where they land: on balls of snow and on the ground."""

    name = "snow"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "calm": {"wind": 0.05, "gusts": 0.2, "flutter": 0.15, "rate": 1500.0},
        "blizzard": {"wind": 4.0, "gusts": 0.5, "rate": 9000.0, "flutter": 0.8},
        "hail": {"fall": 6.0, "flutter": 0.02, "wind": 0.3, "size": 0.008},
    }

    rate: float = knob(3000.0, "flakes that begin to fall in a second", unit="1/s", low=1, high=1e6)
    fall: float = knob(1.1, "speed at which a flake falls in still air", unit="m/s", low=0.05, high=100)
    size: float = knob(0.014, "mean radius at which a flake is drawn", unit="m", low=1e-4, high=1)
    flutter: float = knob(0.35, "of a flake, standard deviation of its own speed", unit="m/s", low=0, high=10)
    wind: float = knob(0.5, "mean of the wind, along x", unit="m/s", low=-50, high=50)
    gusts: float = knob(0.4, "standard deviation of the wind, relative to its mean", low=0, high=2)
    gust_length: float = knob(3.0, "size of a gust", unit="m", low=0.1, high=1000)
    ball: float = knob(0.8, "radius of the larger snowball", unit="m", low=0.05, high=2)
    friction: float = knob(1.0, "of snow on snow; on less, flakes slide off the balls", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.01, high=1000)
    seed: int = knob(1, "another one gives other flakes and gusts", low=0, high=2**31)

    def build(self) -> Scene:
        """The air is full of flakes at the start; from then on they come from above and from where the wind does."""
        k = FLAKE * self.gravity / self.fall
        gust = Gust((self.wind, 0.0, 0.15 * self.wind), self.gusts, self.gust_length, seed=self.seed)
        flutter = Flutter((self.flutter, 0.3 * self.flutter, self.flutter), 0.5, seed=self.seed)
        surface: dict[str, Any] = {"restitution": 0.0, "friction": self.friction}
        drift = self.wind * HEIGHT / self.fall
        count = round(self.rate * HEIGHT / self.fall)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 120,
            frames=360,
            dtype="float32",
            seed=self.seed,
            solver=SymplecticEuler(),
            bodies=[scatter(count, (0.0, HEIGHT / 2 + 0.01, 0.0), (SIDE, HEIGHT, SIDE), m=FLAKE, seed=self.seed)],
            emitters=[
                BoxEmitter(
                    (-0.5 * drift, HEIGHT, 0.0),
                    sides=(SIDE + abs(drift), 0.0, SIDE),
                    direction=(0.0, -1.0, 0.0),
                    rate=self.rate * (1 + abs(drift) / SIDE),
                    speed=self.fall,
                    cone=0.0,
                    mass=FLAKE,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), Wind([gust, flutter], k)],
            colliders=[
                Plane(**surface),
                Sphere((0.0, 0.85 * self.ball, 0.0), self.ball, **surface),
                Sphere((0.0, 2.3 * self.ball, 0.0), 0.68 * self.ball, **surface),
            ],
            camera=Camera(position=(1.2, 1.5, 8.5), target=(0.0, 1.4, 0.0), fov=32.0),
            look=Look(particles="flakes", size=self.size, color="#eef4ff", shutter=1 / 90, collider_color="#3c4a63"),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is in the ground, who lies stays there but in strong gusts, who falls has the right speed."""
        last, before = frames[-1], frames[-2]
        lowest = float(last.positions[:, 1].min(initial=0.0))
        expect(lowest > -1e-3, f"a flake sank {-lowest:.2g} m into the ground")
        if self.friction >= 1 and abs(self.wind) < 1:
            _, now, then = np.intersect1d(last.ids, before.ids, return_indices=True)
            lies = ~before.velocities[then].any(axis=1)
            stays = (last.positions[now] == before.positions[then]).all(axis=1)[lies]
            expect(not len(stays) or stays.mean() > 0.9, f"{(~stays).sum()} of {len(stays)} flakes that lay have moved")
        high = last.positions[:, 1] > 3.5
        if high.sum() > 100 and last.time > 0.5:
            fall = -float(last.velocities[high, 1].mean())
            off = 5 * (0.3 * self.flutter + abs(self.gusts * self.wind)) / 3 + 0.05 * self.fall
            expect(abs(fall - self.fall) < off, f"flakes fall at {fall:.3f} m/s, not at {self.fall} m/s")
