"""A shadow map: how far the key light reaches, seen from the light without perspective."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pointmass.render.bands import each
from pointmass.render.camera import View, turn
from pointmass.render.tables import F32, F64, OPAQUE, Table

TEXELS = 1024  # side of the map
BAND = 64  # rows that one thread draws at a time
MARGIN = 6  # free texels around it
GROWTH = 1.25  # the map's extent is a power of this, so that shadows do not crawl when the scene breathes
MANY = 1000  # larger clouds are measured by their percentiles, too
THINNEST = 0.75  # casters are at least this wide [texels]


@dataclass(frozen=True, eq=False)
class Shadow:
    """The map, and how to look into it.

    Attributes
    ----------
    depth : distance from the light's plane to the nearest caster [texels], inf where there is none; (0, 0) = no map.
    matrix : view coordinates [m] to column, row and depth of the map [texels], shape (3, 4).
    """

    depth: F32
    matrix: F32


@dataclass(frozen=True, eq=False)
class Casters:
    """What throws shadows, in view coordinates [m].

    Attributes
    ----------
    faces : corners of triangles, shape (k, 3, 3).
    balls : centre and radius, shape (k, 4).
    capsules : both ends and both radii, shape (k, 8).
    static : no part of the particles: in the map only as far as it is near them.
    """

    faces: F64
    balls: F64
    capsules: F64
    static: bool

    def spots(self) -> F64:
        """Points that span the casters, shape (n, 3)."""
        return np.concatenate([self.faces.reshape(-1, 3), self.balls[:, :3], self.capsules[:, :6].reshape(-1, 3)])


def no_shadow() -> Shadow:
    """Light everywhere."""
    return Shadow(np.zeros((0, 0), np.float32), np.zeros((3, 4), np.float32))


def casters(meshes: Table, balls: Table, capsules: Table, view: View, static: bool) -> Casters:
    """What of the tables throws shadows: opaque, and not a glow."""
    rows = meshes.rows[meshes.solid].astype(np.float64)
    z = 1.0 / rows[:, 6:9]
    faces = np.empty((len(rows), 3, 3))
    faces[:, :, 0] = (rows[:, 0:6:2] - 0.5 * view.width) / view.focal * z
    faces[:, :, 1] = (0.5 * view.height - rows[:, 1:6:2]) / view.focal * z
    faces[:, :, 2] = z
    round_ones = balls.rows[(balls.rows[:, 7] >= OPAQUE) & ~balls.adds, :4].astype(np.float64)
    opaque = (np.minimum(capsules.rows[:, 15], capsules.rows[:, 19]) >= OPAQUE) & ~capsules.adds
    return Casters(faces, round_ones, capsules.rows[opaque, :8].astype(np.float64), static)


def shadow(all_casters: list[Casters], light: F64) -> Shadow:
    """The map of these casters for a unit vector `light` towards the light, in view coordinates."""
    spots = [c.spots() for c in all_casters if not c.static]
    if not any(len(s) for s in spots):
        spots = [c.spots() for c in all_casters]
    found = np.concatenate(spots) if spots else np.zeros((0, 3))
    if not len(found):
        return no_shadow()
    axes = light_axes(light)
    placed = turn(found, axes)
    low, high = bounds(placed)
    widest = max((float(c.balls[:, 3].max()) for c in all_casters if len(c.balls)), default=0.0)
    extent = max(float((high - low)[:2].max()) * 1.1 + 2.0 * widest, 1e-9)
    extent = GROWTH ** math.ceil(math.log(extent, GROWTH))
    scale = (TEXELS - 2 * MARGIN) / extent
    origin = np.round(0.5 * (low + high)[:2] * scale) - TEXELS // 2
    shift = np.array((origin[0], origin[1], 0.0))
    matrix = np.concatenate((axes * scale, -shift[:, None]), axis=1).astype(np.float32)

    def texels(points: F64) -> F64:
        placed: F64 = turn(points, axes) * scale - shift
        return placed

    parts_f, parts_b, parts_c = [], [], []
    for c in all_casters:
        parts_f.append(texels(c.faces.reshape(-1, 3)).reshape(-1, 9))
        parts_b.append(np.column_stack((texels(c.balls[:, :3]), np.maximum(c.balls[:, 3] * scale, THINNEST))))
        ends = (texels(c.capsules[:, 0:3]), texels(c.capsules[:, 3:6]))
        parts_c.append(np.column_stack((*ends, np.maximum(c.capsules[:, 6:8] * scale, THINNEST))))
    from pointmass.render import kernels_shadow

    depth = np.empty((TEXELS, TEXELS), dtype=np.float32)
    rows = [np.ascontiguousarray(np.concatenate(parts), dtype=np.float32) for parts in (parts_f, parts_b, parts_c)]
    each(lambda i: kernels_shadow.cast(i * BAND, (i + 1) * BAND, depth, *rows), TEXELS // BAND)
    return Shadow(depth, matrix)


def bounds(placed: F64) -> tuple[F64, F64]:
    """Lowest and highest corner of what the map must hold; a runaway of a large cloud does not spread it thin."""
    low, high = placed.min(axis=0), placed.max(axis=0)
    if len(placed) <= MANY:
        return low, high
    first, last = np.percentile(placed, (1.0, 99.0), axis=0)
    return np.maximum(low, 2.0 * first - last), np.minimum(high, 2.0 * last - first)


def light_axes(light: F64) -> F64:
    """Two axes of the map and the direction in which the light flies, as rows."""
    forward = -light
    helper = np.array((0.0, 1.0, 0.0)) if abs(forward[1]) < 0.9 else np.array((1.0, 0.0, 0.0))
    right = np.cross(forward, helper)
    right = right / np.linalg.norm(right)
    return np.stack((right, np.cross(right, forward), forward))
