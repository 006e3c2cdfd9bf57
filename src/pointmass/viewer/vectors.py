"""Arrows at particles: their velocities, the forces on them, and how hard they press on what they touch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pointmass.colors import linear
from pointmass.errors import unknown
from pointmass.frame import Arrows, Drawable, Frame, Points
from pointmass.simulation import Simulation
from pointmass.viewer import shading
from pointmass.viewer.columns import Columns, Numbers, length
from pointmass.viewer.messages import Choice

MOST = 4000  # arrows; of more particles every second, third, ... has one
LONG, WIDE = 0.14, 0.008  # of the scene's size: the arrow of a particle faster than most, and its shaft
TYPICAL = 95.0  # percentile of it
FALL = 0.99  # of the scale from frame to frame, so that arrows do not jump
KINDS = {
    "velocity": (Choice(name="velocity", title="velocities", unit="m/s"), linear("#7cc4ff", 1.2)),
    "force": (Choice(name="force", title="forces", unit="N"), linear("#ffa23a", 1.2)),
    "contact": (Choice(name="contact", title="contacts", unit="N"), linear("#f070b8", 1.2)),
}
DOT = 0.8  # radius where a particle touches, over the width of an arrow


class Vectors:
    """Draws arrows over frames.

    Attributes
    ----------
    shown : names of those that are on.
    """

    def __init__(self) -> None:
        self.shown: list[str] = []
        self._scale: dict[str, float] = {}

    def choose(self, name: str, on: bool, sims: Sequence[Simulation]) -> None:
        """Switch one on or off.

        Raises
        ------
        InvalidInput
            It does not exist here.
        """
        offered = [choice.name for choice in choices(sims)]
        if name not in offered:
            raise unknown("arrows", name, offered)
        self.shown = [each for each in offered if (on if each == name else each in self.shown)]
        self._scale.pop(name, None)

    def arrows(self, frame: Frame, columns: Columns, version: int) -> list[Drawable]:
        """What is on."""
        drawn: list[Drawable] = []
        for name in self.shown:
            tails, vectors = _contacts(frame, columns) if name == "contact" else _all(name, frame, columns)
            step = max(1, -(-len(tails) // MOST))
            arrows = self._drawn(name, frame, tails[::step].astype(np.float32), vectors[::step], version)
            drawn.append(arrows)
            if name == "contact":  # also who presses with no force is seen to touch
                dot = DOT * float(np.max(arrows.width))
                drawn.append(
                    Points(name="contacts", version=version, vertices=arrows.vertices, radius=dot, color=arrows.color)
                )
        return drawn

    def _drawn(self, name: str, frame: Frame, tails: Numbers, vectors: Numbers, version: int) -> Arrows:
        size = shading.extent(frame.positions)
        scale = self._typical(name, vectors)
        factor = LONG * size / scale if scale > 0 else 0.0
        return Arrows(
            name=f"{name} arrows",
            version=version,
            vertices=tails,
            vectors=np.nan_to_num(factor * vectors, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32),
            width=WIDE * size,
            color=KINDS[name][1],
        )

    def _typical(self, name: str, vectors: Numbers) -> float:
        sizes = length(vectors)
        sizes = sizes[np.isfinite(sizes)]
        now = float(np.percentile(sizes, TYPICAL)) if len(sizes) else 0.0
        self._scale[name] = max(now, FALL * self._scale.get(name, 0.0))
        return self._scale[name]


def choices(sims: Sequence[Simulation]) -> list[Choice]:
    """The arrows that there are."""
    forces = bool(sims) and sims[0].system.order == 2
    touch = forces and any(sim.system.colliders for sim in sims)
    return [KINDS[name][0] for name in ("velocity", *(["force"] if forces else []), *(["contact"] if touch else []))]


def _all(name: str, frame: Frame, columns: Columns) -> tuple[Numbers, Numbers]:
    return frame.positions, (frame.velocities if name == "velocity" else columns.forces).astype(np.float64)


def _contacts(frame: Frame, columns: Columns) -> tuple[Numbers, Numbers]:
    """Where particles touch surfaces, and the force with which the surface bears the others that press them into it."""
    rows, normals = columns.contacts
    pressing = np.einsum("ij,ij->i", columns.forces[rows], normals)
    radius = np.asarray(columns["radius"])[rows]
    return frame.positions[rows] - radius[:, None] * normals, np.maximum(-pressing, 0.0)[:, None] * normals
