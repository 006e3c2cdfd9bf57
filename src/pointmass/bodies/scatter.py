"""Particles spread at random."""

from __future__ import annotations

from typing import Any

import numpy as np

from pointmass import random
from pointmass.bodies.body import Body, body
from pointmass.errors import InvalidInput, finite_array, number, whole_number
from pointmass.particles import Particles


@body
def scatter(
    count: int,
    center: Any = (0.0, 0.0, 0.0),
    size: Any = (1.0, 1.0, 1.0),
    *,
    speed: float = 0.0,
    m: float = 1.0,
    radius: float = 0.0,
    radius_range: float = 0.0,
    seed: int = 0,
) -> Body:
    """Particles evenly spread over a box.

    Parameters
    ----------
    count : how many.
    center, size : of the box [m]; an edge of 0 makes it flat.
    speed : of each, in a direction of its own [m/s].
    m : mass of a particle of the mean radius [kg]; it grows with the cube of the radius.
    radius, radius_range : mean and half-range [m].
    seed : another one gives another spread.
    """
    count = whole_number("count", count, at_least=1)
    seed = whole_number("seed", seed, at_least=0)
    edges = finite_array("size", size, (3,))
    if (edges < 0).any():
        raise InvalidInput(f"size = {size} is not allowed: each edge must be at least 0 [m]")
    mean = number("radius", radius, at_least=0, unit="m")
    half = number("radius_range", radius_range, at_least=0, at_most=mean, unit="m")
    ids = np.arange(count)
    place = np.stack([random.uniform(seed, "scatter", ids, axis)[:, 0] for axis in "xyz"], axis=1)
    x = finite_array("center", center, (3,)) + (place - 0.5) * edges
    v = number("speed", speed, at_least=0, unit="m/s") * random.direction(seed, "scatter", ids, "direction")
    r = random.spread(seed, "scatter", ids, "radius", mean, half)
    mass = number("m", m, above=0, unit="kg") * (np.maximum(r / mean, 1e-3) ** 3 if mean else np.ones(count))
    return Body(Particles(x, v, mass, r))
