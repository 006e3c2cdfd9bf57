"""The loops that draw the shadow map."""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np

from pointmass.kernels_base import inner
from pointmass.render.inner import bare, kernel

FAR = np.float32(np.inf)
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
HALF = np.float32(0.5)
TINY = np.float32(1e-12)
STEEP = np.float32(1e-3)  # [texels] a line that rises less has no slope


@inner
def _clamp(value, low, high):
    return min(max(value, low), high)


@inner
def _keep_nearest(depth, row, column, value):
    depth[row, column] = min(value, depth[row, column])


@inner
def _span(low, high, first, last):
    """Whole texels between low and high, inside [first, last)."""
    a = np.int64(_clamp(math.floor(low), np.float32(first), np.float32(last)))
    b = np.int64(_clamp(math.ceil(high), np.float32(first), np.float32(last)))
    return a, b


@inner
def _cast_face(depth, r0, r1, c):
    ax, ay, bx, by, cx, cy = c[0], c[1], c[3], c[4], c[6], c[7]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < TINY:
        return
    inverse = ONE / area
    y0, y1 = _span(min(ay, by, cy), max(ay, by, cy), r0, r1)
    x0, x1 = _span(min(ax, bx, cx), max(ax, bx, cx), 0, depth.shape[1])
    for row in range(y0, y1):
        y = np.float32(row) + HALF
        for column in range(x0, x1):
            x = np.float32(column) + HALF
            v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) * inverse
            w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) * inverse
            if v >= ZERO and w >= ZERO and v + w <= ONE:
                _keep_nearest(depth, row, column, c[2] + v * (c[5] - c[2]) + w * (c[8] - c[2]))


@inner
def _cast_capsule(depth, r0, r1, ax, ay, az, ra, bx, by, bz, rb):
    """A capsule seen across; a ball is one without length."""
    dx, dy = bx - ax, by - ay
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    reach = max(ra, rb)
    y0, y1 = _span(min(ay - ra, by - rb), max(ay + ra, by + rb), r0, r1)
    left, right = min(ax - ra, bx - rb), max(ax + ra, bx + rb)
    steep = abs(dy) > STEEP
    slope = dx / dy if steep else ZERO
    half = reach * math.sqrt(ONE + slope * slope) + ONE
    for row in range(y0, y1):
        y = np.float32(row) + HALF
        low, high = left, right
        if steep:  # a row meets only a part of a slanted line
            middle = ax + (y - ay) * slope
            low, high = max(left, middle - half), min(right, middle + half)
        x0, x1 = _span(low, high, 0, depth.shape[1])
        for column in range(x0, x1):
            x = np.float32(column) + HALF
            t = _clamp(((x - ax) * dx + (y - ay) * dy) * inverse, ZERO, ONE)
            radius = ra + t * (rb - ra)
            ex, ey = x - ax - t * dx, y - ay - t * dy
            rest = radius * radius - ex * ex - ey * ey
            if rest > ZERO:
                _keep_nearest(depth, row, column, az + t * (bz - az) - math.sqrt(rest))


@kernel
def cast(first, last, depth, faces, balls, capsules):
    """Write the distance to the nearest caster into the rows [first, last) of `depth`; all in texels."""
    depth, faces, balls, capsules = bare(depth), bare(faces), bare(balls), bare(capsules)
    for row in range(first, last):
        for column in range(depth.shape[1]):
            depth[row, column] = FAR
    for i in range(faces.shape[0]):
        _cast_face(depth, first, last, faces[i])
    for i in range(balls.shape[0]):
        b = balls[i]
        _cast_capsule(depth, first, last, b[0], b[1], b[2], b[3], b[0], b[1], b[2], b[3])
    for i in range(capsules.shape[0]):
        c = capsules[i]
        _cast_capsule(depth, first, last, c[0], c[1], c[2], c[6], c[3], c[4], c[5], c[7])
