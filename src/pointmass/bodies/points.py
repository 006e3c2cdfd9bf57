"""Particles that nothing holds together."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pointmass.bodies.body import Body, body
from pointmass.errors import InvalidInput, shown
from pointmass.particles import Particles, attribute_name


@body
def points(
    x: Any,
    v: Any = None,
    m: Any = 1.0,
    radius: Any = 0.0,
    *,
    lifetime: Any = math.inf,
    pinned: Any = (),
    attributes: dict[str, Any] | None = None,
) -> Body:
    """Particles given one by one.

    Parameters
    ----------
    x, v : positions [m] and velocities [m/s], shape (n, 3) or (n, 2).
    m, radius : masses [kg] and radii [m], numbers or shape (n,).
    lifetime : age at which they die [s], a number or shape (n,); inf = never.
    pinned : rows of particles that are held.
    attributes : further columns by name, such as charge.
    """
    further = {} if attributes is None else attributes
    if not isinstance(further, Mapping):
        raise InvalidInput(f'attributes must be columns by name, such as {{"charge": 1.0}}, not {shown(further)}')
    particles = Particles(
        x, v, m, radius, lifetime=lifetime, **{attribute_name(name): column for name, column in further.items()}
    )
    particles.pin(() if pinned is None else pinned)
    return Body(particles)
