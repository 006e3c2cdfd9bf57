"""Small print in the lower left corner: the time, and what the frame measures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import Frame

INK = (205, 214, 226, 215)
GROW = 44  # the letters are this fraction of the picture's height


def caption(picture: NDArray[np.uint8], frame: Frame) -> NDArray[np.uint8]:
    """A copy of the picture with the frame's time and quantities written into it."""
    from PIL import Image, ImageDraw, ImageFont

    height = picture.shape[0]
    letters = max(9, round(height / GROW))
    words = [f"t = {frame.time:.3f} s", *(f"{name} = {value:.4g}" for name, value in frame.quantities.items())]
    base = Image.fromarray(picture).convert("RGBA")
    layer = Image.new("RGBA", base.size, (0, 0, 0, 0))
    pen = ImageDraw.Draw(layer)
    pen.text((letters, height - letters), "     ".join(words), INK, ImageFont.load_default(letters), anchor="ld")
    return np.array(Image.alpha_composite(base, layer).convert("RGB"))
