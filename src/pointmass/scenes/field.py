"""A velocity field that is typed, and what is dropped into it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body, hair, points
from pointmass.collisions import Sphere
from pointmass.emitters import BoxEmitter, Spread
from pointmass.forces import Cushion, Flow, Gravity, PlateWind, Springs, Wind
from pointmass.frame import Camera, Frame
from pointmass.laws.formula import Formula
from pointmass.look import Look
from pointmass.particles import Particles
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.scenes.sheets import check_sheet, sheet, steps
from pointmass.solvers import RK4, DormandPrince, SymplecticEuler, integrate
from pointmass.system import ParticleSystem

LIFETIME = 5.0  # of a particle, on average [s]
THREADS = 20  # particles of the cloth along each side
WIDTH = 0.7  # of the cloth, by half a side of the box
ROOM = 1.3  # in the steps, for what the air does to a cloth
STRANDS, POINTS = 160, 10  # of hair, and the points of each
LONG, BALL = 0.45, 0.2  # length of a hair, and radius of the ball that it grows on, by half a side of the box
AIR = 0.1  # time in which air takes hair along [s]
FIRM = 40.0  # stiffness EA of a hair, by its weight where g is 10 m/s^2

WHIRLS = ("noise(x, y + 0.02, z, 0.3*t, 1)", "noise(x, y - 0.02, z, 0.3*t, 1)")
SHEARS = ("noise(x - 0.02, y, z, 0.3*t, 1)", "noise(x + 0.02, y, z, 0.3*t, 1)")


@dataclass(frozen=True, kw_only=True)
class FieldScene(ShippedScene):
    """A laboratory of vector fields: type one, see it, and drop particles, a cloth or hair into it.

    Raises
    ------
    InvalidInput
        A value that a parameter does not allow, a velocity that is no formula of x, y, z and t.
    """

    name = "field"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "saddle": {"u": "x", "v": "-y"},
        "shear": {"u": "y", "v": "0"},
        "source": {"u": "x/(x**2 + y**2 + 0.1)", "v": "y/(x**2 + y**2 + 0.1)"},
        "vortices": {"u": "sin(2*x)*cos(2*y)", "v": "-cos(2*x)*sin(2*y)"},
        "pendulum": {"u": "y", "v": "-4*sin(x)", "size": 4.0},
        "ABC flow": {"u": "sin(z) + cos(y)", "v": "sin(x) + cos(z)", "w": "sin(y) + cos(x)", "size": 3.0, "depth": 3.0},
        "curl noise": {
            "u": f"({WHIRLS[0]} - {WHIRLS[1]})/0.04",
            "v": f"({SHEARS[0]} - {SHEARS[1]})/0.04",
            "streamlines": 0,
        },
    }

    u: str = knob("-y", "velocity along x, a formula of x, y, z and t", unit="m/s")
    v: str = knob("x", "velocity along y", unit="m/s")
    w: str = knob("0", "velocity along z", unit="m/s")
    drop: str = knob("particles", "what is dropped into the field", choices=("particles", "cloth", "hair"))
    particles: int = knob(150, "how many particles, about", low=1, high=100000)
    size: float = knob(2.0, "half a side of the box", unit="m", low=0.01, high=1000)
    depth: float = knob(0.0, "half its depth, 0 = a plane", unit="m", low=0, high=1000)
    gravity: float = knob(0.0, "gravity, downwards, on cloth and hair", unit="m/s^2", low=0, high=30)
    arrows: int = knob(20, "arrows along a side, 0 = none", low=0, high=200)
    streamlines: int = knob(60, "integral curves, 0 = none", low=0, high=1000)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in "uvw":
            Formula(getattr(self, name), ("x", "y", "z", "t"), what=name)

    def field(self) -> Flow:
        """The velocity field."""
        return Flow((self.u, self.v, self.w))

    def build(self) -> Scene:
        """The box in the field, seen along z; aside, if it is deep."""
        made = {"particles": self._particles, "cloth": self._cloth, "hair": self._hair}[self.drop]()
        s, d = self.size, self.depth
        eye = (0.0, 0.0, 6.2 * s) if d == 0 else (3.2 * s, 2.2 * s, 5.4 * s + d)
        look: dict[str, Any] = {
            "field_box": ((-s, -s, -d), (s, s, d)),
            "arrows": self.arrows if d == 0 else self.arrows // 2,
            "streamlines": self.streamlines,
        }
        return Scene(
            name=self.name,
            summary=self.summary(),
            frames=300,
            camera=Camera(position=eye, target=(0.0, 0.0, 0.0), fov=22.0 if d == 0 else 30.0),
            **{**made, "look": Look(**look, **made["look"])},
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Particles are where another solver takes them, cloth and hair are not torn."""
        last = frames[-1]
        if self.drop == "cloth":
            check_sheet(self._sheet(), frames)
        elif self.drop == "hair":
            body = self._wig()
            links = next(f for f in body.forces if isinstance(f, Springs)).rows(body.particles)
            lengths = [np.linalg.norm(f.positions[links[:, 0]] - f.positions[links[:, 1]], axis=1) for f in frames]
            longest = max(float((each / lengths[0]).max()) for each in lengths)
            expect(longest < 1.5, f"a link of a hair is {longest:.3g} times as long as at rest")
        else:
            before = frames[-2]
            _, rows, now = np.intersect1d(before.ids, last.ids, return_indices=True)
            expect(len(rows) > 0, "no particle lives for a frame")
            way = float(np.abs(self._taken(before, rows, last.time) - last.positions[now]).max())
            expect(way < 1e-3 * self.size, f"a particle is {way:.2g} m from where the field takes it in a frame")

    # ---------------------------------------------------------------------------------------------- inside

    def _particles(self) -> dict[str, Any]:
        """Those that are born all over the box, and follow the field."""
        s = self.size
        return {
            "dt": 1 / 60,
            "solver": RK4(),
            "emitters": [
                BoxEmitter(
                    (0.0, 0.0, 0.0),
                    sides=(2 * s, 2 * s, 2 * self.depth),
                    rate=self.particles / LIFETIME,
                    bursts=[(0.0, self.particles)],
                    lifetime=Spread(LIFETIME, 0.8 * LIFETIME),
                )
            ],
            "forces": [self.field()],
            "look": {"size": 0.009 * s, "trails": 0.6, "color": "#ffd166"},
        }

    def _cloth(self) -> dict[str, Any]:
        body = self._sheet()
        solver, dt = steps(body, ROOM)
        return {
            "dt": dt,
            "solver": solver,
            "bodies": [body],
            "names": ["cloth"],
            "forces": [Gravity((0.0, -self.gravity, 0.0)), PlateWind("cloth", self.field())],
            "look": {"color": "#e4572e", "pattern": "checker", "pattern_color": "#f6e7cb", "pattern_count": 6},
        }

    def _hair(self) -> dict[str, Any]:
        body, few = self._wig(), self._wig(4)
        m, ball = float(body.particles.m.mean()), BALL * self.size
        safe = ParticleSystem(few.particles, few.forces).stability(SymplecticEuler()).largest_safe_dt
        pull = 10.0 * FIRM * float(body.particles.m[:POINTS].sum())
        stiff = 0.5 * pull * (POINTS - 1) / (LONG * self.size)
        layer = Cushion([Sphere(radius=0.9 * ball)], stiff, thickness=0.1 * ball, on="hair")
        return {
            "dt": 1 / 60 / max(2, math.ceil(1 / 60 / (0.5 * safe))),
            "solver": SymplecticEuler(),
            "bodies": [body, points([(0.0, 0.0, 0.0)], radius=[0.98 * ball], pinned=[0])],
            "names": ["hair", "ball"],
            "forces": [Gravity((0.0, -self.gravity, 0.0)), Wind(self.field(), k=m / AIR, on="hair"), layer],
            "look": {
                "particles": "none",
                "groups": {"ball": Look(particles="solid", color="#d9a07a")},
                "spring_width": 0.006 * self.size,
                "strand_color": "#6b2f14",
                "tip_color": "#e2a25a",
            },
        }

    def _sheet(self) -> Body:
        """A cloth that is aslant to all axes: air that blows along a plate does nothing to it."""
        side = WIDTH * self.size
        slant = {"right": (1.0, -1.0, 0.0), "down": (-1.0, -1.0, math.sqrt(2))}
        return sheet(THREADS, side, side, "cotton", 0.0, 0.0, center=(0.3 * side, 0.1 * side, 0.0), **slant)

    def _wig(self, strands: int = STRANDS) -> Body:
        """Hair all over a ball in the middle."""
        length = LONG * self.size
        made = hair(2, POINTS, length)
        weight = 10.0 * float(made.particles.m[:POINTS].sum())
        return hair(strands, POINTS, length, scalp=BALL * self.size, cap=180.0, stretch=FIRM * weight)

    def _taken(self, before: Frame, rows: Any, end: float) -> Any:
        """Where the field takes particles of a frame until another time, by an adaptive solver."""
        flow = ParticleSystem(Particles(before.positions[rows]), [self.field()])
        flow.t = before.time
        run = integrate(flow, DormandPrince(1e-8, 1e-9 * self.size), (before.time, end), end - before.time)
        return run.y[-1].reshape(-1, 3)
