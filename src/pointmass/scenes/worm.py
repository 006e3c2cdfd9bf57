"""A worm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pointmass.bodies import Body, worm
from pointmass.collisions import Plane
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.snake import LOW, crawled, crawler_scene


@dataclass(frozen=True, kw_only=True)
class WormScene(ShippedScene):
    """A worm crawls: waves of thick and thin run along it."""

    name = "worm"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "caterpillar": {"waves": 2.0, "segments": 24, "length": 0.9, "frequency": 1.6},
        "maggot": {"length": 0.3, "width": 0.07, "segments": 8, "frequency": 1.4, "amplitude": 0.3},
        "ice": {"forward": 0.02, "backward": 0.02, "sideways": 0.02},
    }

    segments: int = knob(16, "cubes that it consists of", low=4, high=60)
    length: float = knob(0.6, "of the worm", unit="m", low=0.3, high=2.0)
    width: float = knob(0.05, "of the worm", unit="m", low=0.03, high=0.1)
    amplitude: float = knob(0.35, "how much muscles shorten and lengthen, relative", low=0.0, high=0.45)
    waves: float = knob(1.0, "on the body", low=0.5, high=2.0)
    frequency: float = knob(0.8, "of the waves", unit="1/s", low=0.1, high=2.0)
    mass: float = knob(0.4, "of the worm", unit="kg", low=0.05, high=5.0)
    stiffness: float = knob(1500.0, "of each spring", unit="N/m", low=500.0, high=2e4)
    forward: float = knob(0.1, "friction forwards", low=0.0, high=1.0)
    backward: float = knob(0.5, "friction backwards", low=0.0, high=2.0)
    sideways: float = knob(0.5, "friction sideways", low=0.0, high=2.0)

    def body(self) -> Body:
        """The worm."""
        return worm(
            self.segments,
            self.length,
            self.width,
            amplitude=self.amplitude,
            waves=self.waves,
            frequency=self.frequency,
            center=(0.0, self.width / 2, 0.0),
            mass=self.mass,
            stiffness=self.stiffness,
            forward=self.forward,
            backward=self.backward,
            sideways=self.sideways,
        )

    def build(self) -> Scene:
        """The worm on the floor."""
        far = self.length
        return crawler_scene(
            self,
            "worm",
            self.body(),
            colliders=[Plane((0.0, LOW * self.width, 0.0))],
            camera=Camera(position=(0.6 * far, 0.55 * far, 1.35 * far), target=(0.35 * far, 0.02, 0.0), fov=38.0),
            look=Look(
                groups={"worm": Look(color="#d98a7b", pattern="bands", pattern_color="#b9604f", pattern_count=48)},
                collider_color="#6a5644",
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """It lies on the ground and comes on where its head is."""
        way = crawled(frames, 4 * (self.segments + 1), self.width)
        if self.forward < 0.5 * self.backward and self.amplitude >= 0.15:
            expect(way[0] > 0, f"the worm went {way[0]:.3g} m along the direction of its head")
