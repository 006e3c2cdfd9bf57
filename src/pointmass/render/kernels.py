"""The loops that draw: triangles, balls and capsules, band by band.

The picture is cut into bands of BAND rows, whatever the number of threads. A band walks the solid things that touch
it (near ones first, with a z-buffer of several samples for each pixel), then lays the soft things over them, far ones
first. No two threads write the same row and every row adds in the same order, so the bytes do not depend on threads.

Depths are compared as w = 1/z, which is linear in the picture; 0 is infinitely far.

`light` (RGB) and `depth` of a band are flat: a view of an array costs more than a pixel. `shape` says how they are
cut: pixels in a row, layers of light in each pixel, samples of depth in each pixel.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np
from numba import njit

from pointmass.render.balls import HALO as _HALO
from pointmass.render.balls import MIN_BALL as _MIN_BALL
from pointmass.render.balls import MIN_GLOW as _MIN_GLOW
from pointmass.render.capsules import GLOW_REACH as _REACH
from pointmass.render.capsules import MIN_GLOW as _MIN_LINE
from pointmass.render.inner import bare, inner

BAND = 16  # rows of a band; even, for the bloom works at half the size

# Wrapped, or every product with them would be in double precision.
ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
TWO = np.float32(2.0)
TINY = np.float32(1e-20)
HALO = np.float32(_HALO)
MIN_BALL = np.float32(_MIN_BALL)
MIN_GLOW = np.float32(_MIN_GLOW)
REACH = np.float32(_REACH)
MIN_LINE = np.float32(_MIN_LINE)
GLOSS_BALL = np.float32(0.40)
GLOSS_LINE = np.float32(0.12)
GLOSS_MESH = np.float32(0.06)
WRAP = np.float32(0.12)  # how far the key light reaches round an edge
ROUND = np.float32(0.55)  # light from around that reaches a surface seen edge-on: keeps form in the shade
FALLOFF = np.float32(0.55)  # how much darker a ball or line is where it turns away
SKIRT = np.float32(0.15)  # strength of a glow's halo
KNEE = np.float32(1.0)  # light above this spills
HOTTEST = np.float32(24.0)  # and no more than this, or one spark would fill the picture


@inner
def _clamp(value, low, high):
    return min(max(value, low), high)


@inner
def _unit(x, y, z):
    scale = ONE / math.sqrt(max(x * x + y * y + z * z, TINY))
    return x * scale, y * scale, z * scale


@inner
def _ray(px, py, camera):
    """Direction (x, y) with z = 1 from the eye through a pixel coordinate."""
    return (px - camera[1]) / camera[0], (camera[2] - py) / camera[0]


@inner
def _lit(x, y, z, depth, matrix):
    """Share of the key light at a place, from 4 x 4 texels weighted like a box three texels wide."""
    texels = depth.shape[0]
    if texels == 0:
        return ONE
    u = matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3] - HALF
    v = matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3] - HALF
    far = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
    edge = np.float32(texels - 3)
    if not (u > TWO and v > TWO and u < edge and v < edge):
        return ONE
    column, row = np.int64(u), np.int64(v)
    fu, fv = u - np.float32(column), v - np.float32(row)
    lit = ZERO
    for j in range(4):
        line = ZERO
        for i in range(4):
            if not depth[row + j - 1, column + i - 1] < far:
                line += ONE - fu if i == 0 else (fu if i == 3 else ONE)
        lit += line * (ONE - fv if j == 0 else (fv if j == 3 else ONE))
    return lit / np.float32(9.0)


@inner
def _shade(x, y, z, nx, ny, nz, r, g, b, gloss, lamp, shadow, matrix):
    """Light that leaves a surface at (x, y, z) towards the eye: key, sky and ground, a soft highlight, a rim."""
    vx, vy, vz = _unit(-x, -y, -z)
    facing = _clamp(nx * vx + ny * vy + nz * vz, ZERO, ONE)
    towards = nx * lamp[0] + ny * lamp[1] + nz * lamp[2]
    key = max(ZERO, (towards + WRAP) / (ONE + WRAP))
    shine = ZERO
    if key > ZERO:
        # One texel and a half off the surface, or it would shade itself.
        off = lamp[16]
        lit = _lit(x + off * (nx + lamp[0]), y + off * (ny + lamp[1]), z + off * (nz + lamp[2]), shadow, matrix)
        key *= lit
        hx, hy, hz = _unit(vx + lamp[0], vy + lamp[1], vz + lamp[2])
        shine = max(ZERO, nx * hx + ny * hy + nz * hz)
        for _ in range(5):
            shine *= shine
        shine *= gloss * lit
    high = HALF + HALF * (nx * lamp[3] + ny * lamp[4] + nz * lamp[5])
    around = ROUND + (ONE - ROUND) * facing
    rim = (ONE - facing) * (ONE - facing)
    rim *= rim * lamp[15] * high
    # The light is a pool around the target; beyond it all sinks into the colour of the background.
    x, y, z = x * lamp[17], y * lamp[17], (z - lamp[18]) * lamp[17]
    far = x * x + y * y + z * z
    pool = ONE / (ONE + far * far)
    dim = ONE - pool
    key_r, key_g, key_b = lamp[6], lamp[7], lamp[8]
    sky_r, sky_g, sky_b = lamp[9], lamp[10], lamp[11]
    low_r, low_g, low_b = lamp[12], lamp[13], lamp[14]
    r *= key * key_r + around * (low_r + high * (sky_r - low_r))
    g *= key * key_g + around * (low_g + high * (sky_g - low_g))
    b *= key * key_b + around * (low_b + high * (sky_b - low_b))
    return (
        pool * (r + shine * key_r + rim * sky_r) + dim * lamp[19],
        pool * (g + shine * key_g + rim * sky_g) + dim * lamp[20],
        pool * (b + shine * key_b + rim * sky_b) + dim * lamp[21],
    )


@inner
def _seen(depth, first, last, w, sharp):
    """Share of the samples [first, last) that lie behind w; it fades over the thickness that `sharp` stands for."""
    total = ZERO
    for k in range(first, last):
        total += _clamp((w - depth[k]) * sharp + ONE, ZERO, ONE)
    return total / np.float32(last - first)


@inner
def _lay(light, depth, solid, pixel, shape, w, sharp, r, g, b, alpha):
    """Lay premultiplied light with an alpha (0: it only adds) over every layer of a pixel, where it is in front."""
    layers, samples = shape[1], shape[2]
    for k in range(layers):
        at = pixel * layers + k
        share = ONE
        if solid:
            first = pixel * samples if layers == 1 else at
            share = _seen(depth, first, first + samples if layers == 1 else first + 1, w, sharp)
        if share > ZERO:
            keep = ONE - alpha * share
            light[3 * at] = keep * light[3 * at] + share * r
            light[3 * at + 1] = keep * light[3 * at + 1] + share * g
            light[3 * at + 2] = keep * light[3 * at + 2] + share * b


@inner
def _write(light, first, samples, mask, alpha, r, g, b):
    """Lay a colour over the samples of a pixel that the mask names."""
    keep = ONE - alpha
    for k in range(samples):
        if mask & (1 << k):
            at = 3 * (first + k)
            light[at] = keep * light[at] + alpha * r
            light[at + 1] = keep * light[at + 1] + alpha * g
            light[at + 2] = keep * light[at + 2] + alpha * b


@inner
def _narrow(slope, rest, x0, x1):
    """Pixels of [x0, x1) where slope * x + rest may be >= 0."""
    if slope > 0.0:
        x0 = max(x0, np.int64(_clamp(math.floor(-rest / slope), -1.0, 1e6)))
    elif slope < 0.0:
        x1 = min(x1, np.int64(_clamp(math.ceil(-rest / slope), -1.0, 1e6)))
    elif rest < 0.0:
        x1 = x0
    return x0, x1


@inner
def _face(t, box, top, bottom, solid, light, depth, shape, camera, offsets, lamp, shadow, matrix):
    """One triangle: each sample in front is replaced (solid) or laid over."""
    ax, ay = np.float64(t[0]), np.float64(t[1])
    bx, by, cx, cy = t[2] - ax, t[3] - ay, t[4] - ax, t[5] - ay
    area = bx * cy - by * cx
    if not abs(area) > 1e-12:
        return
    # Barycentric coordinates of b and c are linear: vx (x - ax) + vy (y - ay).
    vx, vy, wx, wy = cy / area, -cx / area, -by / area, bx / area
    ux, uy = -vx - wx, -vy - wy
    # Corners turn counter-clockwise seen from outside, and pixels count downwards.
    side = ONE if area < 0.0 else -ONE
    samples = shape[2]
    for row in range(max(box[2], top), min(box[3], bottom)):
        y = row - ay
        x0, x1 = np.int64(box[0]), np.int64(box[1])
        x0, x1 = _narrow(vx, vy * y - vx * ax + max(vy, 0.0) + max(vx, 0.0), x0, x1)
        x0, x1 = _narrow(wx, wy * y - wx * ax + max(wy, 0.0) + max(wx, 0.0), x0, x1)
        x0, x1 = _narrow(ux, 1.0 + uy * y - ux * ax + max(uy, 0.0) + max(ux, 0.0), x0, x1)
        for column in range(x0, x1):
            hits, sx, sy = 0, 0.0, 0.0
            mask = 0
            first = ((row - top) * shape[0] + column) * samples
            for k in range(samples):
                px, py = column + offsets[k, 0] - ax, row + offsets[k, 1] - ay
                v, w = vx * px + vy * py, wx * px + wy * py
                if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
                    near = np.float32((1.0 - v - w) * t[6] + v * t[7] + w * t[8])
                    if near > depth[first + k]:
                        if solid:
                            depth[first + k] = near
                        mask |= 1 << k
                        hits += 1
                        sx += px
                        sy += py
            if hits == 0:
                continue
            px, py = sx / hits, sy / hits
            v, w = np.float32(vx * px + vy * py), np.float32(wx * px + wy * py)
            u = (ONE - v - w) * t[6]
            v, w = v * t[7], w * t[8]
            z = ONE / (u + v + w)
            u, v, w = u * z, v * z, w * z
            dx, dy = _ray(np.float32(px + ax), np.float32(py + ay), camera)
            nx, ny, nz = _unit(
                side * (u * t[9] + v * t[12] + w * t[15]),
                side * (u * t[10] + v * t[13] + w * t[16]),
                side * (u * t[11] + v * t[14] + w * t[17]),
            )
            r, g, b = _shade(
                dx * z, dy * z, z, nx, ny, nz,
                u * t[18] + v * t[22] + w * t[26],
                u * t[19] + v * t[23] + w * t[27],
                u * t[20] + v * t[24] + w * t[28],
                GLOSS_MESH, lamp, shadow, matrix,
            )  # fmt: skip
            alpha = ONE if solid else _clamp(u * t[21] + v * t[25] + w * t[29], ZERO, ONE)
            _write(light, first, samples, mask, alpha, r, g, b)


@inner
def _closest(c, dx, dy):
    """Along a ray: where it is nearest to a ball's centre, the centre as seen from there, and the ray's square."""
    square = dx * dx + dy * dy + ONE
    along = (dx * c[0] + dy * c[1] + c[2]) / square
    return along, c[0] - along * dx, c[1] - along * dy, c[2] - along, square


@inner
def _ball_color(c, dx, dy, lamp, shadow, matrix):
    """Light of a ball along a ray; a ray that just misses sees the edge."""
    along, px, py, pz, square = _closest(c, dx, dy)
    half = math.sqrt(max(c[3] * c[3] - px * px - py * py - pz * pz, ZERO) / square)
    nx, ny, nz = _unit(-px - half * dx, -py - half * dy, -pz - half)
    z = along - half
    # A ball is darker at its edge, as if it stood among others.
    x, y, _ = _unit(dx, dy, ONE)
    turned = ONE + nx * x + ny * y + nz / math.sqrt(square)
    dark = ONE - FALLOFF * turned * turned
    return _shade(
        dx * z, dy * z, z, nx, ny, nz, c[4] * dark, c[5] * dark, c[6] * dark, GLOSS_BALL, lamp, shadow, matrix
    )


@inner
def _ball_solid(c, box, top, bottom, light, depth, shape, camera, offsets, lamp, shadow, matrix):
    samples = shape[2]
    for row in range(max(box[2], top), min(box[3], bottom)):
        for column in range(box[0], box[1]):
            hits, sx, sy = 0, ZERO, ZERO
            mask = 0
            first = ((row - top) * shape[0] + column) * samples
            for k in range(samples):
                dx, dy = _ray(np.float32(column) + offsets[k, 0], np.float32(row) + offsets[k, 1], camera)
                along, px, py, pz, square = _closest(c, dx, dy)
                rest = c[3] * c[3] - px * px - py * py - pz * pz
                if rest > ZERO:
                    near = ONE / (along - math.sqrt(rest / square))
                    if near > depth[first + k]:
                        depth[first + k] = near
                        mask |= 1 << k
                        hits += 1
                        sx += dx
                        sy += dy
            if hits == 0:
                continue
            share = ONE / np.float32(hits)
            r, g, b = _ball_color(c, sx * share, sy * share, lamp, shadow, matrix)
            _write(light, first, samples, mask, ONE, r, g, b)


@inner
def _ball_soft(c, box, top, bottom, solid, light, depth, shape, camera, lamp, shadow, matrix):
    """A ball that is small or lets light through: coverage from the distance to its edge."""
    w = ONE / c[2]
    scale = camera[0] * w
    radius = scale * c[3]
    shown = max(radius, MIN_BALL)
    strength = c[7] * (radius / shown) * (radius / shown)
    sharp = c[2] * c[2] / c[3]
    for row in range(max(box[2], top), min(box[3], bottom)):
        for column in range(box[0], box[1]):
            dx, dy = _ray(np.float32(column) + HALF, np.float32(row) + HALF, camera)
            _, px, py, pz, _ = _closest(c, dx, dy)
            alpha = strength * _clamp(shown + HALF - scale * math.sqrt(px * px + py * py + pz * pz), ZERO, ONE)
            if alpha > ZERO:
                r, g, b = _ball_color(c, dx, dy, lamp, shadow, matrix)
                pixel = (row - top) * shape[0] + column
                _lay(light, depth, solid, pixel, shape, w, sharp, alpha * r, alpha * g, alpha * b, alpha)


@inner
def _ball_glow(c, box, top, bottom, solid, light, depth, shape, camera):
    """A bright core in a faint halo: with u = 1 - d^2, u^3 (u^6 + 0.15) is close to two Gaussians, but has an end."""
    w = ONE / c[2]
    full = HALO * camera[0] * w * c[3]
    reach = max(full, MIN_GLOW)
    strength = c[7] * (full / reach) * (full / reach)
    sharp = c[2] * c[2] / c[3]
    x, y = camera[1] + camera[0] * w * c[0], camera[2] - camera[0] * w * c[1]
    inverse = ONE / (reach * reach)
    for row in range(max(box[2], top), min(box[3], bottom)):
        ey = np.float32(row) + HALF - y
        for column in range(box[0], box[1]):
            ex = np.float32(column) + HALF - x
            rest = ONE - (ex * ex + ey * ey) * inverse
            if rest > ZERO:
                cube = rest * rest * rest
                f = strength * cube * (cube * cube + SKIRT)
                pixel = (row - top) * shape[0] + column
                _lay(light, depth, solid, pixel, shape, w, sharp, f * c[4], f * c[5], f * c[6], ZERO)


@inner
def _across(c, ra, rb, px, py):
    """Where a pixel coordinate lies on a capsule: along it (0 to 1), off its axis, to the left; off is -1 outside.

    Both are in pixels, and so are the radii at both ends.
    """
    dx, dy = c[10] - c[8], c[11] - c[9]
    ex, ey = px - c[8], py - c[9]
    fx, fy = px - c[10], py - c[11]
    if ex * c[20] + ey * c[21] < ZERO:
        return ZERO, -ONE, ZERO
    if (c[22] != ZERO or c[23] != ZERO) and fx * c[22] + fy * c[23] >= ZERO:
        return ZERO, -ONE, ZERO
    square = max(dx * dx + dy * dy, TINY)
    t = _clamp((ex * dx + ey * dy) / square, ZERO, ONE)
    ox, oy = ex - t * dx, ey - t * dy
    return t, math.sqrt(ox * ox + oy * oy), (dy * ex - dx * ey) / math.sqrt(square)


@inner
def _capsule_color(c, t, left, radius, z, px, py, camera, lamp, shadow, matrix):
    """Light of a round line: the normal turns from edge to edge; along the line all is linear in the picture."""
    tx, ty, tz = _unit(c[3] - c[0], c[4] - c[1], c[5] - c[2])
    dx, dy = _ray(px, py, camera)
    vx, vy, vz = _unit(-dx, -dy, -ONE)
    lx, ly, lz = c[11] - c[9], c[10] - c[8], ZERO  # to the left in the picture, in view coordinates
    lx, ly, lz = _unit(lx, ly, lz)
    side = vx * tx + vy * ty + vz * tz
    fx, fy, fz = _unit(vx - side * tx, vy - side * ty, vz - side * tz)
    s = _clamp(left / max(radius, ONE), np.float32(-0.95), np.float32(0.95))
    front = math.sqrt(ONE - s * s)
    nx, ny, nz = _unit(s * lx + front * fx, s * ly + front * fy, s * lz + front * fz)
    dark = ONE - FALLOFF * (ONE - front) * (ONE - front)
    r, g, b = c[12] + t * (c[16] - c[12]), c[13] + t * (c[17] - c[13]), c[14] + t * (c[18] - c[14])
    return _shade(dx * z, dy * z, z, nx, ny, nz, r * dark, g * dark, b * dark, GLOSS_LINE, lamp, shadow, matrix)


@inner
def _capsule_solid(c, box, top, bottom, light, depth, shape, camera, offsets, lamp, shadow, matrix):
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    samples = shape[2]
    for row in range(max(box[2], top), min(box[3], bottom)):
        x0, x1 = _capsule_span(c, np.float32(row) + HALF, max(ra, rb) + ONE, box)
        for column in range(x0, x1):
            hits, sx, sy = 0, ZERO, ZERO
            mask = 0
            first = ((row - top) * shape[0] + column) * samples
            for k in range(samples):
                px, py = np.float32(column) + offsets[k, 0], np.float32(row) + offsets[k, 1]
                t, off, _ = _across(c, ra, rb, px, py)
                radius = ra + t * (rb - ra)
                if off >= ZERO and off < radius:
                    w = wa + t * (wb - wa)
                    s = off / radius
                    # The surface bulges towards the eye by a part of the radius.
                    near = w / (ONE - math.sqrt(ONE - s * s) * min(radius / camera[0], HALF))
                    if near > depth[first + k]:
                        depth[first + k] = near
                        mask |= 1 << k
                        hits += 1
                        sx += px
                        sy += py
            if hits == 0:
                continue
            sx, sy = sx / np.float32(hits), sy / np.float32(hits)
            t, _, left = _across(c, ra, rb, sx, sy)
            z = ONE / (wa + t * (wb - wa))
            r, g, b = _capsule_color(c, t, left, ra + t * (rb - ra), z, sx, sy, camera, lamp, shadow, matrix)
            _write(light, first, samples, mask, ONE, r, g, b)


@inner
def _capsule_span(c, y, reach, box):
    """Pixels of a row that lie within `reach` of the capsule's axis."""
    dx, dy = c[10] - c[8], c[11] - c[9]
    x0, x1 = np.float32(box[0]), np.float32(box[1])
    if abs(dy) > np.float32(1e-3):
        middle = c[8] + (y - c[9]) * dx / dy
        half = reach * math.sqrt(dx * dx + dy * dy) / abs(dy) + ONE
        low, high = _clamp(middle - half, x0, x1), _clamp(middle + half, x0, x1)
        x0, x1 = low, high
    return np.int64(math.floor(x0)), np.int64(math.ceil(x1))


