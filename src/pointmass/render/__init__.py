"""Pictures and films of frames, drawn by loops of our own: no window, no GPU, the same bytes on any number of threads.

Numba, PyAV and Pillow are loaded when the first picture or film is made.
"""

from pointmass.render.camera import fit_camera
from pointmass.render.film import SUFFIXES, check_write, write
from pointmass.render.image import image
from pointmass.render.style import Style

__all__ = ["SUFFIXES", "Style", "check_write", "fit_camera", "image", "write"]
