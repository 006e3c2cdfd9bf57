"""A cloth over a ball, a block, a table, or a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body
from pointmass.bodies.materials import MATERIALS
from pointmass.collisions import Box, Collider, Mesh, Plane, Sphere
from pointmass.collisions.collider import Array
from pointmass.constraints import SurfaceContact
from pointmass.forces import Gravity, PlateWind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.models import of_file, table
from pointmass.scenes.sheets import check_sheet, sheet, steps

HUNG = ("ball", "block")  # things from which it hangs freely


@dataclass(frozen=True, kw_only=True)
class Drape(ShippedScene):
    """A cloth falls over a ball, a block, a table or a mesh of your own, and drapes it in folds."""

    name = "drape"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "silk": {"material": "silk", "friction": 0.25},
        "leather": {"material": "leather"},
        "pedestal": {"over": "block", "particles": 32},
        "slips off": {"friction": 0.02, "aside": 0.25},
        "table": {"over": "table", "side": 1.4, "height": 0.05},
    }

    particles: int = knob(48, "along each side", low=8, high=512)
    side: float = knob(1.3, "of the cloth", unit="m", low=0.2, high=5)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    stretch: float = knob(0.0, "stiffness along the threads, 0 = of the material", unit="N/m", low=0, high=1e6)
    bend: float = knob(0.0, "bending stiffness, 0 = of the material", unit="N m", low=0, high=0.01)
    over: str = knob("ball", 'what it falls on: "ball", "block", "table", or the file of a mesh')
    radius: float = knob(0.35, "of the ball, or half as much as other things are tall", unit="m", low=0.05, high=2)
    height: float = knob(0.15, "of the cloth above it at the start", unit="m", low=0, high=2)
    aside: float = knob(0.0, "how far from the middle it falls", unit="m", low=-2, high=2)
    friction: float = knob(0.4, "of what it falls on", low=0, high=5)
    air: float = knob(1.2, "density of the air", unit="kg/m^3", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=30)

    def body(self) -> Body:
        """The cloth, flat above all and turned, so that a corner hangs towards the camera."""
        cell = self.side / (self.particles - 1)
        top = self._center + self.radius + 0.3 * cell + self.height
        return sheet(
            self.particles,
            self.side,
            self.side,
            self.material,
            self.stretch,
            self.bend,
            center=(self.aside, top, 0.0),
            right=(0.8, 0.0, 0.6),
            down=(-0.6, 0.0, 0.8),
        )

    def _thick(self, body: Body) -> float:
        """How far its particles are from what they lie on [m]."""
        return float(body.particles.radius[0])

    @property
    def _center(self) -> float:
        """Height of the middle [m]: off a ball or a block the cloth hangs above the floor."""
        return max(self.radius, 0.75 * self.side - 0.6 * self.radius) if self.over in HUNG else self.radius

    @property
    def _surface(self) -> dict[str, Any]:
        return {"restitution": 0.0, "friction": self.friction}

    def below(self) -> Collider:
        """What it falls over."""
        if self.over == "ball":
            return Sphere((0.0, self._center, 0.0), self.radius, **self._surface)
        if self.over == "block":
            top, wide = self._center + self.radius, 2**0.5 * self.radius
            return Box((0.0, 0.5 * top, 0.0), (wide, top, wide), **self._surface)
        if self.over == "table":
            return Mesh(table(2 * self.radius), **self._surface)
        return of_file("over", self.over, 2 * self.radius, **self._surface)

    def build(self) -> Scene:
        """The cloth, what is below it, and a floor."""
        body = self.body()
        solver, dt = steps(body)
        size = max(self.side, 2 * self.radius)
        near, low = (1.0, 0.2) if self.over in HUNG else (0.75, 0.05)  # others are lower
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=240,
            solver=solver,
            bodies=[body],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                PlateWind("cloth", (0.0, 0.0, 0.0), density=self.air),
            ],
            colliders=[self.below(), Plane(**self._surface)],
            # The top of a ball stays below the particles' radius between them, the corners of a block do not.
            constraints=[SurfaceContact(thickness=self._thick(body) / 2)] if self.over == "block" else [],
            camera=Camera(
                position=(0.3 * near * size, self._center + 0.9 * near * size, 2.2 * near * size),
                target=(0.0, self._center - low * size, 0.0),
                fov=34.0,
            ),
            look=Look(
                color="#2f6f9f", pattern="checker", pattern_color="#dfe8ee", pattern_count=8, collider_color="#8d8576"
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is inside of what is below or of the floor, nor a triangle inside of the block; no energy comes from
        nowhere; and a cloth that lies on the middle of a ball, a block or a table with friction comes to rest."""
        body = self.body()
        check_sheet(body, frames)
        last = frames[-1]
        thick = self._thick(body)
        gap = self.below().distance(last.positions, last.time) - thick
        deepest = float(min(gap.min(), last.positions[:, 1].min() - thick))
        expect(deepest > -1e-6, f"the cloth is {-deepest:.2g} m inside of what it fell on or of the floor")
        if self.over == "block":
            corners = last.positions[body.particles.corners("cloth")]
            between = self.below().distance(np.concatenate([corners.mean(axis=1), *_halfway(corners)]), last.time)
            expect(float(between.min()) > 0, f"the block comes {-between.min():.2g} m through the cloth")
        lost = frames[0].quantities["energy"] - last.quantities["energy"]
        expect(lost > -1e-6, f"the cloth gained {-lost:.2g} J")
        if (
            self.over in (*HUNG, "table")
            and self.friction >= 0.3
            and abs(self.aside) < 0.1 * self.radius
            and last.time > 3.5
        ):
            speed = float(np.median(np.linalg.norm(last.velocities, axis=1)))
            expect(speed < 0.1, f"half of the cloth still moves, faster than {speed:.2f} m/s")


def _halfway(corners: Array) -> list[Array]:
    """The middles of the edges of triangles."""
    return [0.5 * (corners[:, k] + corners[:, k - 1]) for k in range(3)]
