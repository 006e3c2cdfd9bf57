"""A triangle mesh that emits particles."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.emitters.emitter import Array
from pointmass.emitters.shaped import ShapedEmitter
from pointmass.emitters.solid import Solid
from pointmass.emitters.sphere import Where, check_where
from pointmass.errors import InvalidInput
from pointmass.meshes import TriangleMesh, TriangleSource, as_mesh

LEAST = 1e-3  # of the columns that hold a solid, inside of it


@dataclass(eq=False, repr=False)
class MeshEmitter(ShapedEmitter):
    """Particles evenly spread over the triangles of a mesh, whose normals are its normals, or over its inside.

    Parameters
    ----------
    mesh : the path of an `.obj`, `.ply`, `.stl`, `.glb`, `.gltf`, `.off`, `.vtp` or `.usd` file, or a pair (vertices
        [m], shape (n, 3); faces, shape (k, 3)). It is moved by `position`.
    where : "surface", or the "volume" of a closed mesh.

    Raises
    ------
    InvalidInput
        A file that is no mesh; the volume of a mesh that is open or nearly flat; the normal in a volume.

    Examples
    --------
    >>> pm.MeshEmitter((0, 1, 0), mesh="teapot.obj", direction="normal", speed=0.2, rate=5000)
    """

    _: KW_ONLY
    mesh: TriangleSource
    where: Where = "surface"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_where(self.where)
        self._mesh = as_mesh(self.mesh)
        self._solid: Solid | None = None
        if self.where == "volume":
            self._solid = self._inside(self._mesh)

    def _inside(self, mesh: TriangleMesh) -> Solid:
        if not mesh.closed:
            raise InvalidInput(
                f"where = 'volume' is not allowed for a mesh that is not closed ({mesh.open_edges} edges do not lie"
                " between two triangles): close it, or emit from its surface"
            )
        if self._axis is None and self.on != "impact":
            raise InvalidInput("direction = 'normal' is not allowed in the volume of a mesh: give numbers")
        solid = Solid(mesh) if np.ptp(mesh.vertices, axis=0).all() else None
        if solid is None or solid.filled < LEAST:
            raise InvalidInput("where = 'volume' is not allowed for a mesh that is nearly flat: emit from its surface")
        return solid

    def spot(self, u: Array) -> tuple[Array, Array]:
        return self._mesh.scattered(u[:, [0, 1, 3]])

    def places(self, seed: int, stream: str, ids: NDArray[np.int64]) -> tuple[Array, Array]:
        if self._solid is None:
            return super().places(seed, stream, ids)
        x, left, tries = np.zeros((len(ids), 3)), np.arange(len(ids)), 0
        while len(left):  # each birth draws for itself until it is inside
            u = [random.uniform(seed, stream, ids[left], f"place {tries}.{k}") for k in range(2)]
            x[left] = self._solid.places(np.concatenate(u, axis=1))
            left = left[~self._solid.holds(x[left])]
            tries += 1
        return x, np.zeros_like(x)
