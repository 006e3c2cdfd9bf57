"""What scenes with a cloth have in common: a sheet of a material in cells that are nearly square, and its checks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from pointmass.bodies import Body, cloth
from pointmass.bodies.materials import MATERIALS
from pointmass.forces import Springs
from pointmass.frame import Frame
from pointmass.scenes.base import expect, stiffest, substeps
from pointmass.solvers import SymplecticEuler

STRETCHED = 0.6  # of a spring, relative: more than any cloth of these scenes does where it is held


def sheet(particles: int, width: float, height: float, material: str, stretch: float, bend: float, **more: Any) -> Body:
    """A cloth with so many particles along its longer side; a stretch or bend of 0 is that of the material."""
    longer = max(width, height)
    cols, rows = (max(2, 1 + round((particles - 1) * side / longer)) for side in (width, height))
    made = MATERIALS[material]
    if stretch > 0:  # the shear stays in proportion
        more = {**more, "stretch": stretch, "shear": made.shear * stretch / made.stretch}
    return cloth(rows, cols, (width, height), material=material, bend=bend if bend > 0 else None, **more)


def steps(body: Body, room: float = 1.0) -> tuple[SymplecticEuler, float]:
    """A solver and its step [s], a part of a sixtieth of a second in which the springs of a cloth stay stable.

    Parameters
    ----------
    room : factor on their number, where something else drives the cloth.
    """
    solver = SymplecticEuler()
    stiffness, damping = stiffest(body)
    return solver, 1 / 60 / max(4, math.ceil(room * substeps(solver, stiffness, damping)))


def check_sheet(body: Body, frames: Sequence[Frame], rows: slice = slice(None)) -> None:
    """Who is held stays where it was to the bit, and no spring is stretched beyond what cloth bears."""
    first, last = frames[0], frames[-1]
    held = body.particles.pinned
    same = first.positions[rows][held].tobytes() == last.positions[rows][held].tobytes()
    expect(same, "a particle that is held has moved")
    worst = 0.0
    for force in body.forces:
        if isinstance(force, Springs) and force.family == "stretch":
            ends = last.positions[rows][force.rows(body.particles)]
            length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
            worst = float(np.max(length / force.rests(body.particles, 0.0))) - 1
    expect(worst < STRETCHED, f"a spring along the threads is stretched by {100 * worst:.0f}%")
