"""What a thing shows in a pixel: gathered as fragments, lit many at a time, then laid into the tile in their order.

A fragment is one pixel of one thing: where it is, how it is turned, its colour, and how it goes into the picture. They
wait in a table with one line for each number, because a loop over such lines runs many pixels at once. Things must be
handed over in the order in which they are to be laid; `flush` keeps it.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np

from pointmass.kernels_base import inner

TILE = 128  # columns of a tile, and
BAND = 16  # its rows; both even, for the bloom works at half the size
AREA = TILE * BAND
LINE = AREA + 48  # a tile's lines in memory: at powers of two they would push each other out of the cache
# A layer of a tile: a line each for red, green and blue; for 1/z, first of a sample, later the nearest; for the
# farthest; and for the share of the nearest.
RED, GREEN, BLUE, NEAR, FAR, COVER = (LINE * line for line in range(6))
BLOCK = 6 * LINE  # from layer to layer

WAITING = AREA  # fragments that the table holds: what one thing may show in a tile
STEP = WAITING + 16  # from line to line: at powers of two they would push each other out of the cache
LINES = 17
# Where the line of each number starts: the place, the normal (of any length), the colour, how much it shines, its
# alpha, the 1/z by which it is hidden, how sharply; then room for the place in the shadow map and the share of light.
X, Y, Z, NX, NY, NZ, R, G, B, GLOSS, ALPHA, W, SHARP, U, V, DEEP, LIT = (STEP * line for line in range(LINES))

NONE = np.int64(0)  # a plain 0 is a type of its own: each function would be compiled once more for it
# Wrapped, or every product with them would be in double precision.
ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
TWO = np.float32(2.0)
TINY = np.float32(1e-20)
WRAP = np.float32(0.12)  # how far the key light reaches round an edge
ROUND = np.float32(0.55)  # light from around that reaches a surface seen edge-on: keeps form in the shade


@inner
def clamp(value, low, high):
    """The value, or the bound that it has passed."""
    return min(max(value, low), high)


@inner
def unit(x, y, z):
    """The same direction with length 1."""
    scale = ONE / math.sqrt(max(x * x + y * y + z * z, TINY))
    return x * scale, y * scale, z * scale


@inner
def put(waiting, i, x, y, z, nx, ny, nz, r, g, b, gloss, alpha, w, sharp):
    """Fill in fragment i."""
    waiting[X + i], waiting[Y + i], waiting[Z + i] = x, y, z
    waiting[NX + i], waiting[NY + i], waiting[NZ + i] = nx, ny, nz
    waiting[R + i], waiting[G + i], waiting[B + i] = r, g, b
    waiting[GLOSS + i], waiting[ALPHA + i] = gloss, alpha
    waiting[W + i], waiting[SHARP + i] = w, sharp


@inner
def shown(line, i, w, sharp):
    """Share of a pixel that lies behind w; it fades over the thickness that `sharp` stands for."""
    far = clamp((w - line[FAR + i]) * sharp + ONE, ZERO, ONE)
    near = clamp((w - line[NEAR + i]) * sharp + ONE, ZERO, ONE)
    return far + line[COVER + i] * (near - far)


@inner
def flush(tile, count):
    """Light the fragments that wait, and lay them into the tile; 0, which is how many wait then."""
    room, even, waiting, spots, layers, samples, lamp, shadow, matrix = tile
    if count > 0:
        _look_up(waiting, count, lamp, shadow, matrix)
        _shade(waiting, count, lamp)
    full = (1 << samples) - 1
    for i in range(count):
        p, mask, alpha = spots[0, i], spots[1, i], waiting[ALPHA + i]
        r, g, b = waiting[R + i], waiting[G + i], waiting[B + i]
        if mask == full and alpha == ONE:
            room[RED + p], room[GREEN + p], room[BLUE + p] = r, g, b
            even[p] = True
            continue
        if mask != 0:
            spread(room, even, p, samples)
        for k in range(samples if mask != 0 else layers):
            share = alpha
            if mask == 0:
                share *= shown(room, k * BLOCK + p, waiting[W + i], waiting[SHARP + i])
            elif not mask & (1 << k):
                continue
            room[k * BLOCK + RED + p] += share * (r - room[k * BLOCK + RED + p])
            room[k * BLOCK + GREEN + p] += share * (g - room[k * BLOCK + GREEN + p])
            room[k * BLOCK + BLUE + p] += share * (b - room[k * BLOCK + BLUE + p])
    return NONE


@inner
def spread(room, even, p, samples):
    """Give each sample of a pixel its own light, before they part."""
    if even[p]:
        for k in range(1, samples):
            for channel in range(3):
                room[k * BLOCK + channel * LINE + p] = room[channel * LINE + p]
        even[p] = False


@inner
def _look_up(waiting, count, lamp, shadow, matrix):
    """Make the normals unit vectors, and find which share of the key light each fragment gets."""
    lx, ly, lz, off = lamp[0], lamp[1], lamp[2], lamp[16]
    ux, uy, uz, u0 = matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[0, 3] - HALF
    vx, vy, vz, v0 = matrix[1, 0], matrix[1, 1], matrix[1, 2], matrix[1, 3] - HALF
    fx, fy, fz, f0 = matrix[2, 0], matrix[2, 1], matrix[2, 2], matrix[2, 3]
    for i in range(count):
        nx, ny, nz = unit(waiting[NX + i], waiting[NY + i], waiting[NZ + i])
        waiting[NX + i], waiting[NY + i], waiting[NZ + i] = nx, ny, nz
        # One texel and a half off the surface, or it would shade itself.
        x, y, z = waiting[X + i] + off * (nx + lx), waiting[Y + i] + off * (ny + ly), waiting[Z + i] + off * (nz + lz)
        waiting[U + i] = ux * x + uy * y + uz * z + u0
        waiting[V + i] = vx * x + vy * y + vz * z + v0
        waiting[DEEP + i] = fx * x + fy * y + fz * z + f0
        waiting[LIT + i] = max(ZERO, (nx * lx + ny * ly + nz * lz + WRAP) / (ONE + WRAP))
    for i in range(count):
        if waiting[LIT + i] > ZERO:
            waiting[LIT + i] = _lit(waiting[U + i], waiting[V + i], waiting[DEEP + i], shadow)


@inner
def _lit(u, v, far, shadow):
    """Share of the key light at a place, from 4 x 4 texels weighted like a box three texels wide."""
    edge = np.float32(shadow.shape[0] - 3)
    if not (u > TWO and v > TWO and u < edge and v < edge):
        return ONE
    column, row = np.int64(u), np.int64(v)
    fu, fv = u - np.float32(column), v - np.float32(row)
    lit = ZERO
    for j in range(4):
        line = ZERO
        for i in range(4):
            if not shadow[row + j - 1, column + i - 1] < far:
                line += ONE - fu if i == 0 else (fu if i == 3 else ONE)
        lit += line * (ONE - fv if j == 0 else (fv if j == 3 else ONE))
    return lit / np.float32(9.0)


@inner
def _shade(waiting, count, lamp):
    """Colours into the light that leaves towards the eye: key, sky and ground, a soft highlight, a rim."""
    lx, ly, lz, up_x, up_y, up_z = lamp[0], lamp[1], lamp[2], lamp[3], lamp[4], lamp[5]
    key_r, key_g, key_b = lamp[6], lamp[7], lamp[8]
    sky_r, sky_g, sky_b = lamp[9], lamp[10], lamp[11]
    low_r, low_g, low_b = lamp[12], lamp[13], lamp[14]
    edge, wide, middle = lamp[15], lamp[17], lamp[18]
    dark_r, dark_g, dark_b = lamp[19], lamp[20], lamp[21]
    for i in range(count):
        x, y, z = waiting[X + i], waiting[Y + i], waiting[Z + i]
        nx, ny, nz, lit = waiting[NX + i], waiting[NY + i], waiting[NZ + i], waiting[LIT + i]
        vx, vy, vz = unit(-x, -y, -z)
        facing = clamp(nx * vx + ny * vy + nz * vz, ZERO, ONE)
        key = lit * max(ZERO, (nx * lx + ny * ly + nz * lz + WRAP) / (ONE + WRAP))
        hx, hy, hz = unit(vx + lx, vy + ly, vz + lz)
        shine = max(ZERO, nx * hx + ny * hy + nz * hz)
        shine *= shine  # to the 32nd power
        shine *= shine
        shine *= shine
        shine *= shine
        shine *= shine
        shine *= waiting[GLOSS + i] * lit
        high = HALF + HALF * (nx * up_x + ny * up_y + nz * up_z)
        around = ROUND + (ONE - ROUND) * facing
        rim = (ONE - facing) * (ONE - facing)
        rim *= rim * edge * high
        # The light is a pool around the target; beyond it all sinks into the colour of the background.
        x, y, z = x * wide, y * wide, (z - middle) * wide
        far = x * x + y * y + z * z
        pool = ONE / (ONE + far * far)
        dim = ONE - pool
        r = waiting[R + i] * (key * key_r + around * (low_r + high * (sky_r - low_r)))
        g = waiting[G + i] * (key * key_g + around * (low_g + high * (sky_g - low_g)))
        b = waiting[B + i] * (key * key_b + around * (low_b + high * (sky_b - low_b)))
        waiting[R + i] = pool * (r + shine * key_r + rim * sky_r) + dim * dark_r
        waiting[G + i] = pool * (g + shine * key_g + rim * sky_g) + dim * dark_g
        waiting[B + i] = pool * (b + shine * key_b + rim * sky_b) + dim * dark_b
