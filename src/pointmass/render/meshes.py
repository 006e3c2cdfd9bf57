"""Triangles as rows for the kernels.

Columns: 0-1 2-3 4-5 the corners [pixels], 6-8 their 1/z [1/m], 9-11 12-14 15-17 their normals in view coordinates,
18-21 22-25 26-29 their linear RGBA.
"""

from __future__ import annotations

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.frame import Frame, Ints, Triangles
from pointmass.render.camera import View
from pointmass.render.pattern import patterned
from pointmass.render.tables import F64, OPAQUE, Mask, Table, colors, corners, named, pixel_box

COLUMNS = 30
CORNER = 10  # x y z, normal, RGBA of a corner before the projection

EMPTY = Table(
    np.zeros((0, COLUMNS), np.float32), np.zeros((0, 4), np.int32), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
)


def triangles(drawable: Triangles, frame: Frame, view: View) -> Table:
    """The triangles that may be seen, cut at the near plane."""
    places = corners(drawable, frame)
    faces = np.asarray(drawable.faces).reshape(-1, 3)
    named(places, faces, drawable.name)
    # Colours may end where the corners that faces name end: a cloth among other particles.
    count = np.asarray(drawable.color).shape[0] if np.ndim(drawable.color) == 2 else len(places)
    color = colors(drawable.color, count, drawable.name)
    seen = view.see(places)
    normals = face_normals(seen, faces)
    shaded = vertex_normals(normals, faces, len(seen))[faces] if drawable.smooth else unit(normals)[:, None, :]
    full = np.empty((len(faces), 3, CORNER))
    full[:, :, 0:3], full[:, :, 3:6], full[:, :, 6:10] = seen[faces], shaded, named(color, faces, drawable.name)
    with np.errstate(invalid="ignore"):
        keep = np.isfinite(full.sum(axis=(1, 2))) & (full[:, :, 9] > 0.0).any(axis=1)
        keep &= (normals * normals).sum(axis=1) > 0.0
    full = full[keep]
    if drawable.pattern != "plain" and drawable.uv is not None:
        uv = np.asarray(drawable.uv, dtype=np.float64)
        if uv.shape != (len(faces), 3, 2) or not np.isfinite(uv).all():
            raise InvalidInput(
                f"drawable {drawable.name!r} has {len(faces)} faces, but no finite uv of shape ({len(faces)}, 3, 2)"
            )
        full = patterned(full, uv[keep], slice(6, 9), drawable)
    return _project(clip(full, view.near), view)


def face_normals(places: F64, faces: Ints) -> F64:
    """Normals with the length of twice the area, shape (k, 3)."""
    a, b, c = places[faces[:, 0]], places[faces[:, 1]], places[faces[:, 2]]
    with np.errstate(invalid="ignore", over="ignore"):
        # The view's axes are left-handed (z away from the eye), so the product is turned round.
        normals: F64 = np.cross(c - a, b - a)
        return normals


def vertex_normals(normals: F64, faces: Ints, count: int) -> F64:
    """Unit mean normals of the corners, weighted by area, shape (count, 3)."""
    flat = faces.ravel()
    sums: F64 = np.stack([np.bincount(flat, np.repeat(normals[:, i], 3), count) for i in range(3)], axis=1)
    return unit(sums)


def unit(vectors: F64) -> F64:
    """The same directions with length 1 (0 where there is no direction), shape (n, 3)."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        result: F64 = np.nan_to_num(vectors / np.sqrt((vectors * vectors).sum(axis=1))[:, None])
        return result


def clip(full: F64, near: float) -> F64:
    """What lies beyond the near plane, as triangles; corners of shape (k, 3, CORNER)."""
    out = full[:, :, 2] < near
    hidden = out.sum(axis=1)
    if not hidden.any():
        return full
    parts = [full[hidden == 0]]
    for lost in (1, 2):
        some, gone = full[hidden == lost], out[hidden == lost]
        # Turn each triangle until its odd corner (the one hidden, or the one seen) comes first.
        odd = np.argmax(gone if lost == 1 else ~gone, axis=1)
        turned = some[np.arange(len(some))[:, None], (odd[:, None] + np.arange(3)) % 3]
        p, q, r = turned[:, 0], turned[:, 1], turned[:, 2]
        pq, pr = _cross(p, q, near), _cross(p, r, near)
        if lost == 1:
            parts += [np.stack((pq, q, r), axis=1), np.stack((pq, r, pr), axis=1)]
        else:
            parts.append(np.stack((p, pq, pr), axis=1))
    return np.concatenate(parts)


def _cross(p: F64, q: F64, near: float) -> F64:
    """Where the edges from p to q meet the near plane."""
    share = ((near - p[:, 2]) / (q[:, 2] - p[:, 2]))[:, None]
    return p + share * (q - p)


def _project(full: F64, view: View) -> Table:
    count = len(full)
    points = view.project(full[:, :, 0:3].reshape(-1, 3)).reshape(count, 3, 2)
    rows = np.empty((count, COLUMNS), dtype=np.float32)
    rows[:, 0:6] = points.reshape(count, 6)
    rows[:, 6:9] = 1.0 / full[:, :, 2]
    rows[:, 9:18] = full[:, :, 3:6].reshape(count, 9)
    rows[:, 18:30] = full[:, :, 6:10].reshape(count, 12)
    box = pixel_box(points.min(axis=1), points.max(axis=1), view.width, view.height)
    solid: Mask = np.all(full[:, :, 9] >= OPAQUE, axis=1)
    return Table(rows, box, full[:, :, 2].mean(axis=1), solid, np.zeros(count, dtype=bool))
