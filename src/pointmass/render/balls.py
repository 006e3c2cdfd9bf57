"""Points as rows for the kernels.

Columns: 0-2 centre in view coordinates [m], 3 radius [m], 4-7 linear RGBA, 8 = 1 for a glow, 9-10 the way that it went
while the shutter was open [pixels], 0 for a ball that is sharp. A ball with a way is in the middle of it.
"""

from __future__ import annotations

import numpy as np

from pointmass.frame import Frame, Points
from pointmass.render.camera import View
from pointmass.render.tables import F64, OPAQUE, Table, colors, column, corners, named, pixel_box, turned

COLUMNS = 11
HALO = 3.2  # a glow ends at this many radii
MIN_GLOW = 2.2  # and is never narrower than this [pixels]: it fades instead
MIN_BALL = 0.7  # the same for a ball
SHORTEST = 0.5  # way that smears a ball [pixels]
SOLID = 1.5  # a ball whose radius is less is laid over with a soft edge [pixels]

EMPTY = Table(
    np.zeros((0, COLUMNS), np.float32), np.zeros((0, 4), np.int32), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
)


def balls(points: Points, frame: Frame, view: View) -> Table:
    """The points before the eye."""
    places = corners(points, frame)
    if points.index is not None:
        places = named(places, points.index, points.name)
    seen = view.see(places)
    radius = column(points.radius, len(seen), points.name)
    color = colors(points.color, len(seen), points.name)
    motion = turned("motions", None if points.glow else points.motion, points.name, seen, view)
    # An eye inside a ball sees nothing of it.
    nearest = view.near if points.glow else np.maximum(view.near, 1.01 * radius)
    with np.errstate(invalid="ignore"):
        keep = (seen[:, 2] > nearest) & (radius > 0.0) & (color[:, 3] > 0.0)
        keep &= np.isfinite(seen.sum(axis=1) + radius + color.sum(axis=1) + motion.sum(axis=1))
    seen, radius, color, motion = seen[keep], radius[keep], color[keep], motion[keep]
    ends, way = (seen, seen), np.zeros((len(seen), 2))
    if motion.any():
        ends, way = _smeared(seen, motion, np.maximum(view.near, 1.01 * radius), view)
        seen = 0.5 * (ends[0] + ends[1])
    rows = np.empty((len(seen), COLUMNS), dtype=np.float32)
    rows[:, :3], rows[:, 3], rows[:, 4:8], rows[:, 8], rows[:, 9:] = seen, radius, color, points.glow, way
    pixels = view.focal * radius / seen[:, 2]
    if points.glow:
        reach = np.maximum(HALO * pixels, MIN_GLOW)[:, None]
        centre = view.project(seen)
        low, high = centre - reach, centre + reach
    else:
        outlines = [_outline(end, radius, view) for end in ends]
        low, high = np.minimum(outlines[0][0], outlines[1][0]), np.maximum(outlines[0][1], outlines[1][1])
    box = pixel_box(low, high, view.width, view.height)
    solid = (color[:, 3] >= OPAQUE) & (pixels >= SOLID) & (not points.glow) & (way == 0.0).all(axis=1)
    adds = np.full(len(seen), points.glow)
    return Table(rows, box, seen[:, 2], solid, adds)


def _smeared(seen: F64, motion: F64, nearest: F64, view: View) -> tuple[tuple[F64, F64], F64]:
    """Both ends of each ball's way, and the way in the picture [pixels]; both ends are one for a ball that is sharp.

    Balls that come from behind the eye or hardly move in the picture are sharp.
    """
    start = seen - motion
    start = np.where((start[:, 2] > nearest)[:, None], start, seen)
    way = view.project(seen) - view.project(start)
    sharp = ((way * way).sum(axis=1) < SHORTEST**2)[:, None]
    return (np.where(sharp, seen, start), seen), np.where(sharp, 0.0, way)


def _outline(seen: F64, radius: F64, view: View) -> tuple[F64, F64]:
    """Pixel boxes of balls: the planes through the eye that touch each ball, plus room for a soft edge."""
    z = seen[:, 2]
    below = z * z - radius * radius
    low, high = np.empty((len(z), 2)), np.empty((len(z), 2))
    for axis, (middle, sign) in enumerate(((0.5 * view.width, 1.0), (0.5 * view.height, -1.0))):
        x = sign * seen[:, axis]
        root = radius * np.sqrt(x * x + below)
        low[:, axis] = middle + view.focal * (x * z - root) / below - 1.0
        high[:, axis] = middle + view.focal * (x * z + root) / below + 1.0
    return low, high
