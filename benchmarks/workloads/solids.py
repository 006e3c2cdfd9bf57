"""What particles bounce off in a race: for pointmass a collider, for the peers distances written by hand."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from benchmarks.track import Array

CLEAR, OUT = 2e-4, 0.1  # [m]: who begins nearer than that is put so far out
SAGITTA = 2e-3  # [m]: no triangle is so far from the round surface that its corners are on
CELL = 0.025  # [m]: size of the cells that know which triangles may be nearest
MOST = 128  # triangles that are looked at for each cell
DEEP = 0.025  # [m]: nobody comes farther into a solid than this, and farther out there is nothing to hit


@dataclass(frozen=True)
class Ball:
    """A sphere."""

    center: tuple[float, float, float] = (0.2, 0.1, -0.1)
    radius: float = 0.8

    def emptied(self, x: Array) -> Array:
        """The same places, but nobody is inside."""
        gap, normal = self.distance(x)
        inside = gap < CLEAR
        x = x.copy()
        x[inside] += ((OUT - gap[inside])[:, None] * normal[inside]).astype(x.dtype)
        return x

    def ours(self, **material: Any) -> Any:
        """As a collider of pointmass."""
        import pointmass as pm

        return pm.Sphere(self.center, self.radius, **material)

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distances [m], shape (n,), and unit normals, shape (n, 3)."""
        d = x - np.array(self.center, x.dtype)
        size = np.sqrt((d * d).sum(axis=1))
        return size - x.dtype.type(self.radius), d / size[:, None]

    def taichi(self) -> Any:
        """A function of a place: the normal and the distance in one vector."""
        import taichi as ti

        center, radius = ti.Vector(self.center), self.radius

        @ti.func
        def distance(x):
            d = x - center
            size = d.norm()
            n = d / size
            return ti.Vector([n[0], n[1], n[2], size - radius])

        return distance


