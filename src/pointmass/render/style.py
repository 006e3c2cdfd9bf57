"""How a picture looks: background, light, exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pointmass.errors import InvalidInput, number, whole_number

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Style:
    """The look of a picture; the defaults are a dark studio with one soft key light.

    Attributes
    ----------
    bottom, top : linear RGB of the background at the lower and at the upper edge.
    exposure : factor on all light before the tone map.
    samples : samples for each pixel and axis for solid things (1 to 4); 2 means four samples per pixel.
    light : direction from the scene towards the key light, in world coordinates.
    ambient : strength of the light that comes from everywhere.
    pool : radius of the pool of light around the camera's target, in halves of the picture's height (0 = no end).
    bloom : how much of what is brighter than white spills around it (0 = none).
    shadows : whether solid things throw shadows.
    caption : write the time and the energy into the lower left corner.
    shutter : exposure time [s]: particles are smeared along the way that they went at their speed meanwhile, 0 = a
        moment; None = as the frames say, see `Look.shutter`.
    transparent : no background: pictures have an alpha, and look over black as they do without. What glows lies over
        other things as light does. Two pictures are drawn for one.

    Raises
    ------
    InvalidInput : a number is out of its range.
    """

    bottom: Triple = (0.0105, 0.0150, 0.0240)
    top: Triple = (0.0030, 0.0042, 0.0085)
    exposure: float = 1.0
    samples: int = 2
    light: Triple = (-0.45, 1.0, 0.55)
    ambient: float = 0.34
    pool: float = 1.8
    bloom: float = 0.6
    shadows: bool = True
    caption: bool = False
    shutter: float | None = None
    transparent: bool = False

    def __post_init__(self) -> None:
        number("style.exposure", self.exposure, above=0.0)
        number("style.ambient", self.ambient, at_least=0.0)
        number("style.pool", self.pool, at_least=0.0)
        number("style.bloom", self.bloom, at_least=0.0)
        if self.shutter is not None:
            number("style.shutter", self.shutter, at_least=0.0, unit="s")
        if whole_number("style.samples", self.samples, at_least=1) > 4:
            raise InvalidInput(f"style.samples = {self.samples} is not allowed: it must be 1, 2, 3 or 4")
        for name in ("bottom", "top", "light"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise InvalidInput(f"style.{name} = {getattr(self, name)} is not allowed: it must be 3 finite numbers")
        if not np.any(np.asarray(self.light)):
            raise InvalidInput("style.light = (0, 0, 0) is not allowed: it must be a direction")
        if min(*self.bottom, *self.top) < 0.0:
            raise InvalidInput("style.bottom and style.top must not be negative: they are linear RGB")
