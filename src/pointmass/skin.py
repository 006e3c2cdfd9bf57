"""Smooth skins over a few particles: what one sees of a body whose own triangles are coarse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = NDArray[np.float64]
Faces = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Skin:
    """The same mesh over the particles of each of several equal bodies: every corner is a fixed mean of particles.

    Attributes
    ----------
    nodes : ids of the particles of each body, shape (bodies, k).
    weights : of the particles for each corner, whose sum is 1, shape (corners, k).
    faces : of one body, counter-clockwise seen from outside, shape (f, 3).
    uv : place of each face's corners on the pattern, shape (f, 3, 2).
    eyes : weights of the middle of each eye, shape (e, k).
    eye_radius : [m].
    """

    nodes: Faces
    weights: Weights
    faces: Faces
    uv: NDArray[np.float64]
    eyes: Weights
    eye_radius: float = 0.0

    def shifted(self, offset: int) -> Skin:
        """The same skin over particles with ids `offset` higher."""
        return replace(self, nodes=self.nodes + offset)

    def kept(self, here: NDArray[np.bool_]) -> Skin:
        """That of the bodies of which all particles are there, shape (bodies, k)."""
        return replace(self, nodes=self.nodes[here.all(axis=1)])

    def corners(self, x: NDArray[Any]) -> NDArray[np.float32]:
        """Places of all corners [m], shape (bodies corners, 3), for those of the nodes, shape (bodies, k, 3)."""
        return np.asarray(np.matmul(self.weights, x).reshape(-1, 3), np.float32)

    def all_faces(self) -> NDArray[np.int32]:
        """Faces of all bodies, rows of `corners`."""
        first = len(self.weights) * np.arange(len(self.nodes))
        return (self.faces + first[:, None, None]).reshape(-1, 3).astype(np.int32)

    def pupils(self, x: NDArray[Any]) -> NDArray[np.float32]:
        """Places of all eyes [m], shape (bodies e, 3)."""
        return np.asarray(np.matmul(self.eyes, x).reshape(-1, 3), np.float32)


def subdivided(weights: Weights, faces: Faces) -> tuple[Weights, Faces]:
    """Each triangle of a closed mesh in four, and smoothed (Loop, Smooth subdivision surfaces, 1987).

    Parameters
    ----------
    weights : of the nodes for each corner, shape (corners, k).
    faces : shape (f, 3).
    """
    n = len(weights)
    edges: dict[tuple[int, int], int] = {}
    across: list[list[int]] = []
    neighbours: list[set[int]] = [set() for _ in range(n)]
    for face in faces.tolist():
        for a, b, c in (face, face[1:] + face[:1], face[2:] + face[:2]):
            edge = (min(a, b), max(a, b))
            if edge not in edges:
                edges[edge] = n + len(across)
                across.append([])
            across[edges[edge] - n].append(c)
            neighbours[a].add(b)
            neighbours[b].add(a)
    moved = np.empty_like(weights)
    for corner, ring in enumerate(neighbours):
        k = len(ring)
        share = (0.625 - (0.375 + 0.25 * np.cos(2 * np.pi / k)) ** 2) / k
        moved[corner] = (1 - k * share) * weights[corner] + share * weights[sorted(ring)].sum(axis=0)
    ends = np.array(list(edges))
    middles = 0.375 * weights[ends].sum(axis=1) + 0.125 * weights[np.array(across)].sum(axis=1)
    quarters = []
    for a, b, c in faces.tolist():
        ab, bc, ca = (edges[min(p, q), max(p, q)] for p, q in ((a, b), (b, c), (c, a)))
        quarters += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return np.concatenate([moved, middles]), np.array(quarters, np.int64)


def tube(
    profile: Sequence[tuple[float, float]], rings: int, girth: float = 1.0, around: int = 16, along: int = 4
) -> tuple[Weights, Faces, NDArray[np.float64]]:
    """Weights, faces and pattern of a round skin along rings of four particles, which are numbered ring by ring.

    Sections are the circles (when a ring is sheared: ellipses) through the four, joined by cubic B-splines; the ends
    are pointed where the profile is.

    Parameters
    ----------
    profile : (place, radius): along the body from 0 to 1, straight on beyond it, and the radius there relative to that
        of the rings; straight in between, from front to back.
    rings : how many; the four are counter-clockwise around each, seen from the front.
    girth : of the pattern around the body, relative to its length.
    around, along : corners of a section, and sections for each ring.
    """
    places, radii = np.array(profile, np.float64).T
    s = np.unique(np.concatenate([places[(places < 0) | (places > 1)], np.linspace(0, 1, along * (rings - 1) + 1)]))
    angle = 2 * np.pi * np.arange(around) / around
    turned = 0.5 * np.stack([np.cos(angle), np.sin(angle), -np.cos(angle), -np.sin(angle)], axis=1)
    corner = 0.25 + np.interp(s, places, radii)[:, None, None] * turned  # (sections, around, 4)
    weights = splines(s * (rings - 1), rings)[:, None, :, None] * corner[:, :, None, :]
    faces, uv = _quads(len(s), around, (s - s[0]) / (s[-1] - s[0]), girth)
    return weights.reshape(-1, 4 * rings), faces, uv


def splines(at: NDArray[np.float64], count: int) -> Weights:
    """Weights of `count` points, numbered from 0, on a cubic B-spline; on a straight line beyond its ends."""
    result = np.zeros((len(at), count))
    inside = np.clip(at, 0, count - 1)
    first = np.minimum(inside.astype(np.int64), count - 2)
    t = inside - first
    basis = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    rows = np.arange(len(at))
    for k in range(4):  # points beyond the ends lie on the line through the last two
        point = first + k - 1
        low, high = point < 0, point > count - 1
        np.add.at(result, (rows, np.clip(point, 0, count - 1)), np.where(low | high, 2 * basis[:, k], basis[:, k]))
        np.add.at(result, (rows, np.where(low, 1, count - 2)), np.where(low | high, -basis[:, k], 0.0))
    beyond = at - inside
    np.add.at(result, (rows, np.where(beyond < 0, 0, count - 1)), np.abs(beyond))
    np.add.at(result, (rows, np.where(beyond < 0, 1, count - 2)), -np.abs(beyond))
    return result


def _quads(sections: int, around: int, v: NDArray[np.float64], girth: float) -> tuple[Faces, NDArray[np.float64]]:
    """Two triangles between each two neighbours of two sections, and their places on the pattern."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(sections - 1), np.arange(around), indexing="ij"))
    right = (j + 1) % around
    a, b, c, d = i * around + j, i * around + right, (i + 1) * around + right, (i + 1) * around + j
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)])
    u = girth * np.stack([j, j + 1]) / around
    at = {"a": (u[0], v[i]), "b": (u[1], v[i]), "c": (u[1], v[i + 1]), "d": (u[0], v[i + 1])}
    uv = np.concatenate([np.stack([np.stack(at[n], axis=1) for n in names], axis=1) for names in ("acb", "adc")])
    return faces.astype(np.int64), uv
