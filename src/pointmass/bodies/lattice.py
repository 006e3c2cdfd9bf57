"""A block of masses on a cubic lattice: a jelly."""

from __future__ import annotations

from typing import Any

import numpy as np

from pointmass.bodies.block import block
from pointmass.bodies.body import Body, body
from pointmass.errors import finite_array, number
from pointmass.forces.springs import Springs
from pointmass.particles import Particles

FAMILIES = {"stretch": 1, "shear": 2, "volume": 3}  # lattice steps between the ends: along an edge, a face, the body


@body
def lattice(
    counts: Any = (5, 5, 5),
    size: Any = (1.0, 1.0, 1.0),
    *,
    center: Any = (0.0, 0.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    tilt: float = 0.0,
    mass: float = 1.0,
    k_s: float = 1000.0,
    damping_ratio: float = 0.1,
    radius: float = 0.0,
) -> Body:
    """A block whose neighbours are joined along edges, face diagonals and body diagonals.

    Parameters
    ----------
    counts : particles along x, y and z, each at least 2.
    size : of the block [m].
    center, velocity : [m], [m/s].
    tilt : turn about z and then about x by this angle [degrees], so that it lands on a corner.
    mass : of the block [kg].
    k_s : stiffness of a spring along an edge [N/m]; diagonals have half of it.
    damping_ratio : of one spring between two of the masses, 1 = critical.
    radius : of a particle [m].
    """
    made = block(counts, size)
    x = made.straight
    place = made.places(center, tilt)
    m = number("mass", mass, above=0, unit="kg") / len(x)
    v = np.tile(finite_array("velocity", velocity, (3,)), (len(x), 1))
    k = number("k_s", k_s, above=0, unit="N/m")
    ratio = number("damping_ratio", damping_ratio, at_least=0)
    forces = []
    for family, steps in FAMILIES.items():
        pairs = np.concatenate([made.pairs(step)[0] for step in made.steps(steps)])
        stiffness = k if steps == 1 else 0.5 * k
        with np.errstate(over="ignore"):  # the springs refuse what is infinite
            rest = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
        forces.append(Springs(pairs, stiffness, float(2 * ratio * np.sqrt(stiffness * m / 2)), rest, family=family))
    return Body(Particles(place, v, m, radius), list(forces))
