"""Where the camera stands: where the scene says, or so that all that was seen so far is in the picture."""

from __future__ import annotations

from pointmass.frame import Camera, Frame
from pointmass.render import fit_camera
from pointmass.viewer.messages import View

EVERY = 0.25  # simulated time between two frames that are looked at [s]
MOST = 24  # of them; after that the camera stays
NOWHERE = (0.0, 1.0, 5.0)  # while there is nothing to be seen


class Framing:
    """Finds the place of a camera that is not given one.

    Attributes
    ----------
    view : the place so far.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._fixed = camera.position is not None and camera.target is not None
        self._seen: list[Frame] = []
        self.view = _view(camera)

    def sees(self, frame: Frame) -> bool:
        """Take a frame into account; returns whether that moves the camera."""
        late = bool(self._seen) and frame.time < self._seen[-1].time + EVERY
        if self._fixed or late or len(self._seen) >= MOST or not len(frame.positions):
            return False
        self._seen.append(frame)
        self.view = _view(fit_camera(self._seen, self._camera))
        return True


def _view(camera: Camera) -> View:
    position, target = camera.position or NOWHERE, camera.target or (0.0, 0.0, 0.0)
    return View(position=position, target=target, up=camera.up, fov=camera.fov)
