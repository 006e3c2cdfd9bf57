"""The light on puffs and flakes: of the key light, as far as it comes through the other puffs, of the sky, of glows."""

from __future__ import annotations

import numpy as np

from pointmass.render.bands import each
from pointmass.render.camera import turn
from pointmass.render.shadow import Shadow, bounds, light_axes
from pointmass.render.tables import F32, F64

LARGEST = 512  # cells along a side of the plane on which puffs leave their shadow
FINE = 3.0  # radii of a middling puff [cells]
SCATTERED = 0.3  # share of the light that finds its way through from puff to puff, which ends with
SOFTLY = 0.15  # one over the thickness (times this), not exponentially: thick smoke is grey, and not black
OWN = 0.25  # share of a puff's thickness that lies before its own middle
SIDE = 0.55  # how much brighter a puff is on the side of the light
MATT = 0.45  # light that shines through a flake, so that it is never black
CLUSTERS = 8  # glows are gathered into at most so many cells along an axis
CHUNK = 1024  # puffs that one thread lights at a time


def light(rows: F32, lamp: F32, shadow: Shadow, glows: F64) -> None:
    """Turn the colours of the sprites' rows into the light that leaves them, in place.

    Parameters
    ----------
    rows : see `sprites.py`.
    lamp : see `lamp.py`.
    shadow : the map of what is solid.
    glows : centre in view coordinates [m] and colour times the square of the radius [m^2], shape (k, 6).
    """
    if not len(rows):
        return
    numbers = lamp.astype(np.float64)
    to_key, above = numbers[0:3], numbers[3:6]
    key, sky, ground = numbers[6:9], numbers[9:12], numbers[12:15]
    centre, albedo = rows[:, 17:20].astype(np.float64), rows[:, 9:12].astype(np.float64)
    normal = rows[:, 21:24].astype(np.float64)
    flat = (normal != 0.0).any(axis=1)
    lit = _lit(centre, shadow) * _through(rows, to_key)
    open_sky = _through(rows, above)
    high = 0.5 * np.ones(len(rows))
    lit[flat] *= MATT + (1.0 - MATT) * np.abs((normal[flat] * to_key).sum(axis=1))
    # Of its two sides the eye sees one.
    turned = np.where((normal * centre).sum(axis=1) > 0.0, -1.0, 1.0)
    high[flat] += 0.5 * (turned * (normal * above).sum(axis=1))[flat]
    around = open_sky[:, None] * (ground + high[:, None] * (sky - ground))
    straight = lit[:, None] * key
    far = (((centre - (0.0, 0.0, numbers[18])) * numbers[17]) ** 2).sum(axis=1)
    pool = (1.0 / (1.0 + far * far))[:, None]
    own = pool * albedo * rows[:, 25:26]
    rows[:, 9:12] = own * (straight + around) + albedo * _glowing(rows, glows) + (1.0 - pool) * numbers[19:22]
    rows[:, 12:15] = np.where(flat[:, None], 0.0, SIDE * own * straight)
    rows[:, 15] *= np.float32(to_key[0])
    rows[:, 16] *= np.float32(-to_key[1])


def _lit(centre: F64, shadow: Shadow) -> F64:
    """Share of the key light that nothing solid takes, from 3 x 3 texels."""
    side = len(shadow.depth)
    if not side:
        return np.ones(len(centre))
    matrix = shadow.matrix.astype(np.float64)
    places = turn(centre, matrix[:, :3]) + matrix[:, 3]
    column, row = np.floor(places[:, 0]).astype(np.int64), np.floor(places[:, 1]).astype(np.int64)
    inside = (column > 0) & (row > 0) & (column < side - 1) & (row < side - 1)
    column, row = np.clip(column, 1, side - 2), np.clip(row, 1, side - 2)
    open_ = np.zeros(len(centre))
    for j in (-1, 0, 1):
        for i in (-1, 0, 1):
            open_ += ~(shadow.depth[row + j, column + i] < places[:, 2] - 1.0)
    return np.where(inside, open_ / 9.0, 1.0)


def _through(rows: F32, towards: F64) -> F64:
    """Share of a light from far away that reaches each sprite through the puffs; `towards` is the way to it."""
    from pointmass.render import kernels_haze

    thick = rows[:, 24].astype(np.float64)
    if not (thick > 0.0).any():
        return np.ones(len(rows))
    places = turn(rows[:, 17:20].astype(np.float64), light_axes(towards))
    radius = rows[:, 20].astype(np.float64)
    low, high = (corner[:2] for corner in bounds(places))
    cell = max(float((high - low).max()) / (LARGEST - 1), float(np.median(radius)) / FINE)
    side = np.ceil((high - low) / cell).astype(np.int64) + 1
    spots = np.column_stack((places[:, :2] - low, radius)) / cell
    order = np.argsort(places[:, 2], kind="stable")
    depth = kernels_haze.gather(order, spots.astype(np.float32), thick.astype(np.float32), int(side[1]), int(side[0]))
    depth = depth.astype(np.float64) + OWN * thick
    through: F64 = (1.0 - SCATTERED) * np.exp(-depth) + SCATTERED / (1.0 + SOFTLY * depth)
    return through


def _glowing(rows: F32, glows: F64) -> F32:
    """Light that glows throw on each sprite, shape (n, 3)."""
    from pointmass.render import kernels_haze

    result = np.zeros((len(rows), 3), np.float32)
    if len(glows):
        lamps, width = _clusters(glows)

        def chunk(i: int) -> None:
            part = slice(i * CHUNK, (i + 1) * CHUNK)
            kernels_haze.shine(np.ascontiguousarray(rows[part, 17:21]), lamps, np.float32(width), result[part])

        each(chunk, -(-len(rows) // CHUNK))
    return result


def _clusters(glows: F64) -> tuple[F32, float]:
    """Few lights that stand for many, and how wide each is [m]: the middle and the sum of those in a cell."""
    if len(glows) <= CLUSTERS**2:
        return glows.astype(np.float32), 0.0
    low, high = bounds(glows[:, :3])
    cell = max(float((high - low).max()) / CLUSTERS, 1e-9)
    place = np.clip((glows[:, :3] - low) / cell, 0, CLUSTERS - 1).astype(np.int64)
    index = (place[:, 0] * CLUSTERS + place[:, 1]) * CLUSTERS + place[:, 2]
    strength = glows[:, 3:].sum(axis=1)
    total = np.bincount(index, strength, CLUSTERS**3)
    used = total > 0.0
    middle = [np.bincount(index, strength * glows[:, k], CLUSTERS**3)[used] / total[used] for k in range(3)]
    power = [np.bincount(index, glows[:, 3 + k], CLUSTERS**3)[used] for k in range(3)]
    return np.stack((*middle, *power), axis=1).astype(np.float32), 0.5 * cell
