"""Cloth in the form of any triangle mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import Body, body, pin_parts
from pointmass.bodies.materials import made_of
from pointmass.errors import InvalidInput, finite_array, number
from pointmass.forces.hinges import Hinges
from pointmass.forces.springs import Springs
from pointmass.meshes import TriangleMesh, TriangleSource, as_mesh
from pointmass.particles import Particles

Ids = NDArray[np.int64]
LEVEL = 1e-6  # of the mesh's size: vertices this near to the highest one are as high


@body
def cloth_from_mesh(
    mesh: TriangleSource,
    *,
    scale: float = 1.0,
    shift: Any = (0.0, 0.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    material: str = "cotton",
    density: float | None = None,
    stretch: float | None = None,
    bend: float | None = None,
    damping_ratio: float | None = None,
    radius: float | None = None,
    pinned: Any = "none",
) -> Body:
    """A mass at each vertex, a spring along each edge ("stretch"), and a hinge across each edge of two triangles.

    Vertices at the same place are one, vertices of no triangle and triangles without area are left out. The form of
    the mesh is the one without force.

    Parameters
    ----------
    mesh : the path of a file, a pair (vertices [m], faces), or a mesh; see `pointmass.meshes.read_mesh`.
    scale, shift : of its vertices, after which `shift` is added [m].
    velocity : at the start [m/s].
    material : cotton, silk, denim, leather or rubber, which has the values that are not given below.
    density : mass of an area [kg/m^2]; a vertex has a third of each of its triangles.
    stretch : tension for each unit of strain [N/m], that is newtons for each metre of width.
    bend : bending stiffness B [N m].
    damping_ratio : of one spring and one hinge between two of the masses, 1 = critical.
    radius : of a particle [m], its distance from what it lies on; a quarter of the mean edge by default.
    pinned : what is held: "top", "bottom" (the highest and the lowest vertices), "border" (edges of one triangle), a
        list of such names or of numbers of vertices, or "none". Particles have groups of these names.

    Raises
    ------
    InvalidInput
        A mesh that cannot be read, or where more than two triangles share an edge; a number that is not allowed.

    Notes
    -----
    An edge of the length e between triangles of the area A in sum has the stiffness `stretch` A / e^2 (Van Gelder, J.
    Graphics Tools 3 (1998), no. 2): exact for equilateral triangles, where it makes a sheet of the Young's modulus
    `stretch` and the Poisson's ratio 1/3. A hinge has B e^2 / A, see `Hinges`.
    """
    found = as_mesh(mesh)
    size = number("scale", scale, above=0)
    found = TriangleMesh(size * found.vertices + finite_array("shift", shift, (3,)), found.faces, found.uv)
    made = made_of(material, density=density, stretch=stretch, bend=bend, damping_ratio=damping_ratio)
    pairs, which = found.edges
    area = np.bincount(which.ravel(), np.repeat(found.areas, 3), len(pairs))
    shared = np.bincount(which.ravel(), minlength=len(pairs))
    _check_edges(found, pairs, shared)
    length = np.linalg.norm(np.diff(found.vertices[pairs], axis=1)[:, 0], axis=1)
    mass = made.density * np.bincount(found.faces.ravel(), np.repeat(found.areas, 3), len(found.vertices)) / 3
    thick = 0.25 * float(length.mean()) if radius is None else number("radius", radius, at_least=0, unit="m")
    particles = Particles(found.vertices, velocity, mass, thick)
    _tag(particles, pairs[shared == 1], pinned)
    particles.cover("cloth", found.faces, found.uv)
    inverse = 1 / mass
    k = made.stretch * area / length**2
    k_d = 2 * made.damping_ratio * np.sqrt(k / inverse[pairs].sum(axis=1))
    forces: list[Any] = [Springs(pairs, k, k_d, length, family="stretch")]
    inner = np.flatnonzero(shared == 2)
    if made.bend > 0 and len(inner):
        hinges = _hinges(found, inner)
        stiffness = made.bend * length[inner] ** 2 / area[inner]
        places = found.vertices[hinges]
        mobility = ((Hinges.slopes(places) ** 2).sum(axis=2) * inverse[hinges]).sum(axis=1)
        rate = 2 * made.damping_ratio * np.sqrt(stiffness / mobility)
        forces.append(Hinges(hinges, stiffness, rate, Hinges.at(places)))
    return Body(particles, forces)


def _check_edges(mesh: TriangleMesh, pairs: Ids, shared: NDArray[np.integer[Any]]) -> None:
    if (shared > 2).any():
        edge = int(np.argmax(shared > 2))
        a, b = (", ".join(f"{c:.4g}" for c in mesh.vertices[end]) for end in pairs[edge])
        raise InvalidInput(
            f"the mesh has {int((shared > 2).sum())} edges that more than two triangles share, such as that of "
            f"{shared[edge]} triangles from ({a}) to ({b}) [m]: a cloth has one or two at each edge"
        )


def _hinges(mesh: TriangleMesh, inner: Ids) -> Ids:
    """Ends of the edges of two triangles, and the opposite corner of each, shape (k, 4)."""
    pairs, which = mesh.edges
    order = np.argsort(which, axis=None, kind="stable")
    start = np.searchsorted(which.ravel()[order], inner)
    opposite = [mesh.faces.ravel()[_across(order[start + k])] for k in (0, 1)]
    return np.stack([*pairs[inner].T, *opposite], axis=1)


def _across(side: Ids) -> Ids:
    """Which corner, counted over all faces, lies opposite a side, counted likewise; side 0 is from corner 0 to 1."""
    return 3 * (side // 3) + (side + 2 - 3 * (side // 3)) % 3


def _tag(particles: Particles, border: Ids, pinned: Any) -> None:
    """Make groups of what has a name, and pin."""
    y = particles.x[:, 1]
    near = LEVEL * float(np.ptp(particles.x, axis=0).max())
    particles.tag("top", y >= y.max() - near)
    particles.tag("bottom", y <= y.min() + near)
    particles.tag("border", np.unique(border))
    if isinstance(pinned, str) or (isinstance(pinned, (list, tuple)) and all(isinstance(name, str) for name in pinned)):
        pin_parts(particles, pinned)
    else:
        particles.pin(pinned)
