"""A surface of triangles."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions.collider import Array, Contact, Response
from pointmass.collisions.looked_up import LookedUp
from pointmass.collisions.triangles import TriangleTree, outcome
from pointmass.collisions.voxels import Voxels
from pointmass.laws.parameter import Vector
from pointmass.meshes import TriangleMesh

NUMBERS = (  # of the shape
    *("HALF", "SIDE", "SMALL", "EXTENT", "COUNT", "LEAVES"),
    *("TRIANGLES", "NORMALS", "BOUNDS", "HINTS"),  # where they begin in the data, behind the boxes of the tree
    *("CUBES", "", "", "CUBE", "ALONG", "", "", "RIM"),
)
SMALL = 1e-9  # of the extent of the mesh: nearer than that, a point has no direction from an edge


class Triangulated(LookedUp):
    """The skin of a solid, or a sheet with two sides, made of triangles: see `Mesh` and `HeightField`.

    Attributes
    ----------
    triangles : relative to the place.
    sign : 1 if the free space is outside, -1 if it is inside.
    half : half the thickness of a sheet [m], 0 for a solid.
    """

    lookup: ClassVar[str] = "triangles"
    place: ClassVar[str] = "shift"

    def __init__(
        self,
        triangles: TriangleMesh,
        inside: bool,
        half: float,
        shift: Vector,
        restitution: float,
        friction: float,
        eps: float,
        contact: Contact,
        response: Response,
    ) -> None:
        super().__init__(shift, restitution, friction, eps, contact, response)
        self.triangles = triangles
        self.sign = -1.0 if inside else 1.0
        self.half = half
        self.tree = TriangleTree(triangles)
        self.voxels = Voxels(self.tree.corners, self.local_distance, half)
        tree, cubes = self.tree, self.voxels
        blocks = (tree.boxes, tree.numbers, tree.normals, cubes.bounds, cubes.hints)
        self._starts = np.cumsum([b.size for b in blocks])[:-1]
        self.data = np.concatenate([b.ravel().astype(np.float64) for b in blocks])

    @property
    def shape(self) -> tuple[float, ...]:
        """`NUMBERS`."""
        tree, cubes = self.tree, self.voxels
        rim = cubes.size - self.half if self.sign > 0 else -np.inf
        return (
            *(self.half, self.sign, SMALL * tree.extent, tree.extent, len(tree.corners), tree.leaves),
            *self._starts.tolist(),
            *(*cubes.origin.tolist(), 1 / cubes.size, *cubes.counts.tolist(), rim),
        )

    def look(self, x: Array) -> tuple[Array, Array]:
        square, q, feature, which = self.tree.nearest(x)
        normals = self.tree.normals[which, feature.astype(np.intp)]
        numbers = (self.half, self.sign, SMALL * self.tree.extent)
        distance, *normal = outcome().columns(*q.T, square, feature, *normals.T, *numbers)
        return distance, np.stack(normal, axis=1)

    @cached_property
    def detail(self) -> float:
        """Half the median edge, unless the whole solid is convex."""
        if self.sign > 0 and self.triangles.convex:
            return np.inf
        sides = self.triangles.corners - np.roll(self.triangles.corners, 1, axis=1)
        return 0.5 * float(np.median(np.linalg.norm(sides, axis=2)))

    def mesh(self, size: float) -> tuple[Array, NDArray[np.int32]]:
        faces = self.triangles.faces.astype(np.int32)
        if self.half:
            return _plate(self.triangles, self.half)
        return self.triangles.vertices, faces


def _plate(sheet: TriangleMesh, half: float) -> tuple[Array, NDArray[np.int32]]:
    """Both sides of a sheet and its rim."""
    n = len(sheet.vertices)
    lift = np.zeros_like(sheet.vertices)
    np.add.at(lift, sheet.faces, (sheet.areas[:, None] * sheet.normals)[:, None])
    size = np.linalg.norm(lift, axis=1, keepdims=True)
    lift = half * lift / np.where(size > 0, size, 1)
    _, which = sheet.edges
    single = np.bincount(which.ravel())[which] == 1
    begin, end = sheet.faces[single], np.roll(sheet.faces, -1, axis=1)[single]
    rim = [[begin, begin + n, end], [end, begin + n, end + n]]
    faces = [sheet.faces, sheet.faces[:, ::-1] + n, *(np.stack(f, axis=1) for f in rim)]
    return np.concatenate([sheet.vertices + lift, sheet.vertices - lift]), np.concatenate(faces).astype(np.int32)
