"""Segments, curves and arrows as tapered capsules, and the streaks of glowing points that move.

Columns: 0-2 and 3-5 both ends in view coordinates [m], 6-7 their radii [m], 8-9 and 10-11 both ends [pixels],
12-15 and 16-19 linear RGBA at both ends, 20-21 and 22-23 the lines that cut the first and the last end: only what
lies ahead of the first and behind the second is drawn (zeros: not cut), 24 = 1 for a glow, 2 for a streak.

Pieces of a curve are cut where they meet, along the line that halves the angle, so that no pixel is laid over twice.
"""

from __future__ import annotations

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Curves, Frame, Ints, Points, Segments
from pointmass.render.balls import HALO
from pointmass.render.balls import MIN_GLOW as MIN_POINT
from pointmass.render.camera import View
from pointmass.render.tables import F64, OPAQUE, Mask, Table, bounded, colors, column, corners, named, pixel_box

COLUMNS = 25
GLOW_REACH = 2.2  # a glowing line ends at this many radii
MIN_GLOW = 1.3  # and is never narrower than this radius [pixels]: it fades instead
SOLID = 2.0  # a line whose radius is less is laid over with a soft edge [pixels]
HEAD_WIDTH = 3.2  # radius of an arrow's head over the radius of its shaft
HEAD_LENGTH = 2.4  # length of the head over its radius
LONGEST_HEAD = 0.45  # and over the whole arrow
SHORTEST = 0.5  # length of a streak; what is shorter is drawn as long as this [pixels]

EMPTY = Table(
    np.zeros((0, COLUMNS), np.float32), np.zeros((0, 4), np.int32), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
)


def segments(drawable: Segments, frame: Frame, view: View) -> Table:
    """One capsule for each pair."""
    pairs = np.asarray(drawable.pairs).reshape(-1, 2)
    ends = named(corners(drawable, frame), pairs, drawable.name)
    radius = 0.5 * column(drawable.width, len(pairs), drawable.name)
    color = colors(drawable.color, len(pairs), drawable.name)
    return _table(_rows(view.see(ends[:, 0]), view.see(ends[:, 1]), radius, radius, color, color), drawable.glow, view)


def curves(drawable: Curves, frame: Frame, view: View) -> Table:
    """One capsule for each two neighbours on a curve, cut along the bends."""
    index = np.asarray(drawable.index)
    offsets = np.asarray(drawable.offsets)
    count = len(index)
    if len(offsets) < 1 or offsets[0] != 0 or offsets[-1] != count or (np.diff(offsets) < 0).any():
        raise InvalidInput(f"drawable {drawable.name!r}: offsets must rise from 0 to {count}, the length of index")
    seen = view.see(named(corners(drawable, frame), index, drawable.name))
    radius = 0.5 * column(drawable.width, count, drawable.name)
    color = colors(drawable.color, count, drawable.name)
    within = np.ones(max(count - 1, 0), dtype=bool)
    starts = np.asarray(offsets[1:-1], dtype=np.intp)
    starts = starts[(starts > 0) & (starts < count)]
    within[starts - 1] = False
    first = np.flatnonzero(within)
    last = first + 1
    curve = np.cumsum(~within)[first] if len(within) else first
    rows = _rows(seen[first], seen[last], radius[first], radius[last], color[first], color[last])
    return _table(rows, drawable.glow, view, curve)


