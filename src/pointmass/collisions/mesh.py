"""A triangle mesh, from a file or from arrays."""

from __future__ import annotations

from pointmass.collisions.collider import Contact, Response
from pointmass.collisions.triangulated import Triangulated
from pointmass.errors import InvalidInput, number
from pointmass.laws.parameter import Vector
from pointmass.meshes import TriangleMesh, TriangleSource, as_mesh


class Mesh(Triangulated):
    """A surface of triangles, of any shape, such as a model from a file.

    A closed mesh is solid. An open one is a sheet with two sides, a thickness and a round rim.

    Parameters
    ----------
    mesh : the path of an `.obj`, `.ply`, `.stl`, `.glb`, `.gltf`, `.off`, `.vtp` or `.usd` file, or a pair (vertices
        [m], shape (n, 3); faces, three numbers of vertices each, shape (k, 3)). Vertices at the same place count as
        one.
    scale : the factor to metres, above 0.
    thickness : of an open mesh [m], at least eps; its triangles are in the middle.
    inside : whether the free space is inside of a closed mesh.
    shift : moves the whole mesh [m]; a function of t.
    restitution, friction, eps, contact, response : as for every collider.

    Raises
    ------
    InvalidInput
        A file that is missing, damaged or of another kind, no triangles, vertices that are not finite, `inside` of a
        mesh that is open.

    Notes
    -----
    Which side of a closed mesh a point is on is told by angle-weighted normals (Baerentzen & Aanaes 2005), and the
    nearest triangle is found in a tree of boxes.

    Examples
    --------
    >>> statue = pm.Mesh("statue.stl", scale=1e-3, shift=(0, 0.5, 0), friction=0.6)
    """

    def __init__(
        self,
        mesh: TriangleSource,
        *,
        scale: float = 1.0,
        thickness: float = 2e-3,
        inside: bool = False,
        shift: Vector = (0.0, 0.0, 0.0),
        restitution: float = 0.5,
        friction: float = 0.3,
        eps: float = 1e-4,
        contact: Contact = "swept",
        response: Response = "bounce",
    ) -> None:
        found = as_mesh(mesh)
        triangles = TriangleMesh(number("scale", scale, above=0) * found.vertices, found.faces)
        thickness = number("thickness", thickness, at_least=number("eps", eps, above=0, unit="m"), unit="m")
        if inside and not triangles.closed:
            raise InvalidInput(
                f"inside = True needs a closed mesh, but {triangles.open_edges} edges of this one do not lie between "
                "two triangles: close its holes, or leave inside out to make it a sheet"
            )
        half = 0.0 if triangles.closed else 0.5 * thickness
        super().__init__(triangles, inside, half, shift, restitution, friction, eps, contact, response)
