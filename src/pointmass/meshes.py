"""Triangle meshes: read from files, checked, and cleaned of what is no surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput, finite_array, floats, reading, shown
from pointmass.foreign import last_time, open_stage, poly_data, shown_prims, shown_scene, to_world
from pointmass.libraries import check_library

Vertices = NDArray[np.float64]
Faces = NDArray[np.int64]
SAME = 1e-9  # of a mesh's size: vertices nearer to each other are one
FLAT = 1e-12  # of the square of its longest edge: a triangle of less area is none
FILLED = 1 - 1e-9  # of the volume of its convex hull: a mesh that fills as much is convex


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles that share vertices.

    Attributes
    ----------
    vertices : [m], shape (n, 3), no two of them at the same place.
    faces : the three vertices of each triangle, shape (k, 3), counter-clockwise seen from its outer side.
    uv : place of each corner on a flat pattern, if the mesh has one, shape (k, 3, 2).
    """

    vertices: Vertices
    faces: Faces
    uv: NDArray[np.float64] | None = None

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Places of the corners of each triangle [m], shape (k, 3, 3): triangle, corner, axis."""
        return self.vertices[self.faces]

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """Area of each triangle [m^2], shape (k,)."""
        result: NDArray[np.float64] = 0.5 * np.linalg.norm(_across(self.corners), axis=1)
        return result

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        """Outer unit normal of each triangle, shape (k, 3)."""
        across = _across(self.corners)
        result: NDArray[np.float64] = across / np.linalg.norm(across, axis=1)[:, None]
        return result

    @cached_property
    def _summed(self) -> NDArray[np.float64]:
        return np.cumsum(self.areas)

    def scattered(self, u: NDArray[np.floating[Any]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places that are even over the surface [m], and the unit normals there, shape (k, 3) each.

        Parameters
        ----------
        u : random numbers in [0, 1), shape (k, 3): two for the place in a triangle, one for which.
        """
        last = len(self._summed) - 1
        which = np.minimum(np.searchsorted(self._summed, u[:, 2] * self._summed[-1], side="right"), last)
        a, b, c = np.moveaxis(self.corners[which], 1, 0)
        root, along = np.sqrt(u[:, :1]), u[:, 1:2]
        return (1 - root) * a + root * ((1 - along) * b + along * c), self.normals[which]

    @cached_property
    def edges(self) -> tuple[Faces, Faces]:
        """The edges, shape (e, 2), and for each triangle those from corner 0 to 1, 1 to 2 and 2 to 0, shape (k, 3)."""
        ends = np.sort(_sides(self.faces).reshape(-1, 2), axis=1)
        pairs, which = np.unique(ends, axis=0, return_inverse=True)
        return pairs, which.reshape(-1, 3)

    @cached_property
    def closed(self) -> bool:
        """Whether it bounds a solid: every edge belongs to two triangles, which run along it in opposite directions."""
        return self.open_edges == 0 and bool((self._runs == 0).all())

    @cached_property
    def open_edges(self) -> int:
        """How many edges belong to another number of triangles than two."""
        _, which = self.edges
        return int((np.bincount(which.ravel()) != 2).sum())

    @cached_property
    def volume(self) -> float:
        """Volume [m^3] inside of a closed mesh, below 0 where its triangles face inwards."""
        a, b, c = np.moveaxis(self.corners - self.vertices.mean(axis=0), 1, 0)
        return float((a * np.cross(b, c)).sum() / 6)

    @cached_property
    def convex(self) -> bool:
        """Whether it bounds one convex solid: it fills its convex hull."""
        from scipy.spatial import ConvexHull

        return self.closed and abs(self.volume) > FILLED * float(ConvexHull(self.vertices).volume)

    @cached_property
    def _runs(self) -> NDArray[np.int64]:
        """For each edge the triangles that run along it upwards in the order of the vertices, less those downwards."""
        pairs, which = self.edges
        way = np.where(np.diff(_sides(self.faces), axis=2)[:, :, 0] > 0, 1, -1)
        return np.bincount(which.ravel(), way.ravel(), len(pairs)).astype(np.int64)


