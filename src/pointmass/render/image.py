"""One frame as a picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import srgb
from pointmass.errors import InvalidInput
from pointmass.frame import Arrows, Camera, Curves, Drawable, Frame, Points, Segments
from pointmass.render.alpha import BLACK, WHITE, before, covered, with_alpha
from pointmass.render.balls import EMPTY as NO_BALLS
from pointmass.render.balls import balls
from pointmass.render.bands import each
from pointmass.render.blur import exposed
from pointmass.render.camera import View, fit_camera, look, moved
from pointmass.render.capsules import EMPTY as NO_CAPSULES
from pointmass.render.capsules import arrows, curves, segments, streaks
from pointmass.render.haze import light as light_sprites
from pointmass.render.lamp import key_direction, lamp
from pointmass.render.meshes import EMPTY as NO_FACES
from pointmass.render.meshes import triangles
from pointmass.render.shadow import Casters, Shadow, casters, no_shadow, shadow
from pointmass.render.sprites import EMPTY as NO_SPRITES
from pointmass.render.sprites import sprites
from pointmass.render.style import Style
from pointmass.render.tables import F32, F64, Mask, Table, colors, column, corners, join, named, visible

Image = NDArray[np.uint8]
Ints = NDArray[np.int64]

LARGEST = 8192  # pixels along a side
ROWS = 64  # rows that one thread develops at a time
SPREAD = 0.7  # how much weaker the bloom's wider blurs are


def image(
    frame: Frame,
    *,
    camera: Camera | None = None,
    size: tuple[int, int] = (1280, 720),
    style: Style | None = None,
) -> Image:
    """The picture of a frame.

    The same frame gives the same bytes on any number of threads.

    Parameters
    ----------
    frame : what there is to see. Items whose numbers are not finite are left out.
    camera : from where; what it leaves open is chosen to show this frame.
    size : width and height [pixels].
    style : the look.

    Returns
    -------
    array : sRGB bytes, shape (height, width, 3); of a transparent style (height, width, 4), the colour not multiplied
        by the alpha.

    Raises
    ------
    InvalidInput : the size is out of range, or a drawable names corners that are not there.
    """
    size = checked_size(size)
    style = style or Style()
    camera = moved(fit_camera([frame], camera, size), frame)
    view = look(camera, size)
    if style.shutter is not None:
        frame = exposed(frame, style.shutter)
    if style.transparent:
        (light, spill), (over_white, _) = (_light(frame, camera, view, before(style, g)) for g in (BLACK, WHITE))
        picture = with_alpha(_develop(light, spill, style), covered(light, over_white))
    else:
        picture = _develop(*_light(frame, camera, view, style), style)
    if style.caption:
        from pointmass.render.caption import caption

        picture = caption(picture, frame)
    return picture


def checked_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height as whole numbers from 1 to 8192, or `InvalidInput`."""
    sides = tuple(size)
    whole = len(sides) == 2 and all(isinstance(s, (int, np.integer)) and not isinstance(s, bool) for s in sides)
    if not whole or not all(1 <= s <= LARGEST for s in sides):
        raise InvalidInput(f"size = {size} is not allowed: it must be two whole numbers from 1 to {LARGEST}")
    return int(sides[0]), int(sides[1])


