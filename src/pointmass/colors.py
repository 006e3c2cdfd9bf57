"""Colours as linear light: by name, by temperature, from palettes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pointmass.errors import InvalidInput, number

Array = NDArray[np.floating[Any]]
Color = str | float  # a name, "#rrggbb", or a temperature [K]

PALETTES = {  # sRGB anchors from low to high
    "fire": ("#3b0f5c", "#a01a58", "#e8452c", "#ffa62b", "#fff3b0"),
    "ice": ("#0b2545", "#13518f", "#2f9fd0", "#8fe0f0", "#f4ffff"),
    "spectrum": ("#5465ff", "#2ec4b6", "#9be15d", "#ffd23f", "#ff5d5d"),
    "aurora": ("#16324f", "#18a999", "#7ae582", "#f6f740", "#ff6f91"),
    # Even steps of lightness, also for eyes that tell fewer hues (van der Walt and Smith 2015; CC0).
    "viridis": (
        *("#440154", "#482878", "#3e4a89", "#31688e", "#26828e"),
        *("#1f9e89", "#35b779", "#6dcd59", "#b4de2c", "#fde725"),
    ),
}
COOLEST, HOTTEST = 800.0, 40_000.0  # [K]; what is colder glows for no eye (Draper 1847), what is hotter is as blue
SECOND = 1.438776877e7  # Planck's second radiation constant [nm K]
TO_SRGB = np.array(((3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)))  # IEC 61966-2-1


def linear(color: Color, brightness: float = 1.0) -> NDArray[np.float32]:
    """A colour name, "#rrggbb" or a temperature [K] as linear-light RGBA, shape (4,).

    Raises
    ------
    InvalidInput
        A name that is not known, a temperature below 800 or above 40,000 K.
    """
    if not isinstance(color, str):
        kelvin = number("color", color, at_least=COOLEST, at_most=HOTTEST, unit="K")
        return np.append(brightness * blackbody(kelvin), 1.0).astype(np.float32)
    from PIL import ImageColor

    try:
        rgb = np.array(ImageColor.getrgb(color)[:3], np.float64) / 255
    except ValueError:
        raise InvalidInput(f"color {color!r} is not known: use a name such as orange, or #rrggbb") from None
    light = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return np.append(brightness * light, 1.0).astype(np.float32)


def srgb(light: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """What files and screens expect for linear light, both from 0 to 1 (IEC 61966-2-1)."""
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def palette(name: str, level: Array, brightness: float = 1.0) -> NDArray[np.float32]:
    """Colours of levels in [0, 1], shape (n, 4)."""
    anchors = np.array([linear(c, brightness) for c in PALETTES[name]])
    at = np.linspace(0, 1, len(anchors))
    return np.stack([np.interp(level, at, anchors[:, k]) for k in range(4)], axis=1).astype(np.float32)


def blackbody(kelvin: ArrayLike) -> NDArray[np.float64]:
    """The colour in which a body of this temperature glows: linear RGB whose largest channel is 1, shape (*kelvin, 3).

    Planck's law seen by the CIE 1931 observer (as fitted by Wyman, Sloan and Shirley, Simple Analytic Approximations to
    the CIE XYZ Color Matching Functions, JCGT 2(2), 2013), in sRGB's primaries; what lies outside of them is cut.
    Temperatures are held between 800 and 40,000 K.
    """
    at = np.log(np.clip(np.asarray(kelvin, np.float64), COOLEST, HOTTEST))
    logs, table = _glowing()
    result: NDArray[np.float64] = np.stack([np.interp(at, logs, table[:, k]) for k in range(3)], axis=-1)
    return result


@lru_cache(maxsize=1)
def _glowing() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Logarithms of temperatures, and the colour of each."""
    logs = np.linspace(np.log(COOLEST), np.log(HOTTEST), 256)
    rgb: NDArray[np.float64] = np.maximum(np.einsum("ij,kj->ik", planckian(np.exp(logs)), TO_SRGB), 0.0)
    rgb /= rgb.max(axis=1, keepdims=True)
    return logs, rgb


def planckian(kelvin: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIE 1931 XYZ of black bodies, scaled to X + Y + Z = 1, shape (n, 3)."""
    nm = np.arange(380.0, 781.0, 5.0)
    # Divided by what there is at 780 nm, or a cold body's light would vanish among the numbers.
    power = (780.0 / nm) ** 5 * np.expm1(SECOND / (780.0 * kelvin[:, None])) / np.expm1(SECOND / (nm * kelvin[:, None]))
    xyz: NDArray[np.float64] = (power[:, :, None] * _observer(nm)).sum(axis=1)
    xyz /= xyz.sum(axis=1, keepdims=True)
    return xyz


def _observer(nm: NDArray[np.float64]) -> NDArray[np.float64]:
    """The CIE 1931 colour matching functions by sums of lobes, shape (n, 3)."""

    def lobe(height: float, middle: float, left: float, right: float) -> NDArray[np.float64]:
        wide = (nm - middle) / np.where(nm < middle, left, right)
        result: NDArray[np.float64] = height * np.exp(-0.5 * wide * wide)
        return result

    x = lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2)
    y = lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1)
    z = lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8)
    return np.stack([x, y, z], axis=1)
