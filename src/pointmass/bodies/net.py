"""A net of ropes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pointmass.bodies.body import Body, body
from pointmass.bodies.sheet import Ids, sheet
from pointmass.errors import number, whole_number
from pointmass.forces.springs import Springs
from pointmass.particles import Particles


@body
def net(
    rows: int = 9,
    cols: int = 9,
    size: Any = 1.0,
    *,
    links: int = 3,
    center: Any = (0.0, 0.0, 0.0),
    right: Any = (1.0, 0.0, 0.0),
    down: Any = (0.0, -1.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    mass: float = 0.02,
    stiffness: float = 200.0,
    slack: float = 0.0,
    damping_ratio: float = 0.1,
    radius: float = 0.0,
    pinned: Any = "none",
) -> Body:
    """Ropes that cross at right angles and are knotted where they do.

    Parameters
    ----------
    rows, cols : knots along the height and the width, each at least 2.
    size : width and height [m]; one number for a square.
    links : springs of a rope from knot to knot.
    center : of the net [m].
    right, down : directions of its rows and of its columns; (1, 0, 0) and (0, 0, 1) for a net that lies.
    velocity : at the start [m/s].
    mass : of a metre of rope [kg/m]; a particle has half of each of its links.
    stiffness : tension of a rope for each unit of strain [N].
    slack : how much longer each rope is than its way in the flat net, relative; it hangs through by that.
    damping_ratio : of one link between two of the masses, 1 = critical.
    radius : of a particle [m].
    pinned : knots that are held: "top corners", "top edge", "left edge", "corners", "edges", ..., a list of such names,
        or "none". Particles have groups of these names.
    """
    grid = sheet(rows, cols, size)
    links = whole_number("links", links, at_least=1)
    knots = grid.places(center, right, down)
    sides = np.concatenate([grid.pairs(0, 1), grid.pairs(1, 0)])
    part = np.arange(1, links)[None, :, None] / links
    between = knots[sides[:, :1]] * (1 - part) + knots[sides[:, 1:]] * part
    chains = np.column_stack([sides[:, 0], _numbers(len(knots), len(sides), links), sides[:, 1]])
    pairs = np.stack([chains[:, :-1].ravel(), chains[:, 1:].ravel()], axis=1)
    x = np.concatenate([knots, between.reshape(-1, 3)])
    dx, dy = grid.cell
    across = len(grid.pairs(0, 1))
    rest = np.repeat(np.where(np.arange(len(sides)) < across, dx, dy) / links, links)
    rest = rest * (1 + number("slack", slack, at_least=0, at_most=1))
    weight = number("mass", mass, above=0, unit="kg/m") * rest
    m = np.bincount(pairs.ravel(), np.repeat(0.5 * weight, 2), len(x))
    particles = Particles(x, velocity, m, number("radius", radius, at_least=0, unit="m"))
    grid.tag(particles, pinned)
    k = number("stiffness", stiffness, above=0, unit="N") / rest
    k_d = 2 * number("damping_ratio", damping_ratio, at_least=0) * np.sqrt(k * weight) / math.sqrt(2)
    return Body(particles, [Springs(pairs, k, k_d, rest, family="ropes")])


def _numbers(first: int, sides: int, links: int) -> Ids:
    """Numbers of the particles between the knots, a row for each side."""
    return first + np.arange(sides * (links - 1)).reshape(sides, links - 1)
