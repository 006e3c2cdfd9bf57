"""The loops that turn light into a picture: bloom, tone map, sRGB, dither.

They work along lines of one colour, so that the processor does many pixels at once.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np

from pointmass.kernels_base import inner
from pointmass.render.inner import bare, kernel

ZERO = np.float32(0.0)
ONE = np.float32(1.0)
HALF = np.float32(0.5)
QUARTER = np.float32(0.25)
THREE_QUARTERS = np.float32(0.75)
ONE_EIGHTH = np.float32(0.125)
THREE_EIGHTHS = np.float32(0.375)
SHOULDER = np.float32(0.6)  # below this the tone map changes nothing
BLINDING = np.float32(1e30)
FADE = np.float32(0.5)  # how much a light that is too bright for its hue turns white


@inner
def _halve(fine, coarse, line):
    """Half the size, with weights 1 3 3 1 along both axes; `line` is room for a row and two more cells."""
    height, width = fine.shape
    for row in range(coarse.shape[0]):
        above, upper = fine[max(2 * row - 1, 0)], fine[2 * row]
        lower, below = fine[min(2 * row + 1, height - 1)], fine[min(2 * row + 2, height - 1)]
        for x in range(width):
            line[x + 1] = ONE_EIGHTH * (above[x] + below[x]) + THREE_EIGHTHS * (upper[x] + lower[x])
        line[0], line[width + 1], line[width + 2] = line[1], line[width], line[width]
        for x in range(coarse.shape[1]):
            outer, nearer = line[2 * x] + line[2 * x + 3], line[2 * x + 1] + line[2 * x + 2]
            coarse[row, x] = ONE_EIGHTH * outer + THREE_EIGHTHS * nearer


@inner
def _double(coarse, row, line, wide):
    """One row of twice the size, between the cells of a coarse plane, into `wide`; `line` is room for a row of it."""
    near = min(row // 2, coarse.shape[0] - 1)
    far = min(max(near + (1 if row % 2 else -1), 0), coarse.shape[0] - 1)
    here, there = coarse[near], coarse[far]
    cells = coarse.shape[1]
    for x in range(cells):
        line[x + 1] = THREE_QUARTERS * here[x] + QUARTER * there[x]
    line[0], line[cells + 1] = line[1], line[cells]
    for x in range(cells):
        wide[2 * x] = THREE_QUARTERS * line[x + 1] + QUARTER * line[x]
        wide[2 * x + 1] = THREE_QUARTERS * line[x + 1] + QUARTER * line[x + 2]


@kernel
def bloom(bright, levels, decay):
    """Spread one plane in place: the sum of blurs, each twice as wide as the last and `decay` times as strong."""
    pyramid = [bright]
    line = np.empty(bright.shape[1] + 3, dtype=np.float32)
    wide = np.empty(bright.shape[1] + 3, dtype=np.float32)
    for _ in range(levels):
        fine = pyramid[-1]
        coarse = np.empty(((fine.shape[0] + 1) // 2, (fine.shape[1] + 1) // 2), dtype=np.float32)
        _halve(fine, coarse, line)
        pyramid.append(coarse)
    for level in range(levels - 1, -1, -1):
        fine, coarse = pyramid[level], pyramid[level + 1]
        keep = ZERO if level == 0 else ONE - decay
        for row in range(fine.shape[0]):
            _double(coarse, row, line, wide)
            for x in range(fine.shape[1]):
                fine[row, x] = keep * fine[row, x] + decay * wide[x]


@inner
def _roll(value):
    """The identity up to the shoulder, then an exponential towards 1."""
    if value <= SHOULDER:
        return value
    rest = ONE - SHOULDER
    return ONE - rest * np.float32(math.exp(-(value - SHOULDER) / rest))


@inner
def _tame(red, green, blue):
    """The tone map, in place.

    The brightest channel goes through the shoulder and the others keep their ratio to it, so that a bright glow keeps
    its hue; part of the way each channel goes alone, which turns the hottest light towards white as film does.
    """
    for x in range(len(red)):
        r, g, b = red[x], green[x], blue[x]
        if r <= SHOULDER and g <= SHOULDER and b <= SHOULDER:
            continue
        if not r + g + b < BLINDING:  # true for NaN too, which has no place in a table
            r, g, b = ONE, ONE, ONE
        top = max(r, g, b)
        scale = (ONE - FADE) * _roll(top) / top
        red[x] = scale * r + FADE * _roll(r)
        green[x] = scale * g + FADE * _roll(g)
        blue[x] = scale * b + FADE * _roll(b)


@kernel
def develop(first, last, image, light, spill, strength, exposure, curve, pattern):
    """Rows [first, last): tone map `light` plus `strength` times `spill` (of half the size) into sRGB bytes."""
    image, light, spill, curve, pattern = bare(image), bare(light), bare(spill), bare(curve), bare(pattern)
    width = light.shape[2]
    colors = np.empty((3, width), dtype=np.float32)
    steps = np.empty(width, dtype=np.int32)
    line = np.empty(spill.shape[2] + 3, dtype=np.float32)
    wide = np.empty(2 * spill.shape[2], dtype=np.float32)
    finest = np.float32(curve.shape[0] - 1)
    for row in range(first, last):
        for channel in range(3):
            source, target = light[channel, row], colors[channel]
            if strength > ZERO:
                _double(spill[channel], row, line, wide)
                for x in range(width):
                    target[x] = exposure * (source[x] + strength * wide[x])
            else:
                for x in range(width):
                    target[x] = exposure * source[x]
        _tame(colors[0], colors[1], colors[2])
        thresholds = pattern[row % pattern.shape[0]]
        for channel in range(3):
            source = colors[channel]
            for x in range(width):
                steps[x] = np.int32(math.sqrt(min(max(source[x], ZERO), ONE)) * finest + HALF)
            for x in range(width):
                value = curve[steps[x]] + thresholds[x % len(thresholds)]
                image[row, x, channel] = np.uint8(min(value, np.float32(255.0)))
