"""Motion blur by the velocities of a frame, for frames that were made with another exposure time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pointmass.frame import Drawable, Frame, Points


def exposed(frame: Frame, shutter: float) -> Frame:
    """The frame with its particles smeared along the way that they went in an exposure time [s], 0 = a moment."""
    return replace(frame, drawables=tuple(_smeared(drawable, frame, shutter) for drawable in frame.drawables))


def _smeared(drawable: Drawable, frame: Frame, shutter: float) -> Drawable:
    if not isinstance(drawable, Points) or drawable.vertices is not None:
        return drawable
    rows: Any = slice(None) if drawable.index is None else drawable.index
    return replace(drawable, motion=(shutter * frame.velocities[rows]).astype(np.float32) if shutter > 0 else None)
