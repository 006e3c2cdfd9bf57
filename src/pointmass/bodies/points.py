"""Particles that nothing holds together."""

from __future__ import annotations

from typing import Any

from pointmass.bodies.body import Body, body
from pointmass.particles import Particles


@body
def points(
    x: Any,
    v: Any = None,
    m: Any = 1.0,
    radius: Any = 0.0,
    *,
    pinned: Any = (),
    attributes: dict[str, Any] | None = None,
) -> Body:
    """Particles given one by one.

    Parameters
    ----------
    x, v : positions [m] and velocities [m/s], shape (n, 3) or (n, 2).
    m, radius : masses [kg] and radii [m], numbers or shape (n,).
    pinned : rows of particles that are held.
    attributes : further columns by name, such as charge.
    """
    particles = Particles(x, v, m, radius, **(attributes or {}))
    particles.pin(list(pinned))
    return Body(particles)
