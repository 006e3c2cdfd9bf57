"""A chain of masses: a pendulum, a rope."""

from __future__ import annotations

from typing import Any

import numpy as np

from pointmass.bodies.body import Body, body
from pointmass.collisions.collider import unit
from pointmass.errors import finite_array, number, unknown, whole_number
from pointmass.forces.springs import Springs
from pointmass.particles import Particles


@body
def chain(
    links: int = 10,
    length: float = 1.0,
    *,
    start: Any = (0.0, 0.0, 0.0),
    direction: Any = (1.0, 0.0, 0.0),
    mass: float = 1.0,
    k_s: float = 1e4,
    damping_ratio: float = 0.1,
    radius: float = 0.0,
    pinned: str = "start",
) -> Body:
    """Masses on a line, each joined to the next by a spring.

    Parameters
    ----------
    links : number of springs; there is one particle more.
    length : of the whole chain [m].
    start, direction : where its first particle is [m], and where the others lie.
    mass : of the whole chain [kg], shared by the particles that are not pinned.
    k_s : stiffness of one link [N/m].
    damping_ratio : of one link between two of the masses, 1 = critical.
    radius : of a particle [m].
    pinned : "start", "end", "both" or "none".
    """
    links = whole_number("links", links, at_least=1)
    step = number("length", length, above=0, unit="m") / links
    line = np.outer(np.arange(links + 1) * step, unit("direction", direction))
    held = {"start": [0], "end": [links], "both": [0, links], "none": []}
    if pinned not in list(held):
        raise unknown("value of pinned", pinned, held)
    m = number("mass", mass, above=0, unit="kg") / (links + 1 - len(held[pinned]) or 1)
    particles = Particles(finite_array("start", start, (3,)) + line, m=m, radius=radius)
    particles.pin(held[pinned])
    k = number("k_s", k_s, above=0, unit="N/m")
    k_d = 2 * number("damping_ratio", damping_ratio, at_least=0) * np.sqrt(k * m / 2)
    pairs = [(i, i + 1) for i in range(links)]
    return Body(particles, [Springs(pairs, k, float(k_d), step, family="chain")])
