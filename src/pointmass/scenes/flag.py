"""A flag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body, chain
from pointmass.bodies.materials import MATERIALS
from pointmass.forces import Gravity, Gust, PlateWind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import check_sheet, sheet, steps

ROOM = 1.3  # in the steps, for the wind, in which a flag that hangs still begins to flap


@dataclass(frozen=True, kw_only=True)
class Flag(ShippedScene):
    """A flag flies from its pole in a gusting wind."""

    name = "flag"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "breeze": {"wind": 3.0, "gusts": 0.3},
        "storm": {"wind": 16.0, "gusts": 0.35, "material": "denim"},
        "banner": {"width": 0.6, "height": 1.8, "wind": 5.0},
        "calm": {"wind": 0.8, "gusts": 0.6},
    }

    particles: int = knob(40, "along the longer side", low=8, high=512)
    width: float = knob(1.5, "of the flag", unit="m", low=0.2, high=10)
    height: float = knob(1.0, "of the flag, along its pole", unit="m", low=0.2, high=10)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    stretch: float = knob(0.0, "stiffness along the threads, 0 = of the material", unit="N/m", low=0, high=1e6)
    bend: float = knob(0.0, "bending stiffness, 0 = of the material", unit="N m", low=0, high=0.01)
    wind: float = knob(7.0, "mean of the wind, along x", unit="m/s", low=0, high=20)
    gusts: float = knob(0.3, "standard deviation of the wind, relative to its mean", low=0, high=1)
    gust_length: float = knob(0.8, "size of a gust", unit="m", low=0.1, high=100)
    air: float = knob(1.2, "density of the air", unit="kg/m^3", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)
    seed: int = knob(1, "another one gives other gusts", low=0, high=2**31)

    def body(self) -> Body:
        """The flag, a little across the wind, from x = 0 on."""
        return sheet(
            self.particles,
            self.width,
            self.height,
            self.material,
            self.stretch,
            self.bend,
            center=(0.5 * self.width * 0.96, 0.0, 0.5 * self.width * 0.28),
            right=(0.96, 0.0, 0.28),
            pinned="left edge",
        )

    def build(self) -> Scene:
        """The flag at its pole, which stands in the wind."""
        body = self.body()
        solver, dt = steps(body, ROOM)
        length = 2.4 * self.height
        pole = chain(
            1, length, start=(0.0, 0.58 * self.height, 0.0), direction=(0.0, -1.0, 0.0), pinned="both", mass=1.0
        )
        gust = Gust((self.wind, 0.0, 0.0), self.gusts, self.gust_length, lifetime=1.0, seed=self.seed)
        size = max(self.width, self.height)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=300,
            seed=self.seed,
            solver=solver,
            bodies=[body, pole],
            names=["flag", "pole"],
            forces=[Gravity((0.0, -self.gravity, 0.0)), PlateWind("flag", gust, density=self.air)],
            camera=Camera(
                position=(0.3 * self.width, -0.25 * size, 2.4 * size),
                target=(0.48 * self.width, -0.1 * self.height, 0.0),
                fov=34.0,
            ),
            look=Look(
                color="#c8102e",
                pattern="bands",
                pattern_color="#f4efe6",
                pattern_count=5,
                groups={"pole": Look(size=0.03 * self.height, color="#d9b45b")},
                spring_width=0.035 * self.height,
                spring_color="#8a7f70",
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """It stays at its pole, is not torn, and in a strong wind flies with the wind and not against it."""
        body = self.body()
        n = len(body.particles)
        check_sheet(body, frames, slice(0, n))
        last = frames[-1]
        weight = self.gravity * body.particles.m.sum()
        if self.air * self.wind**2 * self.width * self.height > 8 * weight and last.time > 2.0:
            middle = float(last.positions[:n, 0].mean())
            expect(
                middle > 0.25 * self.width, f"the middle of the flag is at x = {middle:.2f} m, not in the wind's lee"
            )
        fastest = float(np.abs(last.velocities).max())
        bound = 10 * (self.wind * (1 + 4 * self.gusts) + np.sqrt(2 * self.gravity * (self.width + self.height)) + 1)
        expect(fastest < bound, f"a part of the flag flies at {fastest:.3g} m/s")
