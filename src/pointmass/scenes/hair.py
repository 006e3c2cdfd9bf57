"""Hair on a head that turns, in gusts of wind."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies import Body, hair, points
from pointmass.bodies.hair import YOUNG
from pointmass.collisions import Capsule, Sphere
from pointmass.errors import InvalidInput
from pointmass.forces import Cushion, Flow, Gravity, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.motions import RigidMotion
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import SymplecticEuler
from pointmass.system import ParticleSystem

Array = NDArray[np.floating[Any]]

SKULL, SCALP, JAW, NECK = 0.088, 0.09, 0.058, 0.044  # radii [m]; hair roots on the scalp
CHIN = (0.0, -0.050, 0.022)  # middle of the jaw [m]
BALLS = {  # that are drawn: places and radii [m]
    "skin": [
        *((*CHIN, JAW), (0.0, 0.0, 0.0, SKULL), (0.0, -0.024, 0.089, 0.011)),
        *((side * 0.087, -0.020, 0.0, 0.017) for side in (-1, 1)),
        *((0.0, -0.09 - 0.004 * k, -0.012, NECK) for k in range(60)),
    ],
    "eyes": [(side * 0.029, -0.002, 0.079, 0.0095) for side in (-1, 1)],
}
RADIUS, DENSITY = 4e-5, 1300.0  # of a hair [m, kg/m^3]
SOFT = 0.005  # thickness of the layer on the head that hair lies on [m]
TONES = {
    "brown": ("#3a2213", "#9c6336"),
    "black": ("#120e0e", "#57463e"),
    "blond": ("#9a7640", "#f4deaa"),
    "red": ("#5c1e0c", "#cf6a30"),
}
LINK = 0.05  # longest link of a strand [m]
STRETCH = 25  # times the load of a strand that would double its length: 4% at rest, twice that in a jerk
ROOM = {"straight": 0.75, "wavy": 0.5, "curly": 0.75}  # part of the largest safe step that is taken
START = 0.6  # in which the head begins to turn [s]


@dataclass(frozen=True, kw_only=True)
class HairScene(ShippedScene):
    """A head turns from side to side, its hair swings after it, and gusts of wind go through it.

    Links are straight, and one of more than 5 cm whose ends lie on the head leads through it: so a strand has at least
    6 points, and a longer one more.

    Raises
    ------
    InvalidInput
        A value that a parameter does not allow, too few points for the length of a strand.
    """

    name = "hair"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "straight": {"style": "straight", "length": 0.3, "points": 20, "tone": "black", "turn": 60.0},
        "wavy": {"style": "wavy", "length": 0.26, "points": 24, "tone": "blond", "wind": 1.2},
        "curly": {"style": "curly", "length": 0.2, "points": 24, "tone": "red", "turn": 60.0},
    }

    strands: int = knob(300, "strands that are simulated", low=3, high=20000)
    points: int = knob(20, "points of a strand", low=6, high=64)
    children: int = knob(20, "strands drawn between each of them and its neighbours", low=0, high=100)
    style: str = knob("straight", "shape of a strand at rest", choices=("straight", "wavy", "curly"))
    length: float = knob(0.24, "length of a strand", unit="m", low=0.08, high=0.5)
    stiffness: float = knob(1.0, "bending stiffness, that of human hair = 1", low=0, high=20)
    tone: str = knob("brown", "colour of the hair", choices=tuple(TONES))
    turn: float = knob(45.0, "how far the head turns to each side", unit="degrees", low=0, high=90)
    period: float = knob(2.4, "of the turns", unit="s", low=1, high=100)
    wind: float = knob(1.0, "mean speed of the wind", unit="m/s", low=0, high=8)
    air: float = knob(0.3, "time in which air takes hair along", unit="s", low=0.1, high=100)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0, high=50)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length > LINK * (self.points - 1):
            raise InvalidInput(
                f"points = {self.points} is not allowed: the links of a strand of {self.length:g} m would lead through"
                f" the head: give at least {math.ceil(self.length / LINK) + 1} points, or shorter strands"
            )

    def build(self) -> Scene:
        """A head of balls, hair on its scalp, a soft layer on what hair falls against."""
        wig = self._wig(self.strands)
        m = float(wig.particles.m.mean())
        link = self.length / (self.points - 1)
        angle = self._angle_formula()
        jaw = (f"{CHIN[2]}*sin({angle})", CHIN[1], f"{CHIN[2]}*cos({angle})")
        layer = Cushion(
            [Sphere(radius=SKULL), Sphere(jaw, JAW), Capsule((0.0, -0.3, -0.012), (0.0, -0.09, -0.012), NECK)],
            k_s=0.5 * self._pull() / link,
            thickness=SOFT,
            damping=1.0,
            on="hair",
        )
        # Gusts by a few waves that travel: noise in every substep takes several times as long as the hair.
        gust = "(1 + 0.5*sin(1.9*t)*sin(0.7*t) + 0.5*sin(9*x + 5*z + 4*t))"
        breeze = Flow(
            (f"-{0.9 * self.wind!r}*{gust}", f"{0.3 * self.wind!r}*sin(3.1*t)", f"-{0.4 * self.wind!r}*{gust}")
        )
        forces = [Gravity((0.0, -self.gravity, 0.0)), Wind(breeze, k=m / self.air, on="hair"), layer]
        head = [
            points(np.array(balls)[:, :3], radius=np.array(balls)[:, 3], pinned=range(len(balls)))
            for balls in BALLS.values()
        ]
        root, tip = TONES[self.tone]
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / self._substeps(),
            frames=360,
            solver=SymplecticEuler(),
            bodies=[wig, *head],
            names=["hair", *BALLS],
            forces=forces,
            motions=[RigidMotion(angle=angle)],
            camera=Camera(position=(0.36, 0.06, 0.74), target=(0.0, -0.045, 0.0), fov=30.0),
            look=Look(
                particles="none",
                groups={
                    "skin": Look(particles="solid", color="#d9a07a"),
                    "eyes": Look(particles="solid", color="#1d2430"),
                },
                children=self.children,
                clump=0.0 if self.style == "straight" else 0.75,
                spring_width=5e-4,
                strand_color=root,
                tip_color=tip,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Roots are where the head is, no link is much too long, and no hair is in the head."""
        first = self._strands_of(frames[0])
        links = np.linalg.norm(np.diff(first, axis=1), axis=2)
        for frame in frames:
            x = self._strands_of(frame)
            angle = self._angle(frame.time)
            away = float(np.abs(x[:, :2] - _turned(first[:, :2], angle)).max())
            expect(away < 1e-9, f"roots are {away:.2g} m from where the head takes them at {frame.time:.3g} s")
            longest = float((np.linalg.norm(np.diff(x, axis=1), axis=2) / links).max())
            expect(longest < 1.1, f"a link is {longest:.3g} times as long as at rest at {frame.time:.3g} s")
            chin = _turned(np.array(CHIN), angle)
            for what, middle, radius in (("skull", np.zeros(3), SKULL), ("jaw", chin, JAW)):
                deep = radius - float(np.linalg.norm(x - middle, axis=2).min())
                expect(deep < 0, f"hair is {deep:.2g} m deep in the {what} at {frame.time:.3g} s")

    # ---------------------------------------------------------------------------------------------- inside

    def _wig(self, strands: int) -> Body:
        """The hair, strong enough for what it has to bear."""
        bend = self.stiffness * YOUNG * math.pi * RADIUS**4 / 4
        return hair(
            strands,
            self.points,
            self.length,
            style=self.style,
            curl_turns=self._turns(),
            jitter=0.08,
            thickness=2 * RADIUS,
            density=DENSITY,
            scalp=SCALP,
            cap=80.0,
            crown=(0.0, 1.0, -1.2),
            comb=(0.0, -24.0, -10.0),
            lean=55.0,
            bend=bend,
            stretch=self._pull(),
        )

    def _pull(self) -> float:
        """Stiffness EA of a strand [N] by what pulls at it: weight, wind, and the turning head."""
        rate, turning, reach = 2 * math.pi / self.period, math.radians(self.turn), SCALP + self.length
        load = self.gravity + 2 * self.wind / self.air + reach * rate**2 * turning * (1 + turning) + 1.0
        return STRETCH * DENSITY * math.pi * RADIUS**2 * self.length * load

    def _turns(self) -> float | None:
        """Turns per metre: those of the style, or as many as there are points for."""
        most = (self.points - 1) / (5.5 * 1.08 * self.length)
        return {"straight": None, "wavy": min(10.0, most), "curly": min(16.0, most)}[self.style]

    def _substeps(self) -> int:
        """Steps in a sixtieth of a second, from a few strands: with some room, as they will bend otherwise.

        What holds torsion grows with the bend, and the more so the less a strand is bent at rest.
        """
        few = self._wig(4)
        safe = ParticleSystem(few.particles, few.forces).stability(SymplecticEuler()).largest_safe_dt
        return max(8, math.ceil(1 / 60 / (ROOM[self.style] * safe)))

    def _angle_formula(self) -> str:
        turn, rate = math.radians(self.turn), 2 * math.pi / self.period
        return f"{turn!r}*sin({rate!r}*t)*t/(t + {START})"

    def _angle(self, t: float) -> float:
        turn, rate = math.radians(self.turn), 2 * math.pi / self.period
        return turn * math.sin(rate * t) * t / (t + START)

    def _strands_of(self, frame: Frame) -> Array:
        return frame.positions[: self.strands * self.points].reshape(self.strands, self.points, 3)


def _turned(x: Array, angle: float) -> Array:
    """Turned about the vertical."""
    c, s = math.cos(angle), math.sin(angle)
    return np.stack([c * x[..., 0] + s * x[..., 2], x[..., 1], c * x[..., 2] - s * x[..., 0]], axis=-1)