@inner
def _capsule_soft(c, box, top, bottom, solid, light, depth, shape, camera, lamp, shadow, matrix):
    """A thin, clear or glowing line; thinner than a pixel it fades instead."""
    glow = c[24] > ZERO
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    widest = max(REACH * max(ra, rb), MIN_LINE) if glow else max(ra, rb) + ONE
    for row in range(max(box[2], top), min(box[3], bottom)):
        py = np.float32(row) + HALF
        x0, x1 = _capsule_span(c, py, widest, box)
        for column in range(x0, x1):
            px = np.float32(column) + HALF
            t, off, left = _across(c, ra, rb, px, py)
            if off < ZERO:
                continue
            radius = ra + t * (rb - ra)
            w = wa + t * (wb - wa)
            z = ONE / w
            sharp = z * camera[0] / max(radius, HALF)
            alpha = c[15] + t * (c[19] - c[15])
            if glow:
                full = REACH * radius
                reach = max(full, MIN_LINE)
                rest = ONE - off * off / (reach * reach)
                if rest > ZERO:
                    f = alpha * full / reach * rest * rest * rest
                    r, g, b = c[12] + t * (c[16] - c[12]), c[13] + t * (c[17] - c[13]), c[14] + t * (c[18] - c[14])
                    pixel = (row - top) * shape[0] + column
                    _lay(light, depth, solid, pixel, shape, w, sharp, f * r, f * g, f * b, ZERO)
            else:
                shown = max(radius, HALF)
                alpha *= radius / shown * _clamp(shown + HALF - off, ZERO, ONE)
                if alpha > ZERO:
                    r, g, b = _capsule_color(c, t, left, radius, z, px, py, camera, lamp, shadow, matrix)
                    pixel = (row - top) * shape[0] + column
                    _lay(light, depth, solid, pixel, shape, w, sharp, alpha * r, alpha * g, alpha * b, alpha)


