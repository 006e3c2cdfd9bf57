"""Blocks of jelly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body, jelly
from pointmass.collisions import Plane
from pointmass.errors import InvalidInput
from pointmass.forces import Bulk, Gravity
from pointmass.forces.bulk import squeezed
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob, stiffest, substeps
from pointmass.solvers import SymplecticEuler

COLORS = (("#e0315c", "#c41f4a"), ("#f29a1f", "#dd8410"), ("#5db431", "#4a9c22"), ("#3d8fd6", "#2d7bc0"),
          ("#a25bc9", "#8d48b4"))  # fmt: skip

BORNE = 0.5  # pressure of its weight that a jelly bears, relative to its stiffness


@dataclass(frozen=True, kw_only=True)
class JellyScene(ShippedScene):
    """Jellies, each firmer than the one before, drop on a corner, bounce and wobble to rest.

    A jelly bears its weight as long as density gravity size, the pressure under it, is at most half of its stiffness; a
    softer one would lie flat. So size, density and gravity end, and stiffness begins, where this holds with the others
    at their defaults; height ends where a fall begins to crush the corner that they land on to nothing. Poisson's ratio
    begins at 0.3, as the springs alone, which have 1/4, hold no volume: once they are crushed they stay so.

    Raises
    ------
    InvalidInput
        A value that a parameter does not allow, a jelly too soft to bear its weight.
    """

    name = "jelly"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "pudding": {"stiffness": 8e3, "contrast": 1.6, "height": 0.15, "tilt": 10.0, "viscosity": 40.0},
        "rubber": {"stiffness": 3e5, "contrast": 2.0, "height": 1.0, "viscosity": 60.0},
        "moon": {"gravity": 1.62, "height": 1.2},
        "cork": {"poisson": 0.3, "density": 400.0},
    }

    jellies: int = knob(3, "how many", low=1, high=5)
    particles: int = knob(9, "along each edge", low=3, high=32)
    size: float = knob(0.3, "edge of a jelly", unit="m", low=0.05, high=0.75)
    stiffness: float = knob(1.5e4, "Young's modulus of the softest", unit="Pa", low=6e3, high=1e8)
    contrast: float = knob(2.0, "how many times as stiff each next one is", low=1, high=10)
    poisson: float = knob(0.35, "Poisson's ratio: how it bulges when squeezed", low=0.3, high=0.49)
    viscosity: float = knob(150.0, "stress for each unit of strain in a second", unit="Pa s", low=0, high=1000)
    density: float = knob(1000.0, "of jelly", unit="kg/m^3", low=100, high=2500)
    height: float = knob(0.25, "of the lowest corner at the start", unit="m", low=0, high=2)
    tilt: float = knob(30.0, "how far each is turned", unit="degrees", low=-180, high=180)
    friction: float = knob(0.6, "of the floor", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=25)

    def __post_init__(self) -> None:
        super().__post_init__()
        weight = self.density * self.gravity * self.size
        if weight > BORNE * self.stiffness:
            raise InvalidInput(
                f"stiffness = {self.stiffness:g} is not allowed: a jelly of {self.size:g} m and {self.density:g} kg/m^3"
                f" would lie flat under its weight with a gravity of {self.gravity:g} m/s^2: give at least"
                f" {weight / BORNE:.4g} Pa, or make it smaller or lighter"
            )

    def bodies(self) -> list[Body]:
        """The jellies side by side, the softest on the left."""
        made = []
        for k in range(self.jellies):
            options: dict[str, Any] = {
                "tilt": self.tilt,
                "stiffness": self.stiffness * self.contrast**k,
                "poisson": self.poisson,
                "viscosity": self.viscosity,
                "density": self.density,
            }
            counts, sides = (self.particles,) * 3, (self.size,) * 3
            lowest = float(jelly(counts, sides, **options).particles.x[:, 1].min())
            x = 2.0 * self.size * (k - 0.5 * (self.jellies - 1))
            made.append(jelly(counts, sides, center=(x, self.height - lowest, 0.0), **options))
        return made

    def build(self) -> Scene:
        """The jellies above a floor."""
        bodies = self.bodies()
        names = [f"jelly {k + 1}" for k in range(self.jellies)]
        solver = SymplecticEuler()
        # The energy of the fall squashes jellies: they spread, and volumes with wide faces are stiffer and more damped,
        # by some 4.4 strain with a Poisson's ratio of 0.49. `substeps` has room for 2.7. As if tetrahedra bore
        # all that energy alike: those at corners are squeezed more, but few of them, and `stiffest` is for all at once.
        fallen = self.density * self.gravity * (self.height + self.size)
        room = max(1.0, math.sqrt(2.7 * fallen / self.stiffness))
        parts = [squeezed(fallen / _modulus(body)) for body in bodies]
        steps = [substeps(solver, *stiffest(body, part)) for body, part in zip(bodies, parts, strict=True)]
        count = math.ceil(room * max(steps))
        width = 2.0 * self.size * self.jellies
        looks = {
            name: Look(color=color, pattern="checker", pattern_color=other, pattern_count=4)
            for name, (color, other) in zip(names, COLORS, strict=False)
        }
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(4, count),
            frames=240,
            solver=solver,
            bodies=bodies,
            names=names,
            forces=[Gravity((0.0, -self.gravity, 0.0))],
            colliders=[Plane(restitution=0.0, friction=self.friction)],
            camera=Camera(
                # Those that are tilted to the right roll to the right.
                position=(0.27 * width, 0.5 * width, 1.45 * width),
                target=(0.12 * width, 0.7 * self.size, 0.0),
                fov=28.0,
            ),
            look=Look(groups=looks, collider_color="#d9d3c7"),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is in the floor, no energy comes from nowhere, no tetrahedron was ever flat or inside out, and no
        jelly has lost its volume or is torn apart."""
        last = frames[-1]
        lowest = min(float(f.positions[:, 1].min()) for f in frames)
        expect(lowest >= -1e-6, f"a jelly sank {-lowest:.2g} m into the floor")
        lost = frames[0].quantities["energy"] - last.quantities["energy"]
        least = 1e-12 * self.stiffness * self.size**3  # round-off, where there is no gravity
        allowed = 1e-6 * abs(frames[0].quantities["energy"]) + least
        expect(lost >= -allowed, f"the jellies gained {-lost:.2g} J")
        first = 0
        for k, body in enumerate(self.bodies()):
            mine = slice(first, first + len(body.particles))
            first, x = mine.stop, last.positions[mine]
            bulk = _bulk(body)
            rest = bulk.rests(body.particles, 0.0)
            for frame in frames:
                flat = bool((bulk.at(frame.positions[mine][bulk.ids]) / rest).min() <= 0)
                expect(not flat, f"a part of jelly {k + 1} is flat or inside out in frame {frame.number}")
            a, b, c = np.moveaxis(x[body.triangles], 1, 0)
            part = float((a * np.cross(b, c)).sum() / 6) / self.size**3
            expect(0.5 < part < 1.5, f"jelly {k + 1} has {100 * part:.0f}% of its volume")
            wide = float(np.ptp(x, axis=0).max())
            expect(wide < 2.5 * self.size, f"jelly {k + 1}, {self.size} m across at first, is {wide:.2f} m wide")


def _bulk(body: Body) -> Bulk:
    return next(force for force in body.forces if isinstance(force, Bulk))


def _modulus(body: Body) -> float:
    """k_s rest of its tetrahedra [Pa]: what they add to a modulus of the body."""
    bulk = _bulk(body)
    k_s = bulk.settings(body.particles, 0.0, np.arange(len(bulk.ids)))["k_s"][0]
    return float((k_s * bulk.rests(body.particles, 0.0)).max())
