"""Small print in the lower left corner: the time and the energy."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import Frame

INK, SHADE = (214, 222, 233), (8, 10, 16)
GROW = 30  # the letters are this fraction of the picture's height, unless the words are too long then
READABLE = 9  # and not lower than this [pixels], unless likewise


def caption(picture: NDArray[np.uint8], frame: Frame) -> NDArray[np.uint8]:
    """A copy of the picture with the frame's time and energy written into it."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = picture.shape[:2]
    words = caption_words(frame)
    letters = max(READABLE, height / GROW)
    room = width - 2.0 * letters
    letters *= min(1.0, room / ImageFont.load_default(letters).getlength(words), 0.25 * height / letters)
    if letters < 1.0:
        return picture
    copy = Image.fromarray(picture)
    ImageDraw.Draw(copy).text(
        (letters, height - letters),
        words,
        INK,
        ImageFont.load_default(letters),
        "ls",
        stroke_width=max(1, round(letters / 16)),
        stroke_fill=SHADE,
    )
    return np.array(copy)


def caption_words(frame: Frame) -> str:
    """What the caption says."""
    energy = frame.quantities.get("energy", math.nan)
    return f"t = {frame.time:.3f} s" + (f"   E = {energy:#.4g} J" if math.isfinite(energy) else "")