TriangleSource = str | Path | tuple[Any, Any] | tuple[Any, Any, Any] | TriangleMesh  # what `as_mesh` takes


def read_mesh(path: str | Path) -> TriangleMesh:
    """Read the triangles of a file, all its parts together.

    Vertices at the same place become one, triangles without area are left out, and of a mesh that is closed all
    triangles are turned to face outwards.

    Parameters
    ----------
    path : `.obj`, `.ply`, `.stl`, `.glb`, `.gltf`, `.off`, `.vtp`, `.usd`, `.usda` or `.usdc`. Larger polygons are cut
        into triangles. Lengths are taken as [m], and the file's y axis is up, unless it is of USD and says something
        else. Of a USD stage all meshes are taken that are seen in its last frame.

    Raises
    ------
    InvalidInput
        No such file, a file of another kind or cut off, a library that is not installed, no triangles in it, a vertex
        that is not finite, a name of a file outside of its folder.
    """
    with reading("mesh", path, tuple(READERS)) as file:
        suffix = file.suffix.lower()
        check_library("reading", suffix)
        vertices, faces, uv = READERS[suffix](file)
        if len(faces) == 0:
            raise InvalidInput("it holds no triangles")
        return triangle_mesh(vertices, faces, uv)


def triangle_mesh(vertices: Any, faces: Any, uv: Any = None) -> TriangleMesh:
    """Check triangles given as arrays, and clean them in the same way as `read_mesh`.

    Parameters
    ----------
    vertices : [m], shape (n, 3).
    faces : three of the vertices' numbers for each triangle, shape (k, 3).
    uv : place on a flat pattern of each vertex, shape (n, 2), or of the corners of faces, shape (k, 3, 2) or (k, 6).

    Raises
    ------
    InvalidInput
        Another shape, a vertex that is not finite, a face with a vertex that does not exist, no triangle with an area.
    """
    points = finite_array("vertices of a mesh", vertices, (None, 3))
    corners = _numbers(faces, len(points))
    pattern = None if uv is None else _pattern(uv, len(points), corners)
    points, corners = _merged(points, corners)
    solid = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    solid &= ~_flat(points[corners])
    corners, pattern = corners[solid], None if pattern is None else pattern[solid]
    if len(corners) == 0:
        raise InvalidInput("a mesh needs at least one triangle whose area is not 0")
    used, corners = np.unique(corners, return_inverse=True)
    return _facing_outwards(TriangleMesh(points[used], corners.reshape(-1, 3).astype(np.int64), pattern))


def as_mesh(mesh: Any) -> TriangleMesh:
    """A mesh as it is, read from its path, or made of (vertices, faces) or (vertices, faces, uv)."""
    if isinstance(mesh, TriangleMesh):
        return mesh
    if isinstance(mesh, (str, Path)):
        return read_mesh(mesh)
    if isinstance(mesh, (tuple, list)) and len(mesh) in (2, 3):
        return triangle_mesh(*mesh)
    raise InvalidInput(
        f"a mesh must be the path of a file or a pair (vertices, faces), or (vertices, faces, uv), not {shown(mesh)}"
    )


Contents = tuple[Any, Any, Any]  # vertices, triangles, and places on the pattern or None, as they stand in a file


def _by_trimesh(file: Path) -> Contents:
    found = shown_scene(file).to_mesh()
    uv = getattr(found.visual, "uv", None)
    if uv is not None and np.asarray(uv).shape != (len(found.vertices), 2):
        uv = None
    return np.asarray(found.vertices), np.asarray(found.faces), uv


