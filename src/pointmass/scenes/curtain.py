"""A curtain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies import Body, chain, cloth, join, points
from pointmass.bodies.materials import MATERIALS
from pointmass.collisions import Plane
from pointmass.errors import InvalidInput
from pointmass.forces import Gravity, Gust, PlateWind, Springs
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.motions import RigidMotion
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import check_sheet, steps

HOOK = 0.04  # from a ring to the cloth [m]
GIVE = 0.25  # of a hook, relative, under its load
BORNE = 0.3  # strain that a thread at a ring would have if it bore its part of the weight alone
AIR, DRAG, GUSTS = 1.2, 1.2, 0.6  # density of the air [kg/m^3], drag of the cloth, intensity of the gusts
REST = 0.5  # before it is drawn, and as long again before it is drawn back [s]


@dataclass(frozen=True, kw_only=True)
class Curtain(ShippedScene):
    """A curtain hangs by rings from a rod, is drawn aside into folds, and back again.

    Each ring holds its part of the cloth by one particle. The threads there bear it as long as it is at most 0.3
    stretch times the side of a cell: a softer or finer cloth would be torn out of shape. So particles and height end
    where this holds with the others at their defaults.

    Raises
    ------
    InvalidInput
        A value that a parameter does not allow, a cloth too soft to hang at its rings.
    """

    name = "curtain"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "silk": {"material": "silk", "wind": 0.8},
        "theatre": {"width": 3.0, "height": 2.2, "material": "leather", "stretch": 600.0, "rings": 17, "time": 3.0},
        "open window": {"wind": 2.5, "material": "silk"},
    }

    particles: int = knob(51, "along its upper edge", low=9, high=256)
    width: float = knob(1.8, "of the curtain", unit="m", low=0.3, high=10)
    height: float = knob(1.4, "of the curtain", unit="m", low=0.3, high=8)
    material: str = knob("cotton", "what it is made of", choices=tuple(MATERIALS))
    stretch: float = knob(200.0, "stiffness along the threads", unit="N/m", low=50, high=1e5)
    rings: int = knob(11, "on the rod", low=3, high=41)
    gathered: float = knob(0.25, "part of its width that it has when it is drawn aside", low=0.1, high=1)
    depth: float = knob(
        0.03, "of the folds at the rings, which stand before and behind the rod", unit="m", low=0, high=1
    )
    time: float = knob(1.5, "in which it is drawn aside", unit="s", low=0.2, high=60)
    wind: float = knob(0.4, "of the wind into the room, along z", unit="m/s", low=0, high=5)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.1, high=30)
    seed: int = knob(1, "another one gives other gusts", low=0, high=2**31)

    def __post_init__(self) -> None:
        super().__post_init__()
        weight = MATERIALS[self.material].density * self.width * self.height * self.gravity
        cell = self.width / ((self.rings - 1) * self._between)
        least = weight / (self.rings - 1) / (BORNE * cell)
        if self.stretch < least:
            raise InvalidInput(
                f"stretch = {self.stretch:g} is not allowed: {self.rings} rings hold a curtain of {self.material},"
                f" {self.width:g} m x {self.height:g} m with a gravity of {self.gravity:g} m/s^2, and the threads there"
                f" would be torn out of shape: give at least {math.ceil(least)} N/m, fewer particles, or more rings"
            )

    @property
    def _between(self) -> int:
        """Cells of the cloth from ring to ring."""
        return max(1, round((self.particles - 1) / (self.rings - 1)))

    def bodies(self) -> tuple[Body, Body]:
        """The cloth, whose upper edge is at y = 0, and the rings."""
        cols = 1 + (self.rings - 1) * self._between
        rows = max(2, 1 + round((cols - 1) * self.height / self.width))
        made = MATERIALS[self.material]
        sheet = cloth(
            rows,
            cols,
            (self.width, self.height),
            center=(0.0, -0.5 * self.height, 0.0),
            material=self.material,
            stretch=self.stretch,
            shear=self.stretch * made.shear / made.stretch,
        )
        x = np.linspace(-0.5, 0.5, self.rings) * self.width
        z = 0.5 * self.depth * np.where(np.arange(self.rings) % 2, -1.0, 1.0)
        rings = points(
            np.stack([x, np.full(self.rings, HOOK), z], axis=1).tolist(), radius=0.011, pinned=range(self.rings)
        )
        return sheet, rings

    def hooks(self) -> Springs:
        """From each ring to the cloth below it; the ids of the rings follow those of the cloth.

        They are as stiff as their load asks for: the weight of the cloth, its inertia when it is drawn, and gusts.
        """
        sheet, rings = self.bodies()
        below = np.arange(self.rings) * self._between
        pairs = np.stack([len(sheet.particles) + np.arange(self.rings), below], axis=1)
        rest = np.linalg.norm(rings.particles.x - sheet.particles.x[below], axis=1)
        drawn = 6 * (1 - self.gathered) * self.width / self.time**2  # where `_smooth` is steepest
        gusts = 0.5 * AIR * DRAG * ((1 + GUSTS) * self.wind) ** 2 * self.width * self.height
        load = sheet.particles.m.sum() * math.hypot(self.gravity, drawn) + gusts
        k = load / (self.rings - 1) / (GIVE * HOOK)
        return Springs(pairs, k, 0.2 * np.sqrt(k * sheet.particles.m[below]), rest, family="hooks")

    def shifts(self) -> NDArray[np.float64]:
        """How far each ring is drawn to the left [m]."""
        return np.linspace(0, 1, self.rings) * (1 - self.gathered) * self.width

    def build(self) -> Scene:
        """The curtain before a wall, and a motion for each ring."""
        sheet, rings = self.bodies()
        hooks = self.hooks()
        particles, forces = join([sheet, rings], ["curtain", "rings"], np.float64)
        solver, dt = steps(Body(particles, [*forces, hooks]))
        back = REST + self.time + REST
        drawn = f"({_smooth(REST, self.time)} - {_smooth(back, self.time)})"
        first = len(sheet.particles)
        rod = chain(
            1,
            1.12 * self.width,
            start=(-0.56 * self.width, HOOK + 0.012, 0.0),
            direction=(1.0, 0.0, 0.0),
            pinned="both",
        )
        size = max(self.width, self.height)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=dt,
            frames=math.ceil(60 * (back + self.time + 2 * REST)),
            seed=self.seed,
            solver=solver,
            bodies=[sheet, rings, rod],
            names=["curtain", "rings", "rod"],
            forces=[
                Gravity((0.0, -self.gravity, 0.0)),
                PlateWind("curtain", Gust((0.0, 0.0, self.wind), GUSTS, 0.8, lifetime=1.0, seed=self.seed), AIR, DRAG),
                hooks,
            ],
            motions=[
                RigidMotion([first + k], shift=(f"-{shift:.6g}*{drawn}", 0.0, 0.0))
                for k, shift in enumerate(self.shifts())
            ],
            colliders=[Plane((0.0, 0.0, -0.35 * size), normal=(0.0, 0.0, 1.0), friction=0.3)],
            camera=Camera(
                position=(0.42 * size, -0.3 * self.height, 1.45 * size),
                target=(0.0, -0.46 * self.height, 0.0),
                fov=36.0,
            ),
            look=Look(
                color="#a3263b",
                pattern="stripes",
                pattern_color="#c9a24a",
                pattern_count=20,
                spring_width=0.012,
                spring_color="#b08d57",
                groups={"rings": Look(color="#d9b45b"), "rod": Look(size=0.028, color="#d9b45b")},
                collider_color="#c8bfae",
                floor_size=8 * size,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Rings are where they have to be, the cloth hangs at each of them and is not torn."""
        sheet, rings = self.bodies()
        check_sheet(sheet, frames, slice(0, len(sheet.particles)))
        at = slice(len(sheet.particles), len(sheet.particles) + self.rings)
        below = np.arange(self.rings) * self._between
        for frame in (frames[len(frames) // 2], frames[-1]):
            up, down = (
                float(np.clip((frame.time - start) / self.time, 0, 1)) for start in (REST, 2 * REST + self.time)
            )
            drawn = up * up * (3 - 2 * up) - down * down * (3 - 2 * down)
            place = rings.particles.x - np.outer(drawn * self.shifts(), (1.0, 0.0, 0.0))
            off = np.linalg.norm(place - frame.positions[at], axis=1).max()
            expect(off < 1e-4 * self.width, f"a ring is {off:.2g} m from where it has to be at t = {frame.time:.2f} s")
            gap = np.linalg.norm(frame.positions[at] - frame.positions[below], axis=1).max()
            expect(gap < 3 * np.hypot(HOOK, self.depth), f"the cloth hangs {gap:.2g} m below its ring")


def _smooth(start: float, time: float) -> str:
    """A formula of t that rises from 0 to 1 and stands still at both ends."""
    part = f"min(max((t - {start:.6g})/{time:.6g}, 0), 1)"
    return f"({part})**2*(3 - 2*{part})"
