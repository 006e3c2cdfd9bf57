"""Cloths that fall on each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body
from pointmass.bodies.body import join
from pointmass.bodies.materials import MATERIALS
from pointmass.collisions import Plane, Sphere
from pointmass.constraints import SelfContact
from pointmass.forces import Gravity, PlateWind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import sheet, steps
from pointmass.self_contact.crossings import crossings
from pointmass.self_contact.pairs import Mesh
from pointmass.tracing import functions as fn

COLORS = ("#b8323a", "#2f6f9f", "#d9a441", "#4f7f52", "#7a4f8f", "#c9c2b2")
TURN = math.pi * (3 - math.sqrt(5))  # from one cloth to the next: none lies like another
LEAN = 0.2  # of a cloth at the start, as a slope: it lands on its lower edge


@dataclass(frozen=True, kw_only=True)
class Heap(ShippedScene):
    """Cloths fall one after the other over a stone and lie in a heap."""

    name = "heap"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "laundry": {"cloths": 6, "side": 0.45, "stone": 0.0},
        "satin": {"material": "silk", "friction": 0.1},
        "blanket": {"cloths": 1, "side": 1.0, "particles": 48},
    }

    cloths: int = knob(3, "how many", low=1, high=12)
    particles: int = knob(24, "along each side of a cloth", low=6, high=256)
    side: float = knob(0.6, "of a cloth", unit="m", low=0.1, high=3)
    material: str = knob("cotton", "what they are made of", choices=tuple(MATERIALS))
    stretch: float = knob(40.0, "stiffness along the threads, 0 = of the material", unit="N/m", low=0, high=1e6)
    friction: float = knob(0.4, "of cloth on cloth, on the stone and on the floor", low=0, high=5)
    stone: float = knob(0.13, "radius of the stone, 0 = there is none", unit="m", low=0, high=1)
    air: float = knob(1.2, "density of the air", unit="kg/m^3", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)

    def bodies(self) -> list[Body]:
        """The cloths, one above the other, each turned and leaning to its side."""
        step = 0.55 * self.side
        lowest = 2 * self.stone + 0.4 * self.side
        result = []
        for k in range(self.cloths):
            c, s = float(fn.cos(k * TURN)), float(fn.sin(k * TURN))
            result.append(
                sheet(
                    self.particles,
                    self.side,
                    self.side,
                    self.material,
                    self.stretch,
                    0.0,
                    center=(0.05 * self.side * s, lowest + k * step, 0.05 * self.side * c),
                    right=(c, 0.0, -s),
                    down=(s, -LEAN, c),
                )
            )
        return result

    def build(self) -> Scene:
        """The cloths in air at rest, the stone and the floor."""
        bodies = self.bodies()
        solver, dt = steps(bodies[0])
        names = [f"cloth {k + 1}" for k in range(len(bodies))]
        solid: dict[str, Any] = {"restitution": 0.0, "friction": self.friction}
        stone = [Sphere((0.0, 0.6 * self.stone, 0.0), self.stone, **solid)] if self.stone > 0 else []
        size = 0.5 * self.side + self.stone
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=180,
            solver=solver,
            bodies=bodies,
            names=names,
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                *(PlateWind(name, (0.0, 0.0, 0.0), density=self.air) for name in names),
            ],
            colliders=[*stone, Plane(**solid)],
            constraints=[SelfContact(friction=self.friction)],
            camera=Camera(position=(0.5 * size, 1.6 * size, 2.7 * size), target=(0.0, 0.3 * size, 0.0), fov=36.0),
            look=Look(
                collider_color="#8d8576",
                groups={
                    name: Look(
                        color=COLORS[k % len(COLORS)], pattern="checker", pattern_color="#efe6d8", pattern_count=8
                    )
                    for k, name in enumerate(names)
                },
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """No triangle passes through another, nobody is inside of the stone or the floor."""
        bodies = self.bodies()
        particles, _ = join(bodies, [f"cloth {k + 1}" for k in range(len(bodies))], np.float64)
        corners = np.concatenate([particles.corners(name) for name in particles.surfaces])
        mesh = Mesh.of(corners, np.zeros((0, 2), np.intp))
        for frame in (*frames[:: max(1, len(frames) // 8)], frames[-1]):
            through = len(crossings(frame.positions, mesh))
            expect(through == 0, f"cloth passes through cloth at {through} places in frame {frame.number}")
        last = frames[-1].positions
        thick = float(particles.radius[0])
        deepest = float(last[:, 1].min()) - thick
        if self.stone > 0:
            middle = np.linalg.norm(last - (0.0, 0.6 * self.stone, 0.0), axis=1)
            deepest = min(deepest, float(middle.min()) - self.stone - thick)
        expect(deepest > -1e-4, f"cloth is {-deepest:.2g} m inside of the stone or of the floor")
