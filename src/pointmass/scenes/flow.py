"""Particles in a flow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import points
from pointmass.colors import PALETTES
from pointmass.forces import Flow
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.particles import Array
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import RK4

DYES: dict[str, Callable[[Array, Array], Any]] = {  # of x in [0, 2] and y in [0, 1]: 0 or 1
    "halves": lambda x, y: x > 1,
    "stripes": lambda x, y: np.floor(8 * y) % 2 == 0,
    "squares": lambda x, y: (np.floor(8 * x) + np.floor(8 * y)) % 2 == 0,
    "drops": lambda x, y: np.hypot(x % 1 - 0.5, y - 0.7) < 0.18,
}


@dataclass(frozen=True, kw_only=True)
class FlowScene(ShippedScene):
    """Two colours of dye are stirred by a pair of vortices that sway: x' = g(x, t), with arrows and integral curves."""

    name = "flow"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "steady": {"sway": 0.0, "trails": 0.4, "dye": "stripes"},
        "storm": {"speed": 2.0, "sway": 0.4, "period": 2.5},
        "ink": {"particles": 40000, "arrows": 0, "streamlines": 0, "dye": "drops", "dot": 1.0},
    }

    particles: int = knob(3200, "how many particles, about", low=10, high=1000000)
    height: float = knob(1.0, "of the box, which is twice as wide", unit="m", low=0.001, high=1000)
    speed: float = knob(0.6, "highest speed of the flow", unit="m/s", low=0.001, high=100)
    sway: float = knob(0.2, "how far the vortices sway, relative to the height, 0 = steady", low=0, high=0.45)
    period: float = knob(5.0, "of the swaying", unit="s", low=0.1, high=1000)
    dye: str = knob("halves", "where the two colours are at first", choices=tuple(DYES))
    palette: str = knob("spectrum", "from whose ends the colours are", choices=tuple(PALETTES))
    dot: float = knob(0.52, "diameter of a particle, relative to the distance of its neighbours", low=0.05, high=2)
    trails: float = knob(0.0, "where the particles were in this time, 0 = none", unit="s", low=0, high=10)
    arrows: int = knob(24, "arrows along the long side, 0 = none", low=0, high=200)
    streamlines: int = knob(60, "integral curves, 0 = none", low=0, high=1000)

    def build(self) -> Scene:
        """The double gyre of Shadden, Lekien & Marsden (2005) on [0, 2] x [0, 1] times the height."""
        rows, h = max(2, round(math.sqrt(self.particles / 2))), self.height
        x, y = np.meshgrid((np.arange(2 * rows) + 0.5) / rows, (np.arange(rows) + 0.5) / rows, indexing="ij")
        place = np.stack([x.ravel(), y.ravel()], axis=1)
        dye = DYES[self.dye](*place.T).astype(float)
        bend = "(s*sin(w*t)*(x/h)**2 + (1 - 2*s*sin(w*t))*x/h)"
        slope = "(2*s*sin(w*t)*x/h + 1 - 2*s*sin(w*t))"
        velocity = (f"-u*sin(pi*{bend})*cos(pi*y/h)", f"u*cos(pi*{bend})*sin(pi*y/h)*{slope}", "0")
        constants: dict[str, Any] = {"u": self.speed, "s": self.sway, "w": 2 * math.pi / self.period, "h": h}
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(1, math.ceil(self.speed / 60 / (0.02 * h))),  # nobody goes farther in a step than h/50
            frames=480,
            solver=RK4(),
            bodies=[points(np.round(place * h, 9), attributes={"dye": dye})],
            forces=[Flow(velocity, constants=constants)],
            camera=Camera(azimuth=0.0, elevation=0.0, fov=20.0),
            look=Look(
                size=0.5 * self.dot * h / rows,
                color_by="dye",
                color_range=(0.0, 1.0),
                palette=self.palette,
                trails=self.trails,
                field_box=((0.0, 0.0, 0.0), (2 * h, h, 0.0)),
                arrows=self.arrows,
                streamlines=self.streamlines,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """The flow is along the walls, so nothing leaves; in a steady one, particles stay on their integral curves."""
        end = frames[-1].positions
        inside = ((end[:, :2] > 0) & (end[:, :2] < (2 * self.height, self.height))).all()
        expect(bool(inside), "a particle left the box along whose walls it flows")
        if self.sway == 0:
            stream = [
                np.prod(np.sin(np.pi / self.height * f.positions[:, :2]), axis=1) for f in (frames[0], frames[-1])
            ]
            drift = float(np.abs(stream[1] - stream[0]).max())
            expect(drift < 1e-4, f"a particle drifted by {drift:.2g} off its integral curve")
