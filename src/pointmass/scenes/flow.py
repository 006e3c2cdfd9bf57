"""Particles in a flow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pointmass.bodies import points
from pointmass.forces import Flow
from pointmass.frame import Camera, Frame
from pointmass.look import Look
from pointmass.scene import Scene
from pointmass.scenes.base import ShippedScene, expect, knob
from pointmass.solvers import RK4


@dataclass(frozen=True, kw_only=True)
class FlowScene(ShippedScene):
    """Two colours of dye are stirred by a pair of vortices that sway: x' = g(x, t), with arrows and integral curves."""

    name = "flow"
    presets: ClassVar[dict[str, dict[str, Any]]] = {
        "steady": {"sway": 0.0},
        "storm": {"speed": 2.0, "sway": 0.4, "period": 2.5},
        "ink": {"particles": 40000, "arrows": 0, "streamlines": 0},
    }

    particles: int = knob(3200, "how many particles, about", low=10, high=1000000)
    speed: float = knob(0.6, "highest speed of the flow", unit="m/s", low=0.001, high=100)
    sway: float = knob(0.2, "how far the vortices sway, 0 = steady", low=0, high=0.45)
    period: float = knob(5.0, "of the swaying", unit="s", low=0.1, high=1000)
    arrows: int = knob(24, "arrows along the long side, 0 = none", low=0, high=200)
    streamlines: int = knob(60, "integral curves, 0 = none", low=0, high=1000)

    def build(self) -> Scene:
        """The double gyre of Shadden, Lekien & Marsden (2005) on [0, 2] x [0, 1]."""
        rows = max(2, round(math.sqrt(self.particles / 2)))
        x, y = np.meshgrid((np.arange(2 * rows) + 0.5) / rows, (np.arange(rows) + 0.5) / rows, indexing="ij")
        place = np.stack([x.ravel(), y.ravel()], axis=1)
        bend = "(s*sin(w*t)*x**2 + (1 - 2*s*sin(w*t))*x)"
        slope = "(2*s*sin(w*t)*x + 1 - 2*s*sin(w*t))"
        velocity = (f"-u*sin(pi*{bend})*cos(pi*y)", f"u*cos(pi*{bend})*sin(pi*y)*{slope}", "0")
        return Scene(
            name=self.name,
            summary=self.summary(),
            dt=1 / 60 / max(1, math.ceil(self.speed / 60 / 0.02)),  # no particle goes farther than 2 cm in a step
            frames=480,
            solver=RK4(),
            bodies=[points(np.round(place, 9), attributes={"dye": (place[:, 0] > 1).astype(float)})],
            forces=[Flow(velocity, constants={"u": self.speed, "s": self.sway, "w": 2 * math.pi / self.period})],
            camera=Camera(azimuth=0.0, elevation=0.0, fov=20.0),
            look=Look(
                size=0.26 / rows,
                color_by="dye",
                color_range=(0.0, 1.0),
                palette="spectrum",
                field_box=((0.0, 0.0, 0.0), (2.0, 1.0, 0.0)),
                arrows=self.arrows,
                streamlines=self.streamlines,
            ),
        )

    def check(self, frames: Sequence[Frame]) -> None:
        """The flow is along the walls, so nothing leaves; in a steady one, particles stay on their integral curves."""
        end = frames[-1].positions
        inside = ((end[:, :2] > 0) & (end[:, :2] < (2.0, 1.0))).all()
        expect(bool(inside), "a particle left the box along whose walls it flows")
        if self.sway == 0:
            stream = [
                np.sin(np.pi * f.positions[:, 0]) * np.sin(np.pi * f.positions[:, 1]) for f in (frames[0], frames[-1])
            ]
            drift = float(np.abs(stream[1] - stream[0]).max())
            expect(drift < 1e-4, f"a particle drifted by {drift:.2g} off its integral curve")
