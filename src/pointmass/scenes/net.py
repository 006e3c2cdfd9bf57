"""Balls in a net."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass import random
from pointmass.bodies import Body, net, points
from pointmass.collisions import Plane
from pointmass.forces import Drag, Gravity, SoftSphere, Springs
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob, stiffest, substeps
from pointmass.solvers import SymplecticEuler

LINKS = 1  # of a rope from knot to knot
ROPE = 0.012  # radius of a rope, as balls meet it [m]
ROPE_MASS = 0.06  # of a metre of rope [kg/m]
AIR = 0.1  # drag on a particle of the net [N s/m]
LAYER = 4  # balls that fall together


@dataclass(frozen=True, kw_only=True)
class NetScene(ShippedScene):
    """A net hangs in a frame on four posts and catches falling balls."""

    name = "net"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "trampoline": {"slack": 0.0, "balls": 5, "height": 1.0},
        "heavy": {"mass": 2.0, "stiffness": 600.0, "contact": 6000.0},
        "apples": {"balls": 40, "radius": 0.06, "mass": 0.15, "height": 0.3},
        "hammock": {"held": "corners", "balls": 6, "height": 0.2, "slack": 0.0},
    }

    balls: int = knob(9, "how many fall", low=1, high=200)
    radius: float = knob(0.1, "of a ball", unit="m", low=0.04, high=0.3)
    mass: float = knob(0.5, "of a ball", unit="kg", low=0.01, high=10)
    height: float = knob(0.15, "of the lowest ball above the net at the start", unit="m", low=0.1, high=5)
    size: float = knob(1.7, "of the net along each side", unit="m", low=0.8, high=5)
    mesh: float = knob(0.4, "side of a mesh, relative to the diameter of a ball", low=0.3, high=0.8)
    held: str = knob("edges", "what is held of the net", choices=("edges", "corners", "side edges"))
    stiffness: float = knob(200.0, "tension of a rope for each unit of strain", unit="N", low=10, high=1e4)
    slack: float = knob(0.12, "how much longer a rope is than its way in the flat net, relative", low=0, high=0.5)
    contact: float = knob(1500.0, "stiffness with which balls and ropes push each other", unit="N/m", low=100, high=1e5)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.1, high=30)
    seed: int = knob(1, "another one gives other places", low=0, high=2**31)

    @property
    def _top(self) -> float:
        """Height of the net at the start [m]: it does not sag to the floor."""
        return 0.75 * self.size

    def body(self) -> Body:
        """The net, flat at the start."""
        knots = 1 + math.ceil(self.size / (2 * self.mesh * self.radius))
        return net(
            knots,
            knots,
            self.size,
            links=LINKS,
            center=(0.0, self._top, 0.0),
            down=(0.0, 0.0, 1.0),
            mass=ROPE_MASS,
            stiffness=self.stiffness,
            slack=self.slack,
            damping_ratio=0.5,
            radius=ROPE,
            pinned=self.held,
        )

    def caught(self) -> Body:
        """The balls, a few in each layer around the middle."""
        k = np.arange(self.balls)
        chance = random.uniform(self.seed, "net", k, "place")
        angle = 2 * np.pi * (k % LAYER) / LAYER + 2.4 * (k // LAYER) + 0.5 * chance[:, 0]
        out = (1.6 + 0.4 * chance[:, 1]) * self.radius
        y = self._top + self.height + 2.6 * self.radius * (k // LAYER + 0.3 * chance[:, 0])
        x = np.stack([out * np.cos(angle), y, out * np.sin(angle)], axis=1)
        return points(np.round(x, 6).tolist(), m=self.mass, radius=self.radius)

    def frame(self) -> tuple[Body, list[tuple[int, int]]]:
        """The feet and the tops of four posts, and the beams between them."""
        far = 0.5 * self.size + 0.02
        corners = ((-far, -far), (far, -far), (far, far), (-far, far))
        feet, tops = ([(x, y, z) for x, z in corners] for y in (0.0, self._top))
        beams = [(k, k + 4) for k in range(4)]
        if self.held != "corners":
            beams += [(4 + k, 4 + (k + 1) % 4) for k in range(4)]
        return points([*feet, *tops], pinned=list(range(8))), beams

    def build(self) -> Scene:
        """The net at its posts, the balls above it, a floor below."""
        body, balls = self.body(), self.caught()
        solver = SymplecticEuler()
        stiffness, damping = stiffest(body)
        lightest = min(float(body.particles.m.min()), self.mass)
        k_d = 1.4 * math.sqrt(self.contact * lightest)
        count = substeps(solver, stiffness + 4 * self.contact / lightest, damping + 4 * k_d / lightest)
        frame, beams = self.frame()
        ids = len(body.particles) + self.balls + np.array(beams)
        lengths = np.linalg.norm(np.diff(frame.particles.x[beams], axis=1)[:, 0], axis=1)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(4, count),
            frames=240,
            seed=self.seed,
            solver=solver,
            bodies=[body, balls, frame],
            names=["net", "balls", "frame"],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                SoftSphere(self.contact, k_d, onset=0.25 * ROPE),
                Drag(AIR, on="net"),
                Springs(ids, 1.0, 0.0, lengths, family="frame"),
            ],
            colliders=[Plane(restitution=0.4, friction=0.5)],
            camera=Camera(
                position=(0.5 * self.size, self._top + 0.55 * self.size, 1.5 * self.size),
                target=(0.0, 0.72 * self._top, 0.0),
                fov=38.0,
            ),
            look=Look(
                particles="none",
                spring_width=0.014,
                spring_color="#c9b28a",
                groups={
                    "balls": Look(color_by="id", palette="spectrum", color_range=(0.0, 1.0)),
                    "frame": Look(size=0.03, color="#7a5a3a"),
                },
                collider_color="#6f7c74",
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Held knots stay, no ball is inside of another, and all that the net has room for hang in it at the end."""
        body, last = self.body(), frames[-1]
        n = len(body.particles)
        held = np.flatnonzero(body.particles.pinned)
        expect(frames[0].positions[held].tobytes() == last.positions[held].tobytes(), "a knot that is held has moved")
        x, v = last.positions[n : n + self.balls], last.velocities[n : n + self.balls]
        apart = np.linalg.norm(x[:, None] - x[None], axis=2) + 2 * self.radius * np.eye(self.balls)
        deepest = 2 * self.radius - float(apart.min())
        expect(deepest < 0.5 * self.radius, f"two balls are {deepest:.2g} m inside of each other")
        room = self.held == "edges" and self.balls * self.radius**2 < 0.06 * self.size**2
        light = self.balls * self.mass * self.gravity < 2 * self.stiffness and self.height < 0.6
        if room and light and last.time > 3.0:
            low = float(last.positions[:n, 1].min())
            fallen = int((x[:, 1] < low).sum())
            expect(fallen == 0, f"{fallen} of {self.balls} balls are below the net")
            fast = float(np.median(np.linalg.norm(v, axis=1)))
            expect(fast < 1.0, f"half of the balls still move, faster than {fast:.2f} m/s")