def _light(frame: Frame, camera: Camera, view: View, style: Style) -> tuple[F32, F32 | None]:
    """Linear light of the picture, and what spills around bright things at half the size; both as three planes."""
    tables = _Tables(math.dist(view.eye, np.asarray(camera.target)))
    for drawable in frame.drawables:
        tables.add(drawable, frame, view, style.shadows)
    map_ = shadow(tables.casters, key_direction(style, view)) if tables.casters else no_shadow()
    light_from = (lamp(style, view, camera, map_), map_.depth, map_.matrix)
    soft = tables.lit(light_from[0], map_, frame, view)
    parts = (*tables.joined(), soft)
    from pointmass.render import kernels, kernels_shade

    draw: Callable[..., bool] = kernels.draw
    height, width = view.height, view.width
    columns, bands = -(-width // kernels_shade.TILE), -(-height // kernels_shade.BAND)
    boxes = np.concatenate([table.box for table in parts])
    lists: list[Ints] = []
    for order in _orders(parts):
        starts, places = kernels.sort_into_tiles(boxes[order], columns, bands)
        lists += [starts, order[places]]
    light = np.empty((3, height, width), dtype=np.float32)
    bright = np.empty((3, (height + 1) // 2, (width + 1) // 2), dtype=np.float32)
    middle = np.array((view.focal, 0.5 * width, 0.5 * height, 1.0 / view.focal), dtype=np.float32)
    pictures = (light, bright, _gradient(style, height), middle)
    things = [part for table in parts for part in (table.rows, table.box)]
    spilled = np.zeros(bands, dtype=bool)

    def band(i: int) -> None:
        spilled[i] = draw(i, *pictures, _offsets(style.samples), *lists, *things, *light_from, *_room(style.samples**2))

    each(band, bands)
    return light, bright if spilled.any() else None


def _room(samples: int) -> tuple[NDArray[Any], ...]:
    """What one thread needs to draw a tile: not written before it is used, but for the last, the pixels' middles."""
    from pointmass.render import kernels_shade as k

    room = np.empty(samples * k.BLOCK, dtype=np.float32)
    even = np.empty(k.AREA, dtype=np.bool_)
    waiting = np.empty(k.LINES * k.STEP, dtype=np.float32)
    spots = np.empty((2, k.WAITING), dtype=np.int64)
    steps = np.empty(samples, dtype=np.float32)
    ramp = (np.arange(k.TILE) + 0.5).astype(np.float32)
    return room, even, waiting, spots, steps, ramp


class _Tables:
    """The rows of all drawables of a frame, and what of them throws shadows or light.

    Parameters
    ----------
    focus : depth at which the picture is sharp [m].
    """

    def __init__(self, focus: float) -> None:
        self.focus = focus
        self.faces: list[Table] = []
        self.balls: list[Table] = []
        self.lines: list[Table] = []
        self.sprites: list[Table] = []
        self.casters: list[Casters] = []
        self.glows: list[Points] = []

    def add(self, drawable: Drawable, frame: Frame, view: View, shadows: bool) -> None:
        """Rows of one drawable; what lies outside the picture is kept only for its shadow."""
        faces, round_ones, lines = NO_FACES, NO_BALLS, NO_CAPSULES
        if isinstance(drawable, Points):
            if drawable.glow:
                self.glows.append(drawable)
            round_ones, lines = self._points(drawable, frame, view)
        elif isinstance(drawable, Segments):
            lines = segments(drawable, frame, view)
        elif isinstance(drawable, Curves):
            lines = curves(drawable, frame, view)
        elif isinstance(drawable, Arrows):
            lines = arrows(drawable, view)
        else:
            faces = triangles(drawable, frame, view)
        if shadows:
            found = casters(faces, round_ones, lines, view, drawable.vertices is not None)
            if len(found.spots()):
                self.casters.append(found)
        for parts, table in ((self.faces, faces), (self.balls, round_ones), (self.lines, lines)):
            if len(table.rows):
                parts.append(table.take(visible(table.box)))

    def _points(self, points: Points, frame: Frame, view: View) -> tuple[Table, Table]:
        """Points as balls or as streaks, or noted as sprites."""
        if points.soft or points.normals is not None:
            self.sprites.append(sprites(points, frame, view, self.focus))
            return NO_BALLS, NO_CAPSULES
        if points.glow and points.motion is not None:
            return NO_BALLS, streaks(points, frame, view)
        return balls(points, frame, view), NO_CAPSULES

    def joined(self) -> tuple[Table, Table, Table]:
        """Faces, balls and lines in the picture, each in the order of the drawables."""
        return join(self.faces, NO_FACES), join(self.balls, NO_BALLS), join(self.lines, NO_CAPSULES)

    def lit(self, lamp: F32, map_: Shadow, frame: Frame, view: View) -> Table:
        """Puffs and flakes with their light; also those outside the picture throw their shadows on others."""
        table = join(self.sprites, NO_SPRITES)
        if len(table.rows):
            glows = [_lights(points, frame, view) for points in self.glows]
            light_sprites(table.rows, lamp, map_, np.concatenate([np.zeros((0, 6)), *glows]))
        return table.take(visible(table.box))


def _lights(points: Points, frame: Frame, view: View) -> F64:
    """Glowing points as lamps: centre in view coordinates [m], colour times the square of the radius; shape (k, 6)."""
    places = corners(points, frame)
    places = view.see(places if points.index is None else named(places, points.index, points.name))
    radius = column(points.radius, len(places), points.name)[:, None]
    color = colors(points.color, len(places), points.name)
    rows = np.concatenate((places, color[:, :3] * color[:, 3:] * radius * radius), axis=1)
    lamps: F64 = rows[np.isfinite(rows).all(axis=1) & (rows[:, 3:] > 0.0).any(axis=1)]
    return lamps


def _orders(tables: tuple[Table, ...]) -> tuple[Ints, Ints]:
    """Numbers of the solid things, near ones first, and of the soft ones, far ones first."""
    depth = np.concatenate([t.depth for t in tables])
    solid: Mask = np.concatenate([t.solid for t in tables])
    adds: Mask = np.concatenate([t.adds for t in tables])
    front, soft = np.flatnonzero(solid), np.flatnonzero(~solid)
    front = front[np.argsort(depth[front], kind="stable")]
    if not adds[soft].all():  # sums of light need no order
        soft = soft[np.argsort(-depth[soft], kind="stable")]
    return front.astype(np.int64), soft.astype(np.int64)


def _develop(light: F32, spill: F32 | None, style: Style) -> Image:
    """Bloom, tone map, sRGB."""
    from pointmass.render import kernels_post

    height, width = light.shape[1:]
    strength = np.float32(style.bloom)
    if spill is None or style.bloom == 0.0:
        strength, spill = np.float32(0.0), np.zeros((3, 1, 1), dtype=np.float32)
    else:
        levels = max(1, round(np.log2(max(height, 2) / 16.0)))
        planes = spill
        each(lambda i: kernels_post.bloom(planes[i], levels, np.float32(SPREAD)), 3)
    picture = np.empty((height, width, 3), dtype=np.uint8)
    numbers = (strength, np.float32(style.exposure), _srgb_curve(), _dither())

    def rows(i: int) -> None:
        last = min((i + 1) * ROWS, height)
        kernels_post.develop(i * ROWS, last, picture, light, spill, *numbers)

    each(rows, -(-height // ROWS))
    return picture


def _gradient(style: Style, height: int) -> F32:
    """The background: from the top colour in the first row to the bottom colour in the last."""
    share = ((np.arange(height) + 0.5) / height)[:, None]
    # Eased, so that neither end shows an edge.
    share = share * share * (3.0 - 2.0 * share)
    colors: F64 = (1.0 - share) * np.asarray(style.top) + share * np.asarray(style.bottom)
    return colors.astype(np.float32)


@lru_cache(maxsize=4)
def _offsets(samples: int) -> F32:
    """Places of the samples in a pixel: no two share a row or a column, so slanted edges come out smooth."""
    i, j = np.meshgrid(np.arange(samples), np.arange(samples), indexing="ij")
    x = (i + (j + 0.5) / samples) / samples
    y = (j + (samples - i - 0.5) / samples) / samples
    return np.stack((x.ravel(), y.ravel()), axis=1).astype(np.float32)


@lru_cache(maxsize=1)
def _srgb_curve() -> F32:
    """sRGB bytes (not rounded) of linear light, at equal steps of its square root."""
    light = np.linspace(0.0, 1.0, 4096) ** 2
    result: F32 = (255.0 * srgb(light)).astype(np.float32)
    return result


@lru_cache(maxsize=1)
def _dither() -> F32:
    """Bayer's 8 x 8 thresholds in (0, 1): added before the cut to bytes, they hide the steps of dark gradients."""
    pattern: F64 = np.zeros((1, 1))
    for _ in range(3):
        pattern = np.block([[4 * pattern, 4 * pattern + 2], [4 * pattern + 3, 4 * pattern + 1]])
    result: F32 = ((pattern + 0.5) / 64.0).astype(np.float32)
    return result
