"""The loops that pack frames, without the interpreter lock: other threads go on meanwhile."""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, assignment"

import math

import numpy as np

from pointmass.kernels_base import compiler, digest_of

kernel = compiler(digest_of("pointmass.viewer"))


@kernel
def bounds(places):
    """Corners of the box of all places that are finite, and whether there are any."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for i in range(places.shape[0]):
        x, y, z = np.float64(places[i, 0]), np.float64(places[i, 1]), np.float64(places[i, 2])
        if math.isfinite(x + y + z):
            low[0], low[1], low[2] = min(low[0], x), min(low[1], y), min(low[2], z)
            high[0], high[1], high[2] = max(high[0], x), max(high[1], y), max(high[2], z)
    return low, high


@kernel
def quantise(places, low, size, out):
    """Places as whole numbers from 0 to 65535 over a box; what is not finite is at its lower corner."""
    scale = np.zeros(3)
    for a in range(3):
        scale[a] = 65535.0 / size[a] if size[a] > 0.0 else 0.0
    for i in range(places.shape[0]):
        for a in range(3):
            q = (np.float64(places[i, a]) - low[a]) * scale[a]
            out[i, a] = np.uint16(min(q, 65535.0) + 0.5) if q > 0.0 else np.uint16(0)
        out[i, 3] = 0


@kernel
def brightest(colors):
    """The largest of all red, green and blue that are finite; 0 if there is none."""
    top = np.float64(0.0)
    for i in range(colors.shape[0]):
        for a in range(3):
            c = np.float64(colors[i, a])
            if c > top and math.isfinite(c):
                top = c
    return top


@kernel
def tint(colors, scale, out):
    """Linear RGBA as bytes: the square root of light over `scale`, and alpha."""
    for i in range(colors.shape[0]):
        for a in range(4):
            c = np.float64(colors[i, a])
            if a < 3:
                c = math.sqrt(c / scale) if c > 0.0 and scale > 0.0 else 0.0
            out[i, a] = np.uint8(min(c, 1.0) * 255.0 + 0.5) if c > 0.0 else np.uint8(0)


@kernel
def bend(places, faces, out):
    """Normals of a mesh at its places, as bytes from -127 to 127: means of those of the faces, by area."""
    total = np.zeros((places.shape[0], 3))
    for k in range(faces.shape[0]):
        i, j, h = faces[k, 0], faces[k, 1], faces[k, 2]
        ax, ay, az = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1], places[j, 2] - places[i, 2]
        bx, by, bz = places[h, 0] - places[i, 0], places[h, 1] - places[i, 1], places[h, 2] - places[i, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        for c in (i, j, h):
            total[c, 0] += nx
            total[c, 1] += ny
            total[c, 2] += nz
    for i in range(places.shape[0]):
        x, y, z = total[i, 0], total[i, 1], total[i, 2]
        length = math.sqrt(x * x + y * y + z * z)
        known = length > 0.0 and math.isfinite(length)
        for a in range(3):
            out[i, a] = np.int8(np.rint(127.0 * total[i, a] / length)) if known else np.int8(0)
        out[i, 3] = 0
