"""A sheet that tears."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body
from pointmass.bodies.materials import MATERIALS
from pointmass.collisions import Sphere
from pointmass.constraints import Tear
from pointmass.forces import Gravity, PlateWind
from pointmass.frame import Camera, Frame, Triangles
from pointmass.look import Look
from pointmass.motions import RigidMotion
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import sheet, steps

HELD = {
    "all edges": ("edges",),
    "top and bottom": ("top edge", "bottom edge"),
    "sides": ("side edges",),
    "top": ("top edge",),
    "corners": ("top corners", "bottom corners"),
}
SLOWED = 8  # times: so much slower than it is one sees it
BREEZE = 1.5  # along z [m/s], without which a sheet that is pulled stays flat
ROOM = 1.5  # in the steps, for the parts of torn vertices, which are lighter than these


@dataclass(frozen=True, kw_only=True)
class TearScene(ShippedScene):
    """A heavy ball flies through a sheet and rips it, in slow motion."""

    name = "tear"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "pulled apart": {"speed": 0.0, "radius": 0.0, "pull": 0.5, "held": "top and bottom", "uneven": 0.2},
        "silk": {"material": "silk", "strength": 0.1, "speed": 8.0, "radius": 0.12},
        "rubber": {"material": "rubber", "strength": 0.6, "speed": 12.0, "radius": 0.12},
        "curtain": {"held": "top", "strength": 0.06, "speed": 15.0},
    }

    particles: int = knob(48, "along the longer side", low=8, high=512)
    width: float = knob(1.2, "of the sheet", unit="m", low=0.2, high=5)
    height: float = knob(1.2, "of the sheet", unit="m", low=0.2, high=5)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    strength: float = knob(0.15, "strain at which a thread breaks", low=0.01, high=1)
    uneven: float = knob(0.1, "half-range of the strength from thread to thread, relative", low=0, high=0.9)
    held: str = knob("all edges", "where it is held", choices=tuple(HELD))
    radius: float = knob(0.16, "of the ball, 0 = no ball", unit="m", low=0, high=1)
    speed: float = knob(6.0, "of the ball", unit="m/s", low=0, high=20)
    pull: float = knob(
        0.0, "speed at which the bottom moves down, where it and no side is held", unit="m/s", low=0, high=5
    )
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)
    seed: int = knob(1, "another one gives other strengths", low=0, high=2**31)

    def body(self) -> Body:
        """The sheet, upright about the origin."""
        return sheet(self.particles, self.width, self.height, self.material, 0.0, 0.0, pinned=list(HELD[self.held]))

    def build(self) -> Scene:
        """The sheet in a breeze, and a ball that comes from behind."""
        body = self.body()
        solver, dt = steps(body, ROOM)
        dt = 1 / 60 / (SLOWED * math.ceil(1 / 60 / dt / SLOWED))
        size = max(self.width, self.height)
        ball = Sphere((0.0, 0.0, f"{self._ball(0.0)!r} + {self.speed!r}*t"), self.radius or 1.0, friction=0.2)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=300,
            fps=60.0 * SLOWED,
            solver=solver,
            bodies=[body],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                PlateWind("cloth", (0.0, 0.0, BREEZE)),
            ],
            colliders=[ball] if self.radius > 0 else [],
            motions=[RigidMotion(name, shift=(0.0, f"-{self.pull!r}*t", 0.0)) for name in self._led],
            constraints=[Tear(self.strength, "stretch", spread=self.uneven, seed=self.seed)],
            camera=Camera(
                position=(1.45 * size, 0.35 * size, 1.9 * size),
                target=(0.0, -0.05 * size, 0.15 * size),
                fov=34.0,
            ),
            look=Look(
                color="#c9a227", pattern="checker", pattern_color="#f4efe6", pattern_count=12, collider_color="#7a2e2a"
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Who is held stays, no triangle is lost, nobody is inside of the ball, and what is pushed too far is torn."""
        body = self.body()
        first, last = frames[0], frames[-1]
        p, count = body.particles, len(body.particles)
        moves = np.zeros(count, bool)
        for name in self._led:
            moves |= p.groups[name]
        same = first.positions[:count][p.pinned & ~moves] == last.positions[:count][p.pinned & ~moves]
        expect(bool(same.all()), "a particle that is held has moved")
        way = last.positions[:count][moves] - first.positions[:count][moves]
        expect(bool(np.allclose(way, (0.0, -self.pull * last.time, 0.0))), "the bottom edge is not where it is pulled")
        triangles = [
            len(d.faces) for f in (first, last) for d in f.drawables if isinstance(d, Triangles) and d.uv is not None
        ]
        expect(triangles[0] == triangles[1], f"of {triangles[0]} triangles, {triangles[1]} are left")
        free = np.append(~p.pinned, np.ones(len(last.positions) - count, bool))
        gap = np.linalg.norm(last.positions[free] - (0.0, 0.0, self._ball(last.time)), axis=1) - self.radius
        expect(self.radius == 0 or gap.min() > -1e-6, f"the sheet is {-gap.min():.2g} m inside of the ball")
        made = MATERIALS[self.material]
        strain = self.strength * (1 + self.uneven)
        snap = 2 * strain * math.sqrt(made.stretch / made.density)  # of a thread that goes
        fastest = float(np.abs(last.velocities).max())
        bound = 10 * (self.speed + self.pull + snap + math.sqrt(2 * self.gravity * (self.width + self.height)))
        expect(fastest < bound, f"a part of the sheet flies at {fastest:.3g} m/s")
        deep, side = self._ball(last.time) + self.radius, min(self.width, self.height)
        cell = max(self.width, self.height) / (self.particles - 1)  # a smaller ball slips through
        if self.held == "all edges" and cell < self.radius < 0.3 * side and deep > 0:
            stretched = math.hypot(1.0, 2 * deep / side) - 1
            torn = len(last.positions) > count
            expect(torn or stretched < strain, f"threads are stretched by {100 * stretched:.0f}%, and none is torn")

    def _ball(self, t: float) -> float:
        """Where the middle of the ball is on its way, which leads along z [m]; at the start it touches nothing."""
        return -1.1 * self.radius - 0.15 + self.speed * t

    @property
    def _led(self) -> list[str]:
        """Groups of the bottom that are pulled."""
        return [name for name in HELD[self.held] if name.startswith("bottom") and self.pull > 0]
