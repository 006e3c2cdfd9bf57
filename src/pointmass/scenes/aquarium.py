"""An aquarium."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.bodies import Body, fish, hair, points
from pointmass.bodies.fish import NODES
from pointmass.collisions import Box, Collider, Sphere
from pointmass.controllers import FishBrain
from pointmass.forces import Flow, Gravity, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.fish import DRAG, SUBSTEPS
from pointmass.solvers import SymplecticEuler

HIGH, DEEP = 0.42, 0.5  # of the tank, relative to its width
STONES = ((0.24, 0.02, 0.07), (-0.27, -0.08, 0.06), (-0.14, 0.1, 0.04), (0.38, 0.12, 0.05), (0.05, -0.17, 0.06))
LEAF = 9  # points of a plant
LINE = 0.02  # mass of a metre of a plant [kg/m]
LIFT = 3.0  # acceleration with which a plant rises in the water [m/s^2]
SINK = 0.04  # speed with which food sinks [m/s]
DRAWN = 0.1  # time in which water takes plants and food along [s]


class Kind(NamedTuple):
    """Fish of a kind.

    Attributes
    ----------
    size : length, relative to the width of the tank.
    role, habit, speed : for `FishBrain`: kind, schools and vigour.
    side : where they begin, from -1 at the left end of the tank to 1 at the right.
    way : where they look, 1 to the right and -1 to the left.
    """

    size: float
    role: str
    habit: str
    speed: float
    side: float
    way: float


KINDS = {  # by the knob that says how many; a pike is longer and slower, so that a chase is open
    "school": Kind(0.05, "prey", "always", 1.0, -0.35, 1.0),
    "grazers": Kind(0.07, "pacifist", "none", 0.7, 0.1, 1.0),
    "pikes": Kind(0.19, "predator", "none", 0.4, 0.6, -1.0),
}


@dataclass(frozen=True, kw_only=True)
class Aquarium(ShippedScene):
    """A tank with a school of small fish, grazers, a pike that hunts the school, plants in the current, and food."""

    name = "aquarium"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "peace": {"pikes": 0, "school": 40, "grazers": 10, "food": 60},
        "surge": {"current": 0.25, "plants": 120},
        "hunt": {"pikes": 2, "school": 60, "grazers": 0, "stones": 5},
    }

    school: int = knob(30, "small fish that swim together and fear the pike", low=1, high=2000)
    grazers: int = knob(5, "fish that go their own way and fear nobody", low=0, high=200)
    pikes: int = knob(1, "that eat small fish", low=0, high=8)
    food: int = knob(30, "flakes that sink; one that is eaten comes again at the surface", low=0, high=1000)
    plants: int = knob(110, "on the ground", low=0, high=2000)
    stones: int = knob(3, "in the way", low=0, high=len(STONES))
    width: float = knob(3.0, "of the tank", unit="m", low=0.5, high=20)
    current: float = knob(0.1, "largest speed of the water, which goes to and fro", unit="m/s", low=0, high=1)
    swell: float = knob(4.0, "time in which it does so", unit="s", low=1, high=60)
    frequency: float = knob(2.5, "of the beat of a tail at full speed", unit="1/s", low=1, high=4)
    seed: int = knob(1, "another one gives another tank", low=0, high=1000000)

    @property
    def half(self) -> NDArray[np.float64]:
        """Half of the edges of the tank [m]; its ground is at y = 0."""
        return 0.5 * self.width * np.array([1.0, HIGH, DEEP])

    @property
    def middle(self) -> NDArray[np.float64]:
        """Of the tank [m]."""
        return self.half * (0.0, 1.0, 0.0)

    def obstacles(self) -> list[Collider]:
        """The glass, and stones that lie on the ground."""
        surface: dict[str, Any] = {"restitution": 0.0, "friction": 0.3, "contact": "discrete"}
        stones = [
            Sphere((x * self.width, r * self.width, z * self.width), r * self.width, **surface)
            for x, z, r in STONES[: self.stones]
        ]
        return [Box(tuple(self.middle), tuple(2 * self.half), inside=True, **surface), *stones]

    def build(self) -> Scene:
        """Fish by kinds in the middle of the tank, plants where there is no stone, food below the surface."""
        rate, (far, high, _) = 2 * math.pi / self.swell, self.half.tolist()
        to_and_fro = f"{self.current!r}*sin({rate!r}*t + 2*x)*(0.4 + 0.6*y/{high!r})"
        tide = Flow((f"{to_and_fro}*max(1 - (x/{far!r})**2, 0)", 0, 0))  # none at the glass
        kinds = {name: kind for name, kind in KINDS.items() if getattr(self, name)}
        bodies = {name: self._shoal(name, kind, tide) for name, kind in kinds.items()}
        forces: list[Any] = []
        if self.food:
            bodies["food"] = points(self._anywhere("food", self.food, 1.9), m=1e-4)
            forces += [Gravity((0.0, -SINK / DRAWN, 0.0), on="food"), Wind(tide, k=1e-4 / DRAWN, on="food")]
        if self.plants:
            bodies["plants"] = leaves = self._meadow()
            k = float(leaves.particles.m.mean()) / DRAWN
            forces += [Gravity((0.0, LIFT, 0.0), on="plants"), Wind(tide, k=k, on="plants")]
        top = self.middle + self.half * (0.0, 0.7, 0.0)
        brain = FishBrain(
            list(kinds),
            [kind.role for kind in kinds.values()],
            food="food" if self.food else "",
            schools=[kind.habit for kind in kinds.values()],
            sight=0.5 * self.width,
            smell=0.3 * self.width,
            home=(*self.middle, 0.4 * self.width),
            feeding=(*top, *(1.6 * self.half * (1.0, 0.1, 1.0))),
            frequency=self.frequency,
            vigour=[kind.speed for kind in kinds.values()],
        )
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / SUBSTEPS,
            frames=900,
            seed=self.seed,
            solver=SymplecticEuler(),
            bodies=list(bodies.values()),
            names=list(bodies),
            forces=forces,
            colliders=self.obstacles(),
            controllers=[brain],
            camera=Camera(
                position=(0.14 * self.width, 0.28 * self.width, 1.0 * self.width),
                target=(0.0, 0.17 * self.width, 0.0),
                fov=40.0,
            ),
            look=Look(
                collider_color="#7f8a94",
                strand_color="#1d5a34",
                tip_color="#7fc35a",
                spring_width=0.006 * self.width,
                groups={name: look for name, look in self._looks().items() if name in bodies},
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Everybody is in the water and in one piece, and plants stand where they grew."""
        first, last = frames[0], frames[-1]
        for obstacle in self.obstacles():
            deep = -float(obstacle.distance(last.positions, last.time).min())
            expect(deep < 1e-3 * self.width, f"a particle is {deep:.3g} m deep in {obstacle.name.lower()}")
        links = np.linalg.norm(np.diff(self._leaves(first), axis=1), axis=2)
        now = np.linalg.norm(np.diff(self._leaves(last), axis=1), axis=2)
        longest = float((now / links).max(initial=0.0))
        expect(longest < 1.2, f"a link of a plant is {longest:.3g} times as long as at first")
        away = float(np.abs(self._leaves(last)[:, 0] - self._leaves(first)[:, 0]).max(initial=0.0))
        expect(away == 0.0, f"a root is {away:.2g} m from where it grew")
        done = 0
        for name, kind in KINDS.items():
            count = getattr(self, name)
            x = last.positions[done : done + NODES * count].reshape(count, NODES, 3)
            done += NODES * count
            wide = float(np.linalg.norm(np.ptp(x, axis=1), axis=1).max(initial=0.0)) / (kind.size * self.width)
            expect(wide < 1.6, f"a fish is {wide:.2f} times as long as it should be")

    # ---------------------------------------------------------------------------------------------- inside

    def _anywhere(self, name: str, count: int, share: float) -> NDArray[np.float64]:
        """Places by chance in a part of the tank around its middle."""
        u = np.stack([random.uniform(self.seed, name, np.arange(count), axis)[:, 0] for axis in "xyz"], axis=1)
        return self.middle + share * (u - 0.5) * self.half

    def _shoal(self, name: str, kind: Kind, tide: Flow) -> Body:
        """Fish of a kind in a block above the stones, in their part of the tank."""
        count, length = getattr(self, name), kind.size * self.width
        n = math.ceil(count ** (1 / 3))
        k = np.arange(count)
        row = np.stack([k // n**2, k // n % n, k % n], axis=1) - 0.5 * (n - 1)
        step = np.minimum(1.3 * length, self.half * (0.7, 0.7, 1.4) / n)
        stray = 0.15 * (self._anywhere(name, count, 1.0) - self.middle) / self.half * step
        places = self.middle + self.half * (kind.side, 0.3, 0.0) + row * step + stray
        way = (kind.way, 0.0, 0.0)
        return fish(count, places, way, length=length, drag=DRAG * length, current=tide, detail=1 if count > 12 else 2)

    def _meadow(self) -> Body:
        """Plants of different heights that begin upright, most of them at the back."""
        ids = np.arange(self.plants)
        spread = [random.uniform(self.seed, "plants", ids, axis)[:, 0] for axis in "xzh"]
        x, z = self.half[0] * (1.9 * spread[0] - 0.95), self.half[2] * (0.95 - 1.8 * spread[1] ** 1.5)
        for sx, sz, r in STONES[: self.stones]:  # from inside of a stone to its edge
            to = np.stack([x - sx * self.width, z - sz * self.width], axis=1)
            far = np.maximum(np.linalg.norm(to, axis=1), 1e-9)
            out = np.maximum(1.05 * r * self.width / far, 1.0)
            x, z = sx * self.width + out * to[:, 0], sz * self.width + out * to[:, 1]
        tall = self.half[1] * (0.5 + 0.9 * spread[2])
        up = np.linspace(0.0, 1.0, LEAF)
        curves = np.stack(np.broadcast_arrays(x[:, None], tall[:, None] * up, z[:, None]), axis=2)
        curves[..., 0] = np.clip(curves[..., 0], -0.98 * self.half[0], 0.98 * self.half[0])
        curves[..., 2] = np.clip(curves[..., 2], -0.98 * self.half[2], 0.98 * self.half[2])
        curves[..., 1] += 1e-3 * self.width
        load = LINE * float(tall.max()) * (LIFT + self.current / DRAWN)
        thick = 2 * math.sqrt(LINE / 1e3 / math.pi)
        return hair(curves=curves, thickness=thick, density=1e3, bend=1e-4, stretch=30 * load)

    def _looks(self) -> dict[str, Look]:
        return {
            "school": Look(color="#e9eef2", pattern="bands", pattern_color="#2f7fd0", pattern_count=2),
            "grazers": Look(color="#ff9a3c", pattern="stripes", pattern_color="#fff6e8", pattern_count=5),
            "pikes": Look(color="#8d9a6a", pattern="stripes", pattern_color="#5d6b45", pattern_count=9),
            "food": Look(particles="solid", size=0.003 * self.width, color="#f2c46d"),
            "plants": Look(particles="none"),
        }

    def _leaves(self, frame: Frame) -> NDArray[np.float64]:
        x = frame.positions[-LEAF * self.plants :] if self.plants else frame.positions[:0]
        return np.asarray(x, np.float64).reshape(self.plants, LEAF, 3)
