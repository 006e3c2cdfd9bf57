"""Puffs of smoke and flakes as rows for the kernels: soft ellipses that are lit once each, not in every pixel.

Columns: 0-1 centre [pixels], 2-4 the form a ex^2 + 2 b ex ey + c ey^2 that is 1 at the edge [1/pixels^2], 5 how hard
the edge is (1 = as soft as can be), 6 alpha, 7 the 1/z by which it is hidden, 8 how sharply, 9-11 linear RGB in the
middle, 12-14 how much more of it there is at the edge towards the light, 15-16 the way to that edge [1/pixels];
17-19 centre in view coordinates [m], 20 radius [m], 21-23 normal of a flake (0 for a puff), 24 how thick a puff is
in the middle (optical depth), 25 share of the lamps' light that it gets. Before they are lit, 9-11 are the colour of
the thing itself.
"""

from __future__ import annotations

import numpy as np

from pointmass.frame import Frame, Points
from pointmass.render.camera import View
from pointmass.render.tables import F64, Table, colors, column, corners, named, pixel_box, turned

COLUMNS = 26
PUFF = 1.6  # a puff ends at this many radii
MIN_PUFF = 1.5  # and is never narrower than this radius [pixels]: it fades instead
DENSEST = 0.98  # an alpha from here on makes a puff no thicker
EDGE_ON = 0.22  # a flake is never seen narrower than this, for none is flat
SHARPEST = 0.8  # blur of a flake in focus [pixels]
GROUNDED = 3.0  # radii by which a flake comes before what hides it: it lies on the ground and is seen whole
LENS = 0.004  # diameter of the lens, over the distance to the target

EMPTY = Table(
    np.zeros((0, COLUMNS), np.float32), np.zeros((0, 4), np.int32), np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
)


def sprites(points: Points, frame: Frame, view: View, focus: float) -> Table:
    """Puffs or flakes before the eye, not yet lit.

    Parameters
    ----------
    focus : depth at which flakes are sharp [m].
    """
    places = corners(points, frame)
    if points.index is not None:
        places = named(places, points.index, points.name)
    seen = view.see(places)
    radius = column(points.radius, len(seen), points.name)
    color = colors(points.color, len(seen), points.name)
    normals = turned("normals", points.normals, points.name, seen, view)
    motion = turned("motions", points.motion, points.name, seen, view)
    with np.errstate(invalid="ignore"):
        keep = (seen[:, 2] > view.near) & (radius > 0.0) & (color[:, 3] > 0.0)
        keep &= np.isfinite(seen.sum(axis=1) + radius + color.sum(axis=1) + normals.sum(axis=1) + motion.sum(axis=1))
    seen, radius, color, normals, motion = seen[keep], radius[keep], color[keep], normals[keep], motion[keep]
    rows = np.zeros((len(seen), COLUMNS))
    rows[:, 0:2], rows[:, 6], rows[:, 9:12] = view.project(seen), color[:, 3], color[:, :3]
    rows[:, 17:20], rows[:, 20], rows[:, 25] = seen, radius, points.daylight
    if points.normals is None:
        _puffs(rows, view)
    else:
        _flakes(rows, normals, motion, view, focus)
    a, b, c = rows[:, 2], rows[:, 3], rows[:, 4]
    reach = np.sqrt(np.stack([c, a], axis=1) / (a * c - b * b)[:, None])
    box = pixel_box(rows[:, 0:2] - reach, rows[:, 0:2] + reach, view.width, view.height)
    no = np.zeros(len(rows), bool)
    return Table(rows.astype(np.float32), box, seen[:, 2], no, no)


def _puffs(rows: F64, view: View) -> None:
    """Round, and fading over their own radius where they meet something solid, half of it before the middle."""
    z, radius = rows[:, 19], rows[:, 20]
    full = PUFF * view.focal * radius / z
    reach = np.maximum(full, MIN_PUFF)
    rows[:, 24] = -np.log(1.0 - np.minimum(rows[:, 6], DENSEST))
    rows[:, 6] *= (full / reach) ** 2
    rows[:, 2] = rows[:, 4] = 1.0 / reach**2
    rows[:, 5] = 1.0
    rows[:, 8] = 0.5 * z * z / radius
    rows[:, 7] = 1.0 / z - 0.5 / rows[:, 8]
    rows[:, 15] = rows[:, 16] = 1.0 / reach  # times the light's direction, once it is known


def _flakes(rows: F64, normals: F64, motion: F64, view: View, focus: float) -> None:
    """Discs seen at a slant, through a lens, and smeared along their way.

    The second moments of a disc, of the lens and of the way add up, as those of things that are folded into each other
    do; an ellipse is drawn that has the same.
    """
    z, radius = rows[:, 19], rows[:, 20]
    length = np.sqrt((normals * normals).sum(axis=1))
    normals = normals / np.where(length > 0.0, length, 1.0)[:, None]
    rows[:, 21:24] = normals
    # In the picture a disc is narrow along its normal. The eye's own direction takes the place of the z axis.
    to_eye = -rows[:, 17:20] / np.sqrt((rows[:, 17:20] ** 2).sum(axis=1))[:, None]
    slant = np.maximum(np.abs((normals * to_eye).sum(axis=1)), EDGE_ON)
    narrow = np.stack([normals[:, 0], -normals[:, 1]], axis=1)
    size = np.sqrt((narrow * narrow).sum(axis=1))
    narrow = np.where(size[:, None] > 1e-6, narrow / np.maximum(size, 1e-6)[:, None], (1.0, 0.0))
    pixels = view.focal * radius / z
    blur = SHARPEST + 0.5 * view.focal * LENS * np.abs(focus - z) / z
    way = view.focal * np.stack([motion[:, 0], -motion[:, 1]], axis=1) / z[:, None]
    rows[:, 0:2] -= 0.5 * way
    # Four times the moments [pixels^2]: a disc has the square of its radius, a way a third of that of its length.
    disc = np.stack([narrow[:, 0] ** 2, narrow[:, 0] * narrow[:, 1], narrow[:, 1] ** 2])
    xx, xy, yy = (pixels**2) * (np.array([1.0, 0.0, 1.0])[:, None] - (1.0 - slant**2) * disc)
    xx, xy, yy = xx + blur**2 + way[:, 0] ** 2 / 3, xy + way[:, 0] * way[:, 1] / 3, yy + blur**2 + way[:, 1] ** 2 / 3
    area = xx * yy - xy * xy
    rows[:, 6] *= pixels**2 * slant / np.sqrt(area)
    smeared = blur + 0.5 * np.sqrt((way * way).sum(axis=1))
    rows[:, 5] = np.maximum(0.6 * pixels * slant / smeared, 1.0)
    # The mean of min(hard u, 1)^3 over the ellipse, which is so much larger than the flake that no light is lost.
    share = (1.0 - 0.75 / rows[:, 5]) / area
    rows[:, 2], rows[:, 3], rows[:, 4] = share * yy, -share * xy, share * xx
    rows[:, 8] = z * z / radius
    rows[:, 7] = 1.0 / z + GROUNDED / rows[:, 8]
