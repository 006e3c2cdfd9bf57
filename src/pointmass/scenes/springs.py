"""A cube of jelly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import lattice
from pointmass.collisions import Plane
from pointmass.forces import Drag, Gravity
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob, substeps
from pointmass.solvers import SymplecticEuler
from pointmass.tracing import functions as fn

LIVELY = 0.5  # a floor that gives more than this back


@dataclass(frozen=True, kw_only=True)
class SpringsScene(ShippedScene):
    """A cube of masses and springs drops on a corner, bounces and wobbles to rest."""

    name = "springs"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "jelly": {"side": 6, "stiffness": 60.0, "damping_ratio": 0.08},
        "rubber": {"stiffness": 800.0, "restitution": 0.8, "height": 1.5},
        "moon": {"gravity": 1.62, "height": 1.5, "drag": 0.0},
    }

    side: int = knob(5, "particles along each edge", low=2, high=40)
    size: float = knob(1.0, "edge of the cube", unit="m", low=0.01, high=100)
    mass: float = knob(1.0, "mass of the cube", unit="kg", low=1e-6, high=1e6)
    stiffness: float = knob(150.0, "stiffness of an edge spring", unit="N/m", low=0.1, high=1e7)
    damping_ratio: float = knob(0.04, "damping of a spring, 1 = critical", low=0, high=5)
    height: float = knob(0.8, "height of its lowest corner at the start", unit="m", low=0, high=1000)
    tilt: float = knob(40.0, "how far it is turned", unit="degrees", low=-180, high=180)
    restitution: float = knob(0.4, "of the floor", low=0, high=1)
    friction: float = knob(0.6, "of the floor", low=0, high=10)
    drag: float = knob(0.0005, "air drag on each mass", unit="N s/m", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=1000)

    def build(self) -> Scene:
        """The cube above a floor."""
        m = self.mass / self.side**3
        radius = 0.18 * self.size / self.side
        c, s = abs(float(fn.cos(math.radians(self.tilt)))), abs(float(fn.sin(math.radians(self.tilt))))
        reach = 0.5 * self.size * (c * s + c * c + s)  # from the centre down to the lowest corner
        solver = SymplecticEuler()
        # 6 springs along edges and 20 along diagonals, of half the stiffness, pull in all directions; at most both ends
        # of each move against each other.
        stiffest = 2 * (6 + 20 / 2) / 3 * self.stiffness / m
        if self.restitution > LIVELY:
            stiffest *= 4  # impacts add energy to steps above half the limit, unless the bounce takes more away
        damping = 2 * (6 + 20 / math.sqrt(2)) / 3 * 2 * self.damping_ratio * math.sqrt(self.stiffness / (2 * m))
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(4, substeps(solver, stiffest, damping + self.drag / m)),
            frames=300,
            solver=solver,
            bodies=[
                lattice(
                    (self.side,) * 3,
                    (self.size,) * 3,
                    center=(0.0, self.height + radius + reach, 0.0),
                    tilt=self.tilt,
                    mass=self.mass,
                    k_s=self.stiffness,
                    damping_ratio=self.damping_ratio,
                    radius=radius,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), Drag(self.drag)],
            colliders=[Plane(restitution=self.restitution, friction=self.friction)],
            camera=Camera(azimuth=28.0, elevation=14.0),
            look=Look(color="#ffc46b", spring_width=0.012 * self.size),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """It stays on its floor, keeps its shape and ends with less energy than it had."""
        last = frames[-1]
        lowest = min(float(f.positions[:, 1].min()) for f in frames)
        expect(lowest >= -1e-9, f"the cube sank {-lowest:.2g} m into the floor")
        lost = frames[0].quantities["energy"] - last.quantities["energy"]
        expect(lost >= -1e-6, f"the cube gained {-lost:.2g} J")
        spread = float(np.ptp(last.positions, axis=0).max())
        expect(0.5 * self.size < spread < 2.2 * self.size, f"the cube of {self.size} m is now {spread:.2f} m wide")