@inner
def _mean(light, layers, picture):
    """The mean of all layers, into (rows, columns, 3)."""
    share = ONE / np.float32(layers)
    at = 0
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            r, g, b = ZERO, ZERO, ZERO
            for _ in range(layers):
                r += light[at]
                g += light[at + 1]
                b += light[at + 2]
                at += 3
            picture[row, column, 0] = r * share
            picture[row, column, 1] = g * share
            picture[row, column, 2] = b * share


@inner
def _copy(picture, light):
    at = 0
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            for channel in range(3):
                light[at] = picture[row, column, channel]
                at += 1


@inner
def _spill(picture, bright):
    """What is brighter than the knee, at half the size."""
    height, width = picture.shape[0], picture.shape[1]
    for row in range(bright.shape[0]):
        for column in range(bright.shape[1]):
            r, g, b = ZERO, ZERO, ZERO
            for j in range(2):
                for i in range(2):
                    y, x = min(2 * row + j, height - 1), min(2 * column + i, width - 1)
                    top = max(picture[y, x, 0], picture[y, x, 1], picture[y, x, 2])
                    if top > KNEE:
                        share = np.float32(0.25) * (min(top, HOTTEST) - KNEE) / top
                        r += share * picture[y, x, 0]
                        g += share * picture[y, x, 1]
                        b += share * picture[y, x, 2]
            bright[row, column, 0] = r
            bright[row, column, 1] = g
            bright[row, column, 2] = b