def _vtp(file: Path) -> Contents:
    from vtkmodules.util import numpy_support

    array_of: Any = numpy_support.vtk_to_numpy
    found = poly_data(file)
    cells = found.GetPolys()
    corners, offsets = array_of(cells.GetConnectivityArray()), array_of(cells.GetOffsetsArray())
    points = np.zeros((0, 3)) if found.GetPoints() is None else array_of(found.GetPoints().GetData())
    places = found.GetPointData().GetTCoords()
    uv = None if places is None or places.GetNumberOfComponents() != 2 else array_of(places)
    return points, corners[_fans(np.diff(offsets), len(corners))], uv


def _usd(file: Path) -> Contents:
    from pxr import UsdGeom

    stage = open_stage(file)
    time = last_time(stage)
    parts = [_usd_mesh(stage, prim, time) for prim in shown_prims(stage, UsdGeom.Mesh, time)]
    if not parts:
        raise InvalidInput("it holds no triangles")
    before = np.cumsum([0, *(len(points) for points, *_ in parts)])
    faces = [corners + first for (_, corners, _), first in zip(parts, before, strict=False)]
    uvs = [np.zeros((len(corners), 3, 2)) if uv is None else uv for _, corners, uv in parts]
    patterned = any(uv is not None for *_, uv in parts)
    points = np.concatenate([points for points, *_ in parts])
    return points, np.concatenate(faces), np.concatenate(uvs) if patterned else None


def _usd_mesh(stage: Any, mesh: Any, time: Any) -> Contents:
    """A mesh where it stands in the world."""
    from pxr import UsdGeom

    attributes = (mesh.GetPointsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetFaceVertexCountsAttr())
    points, corners, counts = (np.array([] if (value := a.Get(time)) is None else value) for a in attributes)
    corners = corners.astype(np.int64)
    turn, shift = to_world(stage, mesh, time)
    fans = _fans(counts.astype(np.int64), len(corners))
    if (mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded) != (np.linalg.det(turn) < 0):
        fans = fans[:, ::-1]
    uv = _usd_pattern(mesh, time)
    if uv is not None and len(uv) == len(corners):
        uv = uv[fans]
    elif uv is not None:
        uv = uv[corners[fans]]
    return points.reshape(-1, 3) @ turn + shift, corners[fans], uv


def _usd_pattern(mesh: Any, time: Any) -> NDArray[np.float64] | None:
    """Places of all corners, or else of all points, on the first pattern of a mesh."""
    from pxr import Sdf, UsdGeom

    kinds = (Sdf.ValueTypeNames.TexCoord2fArray, Sdf.ValueTypeNames.TexCoord2dArray, Sdf.ValueTypeNames.TexCoord2hArray)
    many = (UsdGeom.Tokens.faceVarying, UsdGeom.Tokens.vertex, UsdGeom.Tokens.varying)
    for primvar in UsdGeom.PrimvarsAPI(mesh).GetPrimvarsWithValues():
        if primvar.GetTypeName() in kinds and primvar.GetInterpolation() in many:
            return np.array(primvar.ComputeFlattened(time), np.float64).reshape(-1, 2)
    return None


