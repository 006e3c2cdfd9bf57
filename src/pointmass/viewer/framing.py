"""Where the camera stands: where the scene says, or so that all that was seen so far is in the picture."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import Camera, Frame
from pointmass.render import fit_camera
from pointmass.render.camera import breadth, interesting, placed
from pointmass.viewer.messages import View

EVERY = 0.25  # simulated time between two frames that are looked at [s]
MOST = 24  # of them; after that the camera stays
NOWHERE = (0.0, 1.0, 5.0)  # while there is nothing to be seen
SHAPE = 16 / 9  # width of the picture for which a place is found, over its height


class Framing:
    """Finds the place of a camera that is not given one, and how much of the picture there is something to be seen in.

    Attributes
    ----------
    view : the place so far.
    """

    def __init__(self, camera: Camera) -> None:
        self._fixed = bool(len(camera.path)) or (camera.position is not None and camera.target is not None)
        self._camera = fit_camera((), camera) if self._fixed else camera
        self._spots: list[NDArray[np.float64]] = []
        self._last = -math.inf  # time of the last frame that was looked at [s]
        self.view = _view(self._camera, SHAPE)

    def sees(self, frame: Frame) -> bool:
        """Take a frame into account; returns whether that moves the camera."""
        if frame.time < self._last + EVERY or len(self._spots) >= MOST or not len(frame.positions):
            return False
        self._last = frame.time
        self._spots.append(interesting([frame]))
        spots = np.concatenate(self._spots)
        camera = self._camera if self._fixed else placed(spots, self._camera)
        before, self.view = self.view, _view(camera, breadth(spots, camera))
        return self.view != before


def _view(camera: Camera, wide: float) -> View:
    position, target = camera.position or NOWHERE, camera.target or (0.0, 0.0, 0.0)
    most = SHAPE * math.tan(math.radians(camera.fov) / 2.0)
    return View(position=position, target=target, up=camera.up, fov=camera.fov, wide=min(wide, most))
