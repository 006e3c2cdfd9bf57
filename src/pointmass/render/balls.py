"""Points as rows for the kernels.

Columns: 0-2 centre in view coordinates [m], 3 radius [m], 4-7 linear RGBA, 8 = 1 for a glow.
"""

from __future__ import annotations

import numpy as np

from pointmass.frame import Frame, Points
from pointmass.render.camera import View
from pointmass.render.tables import F64, OPAQUE, Table, colors, column, corners, named, pixel_box

COLUMNS = 9
HALO = 3.2  # a glow ends at this many radii
MIN_GLOW = 2.2  # and is never narrower than this [pixels]: it fades instead
MIN_BALL = 0.7  # the same for a ball
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
    # An eye inside a ball sees nothing of it.
    nearest = view.near if points.glow else np.maximum(view.near, 1.01 * radius)
    with np.errstate(invalid="ignore"):
        keep = (seen[:, 2] > nearest) & (radius > 0.0) & (color[:, 3] > 0.0)
        keep &= np.isfinite(seen.sum(axis=1) + radius + color.sum(axis=1))
    seen, radius, color = seen[keep], radius[keep], color[keep]
    rows = np.empty((len(seen), COLUMNS), dtype=np.float32)
    rows[:, :3], rows[:, 3], rows[:, 4:8], rows[:, 8] = seen, radius, color, points.glow
    pixels = view.focal * radius / seen[:, 2]
    if points.glow:
        reach = np.maximum(HALO * pixels, MIN_GLOW)[:, None]
        centre = view.project(seen)
        low, high = centre - reach, centre + reach
    else:
        low, high = _outline(seen, radius, view)
    box = pixel_box(low, high, view.width, view.height)
    solid = (color[:, 3] >= OPAQUE) & (pixels >= SOLID) & (not points.glow)
    adds = np.full(len(seen), points.glow)
    return Table(rows, box, seen[:, 2], solid, adds)


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
