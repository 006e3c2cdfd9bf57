"""The loops that find how much light comes to puffs of smoke."""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg, call-overload"

import math

import numpy as np

from pointmass.render.inner import bare, kernel
from pointmass.render.sprites import PUFF as _PUFF

PUFF = np.float32(_PUFF)
ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)


@kernel
def gather(order, spots, thick, height, width):
    """Thickness of what lies between a light and each puff, in the mean over the puff.

    Parameters
    ----------
    order : numbers of the puffs, the nearest to the light first.
    spots : centre and radius of each on a plane across the light [cells], shape (n, 3).
    thick : of each in its middle.
    height, width : of the plane [cells].
    """
    plane = np.zeros((height + 1, width + 1), dtype=np.float32)
    result = np.empty(len(order), dtype=np.float32)
    for i in order:
        x, y, radius = spots[i, 0], spots[i, 1], PUFF * spots[i, 2]
        reach = max(radius, ONE + HALF)
        inverse = ONE / (reach * reach)
        most = thick[i] * (radius / reach) * (radius / reach)
        first, last = max(np.int64(math.ceil(y - reach)), 0), min(np.int64(math.floor(y + reach)), height)
        left, right = max(np.int64(math.ceil(x - reach)), 0), min(np.int64(math.floor(x + reach)), width)
        total, found = ZERO, ZERO
        for row in range(first, last + 1):
            ey = np.float32(row) - y
            for column in range(left, right + 1):
                ex = np.float32(column) - x
                u = max(ONE - (ex * ex + ey * ey) * inverse, ZERO)
                weight = u * u * u
                total += weight
                found += weight * plane[row, column]
                plane[row, column] += most * weight
        result[i] = found / max(total, np.float32(1e-6))
    return result


@kernel
def shine(balls, lamps, width, result):
    """Light of lamps at balls, added in the order of the lamps.

    Parameters
    ----------
    balls : centre and radius [m], shape (n, 4).
    lamps : centre [m] and light times the square of the radius, shape (k, 6).
    width : of a lamp [m]: no ball is nearer to one than that.
    result : written, shape (n, 3).
    """
    balls, lamps, result = bare(balls), bare(lamps), bare(result)
    for i in range(len(balls)):
        x, y, z, radius = balls[i, 0], balls[i, 1], balls[i, 2], balls[i, 3]
        nearest = radius * radius + width * width
        r, g, b = ZERO, ZERO, ZERO
        for k in range(len(lamps)):
            dx, dy, dz = lamps[k, 0] - x, lamps[k, 1] - y, lamps[k, 2] - z
            share = ONE / (dx * dx + dy * dy + dz * dz + nearest)
            r += share * lamps[k, 3]
            g += share * lamps[k, 4]
            b += share * lamps[k, 5]
        result[i, 0], result[i, 1], result[i, 2] = r, g, b
