"""Which triangle of a mesh is nearest to a point, and which way it looks there."""

from __future__ import annotations

from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array
from pointmass.meshes import TriangleMesh
from pointmass.tracing.functions import Number, Triple, atan2, dot, maximum, minimum, scale, sqrt, sub, where
from pointmass.tracing.program import Vector
from pointmass.tracing.trace import Traced, trace

Rows = NDArray[np.intp]
LEAF = 4  # triangles of a leaf of the tree, at most
CHUNK = 1024  # points whose candidates are looked at together
SLACK = 1e-12  # of the size of the mesh and the distance from its origin: more than the roundings of a distance
FEATURES = 7  # of a triangle: its face, the edges from corner 0 to 1, 2 to 0 and 1 to 2, the corners 0, 1 and 2


def triangle_law(
    p: Triple, e1: Triple, e2: Triple, n: Triple, a: Number, b: Number, c: Number, inverse: Number, third: Number
) -> tuple[Number, ...]:
    """From the nearest point of a triangle to a point.

    Parameters
    ----------
    p : the point, relative to corner 0.
    e1, e2 : the other corners, relative to corner 0.
    n : unit normal.
    a, b, c : e1 . e1, e1 . e2, e2 . e2.
    inverse, third : 1 / (a c - b b), and the square of the length of the edge from corner 1 to 2.

    Returns
    -------
    The square of the distance, the vector from the nearest point, and the number of the feature on which that lies.
    """
    along1, along2, above = dot(e1, p), dot(e2, p), dot(n, p)
    s, t = (c * along1 - b * along2) * inverse, (a * along2 - b * along1) * inverse
    first, second = along1 / a, along2 / c
    opposite = ((along2 - along1) + (a - b)) / third
    best = _from_edge(p, e1, first, (1.0, 4.0, 5.0))
    for other in (
        _from_edge(p, e2, second, (2.0, 4.0, 6.0)),
        _from_edge(sub(p, e1), sub(e2, e1), opposite, (3.0, 5.0, 6.0)),
    ):
        closer = other[0] < best[0]
        best = Vector(where(closer, u, v) for u, v in zip(other, best, strict=True))
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    face = (above * above, *scale(above, n), 0.0)
    return tuple(where(inside, u, v) for u, v in zip(face, best, strict=True))


def outcome_law(
    q: Triple, square: Number, feature: Number, n: Triple, half: Number, side: Number, small: Number
) -> tuple[Number, ...]:
    """Signed distance and its gradient where the nearest point of the triangles is q away.

    Parameters
    ----------
    q, square, feature : what `triangle_law` returns for the nearest triangle.
    n : normal of the feature; of an edge or a corner the mean of the faces around it, weighted by their angles, which
        tells inside from outside (Baerentzen & Aanaes, Signed distance computation using the angle weighted
        pseudonormal, 2005).
    half : half the thickness of a sheet, 0 for the skin of a solid.
    side : 1 if the solid is where the triangles look away from, -1 if it is where they look to.
    small : a distance below which q has no direction.
    """
    along = dot(q, n)
    turned = where(along < 0.0, -1.0, 1.0)
    size = sqrt(square)
    face = feature < 0.5
    distance = where(face, along, turned * size)
    far = ~face & (small < size)
    safe = where(far, size, 1.0)
    flip = where((half > 0.0) & (along < 0.0), -1.0, 1.0) * side
    normal = [flip * where(far, turned * u / safe, v) for u, v in zip(q, n, strict=True)]
    return flip * distance - half, *normal


@cache
def triangle() -> Traced:
    """`triangle_law` as a program."""
    vectors, numbers = ("p", "e1", "e2", "n"), ("a", "b", "c", "inverse", "third")
    kinds = dict.fromkeys(vectors, "vector") | dict.fromkeys(numbers, "scalar")
    return trace(triangle_law, kinds, 5)


@cache
def outcome() -> Traced:
    """`outcome_law` as a program."""
    scalar = "scalar"
    kinds = {"q": "vector", "square": scalar, "feature": scalar, "n": "vector"}
    return trace(outcome_law, kinds | {"half": scalar, "side": scalar, "small": scalar}, 4)


