"""Paints frames: drawables in other colours than the scene's, and lines and arrows that lie over them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.hair import STRAND
from pointmass.colors import linear
from pointmass.frame import Curves, Drawable, Floats, Frame, Ints, Points, Segments, Triangles

Colors = NDArray[np.float32]
THIN_PUFF = 0.15  # radius of a puff that is shown as a ball
NEUTRAL = linear("#8b95a5")


def painted(frame: Frame, colors: Colors, version: int) -> tuple[Drawable, ...]:
    """The drawables of a frame with a colour for each particle, linear RGBA of shape (n, 4)."""
    result: list[Drawable] = []
    for drawable in frame.drawables:
        own = getattr(drawable, "vertices", None) is not None
        if isinstance(drawable, Points) and not own:
            result.append(ball(drawable, colors if drawable.index is None else colors[drawable.index], version))
        elif isinstance(drawable, Segments) and not own:
            mean = 0.5 * (colors[drawable.pairs[:, 0]] + colors[drawable.pairs[:, 1]])
            result.append(replace(drawable, color=mean, glow=False, version=version))
        elif isinstance(drawable, Curves) and not own:
            result.append(replace(drawable, color=colors[drawable.index], glow=False, version=version))
        elif isinstance(drawable, Triangles) and not own:
            result.append(replace(drawable, color=colors, uv=None, pattern="plain", version=version))
        elif not is_strand(drawable):
            result.append(drawable)
    return tuple(result)


def bare(frame: Frame, colors: Colors, version: int) -> tuple[Drawable, ...]:
    """The drawables of a frame without its springs and the surfaces on them, and its particles in other colours."""
    result: list[Drawable] = []
    for drawable in frame.drawables:
        moves = isinstance(drawable, (Segments, Triangles)) and drawable.vertices is None
        if isinstance(drawable, Points) and drawable.vertices is None:
            result.append(ball(drawable, colors if drawable.index is None else colors[drawable.index], version))
        elif not moves and not is_strand(drawable):
            result.append(drawable)
    return tuple(result)


def ball(points: Points, colors: Colors, version: int) -> Points:
    """Particles as balls of these colours, whatever they were: light that adds up has no colour of its own."""
    radius: Any = np.multiply(points.radius, THIN_PUFF) if points.soft else points.radius
    return replace(
        points, color=colors, radius=radius, glow=False, soft=False, motion=None, normals=None, version=version
    )


def lines(name: str, pairs: Ints, color: Any, width: float, version: int) -> Segments:
    """Springs between rows of the frame."""
    return Segments(name=name, pairs=pairs.astype(np.int32), color=color, width=width, version=version)


def is_strand(drawable: Drawable) -> bool:
    """Whether it is hair, which has corners of its own."""
    return isinstance(drawable, Curves) and drawable.name.rpartition("/")[2].startswith(f"{STRAND} ")


def extent(positions: Floats) -> float:
    """Size of what is seen [m], without the few that are far away."""
    good = positions[np.isfinite(positions).all(axis=1)] if len(positions) else positions
    if len(good) < 2:
        return 1.0
    low, high = np.percentile(good[:: max(1, len(good) // 10_000)], [2, 98], axis=0)
    return max(float((high - low).max()), 1e-3)
