"""Pictures and films of frames, drawn by loops of our own: no window, no GPU, the same bytes on any number of threads."""

from pointmass.render.camera import fit_camera
from pointmass.render.image import image
from pointmass.render.style import Style

__all__ = ["Style", "fit_camera", "image"]
