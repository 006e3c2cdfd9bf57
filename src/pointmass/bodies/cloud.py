"""Particles from a file."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from pointmass.bodies.body import Body, body
from pointmass.clouds import read_cloud
from pointmass.errors import finite_array, number
from pointmass.particles import Particles


@body
def cloud(
    file: str | Path,
    frame: int | None = None,
    *,
    m: Any = 1.0,
    radius: Any = None,
    scale: float = 1.0,
    shift: Any = (0.0, 0.0, 0.0),
    lifetime: Any = math.inf,
) -> Body:
    """The particles of a file, with the velocities and radii that it knows.

    Parameters
    ----------
    file : its path: what `pointmass export` writes, or another program; see `pointmass.clouds.read_cloud`.
    frame : number of a frame in a file that has several, counted from 0; the last one by default.
    m : masses [kg], a number or shape (n,).
    radius : radii [m], a number or shape (n,); those of the file by default.
    scale, shift : of positions, velocities and radii, after which `shift` is added to the positions [m].
    lifetime : age at which they die [s], a number or shape (n,); inf = never.

    Raises
    ------
    InvalidInput
        A file that cannot be read, or a number that is not allowed.
    """
    found = read_cloud(file, frame)
    size = number("scale", scale, above=0)
    place = finite_array("shift", shift, (3,))
    radii = size * np.maximum(found.radius, 0) if radius is None else radius
    return Body(Particles(size * found.x + place, size * found.v, m, radii, lifetime=lifetime))
