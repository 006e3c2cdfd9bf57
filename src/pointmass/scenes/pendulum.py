"""A chain that swings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import chain
from pointmass.forces import Drag, Gravity
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob, substeps
from pointmass.solvers import Leapfrog


@dataclass(frozen=True, kw_only=True)
class Pendulum(ShippedScene):
    """A chain of masses swings from a nail, and folds over itself."""

    name = "pendulum"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "simple": {"links": 1, "angle": 30.0},
        "whip": {"links": 60, "angle": 170.0},
        "syrup": {"drag": 0.06, "angle": 90.0},
    }

    links: int = knob(12, "links of the chain", low=1, high=400)
    length: float = knob(1.5, "length of the chain", unit="m", low=0.01, high=100)
    mass: float = knob(1.0, "mass of the chain", unit="kg", low=1e-6, high=1e6)
    angle: float = knob(100.0, "angle from hanging at which it is let go", unit="degrees", low=-180, high=180)
    stiffness: float = knob(20000.0, "stiffness of one link", unit="N/m", low=1, high=1e9)
    damping_ratio: float = knob(0.02, "damping of one link, 1 = critical", low=0, high=10)
    drag: float = knob(0.0, "air drag on each mass", unit="N s/m", low=0, high=100)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=1000)

    def build(self) -> Scene:
        """A chain at an angle, with gravity."""
        a = math.radians(self.angle)
        solver, m = Leapfrog(), self.mass / self.links
        stiffest = 4 * self.stiffness / m  # neighbours against each other
        damping = 8 * self.damping_ratio * math.sqrt(self.stiffness / (2 * m)) + self.drag / m
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(4, math.ceil(math.sqrt(stiffest) / 60), substeps(solver, stiffest, damping)),
            frames=300,
            solver=solver,
            bodies=[
                chain(
                    self.links,
                    self.length,
                    direction=(math.sin(a), -math.cos(a), 0.0),
                    mass=self.mass,
                    k_s=self.stiffness,
                    damping_ratio=self.damping_ratio,
                    radius=0.02 * self.length,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), *([Drag(self.drag)] if self.drag else [])],
            camera=Camera(azimuth=0.0, elevation=3.0),
            look=Look(color_by="speed", color_range=(0.0, 6.0), palette="spectrum", trails=0.5, spring_width=0.012),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """It only loses energy, stays in its plane, and its links stay about as long as they are."""
        energy = [f.quantities["energy"] for f in frames]
        scale = self.mass * self.gravity * self.length + 1e-12
        rise = (max(energy) - energy[0]) / scale
        expect(rise < 0.02, f"the chain gained {rise:.1%} of its energy")
        stray = max(float(np.abs(f.positions[:, 2]).max()) for f in frames)
        expect(stray < 1e-9, f"the chain left its plane by {stray:.2g} m")
        stretch = max(f.quantities["stretch"] for f in frames)
        allowed = 0.02 + 60 * self.mass * self.gravity / (self.stiffness * self.length / self.links)
        expect(stretch < allowed, f"a link stretched by {stretch:.1%}")