def arrows(drawable: Arrows, view: View) -> Table:
    """A shaft and a cone for each arrow."""
    tails = bounded(np.asarray(drawable.vertices, dtype=np.float64).reshape(-1, 3))
    vectors = bounded(np.asarray(drawable.vectors, dtype=np.float64).reshape(-1, 3))
    if len(tails) != len(vectors):
        raise InvalidInput(f"drawable {drawable.name!r} has {len(tails)} tails, but {len(vectors)} vectors")
    radius = 0.5 * column(drawable.width, len(tails), drawable.name)
    color = colors(drawable.color, len(tails), drawable.name)
    length = np.sqrt((vectors * vectors).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        head = np.minimum(HEAD_WIDTH * HEAD_LENGTH * radius, LONGEST_HEAD * length)
        neck = tails + vectors * (1.0 - head / length)[:, None]
        broad = head / HEAD_LENGTH
        thin = np.minimum(radius, 0.6 * broad)
    start, bend, tip = view.see(tails), view.see(neck), view.see(tails + vectors)
    shaft = _table(_rows(start, bend, thin, thin, color, color), drawable.glow, view)
    cone = _table(_rows(bend, tip, broad, np.zeros(len(broad)), color, color), drawable.glow, view, flat=True)
    return Table(
        np.concatenate((shaft.rows, cone.rows)),
        np.concatenate((shaft.box, cone.box)),
        np.concatenate((shaft.depth, cone.depth)),
        np.concatenate((shaft.solid, cone.solid)),
        np.concatenate((shaft.adds, cone.adds)),
    )


def streaks(points: Points, frame: Frame, view: View) -> Table:
    """One capsule for each glowing point, along the way that it went while the shutter was open."""
    places = corners(points, frame)
    if points.index is not None:
        places = named(places, points.index, points.name)
    motion = np.asarray(points.motion, dtype=np.float64)
    if motion.shape != places.shape:
        raise InvalidInput(f"drawable {points.name!r} has {len(places)} items, but motions of shape {motion.shape}")
    radius = column(points.radius, len(places), points.name)
    color = colors(points.color, len(places), points.name)
    ends = np.concatenate((view.see(places - bounded(motion)), view.see(places)), axis=1)
    with np.errstate(invalid="ignore"):
        keep = np.isfinite(ends.sum(axis=1) + radius + color.sum(axis=1)) & (radius > 0.0) & (color[:, 3] > 0.0)
        keep &= np.maximum(ends[:, 2], ends[:, 5]) > view.near
    ends, radius, color = ends[keep], radius[keep], color[keep]
    _clip(ends, view.near)
    a, b = view.project(ends[:, 0:3]), view.project(ends[:, 3:6])
    short = np.sqrt(((b - a) ** 2).sum(axis=1)) < SHORTEST
    a[short] = b[short] = 0.5 * (a + b)[short]
    a[short, 0] -= 0.5 * SHORTEST
    b[short, 0] += 0.5 * SHORTEST
    rows = np.zeros((len(ends), COLUMNS), dtype=np.float32)  # a million sparks are ordinary: no table of doubles
    rows[:, 0:6], rows[:, 6], rows[:, 7], rows[:, 8:10], rows[:, 10:12] = ends, radius, radius, a, b
    rows[:, 12:16], rows[:, 16:20], rows[:, 24] = color, color, 2.0
    pixels = 0.5 * view.focal * radius * (1.0 / ends[:, 2] + 1.0 / ends[:, 5])
    reach = np.maximum(HALO * pixels, MIN_POINT)[:, None]
    box = pixel_box(np.minimum(a, b) - reach, np.maximum(a, b) + reach, view.width, view.height)
    depth = 0.5 * (ends[:, 2] + ends[:, 5])
    return Table(rows, box, depth, np.zeros(len(rows), bool), np.ones(len(rows), bool))


def _rows(a: F64, b: F64, ra: F64, rb: F64, ca: F64, cb: F64) -> F64:
    rows = np.zeros((len(a), COLUMNS))
    rows[:, 0:3], rows[:, 3:6], rows[:, 6], rows[:, 7], rows[:, 12:16], rows[:, 16:20] = a, b, ra, rb, ca, cb
    return rows


def _table(rows: F64, glow: bool, view: View, curve: Ints | None = None, flat: bool = False) -> Table:
    """Clipped at the near plane, projected and cut at the joints of `curve`, or flat at the first end."""
    with np.errstate(invalid="ignore"):
        keep = np.isfinite(rows.sum(axis=1)) & (np.maximum(rows[:, 2], rows[:, 5]) > view.near)
        keep &= (np.maximum(rows[:, 6], rows[:, 7]) > 0.0) & (rows[:, 6:8] >= 0.0).all(axis=1)
    rows = rows[keep]
    whole = _clip(rows, view.near)
    a, b = view.project(rows[:, 0:3]), view.project(rows[:, 3:6])
    rows[:, 8:10], rows[:, 10:12], rows[:, 24] = a, b, glow
    step = b - a
    length = np.sqrt((step * step).sum(axis=1))
    radius_a, radius_b = view.focal * rows[:, 6] / rows[:, 2], view.focal * rows[:, 7] / rows[:, 5]
    if curve is not None:
        # A particle at rest leaves a trail without length: it would be as bright as all its pieces.
        long = length > 1e-4
        rows, whole, a, b, length = rows[long], whole[long], a[long], b[long], length[long]
        radius_a, radius_b = radius_a[long], radius_b[long]
        _cut_joints(rows, step[long] / length[:, None], curve[keep][long], whole)
    elif flat:
        drawn = length > radius_a  # an arrow that points at the eye shows its head as a disc
        rows[drawn, 20:22] = step[drawn] / length[drawn, None]
    reach = np.maximum(radius_a, radius_b)
    broad = np.maximum(GLOW_REACH * reach, MIN_GLOW) if glow else reach + 1.0
    box = pixel_box(np.minimum(a, b) - broad[:, None], np.maximum(a, b) + broad[:, None], view.width, view.height)
    solid = (np.minimum(rows[:, 15], rows[:, 19]) >= OPAQUE) & (reach >= SOLID) & (not glow)
    depth = 0.5 * (rows[:, 2] + rows[:, 5])
    return Table(rows.astype(np.float32), box, depth, solid, np.full(len(rows), glow))


def _clip(rows: F64, near: float) -> Mask:
    """Move ends that lie before the near plane onto it, in place; where nothing was moved."""
    whole = (rows[:, 2] >= near) & (rows[:, 5] >= near)
    for low, high in ((0, 3), (3, 0)):
        out = rows[:, low + 2] < near
        share = (near - rows[out, low + 2]) / (rows[out, high + 2] - rows[out, low + 2])
        rows[out, low : low + 3] += share[:, None] * (rows[out, high : high + 3] - rows[out, low : low + 3])
    return whole


def _cut_joints(rows: F64, step: F64, curve: Ints, whole: Mask) -> None:
    """Cut neighbours on a curve along the line that halves their angle, in place."""
    meets = (curve[1:] == curve[:-1]) & whole[1:] & whole[:-1]
    halving = (step[1:] + step[:-1]) * meets[:, None]
    halving[np.abs(halving).sum(axis=1) < 0.2] = 0.0  # a hairpin: both ends stay round
    rows[1:, 20:22] = halving
    rows[:-1, 22:24] = halving
