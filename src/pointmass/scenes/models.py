"""Simple models for scenes, made of triangles: each is closed, faces outwards and stands on y = 0."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.collisions import Mesh
from pointmass.errors import InvalidInput
from pointmass.meshes import as_mesh

Model = tuple[NDArray[np.float64], NDArray[np.int64]]  # vertices [m], shape (n, 3), and faces, shape (k, 3)
TIERS, POINTS = 7, 7  # of branches, and the points of each
HOLLOW = 0.86  # of the radius between two points, relative to theirs
TABLE_SIDES = 48
TABLE = (  # radii and heights of a table from the middle of its foot to the middle of its top, relative to its height
    *((0.0, 0.0), (0.38, 0.0), (0.38, 0.02), (0.3, 0.05), (0.07, 0.1), (0.05, 0.5), (0.07, 0.9), (0.5, 0.94)),
    *((0.54, 0.955), (0.55, 0.97), (0.54, 0.987), (0.52, 1.0), (0.0, 1.0)),
)


def fir(height: float, root: float, steep: float = 0.9) -> Model:
    """A fir of tiers of branches, star-shaped and each `steep`, the tangent of its angle, where it points.

    Parameters
    ----------
    height : of its top [m].
    root : how far its trunk reaches below y = 0 [m].
    """
    outer = np.linspace(1.0, 0.22, TIERS)
    inner = np.append(0.45 * outer[1:], 0.0)
    rise = np.cumsum(steep * (outer - inner))
    trunk = 0.12 * rise[-1]
    radii = [0.0, 0.12, 0.12, *np.stack([outer, inner], axis=1).ravel()[:-1], 0.0]
    heights = [0.0, 0.0, trunk, *(trunk + np.append(0.0, np.repeat(rise, 2)[:-1]))]
    size = height / heights[-1]
    star = np.where(np.arange(2 * POINTS) % 2, HOLLOW, 1.0)
    vertices, faces = _revolved(size * np.array(radii), size * np.array(heights), star)
    vertices[vertices[:, 1] <= 0, 1] = -root
    return vertices, faces


def house(height: float, root: float, steep: float = 0.7) -> Model:
    """A house with a gable roof, whose ridge is along z, and a chimney.

    Parameters
    ----------
    height : of the ridge [m].
    root : how far its walls reach below y = 0 [m].
    steep : tangent of the angle of the roof.
    """
    wall, eaves, thick = 0.62 * height, 0.2 * height, 0.08 * height  # half the width, what overhangs, the roof
    under = height - thick - steep * wall  # where a wall meets the roof
    half = [(wall, -root), (wall, under), (wall + eaves, under - steep * eaves)]
    half += [(wall + eaves, under - steep * eaves + thick)]
    outline = [*half, (0.0, height), *((-x, y) for x, y in reversed(half))]
    body = _prism(outline, (0.0, height - 0.5 * thick), 0.8 * height)
    side, x = 0.1 * height, 0.35 * height
    square = [(x - side, 0.5 * height), (x + side, 0.5 * height), (x + side, 1.12 * height), (x - side, 1.12 * height)]
    return together(body, moved(_prism(square, (x, height), side), (0.0, 0.0, -0.3 * height)))


def table(height: float) -> Model:
    """A round table on one leg.

    Parameters
    ----------
    height : of its top [m]; its radius is 0.55 of that.
    """
    profile = np.array(TABLE)
    around = np.ones(TABLE_SIDES)
    vertices, faces = _revolved(height * profile[:, 0], height * profile[:, 1], around)
    return np.round(vertices, 4), faces


def of_file(parameter: str, path: str, tall: float, foot: float = 0.0, **surface: Any) -> Mesh:
    """The mesh of a file, scaled, with its middle at x = z = 0.

    Parameters
    ----------
    parameter : that names the file, for messages.
    tall : height that it gets [m].
    foot : height at which it stands [m].
    surface : such as its friction.

    Raises
    ------
    InvalidInput
        It cannot be read, or is flat.
    """
    corners = as_mesh(path).vertices
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not high[1] > low[1]:
        raise InvalidInput(f"{parameter} = {path!r} is not allowed: the mesh is flat, and has no height to scale")
    scale = float(tall / (high[1] - low[1]))
    x, y, z = (-scale * p for p in (0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])))
    return Mesh(path, scale=scale, shift=(float(x), float(y) + foot, float(z)), **surface)


def moved(model: Model, shift: ArrayLike) -> Model:
    """The same at another place [m]."""
    vertices, faces = model
    return vertices + np.asarray(shift), faces


def turned(model: Model, angle: float) -> Model:
    """The same turned about the y axis [rad]."""
    vertices, faces = model
    c, s = np.cos(angle), np.sin(angle)
    return vertices @ np.array([(c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c)]), faces


def together(*models: Model) -> Model:
    """Models as one, to a tenth of a millimetre."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in models)])
    faces = [faces + start for (_, faces), start in zip(models, starts, strict=False)]
    return np.round(np.concatenate([vertices for vertices, _ in models]), 4), np.concatenate(faces)


def _revolved(radii: NDArray[np.float64], heights: NDArray[np.float64], star: NDArray[np.float64]) -> Model:
    """A profile turned about the y axis, from the bottom at radius 0 to the top at radius 0; `star` are factors."""
    n, rings = len(star), len(radii) - 2
    angle = 2 * np.pi * np.arange(n) / n
    around = np.stack([star * np.cos(angle), np.zeros(n), star * np.sin(angle)], axis=1)
    vertices = radii[1:-1, None, None] * around + heights[1:-1, None, None] * np.array((0.0, 1.0, 0.0))
    ends = [(0.0, heights[0], 0.0), (0.0, heights[-1], 0.0)]
    a = np.arange(rings * n).reshape(rings, n)
    b = np.roll(a, -1, axis=1)
    bottom, top = np.full(n, rings * n), np.full(n, rings * n + 1)
    faces = [(bottom, a[0], b[0]), (top, b[-1], a[-1]), (a[:-1], a[1:], b[:-1]), (b[:-1], a[1:], b[1:])]
    return np.concatenate([vertices.reshape(-1, 3), ends]), _faces(faces)


def _prism(outline: list[tuple[float, float]], middle: tuple[float, float], half: float) -> Model:
    """An outline in x and y, counter-clockwise, from z = -half to half; its ends are fans around their middle."""
    n = len(outline)
    flat = np.array([*outline, middle])
    vertices = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (-half, half)])
    a, m = np.arange(n), np.full(n, n)
    b = np.roll(a, -1)
    c, d = a + n + 1, b + n + 1
    return vertices, _faces([(m, b, a), (m + n + 1, c, d), (a, b, c), (b, d, c)])


def _faces(parts: Sequence[tuple[NDArray[np.int64], ...]]) -> NDArray[np.int64]:
    return np.concatenate([np.stack([p.ravel() for p in part], axis=1) for part in parts])