@inner
def _background(light, per_row, colors):
    at = 0
    for row in range(colors.shape[0]):
        for _ in range(per_row):
            for channel in range(3):
                light[at] = colors[row, channel]
                at += 1


@njit(cache=True, error_model="numpy")
def sort_into_bands(box, bands):
    """Lists of the items that touch each band, in the order given: where each list starts, and all lists.

    Parameters
    ----------
    box : first and one past the last row of each item, shape (k, 2).
    bands : how many there are.
    """
    starts = np.zeros(bands + 1, dtype=np.int64)
    for i in range(box.shape[0]):
        for band in range(box[i, 0] // BAND, (box[i, 1] - 1) // BAND + 1):
            starts[band + 1] += 1
    for band in range(bands):
        starts[band + 1] += starts[band]
    lists = np.empty(starts[bands], dtype=np.int64)
    free = starts.copy()
    for i in range(box.shape[0]):
        for band in range(box[i, 0] // BAND, (box[i, 1] - 1) // BAND + 1):
            lists[free[band]] = i
            free[band] += 1
    return starts, lists


@njit(nogil=True, cache=True, error_model="numpy")
def draw(
    top, light, depth, picture, bright, background, camera, offsets, layered, solids, softs,
    faces, face_box, balls, ball_box, capsules, capsule_box, lamp, shadow, matrix,
):  # fmt: skip
    """Draw the rows of one band, in linear light.

    Parameters
    ----------
    top : the band's first row.
    light, depth : room to work in: 3 numbers, and 1, for each sample; depth must be zero.
    picture : written, shape (rows, width, 3).
    bright : written; what spills around bright things, of half the size.
    background : colour of each row, shape (rows, 3).
    camera : focal length and centre [pixels].
    offsets : samples within a pixel, shape (s, 2).
    layered : keep the samples apart until the end: needed when triangles are laid over.
    solids, softs : numbers of the things that touch the band; they count faces, then balls, then capsules.
    faces, face_box, balls, ball_box, capsules, capsule_box : rows of the tables.
    lamp : directions and colours of the light, see `lamp.py`.
    shadow, matrix : the shadow map.
    """
    bottom = top + picture.shape[0]
    width = picture.shape[1]
    many = len(solids) > 0 or layered
    samples = offsets.shape[0] if many else 1
    light, depth, camera, offsets, lamp = bare(light), bare(depth), bare(camera), bare(offsets), bare(lamp)
    faces, balls, capsules, shadow, matrix = bare(faces), bare(balls), bare(capsules), bare(shadow), bare(matrix)
    face_box, ball_box, capsule_box = bare(face_box), bare(ball_box), bare(capsule_box)
    _background(light, width * samples, background)
    shape = (width, samples, samples)
    capsule_first = len(faces) + len(balls)
    solid = len(solids) > 0
    for phase in range(2):
        first = phase == 0
        if many and not layered and not first:
            # Nothing that follows needs the samples one by one.
            _mean(light, samples, picture)
            _copy(picture, light)
            shape = (width, 1, samples)
        for item in solids if first else softs:
            if item < len(faces):
                _face(
                    faces[item], face_box[item], top, bottom, first, light, depth, shape,
                    camera, offsets, lamp, shadow, matrix,
                )  # fmt: skip
            elif item < capsule_first:
                i = item - len(faces)
                if first:
                    _ball_solid(
                        balls[i], ball_box[i], top, bottom, light, depth, shape,
                        camera, offsets, lamp, shadow, matrix,
                    )  # fmt: skip
                elif balls[i, 8] > ZERO:
                    _ball_glow(balls[i], ball_box[i], top, bottom, solid, light, depth, shape, camera)
                else:
                    _ball_soft(
                        balls[i], ball_box[i], top, bottom, solid, light, depth, shape,
                        camera, lamp, shadow, matrix,
                    )  # fmt: skip
            else:
                i = item - capsule_first
                if first:
                    _capsule_solid(
                        capsules[i], capsule_box[i], top, bottom, light, depth, shape,
                        camera, offsets, lamp, shadow, matrix,
                    )  # fmt: skip
                else:
                    _capsule_soft(
                        capsules[i], capsule_box[i], top, bottom, solid, light, depth, shape,
                        camera, lamp, shadow, matrix,
                    )  # fmt: skip
    _mean(light, shape[1], picture)
    _spill(picture, bright)
