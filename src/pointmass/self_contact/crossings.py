"""Which edges pass through which triangles."""

from __future__ import annotations

import numpy as np

from pointmass.particles import Array
from pointmass.self_contact.pairs import Mesh, Rows, overlapping

ROUNDINGS = 32  # of a coordinate, that a volume may be off by


def crossings(x: Array, mesh: Mesh) -> Rows:
    """Numbers of edges, and of triangles through which they pass, shape (k, 2); two triangles cross nowhere else.

    An edge that only touches a triangle, or lies in its plane but for the rounding of `x`, does not pass through it.
    """
    rounding = ROUNDINGS * float(np.finfo(x.dtype).eps) * float(np.abs(x).max(initial=0.0))
    x = x.astype(np.float64)
    boxes = [np.hstack([x[items].min(axis=1), x[items].max(axis=1)]) for items in (mesh.edges, mesh.triangles)]
    edge, triangle = overlapping(mesh.edges, boxes[0], mesh.triangles, boxes[1])
    p, q = (x[mesh.edges[edge, k]] for k in range(2))
    a, b, c = (x[mesh.triangles[triangle, k]] for k in range(3))
    nothing = rounding * np.square(x[mesh.edges[:, 0]] - x[mesh.edges[:, 1]]).sum(axis=1).max(initial=0.0)
    around = np.stack([_volumes(p, q, a, b), _volumes(p, q, b, c), _volumes(p, q, c, a)])
    through = (around > nothing).all(axis=0) | (around < -nothing).all(axis=0)
    start, end = _volumes(a, b, c, p), _volumes(a, b, c, q)
    through &= (np.abs(start) > nothing) & (np.abs(end) > nothing) & ((start > 0) != (end > 0))
    return np.stack([edge[through], triangle[through]], axis=1)


def _volumes(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Six times the signed volumes of tetrahedra, row by row."""
    result: Array = (np.cross(b - a, c - a) * (d - a)).sum(axis=1)
    return result
