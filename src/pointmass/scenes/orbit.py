"""Orbits under gravitation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import Body, points
from pointmass.forces import Attractor, Gravitation
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import Leapfrog
from pointmass.tracing import functions as fn

EIGHT_PERIOD = 6.32591398  # Chenciner & Montgomery (2000), with the digits of C. Simo
EIGHT_X = (0.97000435669734, -0.24308753153583)
EIGHT_V = (-0.93240737144104, -0.86473146092102)


@dataclass(frozen=True, kw_only=True)
class Orbit(ShippedScene):
    """Three equal stars chase each other along a figure eight, or planets draw Kepler's ellipses."""

    name = "orbit"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "planets": {"kind": "kepler"},
        "crowd": {"kind": "kepler", "planets": 80, "trail": 1.0},
        "ribbon": {"trail": 6.0},
    }

    kind: str = knob("figure_eight", "which orbits", choices=("figure_eight", "kepler"))
    planets: int = knob(7, "planets of kepler", low=1, high=200)
    steps_per_second: int = knob(480, "steps of the solver in a second", low=60, high=100000)
    trail: float = knob(3.0, "length of the trails", unit="s", low=0, high=60)

    def build(self) -> Scene:
        """G = 1 and masses of order 1: a second is a fraction of an orbit."""
        eight = self.kind == "figure_eight"
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / self.steps_per_second,
            solver=Leapfrog(),
            frames=380 if eight else 480,
            bodies=[_figure_eight() if eight else _planets(self.planets)],
            forces=[Gravitation() if eight else Attractor(1.0)],
            camera=Camera(azimuth=0, elevation=0 if eight else 55),
            look=Look(
                particles="glow",
                color_by="id",
                color_range=(0.0, 1.0),
                palette="spectrum" if eight else "fire",
                size=0.055,
                trails=self.trail,
                brightness=2.0,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """Leapfrog keeps the energy within the error of its order, and the momentum of the eight to round-off."""
        energy = np.array([f.quantities["energy"] for f in frames])
        drift = float(np.abs(energy / energy[0] - 1).max())
        allowed = 5e-3 * (480 / self.steps_per_second) ** 2
        expect(drift < allowed, f"the energy changed by {drift:.2g}, more than {allowed:.2g}")
        if self.kind == "figure_eight":
            total = max(math.hypot(f.quantities["momentum_x"], f.quantities["momentum_y"]) for f in frames)
            expect(total < 1e-11, f"the total momentum grew to {total:.2g} kg m/s")


def _figure_eight() -> Body:
    x1, v3 = np.array(EIGHT_X), np.array(EIGHT_V)
    return points([x1, -x1, (0, 0)], [-v3 / 2, -v3 / 2, v3])


def _planets(count: int) -> Body:
    """Planets at perihelion, each with a larger orbit and a larger eccentricity than the one before."""
    e = np.linspace(0, 0.8, count) if count > 1 else np.array([0.5])
    a = np.linspace(0.5, 1.4, count)
    turn = 2.399963 * np.arange(count)
    near, fast = a * (1 - e), np.sqrt((1 + e) / (a * (1 - e)))
    axis = np.stack([fn.cos(turn), 0 * turn, fn.sin(turn)], axis=1)
    across = np.stack([-fn.sin(turn), 0 * turn, fn.cos(turn)], axis=1)
    return points(near[:, None] * axis, fast[:, None] * across, 1e-3)
