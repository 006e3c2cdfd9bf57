"""A dust devil."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import scatter
from pointmass.collisions import Plane
from pointmass.emitters import Nozzle, Spread
from pointmass.forces import CurlNoise, Flow, Gravity, Wind
from pointmass.frame import Camera, Frame
from pointmass.laws.formula import Formula
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler

SECONDS = 8.0  # length of the film; the whirl is in the middle of the ground at half of it
DUST, SAND = 1e-6, 6e-6  # mass of a grain [kg]; all have the same drag, so sand falls six times as fast
UNEVEN = 0.4  # half-range of the drag of a grain, relative to its mean
WIDER = 0.7  # how much wider the whirl is at its height than below, relative to its core
PEAK = 0.638  # of (1 - exp(-r^2)) / r, the profile of the speed around (Lamb and Oseen)
LEAN = 0.1  # tangent of the angle at which the column leans with the wind
SLOW = 0.12  # thickness of the layer of slow air on the ground, relative to the height
ROUGH = 0.7  # part of it that lies below the tops of the grains, so that the air takes hold of them


@dataclass(frozen=True, kw_only=True)
class Dust(ShippedScene):
    """A dust devil wanders over dry ground, picks up dust and sand, throws them out, and lets them lie behind."""

    name = "dust"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "mars": {"gravity": 3.71, "height": 12.0, "core": 0.9, "updraft": 14.0, "swirl": 11.0, "fall": 0.4},
        "eddy": {"height": 2.2, "core": 0.22, "updraft": 2.6, "swirl": 4.0, "wind": 0.3, "wander": 0.3, "fall": 0.3},
        "landspout": {"swirl": 15.0, "updraft": 15.0, "core": 0.7, "height": 9.0, "fall": 0.5, "dust": 5000.0},
    }

    sand: int = knob(20000, "grains of sand that lie on the ground", low=10, high=1000000)
    dust: float = knob(4000.0, "puffs of dust that the whirl raises in a second", unit="1/s", low=1, high=1e6)
    fall: float = knob(0.8, "speed at which sand falls in still air; dust, a sixth", unit="m/s", low=0.05, high=20)
    swirl: float = knob(9.0, "highest speed of the air around the core", unit="m/s", low=0, high=100)
    updraft: float = knob(8.5, "speed of the air upwards in the core", unit="m/s", low=0, high=100)
    core: float = knob(0.55, "radius of the core near the ground", unit="m", low=0.05, high=20)
    height: float = knob(6.0, "at which the whirl ends", unit="m", low=0.5, high=100)
    wind: float = knob(0.6, "of the air, along x; it carries the whirl along", unit="m/s", low=-20, high=20)
    wander: float = knob(0.6, "how far the whirl strays from a straight way", unit="m", low=0, high=20)
    turbulence: float = knob(0.45, "root mean square speed of small whirls", unit="m/s", low=0, high=20)
    friction: float = knob(2.5, "of the ground; above 1, grains cling to it", low=0, high=10)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.01, high=100)

    @property
    def drag(self) -> float:
        """Mean drag coefficient of a grain [N s/m]."""
        return SAND * self.gravity / self.fall

    @property
    def way(self) -> tuple[str, str]:
        """Where the whirl stands on the ground, formulas of t for x and z [m]."""
        return f"{self.wind}*(t-{SECONDS / 2}) + {self.wander}*sin(1.1*t)", f"{self.wander}*cos(0.8*t)"

    def build(self) -> Scene:
        """Sand lies along the way of the whirl; dust begins below it."""
        stiffest = (1 + UNEVEN) * self.drag / DUST
        substeps = max(2, math.ceil(stiffest / 60))  # a step is at most as long as the air needs to stop a grain
        air = CurlNoise(1.5 * self.core, self.turbulence, rate=0.0, octaves=1, seed=5)
        k = f"{self.drag!r}*({1 - UNEVEN!r} + {2 * UNEVEN!r}*chance)"
        ground = (abs(self.wind) * SECONDS + 10 * self.core, 0.0, 2 * self.wander + 8 * self.core)
        x, z = self.way
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / substeps,
            frames=round(60 * SECONDS),
            dtype="float32",
            solver=SymplecticEuler(),
            bodies=[scatter(self.sand, size=ground, m=SAND)],
            names=["sand"],
            emitters=[
                Nozzle(
                    (x, 0.01 * self.height, z),
                    radius=1.4 * self.core,
                    rate=self.dust,
                    speed=Spread(0.1 * self.updraft, 0.1 * self.updraft),
                    cone=60.0,
                    inherit=0.0,
                    lifetime=Spread(2.8, 1.2),
                    mass=DUST,
                )
            ],
            forces=[Gravity((0.0, -self.gravity, 0.0)), Wind([self._whirl(), air], k)],
            colliders=[Plane(restitution=0.1, friction=self.friction)],
            camera=Camera(
                position=(0.0, 0.2 * self.height, 2.4 * self.height), target=(0.0, 0.46 * self.height, 0.0), fov=32.0
            ),
            look=Look(
                particles="smoke",
                size=0.04 * self.height,
                size_over_life=((0.0, 0.4), (1.0, 1.0)),
                color="#d9b98c",
                opacity=0.07,
                opacity_over_life=((0.0, 0.0), (0.06, 1.0), (0.35, 0.6), (1.0, 0.0)),
                collider_color="#9a7a54",
                groups={"sand": Look(particles="flakes", size=0.003 * self.height, color="#a98555")},
            ),
        )

    def _whirl(self) -> Flow:
        """The air: up in the core, inwards below, outwards above, and around, without divergence.

        With q = r^2 / R^2 and R the radius, which grows upwards, its stream function is Q (1 - exp(-q)) B, and
        B = (1 - (1 + s) exp(-s)) exp(-(y/H)^4), s = (y + a) / d: the air is at rest at y = -a and high above H, and
        at its foot the vortex of Burgers and Rott over a layer of slow air, in which the grains stand up to a.
        """
        x, z, wide = f"(x-cx-{LEAN}*y)", "(z-cz)", "(R+w*y)"
        q = f"(({x}**2+{z}**2)/{wide}**2)"
        swept = f"((1-exp(-{q}))/max({q},1e-6))"
        s, fade = "((y+a)/d)", "exp(-(y/H)**4)"
        lift = f"(1-(1+{s})*exp(-{s}))*{fade}"
        growth = f"({s}*exp(-{s})*{fade}/d-4*y**3/H**4*{lift})"
        around = f"S*R*{swept}*{lift}/{wide}**2"
        up = f"W*R**2*exp(-{q})*{lift}/{wide}**2"
        inward = f"W*R**2*(w*exp(-{q})*{lift}/{wide}**3-0.5*{swept}*{growth}/{wide}**2)"
        depth = SLOW * self.height
        return Flow(
            (
                f"{inward}*{x}+{around}*{z}+{LEAN}*{up}+U*(1-exp(-{s}))",
                up,
                f"{inward}*{z}-{around}*{x}",
            ),
            constants={
                "cx": self.way[0],
                "cz": self.way[1],
                "R": self.core,
                "w": WIDER * self.core / self.height,
                "H": self.height,
                "d": depth,
                "a": ROUGH * depth,
                "S": self.swirl / PEAK,
                "W": self.updraft,
                "U": self.wind,
            },
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is in the ground or faster than the air; sand lies still far away, and what flies turns and rises."""
        last, before = frames[-1], frames[-2]
        lowest = float(last.positions[:, 1].min())
        expect(lowest > -1e-3, f"a grain sank {-lowest:.2g} m into the ground")
        speed = float(np.linalg.norm(last.velocities, axis=1).max())
        inflow = self.updraft * self.core / self.height  # the highest, by the stream function
        gale = math.hypot(self.swirl, self.updraft) + inflow + abs(self.wind) + 7 * self.turbulence
        most = 1.3 * gale + (1 + UNEVEN) / (1 - UNEVEN) * self.fall
        expect(speed <= most, f"a grain has {speed:.2f} m/s, and the air can give it {most:.2f} m/s")
        sand = last.ids < self.sand  # it never dies, and has the same rows in every frame
        expect(sand.sum() == self.sand, f"{sand.sum()} grains of sand are left of {self.sand}")
        x = last.positions - self._foot(last.time)
        far = np.flatnonzero(sand & (np.hypot(x[:, 0], x[:, 2]) > 6 * self.core))
        holds = self.friction * self.fall * (1 - UNEVEN)  # speed of the air on the ground that moves no grain
        gentle = self.turbulence + (1 - math.exp(-ROUGH)) * abs(self.wind) + 0.02 * self.swirl
        if len(far) > 100 and holds > gentle:
            still = (last.positions[far] == before.positions[far]).all(axis=1).mean()
            expect(still > 0.5, f"only {100 * still:.0f} % of the sand far away lies still, and not most of it")
        flies = ~sand & (x[:, 1] > 0.1 * self.height) & (x[:, 1] < 0.8 * self.height)
        if last.time > 1.5 and flies.sum() > 100:
            x, v = x[flies], last.velocities[flies] - (self.wind, 0.0, 0.0)
            if self.swirl > 4 * (self.turbulence + abs(self.wind)):
                turn = float((x[:, 2] * v[:, 0] - x[:, 0] * v[:, 2]).mean())
                expect(turn > 0, f"the dust has {turn:.3g} m^2/s about the whirl: it turns the wrong way")
            if self.updraft > 4 * (self.turbulence + self.fall):
                rise = float(v[:, 1].mean())
                expect(rise > 0, f"the dust rises at {rise:.3g} m/s in an updraft of {self.updraft} m/s")

    def _foot(self, t: float) -> tuple[float, float, float]:
        """Where the whirl stands on the ground at t [m]."""
        x, z = (Formula(way, ("t",))({"t": t}) for way in self.way)
        return x, 0.0, z
