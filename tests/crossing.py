"""The slow obvious versions of what self-contact asks: every pair, one after the other."""

from __future__ import annotations

import numpy as np


def edges_of(triangles):
    """Each edge of some triangles once."""
    return sorted({tuple(sorted((int(t[i]), int(t[j])))) for t in triangles for i, j in ((0, 1), (1, 2), (2, 0))})


def crossings(x, triangles, edges=None):
    """(edge, triangle) of every edge that passes through a triangle with which it shares no corner.

    Volumes of the rounding of `x` are nothing: a flat sheet does not pass through itself.
    """
    x, eps = np.asarray(x, float), np.finfo(np.asarray(x).dtype).eps
    edges = edges_of(triangles) if edges is None else edges
    nothing = 32 * eps * np.abs(x).max() * max(((x[p] - x[q]) ** 2).sum() for p, q in edges)
    triangles = np.asarray(triangles)
    ends = np.asarray(edges)
    low, high = (pick(x[triangles], axis=1) for pick in (np.min, np.max))
    first, last = (pick(x[ends], axis=1) for pick in (np.min, np.max))
    near = np.ones((len(ends), len(triangles)), bool)  # every edge and every triangle, whose boxes overlap
    for axis in range(3):
        near &= (low[None, :, axis] <= last[:, None, axis]) & (first[:, None, axis] <= high[None, :, axis])
    edge, triangle = np.nonzero(near)
    p, q, a, b, c = x[ends[edge, 0]], x[ends[edge, 1]], *(x[triangles[triangle, k]] for k in range(3))
    sides = [volumes(p, q, u, v) for u, v in ((a, b), (b, c), (c, a))]
    inside = np.all([s > nothing for s in sides], axis=0) | np.all([s < -nothing for s in sides], axis=0)
    one, other = volumes(a, b, c, p), volumes(a, b, c, q)
    through = inside & (np.minimum(one, other) < -nothing) & (np.maximum(one, other) > nothing)
    through &= (triangles[triangle][:, :, None] != ends[edge][:, None, :]).all(axis=(1, 2))
    return list(zip(edge[through].tolist(), triangle[through].tolist(), strict=True))


def volumes(a, b, c, d):
    """Six times the signed volumes of tetrahedra."""
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)


def overlaps(items, boxes, others, others_boxes, same):
    """Numbers of items whose boxes overlap and which share no corner."""
    low, high = (b[:, None] for b in np.split(boxes, 2, axis=1))
    near = ((low <= others_boxes[:, 3:]) & (others_boxes[:, :3] <= high)).all(axis=2)
    return [(k, o) for k, o in np.argwhere(near).tolist() if (not same or o > k) and not set(items[k]) & set(others[o])]


def distance(kind, p, steps=60):
    """Of a point and a triangle ("point"), or of two edges ("edge"): the least of a fine grid of places on both."""
    p = np.asarray(p, float)
    s = np.linspace(0, 1, steps)
    if kind == "edge":
        one = p[0] + s[:, None] * (p[1] - p[0])
        two = p[2] + s[:, None] * (p[3] - p[2])
        return np.sqrt(((one[:, None] - two[None]) ** 2).sum(axis=-1)).min()
    u, v = (a.ravel() for a in np.meshgrid(s, s))
    places = np.stack([1 - u - v, u, v], axis=1)[u + v <= 1 + 1e-12] @ p[1:]
    return np.sqrt(((places - p[0]) ** 2).sum(axis=-1)).min()
