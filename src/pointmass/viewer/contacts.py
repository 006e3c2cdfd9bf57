"""Where particles touch surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pointmass.particles import Array
from pointmass.system import ParticleSystem

TOUCHING = 1e-6  # of a particle's size and of the scene's, from a surface


def contacts(system: ParticleSystem, x: Array, t: float) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Who touches a surface at places and a time.

    Parameters
    ----------
    x : places of all particles [m], shape (n, 3).

    Returns
    -------
    rows, normals : of the particles, and the unit normals of the surfaces there, shape (k, 3). Who touches several
        surfaces is there several times.
    """
    size = float(np.ptp(x, axis=0).max()) if len(x) else 0.0
    reach = system.particles.radius * (1 + TOUCHING) + TOUCHING * size
    rows: list[NDArray[np.intp]] = [np.zeros(0, np.intp)]
    normals: list[NDArray[np.float64]] = [np.zeros((0, 3))]
    for collider in system.colliders:
        for surface in collider.surfaces:
            with np.errstate(all="ignore"):
                near = np.flatnonzero(surface.distance(x, t) <= reach + surface.eps)
            rows.append(near)
            normals.append(surface.normal(x[near], t).astype(np.float64))
    return np.concatenate(rows), np.concatenate(normals)