def _fans(counts: NDArray[np.int64], total: int) -> Faces:
    """Polygons cut into triangles from their first corners, as numbers of corners, shape (k, 3).

    Parameters
    ----------
    counts : of the corners of each polygon, one after another; there are `total`.
    """
    if not ((counts >= 0) & (counts <= total)).all() or counts.sum() != total:  # a sum of huge ones may wrap around
        raise InvalidInput("its polygons have other corners than it says")
    first, triangles = np.cumsum(counts) - counts, np.maximum(counts - 2, 0)
    which = np.repeat(np.arange(len(counts)), triangles)
    along = np.arange(len(which)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    fans: Faces = first[which, None] + np.stack([0 * along, along + 1, along + 2], axis=1)
    return fans


READERS: dict[str, Callable[[Path], Contents]] = {
    **dict.fromkeys((".obj", ".ply", ".stl", ".glb", ".gltf", ".off"), _by_trimesh),
    ".vtp": _vtp,
    **dict.fromkeys((".usd", ".usda", ".usdc"), _usd),
}


def _numbers(faces: Any, count: int) -> Faces:
    """Numbers of vertices, each of them below `count`."""
    array = floats(faces)
    if array is None or array.ndim != 2 or array.shape[1] != 3 or (array != np.floor(array)).any():
        raise InvalidInput(f"faces of a mesh must be whole numbers of shape (k, 3), not {shown(faces)}")
    wrong = np.flatnonzero(~((array >= 0) & (array < count)).all(axis=1))
    if len(wrong):
        k = int(wrong[0])
        raise InvalidInput(
            f"face {k} of a mesh has the vertices {array[k].astype(int).tolist()}: they are numbered 0 to {count - 1}"
        )
    return array.astype(np.int64)


def _pattern(uv: Any, count: int, faces: Faces) -> NDArray[np.float64]:
    """Places of the corners of faces, shape (k, 3, 2), from those of vertices or of corners."""
    given = floats(uv)
    if given is not None and given.shape[0:1] == (len(faces),) and given.size == 6 * len(faces) and given.ndim > 1:
        return finite_array("uv of a mesh", given.reshape(-1, 3, 2), (len(faces), 3, 2))
    return finite_array("uv of a mesh", uv, (count, 2))[faces]


def _merged(points: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """The same with one vertex for those at the same place; a file of STL has its own three for each triangle."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(points) == 0:
        return points, faces
    exact, which = np.unique(points + 0.0, axis=0, return_inverse=True)  # + 0.0 makes of -0 a 0
    faces = which.ravel()[faces]
    near = cKDTree(exact).query_pairs(SAME * float(np.ptp(exact, axis=0).max()), output_type="ndarray")
    if len(near) == 0:
        return exact, faces
    links = coo_matrix((np.ones(len(near), bool), near.T), (len(exact), len(exact)))
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    return exact[first], group[faces].astype(np.int64)


def _across(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normals of triangles, twice as long as their areas."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _flat(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which triangles have no area."""
    longest = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2).max(axis=1, initial=0)
    flat: NDArray[np.bool_] = np.linalg.norm(_across(corners), axis=1) <= 2 * FLAT * longest
    return flat


def _sides(faces: Faces) -> Faces:
    """Both ends of the sides of each triangle, in its direction, shape (k, 3, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)


def _facing_outwards(mesh: TriangleMesh) -> TriangleMesh:
    """A closed mesh with all triangles turned so that their normals point out of the solid; an open one as it is.

    Both sides of every triangle are nodes of a graph; sides that look the same way over a common edge are linked, and
    each surface then has two components.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if mesh.open_edges:
        return mesh
    if not mesh.closed:
        k = len(mesh.faces)
        _, which = mesh.edges
        two = np.argsort(which, axis=None, kind="stable").reshape(-1, 2) // 3
        against = np.abs(mesh._runs) == 2
        a, b = two[:, 0], two[:, 1]
        links = np.concatenate([[a, b + k * against], [a + k, b + k * ~against]], axis=1)
        _, label = connected_components(coo_matrix((np.ones(links.shape[1], bool), links), (2 * k, 2 * k)), False)
        if (label[:k] == label[k:]).any():
            return mesh  # one-sided, such as a Klein bottle
        count = np.bincount(label[:k], minlength=label.max() + 1)
        turn = count[label[:k]] < count[label[k:]]
        turn |= (count[label[:k]] == count[label[k:]]) & (label[:k] > label[k:])
        mesh = _turned(mesh, turn)
    return _turned(mesh, np.ones(len(mesh.faces), bool)) if mesh.volume < 0 else mesh


def _turned(mesh: TriangleMesh, turn: NDArray[np.bool_]) -> TriangleMesh:
    """The mesh with some of its triangles facing the other way."""
    uv = None if mesh.uv is None else np.where(turn[:, None, None], mesh.uv[:, ::-1], mesh.uv)
    return TriangleMesh(mesh.vertices, np.where(turn[:, None], mesh.faces[:, ::-1], mesh.faces), uv)
