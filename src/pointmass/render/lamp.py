"""The light of a picture as numbers for the kernels.

0-2 unit vector to the key light, 3-5 up (both in view coordinates), 6-8 colour of the key light, 9-11 of the sky,
12-14 of the ground, 15 strength of the rim, 16 distance by which a surface is lifted out of its own shadow [m],
17 one over the radius of the pool of light [1/m], 18 depth of its middle [m], 19-21 what lies in the dark.
"""

from __future__ import annotations

import numpy as np

from pointmass.frame import Camera
from pointmass.render.camera import View, direction, turn
from pointmass.render.shadow import Shadow
from pointmass.render.style import Style
from pointmass.render.tables import F32, F64

KEY = np.array((0.86, 0.80, 0.72))
SKY = np.array((0.62, 0.78, 1.00))
GROUND = np.array((0.34, 0.28, 0.26))
RIM = 0.30
LIFT = 1.2  # [texels]


def key_direction(style: Style, view: View) -> F64:
    """Unit vector to the key light in view coordinates."""
    light = np.asarray(style.light, dtype=np.float64)
    result: F64 = turn((light / np.sqrt((light * light).sum()))[None], view.axes)[0]
    return result


def lamp(style: Style, view: View, camera: Camera, shadow: Shadow) -> F32:
    """The numbers, shape (22,)."""
    scale = float(np.sqrt((shadow.matrix[0, :3].astype(np.float64) ** 2).sum()))
    above = turn(direction(camera.up)[None], view.axes)[0]
    lift = LIFT / scale if scale > 0.0 else 0.0
    distance = float(np.sqrt(((np.asarray(camera.target) - view.eye) ** 2).sum()))
    radius = style.pool * distance * 0.5 * view.height / view.focal
    pool = (1.0 / radius if radius > 0.0 else 0.0, distance)
    colors = (KEY, style.ambient * SKY, style.ambient * GROUND)
    parts = (key_direction(style, view), above, *colors, (RIM, lift), pool, style.bottom)
    return np.concatenate(parts).astype(np.float32)
