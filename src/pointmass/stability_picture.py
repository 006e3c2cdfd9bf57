"""The picture of stability: where a scene's motions lie in its solver's plane, and which springs are at the edge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pointmass.colors import linear, srgb
from pointmass.frame import Camera, Drawable, Frame, Points, Segments
from pointmass.render import fit_camera, image
from pointmass.solvers.stability import amplification, amplification_of_modes
from pointmass.stability import Modes, Stability, limiting, modes

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from pointmass.simulation import Simulation

Array = NDArray[np.floating[Any]]
Ink = tuple[int, int, int]

SIZE = (1280, 720)
PLOT = (72, 96, 570, 640)  # left, top, right and bottom of the plane [pixels]
SCENE = (616, 96, 1256, 590)  # of the scene
BAR = (616, 618, 1256, 634)  # of the scale of its colours
SMALLEST = 3.2  # height of the upper half of the plane, in |lambda dt|
ASIDE = 0.76  # of the plane's width is where motions decay
ROOM = 1.12
COARSE = 2  # pixels between two places where the solver is tried
FINE = 3  # times finer than a pixel lines are drawn
DOT, SMALL_DOT = 4.5, 3.2  # radius of an eigenvalue [pixels], and where there are many
MANY = 200
ALMOST, ROUNDING = 1e-9, 1e-8  # growth in a step that is round-off, of the region and of a motion
TINY = 1e-300

BACK, PANEL, RULE, INK, FAINT = (10, 13, 20), (16, 21, 31), (52, 62, 80), (226, 232, 240), (148, 160, 178)
INSIDE, EDGE, CALM, ALARM = (30, 74, 104), (118, 200, 240), (255, 226, 140), (255, 84, 84)
SHARES = {
    0.0: "#3f6fb5",
    0.5: "#3fc9a4",
    0.8: "#f5d94a",
    1.0: "#ff7a3c",
    1.5: "#ff2f4f",
}  # colours by share of the limit


@dataclass(frozen=True)
class Plane:
    """The part of the complex plane of lambda dt that is drawn.

    Attributes
    ----------
    scale : pixels for 1.
    zero : where 0 is [pixels].
    """

    scale: float
    zero: tuple[float, float]

    @classmethod
    def around(cls, z: NDArray[np.complex128]) -> Plane:
        """A plane that shows all of z and the neighbourhood of 0."""
        left, top, right, bottom = PLOT
        zero = left + ASIDE * (right - left), 0.5 * (top + bottom)
        reach = max(SMALLEST, ROOM * float(np.abs(z.imag).max(initial=0.0)))
        scale = 0.5 * (bottom - top) / reach
        for far, room in ((-z.real.min(initial=0.0), zero[0] - left), (z.real.max(initial=0.0), right - zero[0])):
            if far > 0.0:
                scale = min(scale, room / (ROOM * float(far)))
        return cls(scale, zero)

    def pixel(self, z: complex) -> tuple[float, float]:
        """Where a number of the plane is in the picture [pixels]."""
        return self.zero[0] + self.scale * z.real, self.zero[1] - self.scale * z.imag

    def number(self, x: Any, y: Any) -> Any:
        """The number at a place of the picture."""
        return (x - self.zero[0]) / self.scale + 1j * (self.zero[1] - y) / self.scale


def stability_picture(simulation: Simulation, found: Stability, camera: Camera | None = None) -> NDArray[np.uint8]:
    """Draw how a simulation stands to the limit of its solver.

    On the left the plane of lambda dt: light where a step of the solver keeps an oscillator with the eigenvalue lambda
    in bounds, with the eigenvalues of the system as dots. On the right the start, springs and particles in the colour
    of their share of the limit together with their neighbours.

    Parameters
    ----------
    simulation : at its start.
    found : its stability.
    camera : that looks at the scene; what it leaves open is chosen.

    Returns
    -------
    array
        sRGB bytes, shape (720, 1280, 3).
    """
    from PIL import Image, ImageDraw

    with limiting(simulation.system, simulation.solver):
        motions = modes(simulation.system)
    z = motions.values * simulation.dt
    plane = Plane.around(z)
    picture = Image.new("RGB", SIZE, BACK)
    picture.paste(_plane(simulation, plane, motions), PLOT[:2])
    width, height = SCENE[2] - SCENE[0], SCENE[3] - SCENE[1]
    frame = coloured(simulation, found)
    if len(frame.positions):
        shown = image(frame, camera=fit_camera([frame], camera, (width, height)), size=(width, height))
        picture.paste(Image.fromarray(shown), SCENE[:2])
    draw = ImageDraw.Draw(picture)
    if found.elements:
        _scale(picture, draw)
    _words(draw, plane, simulation, found)
    return np.asarray(picture)


def coloured(simulation: Simulation, found: Stability) -> Frame:
    """The start with springs and particles in the colours of their shares; who is in no element is grey."""
    frame, p = simulation.frame(0), simulation.system.particles
    extent = float(np.ptp(frame.positions, axis=0).max()) if len(frame.positions) else 1.0
    share = np.full(len(p), -1.0)
    lines: list[Drawable] = []
    for k, table in enumerate(found.elements):
        rows, mine = p.rows(table.ids), table.share_together(simulation.dt)
        np.maximum.at(share, rows, np.broadcast_to(mine[:, None], rows.shape))
        if rows.shape[1] == 2:
            width = simulation.look.spring_width or 0.006 * extent
            pairs = rows.astype(np.int32)
            lines.append(Segments(name=f"{table.family} {k}", pairs=pairs, width=width, color=_light(mine)))
    colors = _light(np.maximum(share, 0.0))
    colors[share < 0.0] = linear("#7d8796")
    others: list[Drawable] = []
    for drawable in frame.drawables:
        if isinstance(drawable, Points):
            mine = colors if drawable.index is None else colors[drawable.index]
            others.append(replace(drawable, color=mine, glow=False, soft=False, motion=None))
        elif not isinstance(drawable, Segments):
            others.append(drawable)
    return replace(frame, drawables=(*others, *lines))


def _light(share: Array) -> NDArray[np.float32]:
    """Linear RGBA of shares of the limit, shape (k, 4)."""
    places = list(SHARES)
    table = np.array([linear(color) for color in SHARES.values()])
    return np.stack([np.interp(share, places, table[:, k]) for k in range(4)], axis=1).astype(np.float32)


def _plane(simulation: Simulation, plane: Plane, motions: Modes) -> Picture:
    """The region of the solver, axes and eigenvalues, of the size of the plot."""
    from PIL import Image, ImageDraw

    left, top, right, bottom = PLOT
    size = (right - left, bottom - top)
    growth = _growth(simulation, plane)
    slope = np.hypot(*np.gradient(growth))
    inside = np.clip(0.5 - growth / np.maximum(slope, 1e-9), 0.0, 1.0)[:, :, None]
    border = np.clip(1.8 - np.abs(growth) / np.maximum(slope, 1e-9), 0.0, 1.0)[:, :, None]
    deep = (0.5 + 0.5 * np.exp(np.minimum(growth, 0.0)))[:, :, None]  # darker where a step damps more
    color = PANEL + inside * (np.multiply(INSIDE, deep) - PANEL)
    color += border * (np.array(EDGE) - color)
    fine = Image.fromarray(color.astype(np.uint8)).resize((FINE * size[0], FINE * size[1]), Image.Resampling.BICUBIC)
    draw = ImageDraw.Draw(fine)
    x, y = (FINE * (a - b) for a, b in zip(plane.zero, (left, top), strict=True))
    draw.line((0, y, fine.width, y), RULE, FINE)
    draw.line((x, 0, x, fine.height), RULE, FINE)
    grows = _amplified(simulation, motions)
    dot = DOT if len(grows) < MANY else SMALL_DOT
    for number, bad in sorted(zip(motions.values * simulation.dt, grows, strict=True), key=lambda pair: bool(pair[1])):
        middle = [FINE * (a - b) for a, b in zip(plane.pixel(complex(number)), (left, top), strict=True)]
        for radius, ink in ((dot + 1.2, BACK), (dot, ALARM if bad else CALM)):
            reach = FINE * radius
            draw.ellipse((middle[0] - reach, middle[1] - reach, middle[0] + reach, middle[1] + reach), ink)
    return fine.resize(size, Image.Resampling.LANCZOS)


def _growth(simulation: Simulation, plane: Plane) -> Array:
    """Logarithm of what a step multiplies an oscillator by, for each pixel of the plot; from the solver's own steps."""
    from PIL import Image

    left, top, right, bottom = PLOT
    size = (right - left, bottom - top)
    count = [side // COARSE + 1 for side in size]
    x = left + np.linspace(0.5, size[0] - 0.5, count[0])
    y = top + np.linspace(0.5, size[1] - 0.5, count[1])
    upper = y <= plane.zero[1] + COARSE  # the lower half is its image
    z = plane.number(x[None, :], y[upper, None])
    speed = np.maximum(np.abs(z), 1e-6)
    factor = amplification(simulation.solver, speed, np.clip(-z.real / speed, -1.0, 1.0), 1.0)
    with np.errstate(all="ignore"):
        growth = np.log(np.where(np.isfinite(factor), np.maximum(factor, 1e-6), 1e6))
    whole = np.empty((count[1], count[0]))
    whole[upper] = growth
    mirrored = np.interp(2 * plane.zero[1] - y[~upper], y[upper], np.arange(upper.sum()))
    whole[~upper] = growth[np.rint(mirrored).astype(int)]
    coarse = Image.fromarray(np.clip(whole - ALMOST, -3.0, 3.0).astype(np.float32))
    return np.asarray(coarse.resize(size, Image.Resampling.BICUBIC), np.float64)


def _amplified(simulation: Simulation, motions: Modes) -> NDArray[np.bool_]:
    """Which motions a step of the simulation makes larger that do not grow by themselves."""
    stiffness, damping = motions.stiffness, motions.damping
    middle, gap = -0.5 * damping, np.sqrt(0.25 * damping * damping - stiffness)
    own = np.maximum(np.maximum((middle + gap).real, (middle - gap).real), 0.0) * simulation.dt
    factor = amplification_of_modes(simulation.solver, stiffness, damping, simulation.dt)
    return np.asarray(~(np.log(np.maximum(factor, TINY)) <= own + ROUNDING))


def _scale(picture: Picture, draw: Any) -> None:
    """The colours of shares from none to one and a half."""
    from PIL import Image

    left, top, right, bottom = BAR
    share = np.linspace(0.0, max(SHARES), right - left)
    rgb = np.clip(_light(share)[:, :3], 0.0, 1.0)
    picture.paste(Image.fromarray(np.tile((255 * srgb(rgb)).astype(np.uint8), (bottom - top, 1, 1))), (left, top))
    for place in (0.0, 0.5, 1.0, 1.5):
        x = left + place / max(SHARES) * (right - left - 1)
        draw.line((x, bottom, x, bottom + 5), FAINT)
        anchor = "lm" if place == 0.0 else "rm" if place == max(SHARES) else "mm"
        text = f"{100 * place:.0f} %" + (" and more" if place == max(SHARES) else "")
        draw.text((x, bottom + 14), text, FAINT, _font(14), anchor)
    x = left + (right - left - 1) / max(SHARES)
    draw.line((x, top - 4, x, bottom + 5), INK, 2)


def _words(draw: Any, plane: Plane, simulation: Simulation, found: Stability) -> None:
    """Heads, labels and numbers."""
    left, top, right, bottom = PLOT
    safe = simulation.dt <= found.largest_safe_dt
    draw.text((left, 30), f"{found.solver}, dt = {simulation.dt:.4g} s", INK, _font(26), "lm")
    limit = "any" if math.isinf(found.largest_safe_dt) else f"{found.largest_safe_dt:.4g} s"
    verdict = f"{'safe' if safe else 'not safe'}: largest safe dt {limit}"
    draw.text((SCENE[2], 30), verdict, EDGE if safe else ALARM, _font(26), "rm")
    draw.text((left, 70), "eigenvalues times dt, and where a step keeps them in bounds", FAINT, _font(17), "lm")
    colors = "share of the limit, with what the neighbours add" if found.elements else "the start; nothing is linked"
    draw.text((SCENE[0], 70), colors, FAINT, _font(17), "lm")
    step = _nice(0.5 * (bottom - top) / plane.scale / 3)
    for k in range(-40, 41):
        x, y = plane.pixel(complex(k * step, 0.0))[0], plane.pixel(complex(0.0, k * step))[1]
        if left + 12 < x < right - 12:
            draw.line((x, bottom, x, bottom + 5), FAINT)
            draw.text((x, bottom + 16), f"{k * step:g}", FAINT, _font(14), "mm")
        if top + 8 < y < bottom - 8:
            draw.line((left - 5, y, left, y), FAINT)
            draw.text((left - 10, y), f"{k * step:g}", FAINT, _font(14), "rm")
    draw.text((right - 8, plane.zero[1] + 14), "Re lambda · dt", FAINT, _font(14), "rm")
    draw.text((plane.zero[0] + 10, top + 14), "Im lambda · dt", FAINT, _font(14), "lm")
    kinds: Sequence[tuple[Ink, str]] = ((CALM, "kept in bounds"), (ALARM, "amplified"))
    x = float(left)
    for ink, text in kinds:
        draw.ellipse((x, bottom + 33, x + 9, bottom + 42), ink)
        draw.text((x + 16, bottom + 38), text, FAINT, _font(15), "lm")
        x += 40 + _font(15).getlength(text)
    carriers = found.carriers(1)
    if carriers:
        draw.text((SCENE[0], bottom + 38), f"the fastest motion is most in {carriers[0]}", FAINT, _font(15), "lm")


def _font(size: float) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _nice(step: float) -> float:
    """1, 2 or 5 times a power of ten near a step."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.99 * step)
