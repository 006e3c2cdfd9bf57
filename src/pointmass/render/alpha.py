"""What pictures without a background let through: they are drawn before black and before white, and compared.

All light is added up before the tone map, so the difference of the two is exactly the share of the background.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pointmass.render.style import Style
from pointmass.render.tables import F32

BLACK, WHITE = 0.0, 1.0


def before(style: Style, gray: float) -> Style:
    """The same style before a background of one gray, in which also what lies in the dark is of that gray."""
    return replace(style, bottom=(gray,) * 3, top=(gray,) * 3)


def covered(over_black: F32, over_white: F32) -> F32:
    """How much of the background each pixel covers, from 0 to 1, by its light before both; shape (height, width)."""
    share: F32 = np.clip(1 - (over_white - over_black).mean(axis=0), 0, 1)
    return share


def with_alpha(picture: NDArray[np.uint8], share: F32) -> NDArray[np.uint8]:
    """A picture before black as one with an alpha, which looks before black the same.

    Light without a body, such as a glow, covers as much as it is bright: what it is laid over shines through.
    """
    shown = picture.astype(np.float32) / 255
    alpha = np.maximum(share, shown.max(axis=2))[:, :, None]
    color = shown / np.where(alpha == 0, 1, alpha)
    return np.round(255 * np.concatenate([color, alpha], axis=2)).astype(np.uint8)
