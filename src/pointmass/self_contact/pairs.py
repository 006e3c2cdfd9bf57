"""Which points and triangles, and which edges, may come near each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.threads import spread
from pointmass.particles import Array

Rows = NDArray[np.intp]

FEW = 16  # boxes that may be larger than a cell
TINY = 1e-300  # size of a cell where nobody has any
MOST_CELLS = 2**20  # along an axis
ROOM = 32  # others for each item, if they do: else the search is made again
GRAIN = 4096  # boxes or pairs that are worth a thread


@dataclass(frozen=True, eq=False)
class Mesh:
    """What may touch: rows of particles.

    Attributes
    ----------
    triangles : shape (k, 3).
    edges : of the triangles, each once, and those of strands, shape (e, 2).
    points : all corners of both, shape (p,).
    """

    triangles: Rows
    edges: Rows
    points: Rows

    @classmethod
    def of(cls, triangles: Rows, strands: Rows) -> Mesh:
        """That of triangles, and of the links of strands."""
        sides = [triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]], strands]
        edges = np.unique(np.sort(np.concatenate(sides), axis=1), axis=0)
        return cls(np.ascontiguousarray(triangles), np.ascontiguousarray(edges), np.unique(edges))

    @cached_property
    def alone(self) -> Rows:
        """The points as items of one corner, shape (p, 1)."""
        return self.points[:, None].copy()


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs that may come near, of points and triangles first, then of edges.

    Attributes
    ----------
    corners : their rows, shape (k, 4): a point and the corners of a triangle, or the ends of two edges.
    points : how many are of a point and a triangle.
    """

    corners: Rows
    points: int

    def __len__(self) -> int:
        return len(self.corners)


def find(mesh: Mesh, x0: Array, x1: Array, reach: float, margin: float) -> Pairs:
    """The pairs that may come as near as `reach` on straight ways from x0 to x1, in an order that is always the same.

    Nobody else does, even if every corner strays from its way by half of the margin, and all of them by any one shift.
    Pairs that share a corner are left out.
    """
    from pointmass.self_contact import kernels_pairs as kernels

    way = x1[mesh.points] - x0[mesh.points]
    shift = 0.5 * (way.min(axis=0) + way.max(axis=0)) if len(way) else np.zeros(3)
    pad = 0.5 * (reach + margin)

    def around(items: Rows) -> Array:
        boxes = np.empty((len(items), 6))
        kernels.boxes(items, x0, x1, shift, pad, boxes)
        return boxes

    edges, triangles = around(mesh.edges), around(mesh.triangles)
    met = overlapping(mesh.alone, around(mesh.alone), mesh.triangles, triangles)
    crossed = overlapping(mesh.edges, edges, mesh.edges, edges)
    found = [
        np.concatenate([mesh.points[met[0]][:, None], mesh.triangles[met[1]]], axis=1),
        np.concatenate([mesh.edges[crossed[0]], mesh.edges[crossed[1]]], axis=1),
    ]
    for k, some in enumerate(found):
        keep = np.empty(len(some), bool)
        each = partial(kernels.near, some, k == 1, x0, x1, reach + margin, keep)
        spread(each, len(some), GRAIN)
        found[k] = some[keep]
    return Pairs(np.concatenate(found), len(found[0]))


def overlapping(items: Rows, boxes: Array, others: Rows, others_boxes: Array) -> tuple[Rows, Rows]:
    """Pairs of an item and another one whose boxes overlap, by a hash grid; in ascending order of both.

    Parameters
    ----------
    items, others : rows of their corners; pairs that share one are left out. If both are one array, each pair comes
        once.
    boxes, others_boxes : their lower and upper corners, shapes (k, 6).
    """
    from pointmass.self_contact import kernels_pairs as kernels

    nothing = np.zeros(0, np.intp)
    if not len(items) or not len(others):
        return nothing, nothing
    low, high = others_boxes[:, :3], others_boxes[:, 3:]
    origin, far = low.min(axis=0), high.max(axis=0)
    sizes = (high - low).max(axis=1)
    usual = float(np.partition(sizes, -(FEW + 1))[-(FEW + 1)]) if len(sizes) > FEW else float(sizes.max())
    size = max(usual, float((far - origin).max()) / MOST_CELLS, TINY)
    numbers = np.floor((far - origin) / size).astype(np.intp) + 1
    same = items is others
    ends = np.zeros(2 ** int(2 * len(others)).bit_length() + 1, np.intp)
    entries, keys, large = (np.empty(len(others), np.intp) for _ in range(3))
    packed, everybody = np.empty((len(others), 6)), np.arange(len(others))
    large = large[: kernels.sort_in(others_boxes, origin, size, numbers, ends, entries, keys, packed, large)]
    counts = np.empty(len(items), np.intp)

    def look(room: Rows) -> Rows:
        found = np.empty(room[-1], np.intp)

        def work(first: int, last: int) -> None:
            kernels.query(
                items, boxes, others, others_boxes, same, origin, size, numbers, ends, entries, keys, packed, large,
                everybody, room, found, counts, first, last,
            )  # fmt: skip

        spread(work, len(items), GRAIN)
        return found

    room = ROOM * np.arange(len(items) + 1)
    found = look(room)
    if counts.max() > ROOM:
        room = np.append(0, np.cumsum(counts))
        found = look(room)
    pairs = np.empty((2, int(counts.sum())), np.intp)
    kernels.pack(found, room, counts, *pairs)
    return pairs[0], pairs[1]