@dataclass(frozen=True)
class Stone:
    """A closed mesh of 10,092 triangles: a ball with bumps.

    Its distance is that to the nearest triangle. The peers know for cells of space which triangles that may be, as
    somebody would write it who has one mesh and one afternoon; pointmass has a tree and a grid of its own.
    """

    center: tuple[float, float, float] = (0.2, 0.1, -0.1)
    radius: float = 0.8
    bumps: float = 0.06
    parts: int = 29

    def emptied(self, x: Array) -> Array:
        """The same places, but nobody is inside."""
        d = x - np.array(self.center)
        away = np.linalg.norm(d, axis=1)
        inside = away < self._size(d / away[:, None]) + SAGITTA
        x = x.copy()
        x[inside] += ((self.radius * (1 + self.bumps) + OUT - away) / away)[inside, None] * d[inside]
        return x

    def _size(self, way: Array) -> Array:
        """Distance from the centre to the vertices in some directions [m]."""
        return self.radius * (1 + self.bumps * np.sin(6 * way).prod(axis=1))

    @cached_property
    def mesh(self) -> tuple[Array, Any]:
        """Vertices [m] and faces, which look outwards: the squares of a cube's sides, blown up."""
        n = self.parts
        i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        u, v = np.stack([i, i + 1, i + 1, i], axis=1), np.stack([j, j, j + 1, j + 1], axis=1)
        squares = []
        for axis, side in product(range(3), (0, n)):
            corners = np.full((n * n, 4, 3), side)
            corners[..., (axis + 1) % 3], corners[..., (axis + 2) % 3] = u, v
            squares.append(corners if side else corners[:, ::-1])
        spots, index = np.unique(np.concatenate(squares).reshape(-1, 3), axis=0, return_inverse=True)
        quads = index.reshape(-1, 4)
        way = np.tan(np.pi / 4 * (2 * spots / n - 1))
        way /= np.linalg.norm(way, axis=1)[:, None]
        return np.array(self.center) + self._size(way)[:, None] * way, np.concatenate(
            [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        )

    @cached_property
    def cells(self) -> "Cells":
        """Which triangles may be nearest to the places in each cell."""
        vertices, faces = self.mesh
        return Cells(vertices[faces])

    def ours(self, **material: Any) -> Any:
        """As a collider of pointmass."""
        import pointmass as pm

        return pm.Mesh(self.mesh, **material)

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distances [m], shape (n,), and unit normals, shape (n, 3); inf and 0 for who is far away."""
        cells = self.cells
        gap, normal = np.full(len(x), np.inf, x.dtype), np.zeros_like(x)
        cell = cells.of(x)
        count = np.where(cell >= 0, cells.count[cell], 0)
        near = np.flatnonzero(count)
        if not len(near):
            return gap, normal
        count, first = count[near], cells.first[cell[near]]
        ends = np.cumsum(count)
        which = cells.which[np.arange(ends[-1]) + np.repeat(first - ends + count, count)]
        q, inner = apart(np.repeat(x[near], count, axis=0), *cells.corners.astype(x.dtype)[which].transpose(1, 0, 2))
        square = (q * q).sum(axis=1)
        least = np.repeat(np.minimum.reduceat(square, ends - count), count)
        first_of = np.flatnonzero(square == least)
        owner = np.repeat(np.arange(len(near)), count)[first_of]
        best = first_of[np.unique(owner, return_index=True)[1]]
        face = cells.normals.astype(x.dtype)[which[best]]
        along, size = (q[best] * face).sum(axis=1), np.sqrt(square[best])
        side = np.where(along < 0, -1, 1).astype(x.dtype)
        flat = inner[best] | (size == 0)
        gap[near] = np.where(flat, along, side * size)
        normal[near] = np.where(flat[:, None], face, side[:, None] * q[best] / np.where(flat, 1, size)[:, None])
        return gap, normal

    def taichi(self) -> Any:
        """A function of a place: the normal and the distance in one vector."""
        import taichi as ti

        cells = self.cells
        triangles = np.concatenate([cells.corners, cells.normals[:, None]], axis=1).astype(np.float32)
        corners, first, count, which = (
            ti.Vector.field(3, ti.f32, triangles.shape[:2]),
            *(ti.field(ti.i32, len(a)) for a in (cells.first, cells.count, cells.which)),
        )
        corners.from_numpy(triangles)
        for made, known in ((first, cells.first), (count, cells.count), (which, cells.which)):
            made.from_numpy(known.astype(np.int32))
        origin, shape = ti.Vector(cells.origin.tolist()), ti.Vector(cells.shape.tolist())

        @ti.func
        def nearest(p, a, b, c):
            """Away from the nearest point of a triangle, and whether that is inside (Ericson 2005, 5.1.5)."""
            ab, ac, ap, bp, cp = b - a, c - a, p - a, p - b, p - c
            d1, d2, d3, d4, d5, d6 = ab.dot(ap), ac.dot(ap), ab.dot(bp), ac.dot(bp), ab.dot(cp), ac.dot(cp)
            va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
            q, inner = ap, 0.0
            if d1 <= 0 and d2 <= 0:
                q = ap
            elif d3 >= 0 and d4 <= d3:
                q = bp
            elif vc <= 0 and d1 >= 0 and d3 <= 0:
                q = ap - d1 / (d1 - d3) * ab
            elif d6 >= 0 and d5 <= d6:
                q = cp
            elif vb <= 0 and d2 >= 0 and d6 <= 0:
                q = ap - d2 / (d2 - d6) * ac
            elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
                q = bp - (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b)
            else:
                q = ap - (vb * ab + vc * ac) / (va + vb + vc)
                inner = 1.0
            return ti.Vector([q[0], q[1], q[2], inner])

        @ti.func
        def distance(x):
            result = ti.Vector([0.0, 0.0, 0.0, 1e9])
            u = (x - origin) / CELL
            if u.min() >= 0 and u[0] < shape[0] and u[1] < shape[1] and u[2] < shape[2]:
                k = ti.cast(u, ti.i32)
                cell = (k[0] * shape[1] + k[1]) * shape[2] + k[2]
                least, inner, best = 1e9, 0.0, -1
                q = ti.Vector([0.0, 0.0, 0.0])
                for j in range(first[cell], first[cell] + count[cell]):
                    t = which[j]
                    found = nearest(x, corners[t, 0], corners[t, 1], corners[t, 2])
                    d = ti.Vector([found[0], found[1], found[2]])
                    if d.dot(d) < least:
                        least, inner, best, q = d.dot(d), found[3], t, d
                if best >= 0:
                    n = corners[best, 3]
                    along, size = q.dot(n), ti.sqrt(least)
                    gap = along
                    if inner == 0.0 and size > 0:
                        side = -1.0 if along < 0 else 1.0
                        gap, n = side * size, side * q / size
                    result = ti.Vector([n[0], n[1], n[2], gap])
            return result

        return distance


@dataclass(frozen=True)
class Cells:
    """Cells of space with lists of triangles: those that may be nearest to a place in the cell; none far from all.

    Attributes
    ----------
    corners : of the triangles [m], shape (t, 3, 3).
    normals : shape (t, 3).
    origin, shape : corner [m] and numbers of cells along the axes.
    first, count : where the list of each cell begins in `which`, and how long it is.
    which : numbers of triangles.
    """

    corners: Array
    normals: Array = field(init=False)
    origin: Array = field(init=False)
    shape: Any = field(init=False)
    first: Any = field(init=False)
    count: Any = field(init=False)
    which: Any = field(init=False)

    def __post_init__(self) -> None:
        from scipy.spatial import cKDTree

        a, b, c = self.corners.transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        low, high = self.corners.min(axis=(0, 1)) - 2 * DEEP, self.corners.max(axis=(0, 1)) + 2 * DEEP
        shape = np.ceil((high - low) / CELL).astype(np.intp)
        middles = low + CELL * (np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3) + 0.5)
        half = 0.5 * np.sqrt(3) * CELL  # from the middle of a cell to its corner
        centroids = self.corners.mean(axis=1)
        size = np.linalg.norm(self.corners - centroids[:, None], axis=2).max()
        tree = cKDTree(centroids)
        about = tree.query(middles)[0]
        near = np.flatnonzero(about - size < half + DEEP)
        far, which = tree.query(middles[near], MOST)

        def away(k: Any, columns: Any) -> Array:
            q = apart(middles[near[k]], *self.corners[which[k, columns]].transpose(1, 0, 2))[0]
            return np.sqrt((q * q).sum(axis=1))

        bound = away(np.arange(len(near)), 0) + 2 * half
        near, far, which, bound = (a[bound < 3 * half + DEEP + size] for a in (near, far, which, bound))
        assert (far[:, -1] - size > bound).all(), "the lists of triangles are too short"
        k, columns = np.nonzero(far - size <= bound[:, None])
        apiece = away(k, columns)
        least = np.minimum.reduceat(apiece, np.searchsorted(k, np.arange(len(near))))[k]
        keep = (least < half + DEEP) & (apiece <= least + 2 * half)
        owner, which = k, which[k, columns]
        counts = np.bincount(near[owner[keep]], minlength=len(middles))
        made = {"normals": normals / np.linalg.norm(normals, axis=1)[:, None], "origin": low, "shape": shape}
        made |= {"first": np.cumsum(counts) - counts, "count": counts, "which": which[keep]}
        for name, value in made.items():
            object.__setattr__(self, name, value)

    def of(self, x: Array) -> Any:
        """Cell of each place, -1 outside, shape (n,)."""
        u = (x - self.origin.astype(x.dtype)) * x.dtype.type(1 / CELL)
        inside = ((u >= 0) & (u < self.shape)).all(axis=1)
        k = np.where(inside[:, None], u, 0).astype(np.intp)
        return np.where(inside, (k[:, 0] * self.shape[1] + k[:, 1]) * self.shape[2] + k[:, 2], -1)


def apart(p: Array, a: Array, b: Array, c: Array) -> tuple[Array, Any]:
    """From the nearest point of each triangle to each place, and whether it is inside (Ericson 2005, 5.1.5)."""

    def dot(u: Array, v: Array) -> Array:
        return np.einsum("ij,ij->i", u, v)

    ab, ac, ap, bp, cp = b - a, c - a, p - a, p - b, p - c
    d1, d2, d3, d4, d5, d6 = dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    cases = [
        (d1 <= 0) & (d2 <= 0),
        (d3 >= 0) & (d4 <= d3),
        (vc <= 0) & (d1 >= 0) & (d3 <= 0),
        (d6 >= 0) & (d5 <= d6),
        (vb <= 0) & (d2 >= 0) & (d6 <= 0),
        (va <= 0) & (d4 - d3 >= 0) & (d5 - d6 >= 0),
    ]
    zero, one = np.zeros_like(d1), np.ones_like(d1)
    with np.errstate(divide="ignore", invalid="ignore"):
        edge = (d4 - d3) / (d4 - d3 + d5 - d6)
        s = np.select(cases, [zero, one, d1 / (d1 - d3), zero, zero, 1 - edge], vb / (va + vb + vc))
        t = np.select(cases, [zero, zero, zero, one, d2 / (d2 - d6), edge], vc / (va + vb + vc))
    return ap - s[:, None] * ab - t[:, None] * ac, ~np.any(cases, axis=0)
