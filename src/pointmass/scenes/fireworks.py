"""Fireworks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from pointmass.collisions import Plane
from pointmass.emitters import LineEmitter, Nozzle, PointEmitter, ShapedEmitter, Spread
from pointmass.forces import Drag, Gravity, Wind
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import Leapfrog

FIELD = 1.3  # between the mortars at both ends, relative to the height
SPARK = 1e-3  # mass of whatever flies [kg]; all motion here is independent of it


@dataclass(frozen=True)
class Style:
    """How a shell bursts.

    Attributes
    ----------
    color : of its stars, linear light.
    stars, speed, life : how many there are, relative to the scene's knob, how fast and for how long.
    uneven : half-range of speed and life, relative to them.
    ring : whether all stars fly in one plane.
    embers : that each star leaves along its way [1/s]; they glow for `glowing` [s].
    crackle : sparks into which each star bursts at its end.
    """

    color: tuple[float, float, float]
    stars: float = 1.0
    speed: float = 1.0
    life: float = 1.0
    uneven: float = 0.06
    ring: bool = False
    embers: float = 0.0
    glowing: float = 0.0
    crackle: int = 0


STYLES = {
    "peony": Style((1.0, 0.12, 0.10), life=0.9),
    "ring": Style((0.15, 0.45, 1.0), stars=0.35, speed=1.15, uneven=0.02, ring=True),
    "willow": Style((1.0, 0.55, 0.18), stars=0.35, speed=0.75, life=1.7, uneven=0.15, embers=45.0, glowing=1.0),
    "palm": Style((0.35, 1.0, 0.30), stars=0.07, speed=1.1, life=1.3, embers=130.0, glowing=0.7),
    "crackle": Style((1.0, 0.9, 0.65), stars=0.6, life=0.8, uneven=0.25, crackle=7),
}


@dataclass(frozen=True, kw_only=True)
class Fireworks(ShippedScene):
    """Rockets rise on tails of sparks and burst into peonies, rings, willows, palms and crackling stars."""

    name = "fireworks"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "finale": {"launches": 6.0, "stars": 700, "wind": 3.0},
        "willows": {"style": "willow", "launches": 1.2, "star_life": 2.6, "star_speed": 20.0},
        "moon": {"gravity": 1.62, "air": 0.0, "star_life": 3.0, "star_speed": 9.0, "height": 45.0},
    }

    style: str = knob("mixed", "of the shells", choices=("mixed", *STYLES))
    launches: float = knob(2.4, "rockets per second", unit="1/s", low=0.05, high=100)
    height: float = knob(55.0, "at which a shell bursts, about", unit="m", low=2, high=1000)
    spread: float = knob(5.0, "half-angle of the rockets' directions", unit="degrees", low=0, high=45)
    stars: int = knob(420, "of a peony; other shells have parts of that", low=1, high=100000)
    star_speed: float = knob(26.0, "of the stars when the shell bursts", unit="m/s", low=0.1, high=1000)
    star_life: float = knob(1.8, "how long a star burns", unit="s", low=0.1, high=60)
    air: float = knob(1.3, "rate at which the air stops a star", unit="1/s", low=0, high=100)
    tail: float = knob(160.0, "sparks per second along a rocket's way, 0 = none", unit="1/s", low=0, high=1e5)
    smoke: int = knob(25, "puffs that a shell leaves, lit by the stars, 0 = none", low=0, high=10000)
    wind: float = knob(1.5, "of the air, along x", unit="m/s", low=-100, high=100)
    gravity: float = knob(9.81, "gravity, downwards", unit="m/s^2", low=0.01, high=1000)

    @property
    def fuse(self) -> float:
        """Time from launch to burst [s]: a little before the rocket would stop."""
        return 0.9 * self.launch_speed / self.gravity

    @property
    def launch_speed(self) -> float:
        """With which a rocket rises as high as `height` in its fuse, by v t - g t^2/2 [m/s]."""
        return math.sqrt(self.gravity * self.height / (0.9 - 0.5 * 0.9**2))

    def build(self) -> Scene:
        """Mortars side by side, one for each style."""
        styles = STYLES if self.style == "mixed" else {self.style: STYLES[self.style]}
        emitters: list[ShapedEmitter] = []
        for k, name in enumerate(styles):
            emitters += self._mortar(k, len(styles), name)
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60,
            frames=540,
            dtype="float32",
            solver=Leapfrog(),
            emitters=emitters,
            # Rockets coast; what burns is stopped by the air, which goes with the wind.
            forces=[Gravity((0.0, -self.gravity, 0.0)), *self._air()],
            colliders=[Plane(response="kill")],
            camera=Camera(
                position=(0.0, 0.05 * self.height, 2.0 * self.height), target=(0.0, 0.68 * self.height, 0.0), fov=40.0
            ),
            look=Look(
                particles="glow",
                size=0.0028 * self.height,
                brightness=9.0,
                brightness_over_life=((0.0, 1.0), (0.55, 0.7), (1.0, 0.0)),
                shutter=1 / 40,
                colliders=False,
                groups={
                    "smoke": Look(
                        particles="smoke",
                        size=0.11 * self.height,
                        size_over_life=((0.0, 0.35), (1.0, 1.0)),
                        color="#aeb4c0",
                        opacity=0.09,
                        opacity_over_life="flare",
                        daylight=0.012,
                    )
                },
            ),
        )

    def _air(self) -> list[Any]:
        k = f"m*air*{self.air!r}"
        return [Wind((self.wind, 0.0, 0.0), k)] if self.wind else [Drag(k)]

    def _mortar(self, k: int, count: int, name: str) -> list[ShapedEmitter]:
        """A mortar, and all that follows from its rockets."""
        style, rocket, star = STYLES[name], f"{name} rocket", f"{name} star"
        red, green, blue = style.color
        light = {"red": red, "green": green, "blue": blue}
        period = count / self.launches
        result: list[ShapedEmitter] = [
            Nozzle(
                (FIELD * self.height * (k / (count - 1) - 0.5) if count > 1 else 0.0, 0.01 * self.height, 0.0),
                name=rocket,
                rate=1 / period,
                start=period * k / count,
                speed=Spread(self.launch_speed, 0.04 * self.launch_speed),
                cone=self.spread,
                lifetime=Spread(self.fuse, 0.04 * self.fuse),
                mass=SPARK,
                attributes={"red": 1.0, "green": 0.6, "blue": 0.3, "air": 0.0, "smoke": 0.0},
            ),
            self._stars(style, rocket, star, light),
        ]
        gold = {"red": 1.0, "green": 0.5, "blue": 0.15, "air": 2.0, "smoke": 0.0}
        if self.tail:
            tail = {name: 0.25 * value if name in light else value for name, value in gold.items()}
            result.append(self._embers(rocket, self.tail, 0.6, tail))
        if style.embers:
            ember = {**{name: 0.14 * value for name, value in light.items()}, "air": 2.0, "smoke": 0.0}
            result.append(self._embers(star, style.embers, style.glowing, ember))
        if style.crackle:
            result.append(
                PointEmitter(
                    of=star,
                    count=style.crackle,
                    cone=180.0,
                    speed=Spread(0.25 * self.star_speed, 0.1 * self.star_speed),
                    inherit=0.5,
                    lifetime=Spread(0.35, 0.2),
                    mass=SPARK,
                    attributes={"red": 2.0, "green": 2.0, "blue": 2.2, "air": 3.0, "smoke": 0.0},
                )
            )
        if self.smoke:
            result.append(
                PointEmitter(
                    of=rocket,
                    count=self.smoke,
                    cone=180.0,
                    speed=Spread(0.3 * self.star_speed, 0.25 * self.star_speed),
                    lifetime=Spread(5.0, 1.5),
                    mass=SPARK,
                    attributes={"red": 0.4, "green": 0.42, "blue": 0.46, "air": 1.5, "smoke": 1.0},
                )
            )
        return result

    def _stars(self, style: Style, rocket: str, star: str, light: dict[str, float]) -> ShapedEmitter:
        shape: dict[str, Any] = {
            "of": rocket,
            "name": star,
            "count": max(1.0, style.stars * self.stars),
            "speed": Spread(style.speed * self.star_speed, style.uneven * style.speed * self.star_speed),
            "lifetime": Spread(style.life * self.star_life, style.uneven * style.life * self.star_life),
            "mass": SPARK,
            "attributes": {**light, "air": 1.0, "smoke": 0.0},
        }
        if style.ring:
            return LineEmitter(extent=(0.01, 0.03, 0.02), direction="normal", cone=0.0, **shape)
        return PointEmitter(cone=180.0, **shape)

    def _embers(self, of: str, rate: float, glowing: float, attributes: dict[str, Any]) -> ShapedEmitter:
        return PointEmitter(
            of=of,
            on="trail",
            rate=rate,
            cone=180.0,
            speed=Spread(0.6, 0.4),
            inherit=0.15,
            lifetime=Spread(glowing, 0.4 * glowing),
            mass=SPARK,
            attributes=attributes,
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Nobody is below the ground, or higher than speed and gravity allow; after the first fuse there are stars."""
        lowest = min(float(f.positions[:, 1].min(initial=0.0)) for f in frames)
        expect(lowest > -1e-3 * self.height, f"a spark sank {-lowest:.2g} m into the ground")
        fastest = 1.04 * self.launch_speed
        burst = self.height * 1.05 + 0.02 * self.height + 0.15 * fastest**2 / self.gravity
        beyond = 1.6 * self.star_speed
        reach = beyond * beyond / (2 * self.gravity) + 0.3 * beyond * fastest / self.gravity
        highest = max(float(f.positions[:, 1].max(initial=0.0)) for f in frames)
        expect(highest < burst + reach, f"a spark rose to {highest:.1f} m, and {burst + reach:.1f} m are possible")
        last = frames[-1]
        if last.time > 1.1 * self.fuse and last.time < 1.0 * self.fuse + 0.5 * self.star_life:
            few = 0.05 * self.stars
            expect(len(last.ids) >= few, f"{len(last.ids)} particles after a shell has burst, not {few:.0f} or more")
