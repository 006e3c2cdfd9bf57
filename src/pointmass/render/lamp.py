"""The light of a picture as numbers for the kernels.

0-2 unit vector to the key light, 3-5 up (both in view coordinates), 6-8 colour of the key light, 9-11 of the sky,
12-14 of the ground, 15 strength of the rim, 16 distance by which a surface is lifted out of its own shadow [m].
"""

from __future__ import annotations

import numpy as np

from pointmass.render.camera import View, turn
from pointmass.render.shadow import Shadow
from pointmass.render.style import Style
from pointmass.render.tables import F32, F64

KEY = np.array((1.00, 0.95, 0.87))
SKY = np.array((0.62, 0.78, 1.00))
GROUND = np.array((0.34, 0.28, 0.26))
RIM = 0.35
LIFT = 1.2  # [texels]


def key_direction(style: Style, view: View) -> F64:
    """Unit vector to the key light in view coordinates."""
    light = np.asarray(style.light, dtype=np.float64)
    result: F64 = turn((light / np.sqrt((light * light).sum()))[None], view.axes)[0]
    return result


def lamp(style: Style, view: View, up: tuple[float, float, float], shadow: Shadow) -> F32:
    """The numbers, shape (17,)."""
    scale = float(np.sqrt((shadow.matrix[0, :3].astype(np.float64) ** 2).sum()))
    above = np.asarray(up, dtype=np.float64)
    above = turn((above / np.sqrt((above * above).sum()))[None], view.axes)[0]
    lift = LIFT / scale if scale > 0.0 else 0.0
    parts = (key_direction(style, view), above, KEY, style.ambient * SKY, style.ambient * GROUND, (RIM, lift))
    return np.concatenate(parts).astype(np.float32)
