"""A block of masses on a cubic lattice: a jelly."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import Body, body
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.forces.springs import Springs
from pointmass.particles import Particles
from pointmass.tracing import functions as fn

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
    along = finite_array("counts", counts, (3,))
    if (along < 2).any() or (along != np.floor(along)).any():
        raise InvalidInput(
            f"counts = {counts} is not allowed: along each side a lattice has a whole number of particles, at least 2"
        )
    shape = tuple(int(c) for c in along)
    grid = np.ascontiguousarray(np.indices(shape).reshape(3, -1).T)  # the last coordinate runs fastest
    edges = finite_array("size", size, (3,)) / (np.array(shape) - 1)
    if (edges <= 0).any():
        raise InvalidInput(f"size = {size} is not allowed: each side must be greater than 0 [m]")
    x = (grid - (np.array(shape) - 1) / 2) * edges
    place = finite_array("center", center, (3,)) + _turned(x, number("tilt", tilt, unit="degrees"))
    m = number("mass", mass, above=0, unit="kg") / len(x)
    v = np.tile(finite_array("velocity", velocity, (3,)), (len(x), 1))
    k = number("k_s", k_s, above=0, unit="N/m")
    ratio = number("damping_ratio", damping_ratio, at_least=0)
    forces = []
    for family, steps in FAMILIES.items():
        pairs = _neighbours(grid, np.array(shape), steps)
        stiffness = k if steps == 1 else 0.5 * k
        with np.errstate(over="ignore"):  # the springs refuse what is infinite
            rest = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
        forces.append(Springs(pairs, stiffness, float(2 * ratio * np.sqrt(stiffness * m / 2)), rest, family=family))
    return Body(Particles(place, v, m, radius), list(forces))


def _neighbours(grid: NDArray[np.integer[Any]], shape: NDArray[np.integer[Any]], steps: int) -> NDArray[np.int64]:
    """Pairs of particles that differ by one in exactly `steps` coordinates, each pair once."""
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    result = []
    for d in product((-1, 0, 1), repeat=3):
        shift = np.array(d)
        if np.abs(shift).sum() == steps and tuple(shift) > (0, 0, 0):
            inside = ((grid + shift >= 0) & (grid + shift < shape)).all(axis=1)
            first = grid[inside] @ stride
            result.append(np.stack([first, first + shift @ stride], axis=1))
    return np.concatenate(result)


def _turned(x: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """Points turned about z, then about x; no matrix product, whose rounding depends on the machine."""
    c, s = fn.cos(math.radians(degrees)), fn.sin(math.radians(degrees))
    a, b = c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1]
    return np.stack([a, c * b - s * x[:, 2], s * b + c * x[:, 2]], axis=1)