class TriangleTree:
    """The triangles of a mesh, and a tree of boxes around them.

    The tree is complete: node 1 is the root, those below node i are 2 i and 2 i + 1, and leaf j of m has the triangles
    from j n / m to (j + 1) n / m, rounded down. Of triangles that are equally near, the first counts.

    Attributes
    ----------
    corners : of the triangles in the order of the leaves [m], shape (n, 3, 3).
    numbers : of each triangle, corner 0 and what `triangle_law` takes, shape (n, 17).
    normals : of its features, shape (n, 7, 3).
    leaves : how many, a power of 2.
    boxes : lower and upper corner of the box of each node [m], shape (2 leaves, 6); there is no node 0.
    extent : largest coordinate of a corner [m].
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        n = len(mesh.faces)
        levels = max(0, int(np.ceil(np.log2(n / LEAF))))
        self.leaves = 2**levels
        order = _order(mesh.corners.mean(axis=1), levels)
        self.corners = mesh.corners[order]
        self.numbers = triangle_numbers(self.corners, mesh.normals[order])
        self.normals = feature_normals(mesh)[order]
        self.boxes = _boxes(self.corners, levels)
        self.extent = float(np.abs(mesh.vertices).max())

    def nearest(self, x: Array) -> tuple[Array, Array, Array, Rows]:
        """For each point, shape (k, 3): what `triangle_law` says of the nearest triangle, and its number.

        The search is not that of the kernels: it looks at all triangles in leaves that are no farther than a point's
        nearest corner.
        """
        square, q, feature = np.full(len(x), np.nan), np.full((len(x), 3), np.nan), np.zeros(len(x))
        which = np.zeros(len(x), np.intp)
        known = np.flatnonzero(np.isfinite(x).all(axis=1))
        for first in range(0, len(known), CHUNK):
            rows = known[first : first + CHUNK]
            point, candidate = self._candidates(x[rows])
            p = x[rows][point] - self.corners[candidate, 0]
            values = triangle().columns(*p.T, *self.numbers[candidate, 3:].T)
            order = np.lexsort((candidate, values[0], point))
            best = order[np.r_[True, point[order][1:] != point[order][:-1]]]
            square[rows], which[rows] = values[0][best], candidate[best]
            q[rows] = np.stack([v[best] for v in values[1:4]], axis=1)
            feature[rows] = values[4][best]
        return square, q, feature, which

    def _candidates(self, x: Array) -> tuple[Rows, Rows]:
        """Pairs of a point and a triangle that may be its nearest: down the tree, all boxes within reach at once."""
        reach, _ = self._corners.query(x)
        reach = reach + 4 * SLACK * (self.extent + np.abs(x).sum(axis=1))
        point, node = np.arange(len(x)), np.ones(len(x), np.intp)
        for level in range(self.leaves.bit_length()):
            if level:
                point, node = np.repeat(point, 2), (2 * node[:, None] + (0, 1)).ravel()
            low, high = np.split(self.boxes[node], 2, axis=1)
            here = x[point]
            apart = np.maximum(np.maximum(low - here, here - high), 0.0)
            near = np.linalg.norm(apart, axis=1) <= reach[point]
            point, node = point[near], node[near]
        first, end = ((node - self.leaves + k) * len(self.corners) // self.leaves for k in (0, 1))
        count = end - first
        before = np.cumsum(count) - count
        return np.repeat(point, count), np.arange(count.sum()) + np.repeat(first - before, count)

    @cached_property
    def _corners(self) -> Any:
        """A tree of the corners."""
        from scipy.spatial import cKDTree

        return cKDTree(np.unique(self.corners.reshape(-1, 3), axis=0))


def feature_normals(mesh: TriangleMesh) -> NDArray[np.float64]:
    """Normal of each feature of each triangle, shape (k, 7, 3): see `outcome_law`."""
    _, edges = mesh.edges
    along = np.zeros((int(edges.max()) + 1, 3))
    np.add.at(along, edges, mesh.normals[:, None])
    at = np.zeros_like(mesh.vertices)
    np.add.at(at, mesh.faces, _angles(mesh.corners)[:, :, None] * mesh.normals[:, None])
    parts = [mesh.normals[:, None], along[edges[:, [0, 2, 1]]], at[mesh.faces]]
    normals = np.concatenate(parts, axis=1)
    size = np.linalg.norm(normals, axis=2, keepdims=True)
    folded = size < 1e-9  # two faces back to back have no mean: each keeps its own
    result: NDArray[np.float64] = np.where(folded, mesh.normals[:, None], normals / np.where(folded, 1, size))
    return result


def _from_edge(p: Triple, edge: Triple, part: Number, features: tuple[float, float, float]) -> Vector:
    """The result of `triangle_law` for an edge from the origin: its features are the edge, its begin and its end."""
    u = minimum(maximum(part, 0.0), 1.0)
    q = sub(p, scale(u, edge))
    middle, begin, end = features
    return Vector((dot(q, q), *q, where(part <= 0.0, begin, where(part >= 1.0, end, middle))))


def _order(middles: Array, levels: int) -> Rows:
    """Triangles in the order of the leaves: each node is cut in two halves along its longest side."""
    n = len(middles)
    order = np.arange(n)
    for level in range(levels):
        starts = np.arange(2**level) * n >> level
        node = np.repeat(np.arange(2**level), np.diff(np.append(starts, n)))
        here = middles[order]
        sides = np.maximum.reduceat(here, starts) - np.minimum.reduceat(here, starts)
        order = order[np.lexsort((here[np.arange(n), sides.argmax(axis=1)[node]], node))]
    return order


def _boxes(corners: Array, levels: int) -> NDArray[np.float64]:
    starts = np.arange(2**levels) * len(corners) >> levels
    boxes = np.zeros((2 ** (levels + 1), 6))
    low, high = (np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts))
    for level in range(levels, -1, -1):
        boxes[2**level : 2 ** (level + 1)] = np.concatenate([low, high], axis=1)
        if level:
            low, high = np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])
    return boxes


def triangle_numbers(corners: Array, normals: Array) -> NDArray[np.float64]:
    """Corner 0 of each triangle, and what `triangle_law` takes beside the point, shape (k, 17)."""
    a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    one, both, two = (e1 * e1).sum(axis=1), (e1 * e2).sum(axis=1), (e2 * e2).sum(axis=1)
    third = ((e2 - e1) ** 2).sum(axis=1)
    inverse = 1 / (np.cross(e1, e2) ** 2).sum(axis=1)
    return np.concatenate([a, e1, e2, normals, np.stack([one, both, two, inverse, third], axis=1)], axis=1)


def _angles(corners: Array) -> Array:
    """Angle of each triangle at each of its corners [rad], shape (k, 3)."""
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(ahead, behind), axis=2)
    result: Array = atan2(across, (ahead * behind).sum(axis=2))
    return result
