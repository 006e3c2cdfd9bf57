"""Hair as one sees it: simulated strands, and many more between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.forces.springs import Springs
from pointmass.frame import Curves
from pointmass.particles import Array, Particles

NEAR = 5  # neighbours of a strand, of which two are parents of a child
UNEVEN = 0.35  # half-range of the light of strands, relative
TIP = 0.35  # width there, relative to the root
Rows = NDArray[np.intp]


class Strands:
    """The strands of one force, and their children.

    A child is the weighted mean of three strands, point by point (Ward et al., A survey on hair modeling, IEEE TVCG
    2007, on interpolation between guides). One of them has `children` children, two of its nearest neighbours are the
    other parents, and the weights are even over the triangle of the roots, so that children root where strands do. What
    they are made of follows from the seed and the places of the roots at the start.

    Parameters
    ----------
    force : springs of the family "strand", from each root to its tip, strand by strand.
    particles : as they are at the start.
    clump : how far children draw near to the one that has them, from not at all at the root to this at the tip, 0 to 1.
    children : of each strand. There are none of fewer than three strands, or of strands that are not alike, as when a
        particle was taken away.
    """

    def __init__(self, force: Springs, particles: Particles, children: int, clump: float, seed: int) -> None:
        self.force, self.clump, self.seed = force, clump, seed
        self.parents: Rows = np.zeros((0, 3), np.intp)
        self.weights: Array = np.zeros((0, 3))
        self._links = len(force.ids)
        self._known = self._read(particles)
        _, counts, _ = self._known[1:]
        if children > 0 and len(counts) >= 3 and (counts == counts[0]).all():
            self.parents, self.weights = _families(particles.x[self._roots(particles)], children, seed)
            self._known = self._read(particles)

    def drawn(
        self, name: str, particles: Particles, x: Array, width: float, root: Array, tip: Array, frame: int
    ) -> Curves:
        """All of them at places `x`, thinner and of another colour towards their tips.

        Parameters
        ----------
        width : diameter at the root [m].
        root, tip : linear RGBA.
        """
        if self._known[0] != particles.version:
            self._known = self._read(particles)
        rows, counts, light = self._known[1:]
        points = x[rows].astype(np.float32)
        if counts.sum() > len(rows):
            strands = points.reshape(-1, counts[0], 3)
            along = np.linspace(0, 1, counts[0])
            near = self.clump * along * (2 - along)
            first, second, third = (w[:, None] * (1 - near) for w in self.weights.T)
            parts = zip((first + near, second, third), self.parents.T, strict=True)
            children = sum(weight[:, :, None] * strands[parent] for weight, parent in parts)
            points = np.concatenate([points, np.reshape(children, (-1, 3))])
        offsets = np.append(0, np.cumsum(counts))
        within = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
        along = (within / np.repeat(counts - 1, counts)).astype(np.float32)
        color = (root + (tip - root) * along[:, None]).astype(np.float32)
        color[:, :3] *= np.repeat(light, counts)[:, None]
        return Curves(
            name=name,
            version=frame,
            vertices=points.astype(np.float32),
            index=np.arange(len(along), dtype=np.int32),
            offsets=offsets.astype(np.int32),
            width=width * (1 - (1 - TIP) * along),
            color=color,
        )

    def _roots(self, particles: Particles) -> Rows:
        pairs = self.force.rows(particles)
        return np.asarray(pairs[_first(pairs), 0])

    def _read(self, particles: Particles) -> tuple[int, Rows, Rows, NDArray[np.float32]]:
        """The version of the particles, rows of all points, and of each strand how many it has and its light."""
        pairs = self.force.rows(particles)
        first = _first(pairs)
        ends = np.append(first[1:], len(pairs))
        rows = np.insert(pairs[:, 1], first, pairs[first, 0])
        counts = ends - first + 1
        light = random.spread(self.seed, "strands", particles.id[pairs[first, 0]], "light", 1.0, UNEVEN)
        if len(pairs) == self._links:
            everybody = np.arange(len(self.parents))
            light = np.append(light, random.spread(self.seed, "children", everybody, "light", 1.0, UNEVEN))
            counts = np.append(counts, np.full(len(self.parents), counts[0]))
        return particles.version, rows, counts, light.astype(np.float32)


def _first(pairs: Rows) -> Rows:
    """The first pair of each strand: one that does not begin where the last one ended."""
    return np.flatnonzero(np.append(True, pairs[1:, 0] != pairs[:-1, 1]))


def _families(roots: Array, children: int, seed: int) -> tuple[Rows, Array]:
    """Parents of each child, shape (strands * children, 3), and their weights."""
    from scipy.spatial import cKDTree

    near = min(NEAR, len(roots) - 1)
    _, found = cKDTree(roots).query(roots, near + 1)
    others = np.array([[j for j in row if j != i][:near] for i, row in enumerate(np.asarray(found))])
    mother = np.repeat(np.arange(len(roots)), children)
    ids = np.arange(len(mother))
    u = random.uniform(seed, "strands", ids, "parents")
    first = np.minimum((u[:, 0] * near).astype(np.intp), near - 1)
    second = (first + 1 + np.minimum((u[:, 1] * (near - 1)).astype(np.intp), max(near - 2, 0))) % near
    place = random.uniform(seed, "strands", ids, "place")
    root, along = np.sqrt(place[:, 0]), place[:, 1]
    weights = np.stack([1 - root, root * (1 - along), root * along], axis=1)
    return np.stack([mother, others[mother, first], others[mother, second]], axis=1), weights
