"""The loops that turn light into a picture: bloom, tone map, sRGB, dither."""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np
from numba import njit

from pointmass.render.inner import bare, inner

ZERO = np.float32(0.0)
ONE = np.float32(1.0)
HALF = np.float32(0.5)
SHOULDER = np.float32(0.6)  # below this the tone map changes nothing
BLINDING = np.float32(1e30)
FADE = np.float32(0.5)  # how much a light that is too bright for its hue turns white


@inner
def _halve(fine, coarse):
    """Half the size, with weights 1 3 3 1 along both axes."""
    height, width = fine.shape[0], fine.shape[1]
    for row in range(coarse.shape[0]):
        for column in range(coarse.shape[1]):
            r, g, b = ZERO, ZERO, ZERO
            for j in range(4):
                y = min(max(2 * row + j - 1, 0), height - 1)
                wy = np.float32(0.375) if 0 < j < 3 else np.float32(0.125)
                for i in range(4):
                    x = min(max(2 * column + i - 1, 0), width - 1)
                    w = wy * (np.float32(0.375) if 0 < i < 3 else np.float32(0.125))
                    r += w * fine[y, x, 0]
                    g += w * fine[y, x, 1]
                    b += w * fine[y, x, 2]
            coarse[row, column, 0] = r
            coarse[row, column, 1] = g
            coarse[row, column, 2] = b


@inner
def _neighbours(index, count):
    """The two coarse cells around a fine one: the nearer (weight 3/4) and the farther (1/4)."""
    near = min(index // 2, count - 1)
    far = min(max(near + (1 if index % 2 else -1), 0), count - 1)
    return near, far


@inner
def _doubled(coarse, row, column):
    """A coarse image between its cells, at a cell of twice its size."""
    y, y2 = _neighbours(row, coarse.shape[0])
    x, x2 = _neighbours(column, coarse.shape[1])
    a, b, c = np.float32(9.0 / 16.0), np.float32(3.0 / 16.0), np.float32(1.0 / 16.0)
    return (
        a * coarse[y, x, 0] + b * (coarse[y, x2, 0] + coarse[y2, x, 0]) + c * coarse[y2, x2, 0],
        a * coarse[y, x, 1] + b * (coarse[y, x2, 1] + coarse[y2, x, 1]) + c * coarse[y2, x2, 1],
        a * coarse[y, x, 2] + b * (coarse[y, x2, 2] + coarse[y2, x, 2]) + c * coarse[y2, x2, 2],
    )


@njit(nogil=True, cache=True, error_model="numpy")
def bloom(bright, levels, decay):
    """Spread `bright` in place: the sum of blurs, each twice as wide as the last and `decay` times as strong."""
    pyramid = [bright]
    for _ in range(levels):
        fine = pyramid[-1]
        coarse = np.empty(((fine.shape[0] + 1) // 2, (fine.shape[1] + 1) // 2, 3), dtype=np.float32)
        _halve(fine, coarse)
        pyramid.append(coarse)
    for level in range(levels - 1, -1, -1):
        fine, coarse = pyramid[level], pyramid[level + 1]
        keep = ZERO if level == 0 else ONE - decay
        for row in range(fine.shape[0]):
            for column in range(fine.shape[1]):
                r, g, b = _doubled(coarse, row, column)
                fine[row, column, 0] = keep * fine[row, column, 0] + decay * r
                fine[row, column, 1] = keep * fine[row, column, 1] + decay * g
                fine[row, column, 2] = keep * fine[row, column, 2] + decay * b


@inner
def _roll(value):
    """The identity up to the shoulder, then an exponential towards 1."""
    if value <= SHOULDER:
        return value
    rest = ONE - SHOULDER
    return ONE - rest * np.float32(math.exp(-(value - SHOULDER) / rest))


@inner
def _byte(light, curve, dither):
    index = np.int64(math.sqrt(min(max(light, ZERO), ONE)) * np.float32(curve.shape[0] - 1) + HALF)
    return np.uint8(min(max(curve[index] + dither, ZERO), np.float32(255.0)))


@njit(nogil=True, cache=True, error_model="numpy")
def develop(first, last, image, light, spill, strength, exposure, curve, pattern):
    """Rows [first, last): tone map `light` plus `strength` times `spill` (of half the size) into sRGB bytes.

    The brightest channel goes through the shoulder and the others keep their ratio to it, so that a bright glow keeps
    its hue; part of the way each channel goes alone, which turns the hottest light towards white as film does.
    """
    image, light, spill, curve, pattern = bare(image), bare(light), bare(spill), bare(curve), bare(pattern)
    for row in range(first, last):
        for column in range(light.shape[1]):
            r, g, b = light[row, column, 0], light[row, column, 1], light[row, column, 2]
            if strength > ZERO:
                wide_r, wide_g, wide_b = _doubled(spill, row, column)
                r, g, b = r + strength * wide_r, g + strength * wide_g, b + strength * wide_b
            r, g, b = exposure * r, exposure * g, exposure * b
            if not r + g + b < BLINDING:  # true for NaN too, which has no place in a table
                r, g, b = ONE, ONE, ONE
            top = max(r, g, b)
            if top > SHOULDER:
                scale = (ONE - FADE) * _roll(top) / top
                r = scale * r + FADE * _roll(r)
                g = scale * g + FADE * _roll(g)
                b = scale * b + FADE * _roll(b)
            dither = pattern[row % pattern.shape[0], column % pattern.shape[1]]
            image[row, column, 0] = _byte(r, curve, dither)
            image[row, column, 1] = _byte(g, curve, dither)
            image[row, column, 2] = _byte(b, curve, dither)
