"""The loops that draw: triangles, balls, capsules and sprites, tile by tile.

The picture is cut into tiles of TILE x BAND pixels, whatever the number of threads. A tile walks the solid things that
touch it (near ones first, with a z-buffer of several samples for each pixel), then lays the soft things over them, far
ones first. No two threads write the same tile and every tile adds in the same order, so the bytes do not depend on
threads. A tile's room is small: it stays in the processor's memory, and an empty tile costs nothing.

Depths are compared as w = 1/z, which is linear in the picture; 0 is infinitely far.

A tile has a layer for each sample, see `kernels_shade`. Where `even` holds, all samples of a pixel have the light of
the first layer, and the other layers hold none yet.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

import numpy as np

from pointmass.kernels_base import inner
from pointmass.render.balls import HALO as _HALO
from pointmass.render.balls import MIN_BALL as _MIN_BALL
from pointmass.render.balls import MIN_GLOW as _MIN_GLOW
from pointmass.render.capsules import GLOW_REACH as _REACH
from pointmass.render.capsules import MIN_GLOW as _MIN_LINE
from pointmass.render.inner import bare, kernel
from pointmass.render.kernels_shade import (
    AREA,
    BAND,
    BLOCK,
    BLUE,
    COVER,
    FAR,
    GREEN,
    HALF,
    LINE,
    NEAR,
    NONE,
    ONE,
    RED,
    TILE,
    TINY,
    TWO,
    WAITING,
    ZERO,
    U,
    V,
    clamp,
    flush,
    put,
    shown,
    spread,
    unit,
)  # fmt: skip

GAUSS = np.float32(0.5 / math.sqrt(3.0))  # from the middle of an interval to the places of the two-point rule
STRIPS = 4  # lines along the way for which a pixel asks how long a smeared ball covers it
WIDTH = 8  # pixels that the processor does at once
HALO = np.float32(_HALO)
MIN_BALL = np.float32(_MIN_BALL)
MIN_GLOW = np.float32(_MIN_GLOW)
REACH = np.float32(_REACH)
MIN_LINE = np.float32(_MIN_LINE)
GLOSS_BALL = np.float32(0.40)
GLOSS_LINE = np.float32(0.12)
GLOSS_MESH = np.float32(0.06)
FALLOFF = np.float32(0.55)  # how much darker a ball or line is where it turns away
SKIRT = np.float32(0.15)  # strength of a glow's halo
# Coefficients of the integrals of (1 - x^2)^9 and (1 - x^2)^3, by powers of x^2.
C1, C2, C3, C4, C5, C6, C7, C8, C9 = (np.float32((-1) ** k * math.comb(9, k) / (2 * k + 1)) for k in range(1, 10))
S2, S3 = np.float32(3.0 / 5.0), np.float32(-1.0 / 7.0)
KNEE = np.float32(1.0)  # light above this spills
HOTTEST = np.float32(24.0)  # and no more than this, or one spark would fill the picture
SLACK = 1e-9  # [pixels] by which an inner span is shorter than it might be


@inner
def _ray(px, py, camera):
    """Direction (x, y) with z = 1 from the eye through a pixel coordinate."""
    return (px - camera[1]) * camera[3], (camera[2] - py) * camera[3]


@inner
def _cut(box, area):
    """Columns and rows of a box within a tile."""
    left, right, top, bottom = area
    return max(box[0], left), min(box[1], right), max(box[2], top), min(box[3], bottom)


@inner
def _place(row, area):
    """The tile's pixel in column 0 of the picture."""
    return (row - area[2]) * TILE - area[0]


@inner
def _touching(slope, rest, x0, x1):
    """Pixels of [x0, x1) where slope * x + rest may be >= 0."""
    if slope > 0.0:
        x0 = max(x0, np.int64(clamp(math.floor(-rest / slope), -1.0, 1e6)))
    elif slope < 0.0:
        x1 = min(x1, np.int64(clamp(math.ceil(-rest / slope), -1.0, 1e6)))
    elif rest < 0.0:
        x1 = x0
    return x0, x1


@inner
def _inside(slope, rest, x0, x1):
    """Pixels of [x0, x1) where slope * x + rest is surely >= 0."""
    if slope > 0.0:
        x0 = max(x0, np.int64(clamp(math.ceil(SLACK - rest / slope), -1.0, 1e6)))
    elif slope < 0.0:
        x1 = min(x1, np.int64(clamp(math.floor(-rest / slope - SLACK), -1.0, 1e6)) + 1)
    elif rest < 0.0:
        x1 = x0
    return x0, x1


@inner
def _middle(mask, offsets, samples):
    """Mean place of the samples of a pixel that a mask names."""
    if mask == (1 << samples) - 1:
        return HALF, HALF
    hits, x, y = ZERO, ZERO, ZERO
    for k in range(samples):
        if mask & (1 << k):
            hits, x, y = hits + ONE, x + offsets[k, 0], y + offsets[k, 1]
    return x / hits, y / hits


@inner
def _face_spans(corner, y, left, right):
    """Pixels of a row in which a triangle may have a sample, and those that lie in it whole; y from the corner."""
    ax, _, vx, vy, wx, wy = corner
    ux, uy = -vx - wx, -vy - wy
    v, w = vy * y - vx * ax, wy * y - wx * ax
    u = 1.0 - v - w
    x0, x1 = np.int64(left), np.int64(right)
    x0, x1 = _touching(vx, v + max(vy, 0.0) + max(vx, 0.0), x0, x1)
    x0, x1 = _touching(wx, w + max(wy, 0.0) + max(wx, 0.0), x0, x1)
    x0, x1 = _touching(ux, u + max(uy, 0.0) + max(ux, 0.0), x0, x1)
    within0, within1 = _inside(vx, v + min(vy, 0.0) + min(vx, 0.0), x0, x1)
    within0, within1 = _inside(wx, w + min(wy, 0.0) + min(wx, 0.0), within0, within1)
    within0, within1 = _inside(ux, u + min(uy, 0.0) + min(ux, 0.0), within0, within1)
    return x0, x1, within0, within1


@inner
def _covers(corner, x, y):
    """Whether a pixel coordinate lies in a triangle."""
    ax, ay, vx, vy, wx, wy = corner
    v, w = vx * (x - ax) + vy * (y - ay), wx * (x - ax) + wy * (y - ay)
    return v >= 0.0 and w >= 0.0 and v + w <= 1.0


@inner
def _face(t, box, area, solid, tile, count, camera, offsets, steps):
    """One triangle: each sample in front is replaced (solid) or laid over; `steps` is a number for each sample."""
    ax, ay = np.float64(t[0]), np.float64(t[1])
    bx, by, cx, cy = t[2] - ax, t[3] - ay, t[4] - ax, t[5] - ay
    twice = bx * cy - by * cx
    if not abs(twice) > 1e-12:
        return count
    # Barycentric coordinates of b and c are linear: vx (x - ax) + vy (y - ay). So is 1/z.
    vx, vy, wx, wy = cy / twice, -cx / twice, -by / twice, bx / twice
    nearer_b, nearer_c = np.float64(t[7]) - t[6], np.float64(t[8]) - t[6]
    zx, zy = vx * nearer_b + wx * nearer_c, vy * nearer_b + wy * nearer_c
    # Corners turn counter-clockwise seen from outside, and pixels count downwards.
    side = ONE if twice < 0.0 else -ONE
    room, waiting, spots, samples = tile[0], tile[2], tile[3], tile[5]
    z0 = t[6] - zx * ax - zy * ay
    corner, begun = (ax, ay, vx, vy, wx, wy), count
    for k in range(samples):
        steps[k] = zx * offsets[k, 0] + zy * offsets[k, 1]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        y = row - ay
        x0, x1, within0, within1 = _face_spans(corner, y, left, right)
        start = _place(row, area)
        for column in range(x0, x1):
            mask = NONE
            p = start + column
            near = np.float32(z0 + zx * column + zy * row)
            within = within0 <= column < within1
            for k in range(samples):
                if not near + steps[k] > room[k * BLOCK + NEAR + p]:
                    continue
                if within or _covers(corner, column + offsets[k, 0], row + offsets[k, 1]):
                    mask |= 1 << k
                    if solid:
                        room[k * BLOCK + NEAR + p] = near + steps[k]
            if mask == 0:
                continue
            px, py = _middle(mask, offsets, samples)
            spots[0, count], spots[1, count] = p, mask
            waiting[U + count], waiting[V + count] = px + column, py + row
            count += 1
    _put_faces(t, begun, count, waiting, corner, side, solid, camera)
    return count


@inner
def _put_faces(t, first, last, waiting, corner, side, solid, camera):
    """What a triangle shows at the places (U, V) of the fragments [first, last)."""
    ax, ay, vx, vy, wx, wy = corner
    t0, t1, t2 = t[6], t[7], t[8]
    nx0, ny0, nz0, nx1, ny1, nz1, nx2, ny2, nz2 = t[9], t[10], t[11], t[12], t[13], t[14], t[15], t[16], t[17]
    r0, g0, b0, a0, r1, g1, b1, a1 = t[18], t[19], t[20], t[21], t[22], t[23], t[24], t[25]
    r2, g2, b2, a2 = t[26], t[27], t[28], t[29]
    least = ONE if solid else ZERO
    inverse, middle_x, middle_y = camera[3], camera[1], camera[2]
    line = waiting[first:]  # or the compiler would not know that what it counts from is not negative
    for i in range(last - first):
        px, py = line[U + i], line[V + i]
        x, y = px - ax, py - ay
        v, w = np.float32(vx * x + vy * y), np.float32(wx * x + wy * y)
        u = (ONE - v - w) * t0
        v, w = v * t1, w * t2
        z = ONE / (u + v + w)
        u, v, w = u * z, v * z, w * z
        put(
            line, i, (px - middle_x) * inverse * z, (middle_y - py) * inverse * z, z,
            side * (u * nx0 + v * nx1 + w * nx2),
            side * (u * ny0 + v * ny1 + w * ny2),
            side * (u * nz0 + v * nz1 + w * nz2),
            u * r0 + v * r1 + w * r2,
            u * g0 + v * g1 + w * g2,
            u * b0 + v * b1 + w * b2,
            GLOSS_MESH, clamp(u * a0 + v * a1 + w * a2, least, ONE), ZERO, ZERO,
        )  # fmt: skip


@inner
def _closest(c, dx, dy):
    """Along a ray: where it is nearest to a ball's centre, the centre as seen from there, and the ray's square."""
    square = dx * dx + dy * dy + ONE
    along = (dx * c[0] + dy * c[1] + c[2]) / square
    return along, c[0] - along * dx, c[1] - along * dy, c[2] - along, square


@inner
def _put_ball(c, dx, dy, alpha, w, sharp, tile, count, p, mask):
    """What a ball shows along a ray; a ray that just misses sees the edge."""
    along, px, py, pz, square = _closest(c, dx, dy)
    half = math.sqrt(max(c[3] * c[3] - px * px - py * py - pz * pz, ZERO) / square)
    nx, ny, nz = unit(-px - half * dx, -py - half * dy, -pz - half)
    z = along - half
    # A ball is darker at its edge, as if it stood among others.
    turned = ONE + (nx * dx + ny * dy + nz) / math.sqrt(square)
    dark = ONE - FALLOFF * turned * turned
    waiting, spots = tile[2], tile[3]
    spots[0, count], spots[1, count] = p, mask
    put(
        waiting, count, dx * z, dy * z, z, nx, ny, nz,
        c[4] * dark, c[5] * dark, c[6] * dark, GLOSS_BALL, alpha, w, sharp,
    )  # fmt: skip
    return count + 1


@inner
def _ball_solid(c, box, area, tile, count, camera, offsets):
    room, samples = tile[0], tile[5]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        start = _place(row, area)
        for column in range(left, right):
            hits, sx, sy = NONE, ZERO, ZERO
            mask = NONE
            p = start + column
            for k in range(samples):
                dx, dy = _ray(np.float32(column) + offsets[k, 0], np.float32(row) + offsets[k, 1], camera)
                along, px, py, pz, square = _closest(c, dx, dy)
                rest = c[3] * c[3] - px * px - py * py - pz * pz
                if rest > ZERO:
                    near = ONE / (along - math.sqrt(rest / square))
                    if near > room[k * BLOCK + NEAR + p]:
                        room[k * BLOCK + NEAR + p] = near
                        mask |= 1 << k
                        hits += 1
                        sx += dx
                        sy += dy
            if hits > 0:
                share = ONE / np.float32(hits)
                count = _put_ball(c, sx * share, sy * share, ONE, ZERO, ZERO, tile, count, p, mask)
    return count


@inner
def _ball_smeared(c, box, area, tile, count, camera):
    """A ball on its way covers a place for the share of the time in which it lies over it.

    A disc on a straight way lies over a point for as long as the disc's chord through the point is, along the way; the
    sum over all points is the disc's area. Each pixel takes the mean of STRIPS such lines. It shows the mean of what
    the ball shows at two moments of that time, those of Gauss's quadrature.
    """
    w = ONE / c[2]
    radius = camera[0] * w * c[3]
    size = max(radius, ONE)
    sharp = c[2] * c[2] / c[3]
    x, y = camera[1] + camera[0] * w * c[0], camera[2] - camera[0] * w * c[1]
    square = c[9] * c[9] + c[10] * c[10]
    length = math.sqrt(square)
    ux, uy = c[9] / length, c[10] / length
    reach = math.sqrt(max(square, ONE))  # of its way: one that is shorter has jagged edges
    strength = c[7] * (radius / size) * (radius / size) / (np.float32(STRIPS) * reach)
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        start = _place(row, area)
        if count + 2 * (right - left) > WAITING:
            count = flush(tile, count)
        for column in range(left, right):
            px, py = np.float32(column) + HALF, np.float32(row) + HALF
            along, across = (px - x) * ux + (py - y) * uy, (py - y) * ux - (px - x) * uy
            covered, moment = ZERO, ZERO
            for k in range(STRIPS):
                off = across + (np.float32(k) + HALF) / np.float32(STRIPS) - HALF
                chord = math.sqrt(max(size * size - off * off, ZERO))
                begin, end = max(along - chord, -HALF * reach), min(along + chord, HALF * reach)
                if end > begin:
                    covered += end - begin
                    moment += HALF * (end - begin) * (end + begin)
            if covered > ZERO:
                alpha, middle = strength * covered, moment / covered
                apart = GAUSS * covered / np.float32(STRIPS)
                # The first is laid over what lies behind, the second over both: then each counts for a half.
                for part in (alpha / (TWO - alpha), HALF * alpha):
                    dx, dy = _ray(px - (middle - apart) * ux, py - (middle - apart) * uy, camera)
                    count = _put_ball(c, dx, dy, part, w, sharp, tile, count, start + column, NONE)
                    apart = -apart
    return count


@inner
def _ball_soft(c, box, area, tile, count, camera):
    """A ball that is small or lets light through: coverage from the distance to its edge."""
    if c[9] != ZERO or c[10] != ZERO:
        return _ball_smeared(c, box, area, tile, count, camera)
    w = ONE / c[2]
    scale = camera[0] * w
    radius = scale * c[3]
    shown = max(radius, MIN_BALL)
    strength = c[7] * (radius / shown) * (radius / shown)
    sharp = c[2] * c[2] / c[3]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        start = _place(row, area)
        for column in range(left, right):
            dx, dy = _ray(np.float32(column) + HALF, np.float32(row) + HALF, camera)
            _, px, py, pz, _ = _closest(c, dx, dy)
            alpha = strength * clamp(shown + HALF - scale * math.sqrt(px * px + py * py + pz * pz), ZERO, ONE)
            if alpha > ZERO:
                count = _put_ball(c, dx, dy, alpha, w, sharp, tile, count, start + column, NONE)
    return count


@inner
def _glow_span(left, x0, x1):
    """Pixels [x0, x1) of a tile whose first column is `left`, up to whole blocks that the processor does at once."""
    return left + (x0 - left) // WIDTH * WIDTH, left + (x1 - left + WIDTH - 1) // WIDTH * WIDTH


@inner
def _ball_glow(c, box, area, room, ramp, camera):
    """A bright core in a faint halo: with u = 1 - d^2, u^3 (u^6 + 0.15) is close to two Gaussians, but has an end."""
    w = ONE / c[2]
    full = HALO * camera[0] * w * c[3]
    reach = max(full, MIN_GLOW)
    strength = c[7] * (full / reach) * (full / reach)
    sharp = c[2] * c[2] / c[3]
    x, y = camera[1] + camera[0] * w * c[0], camera[2] - camera[0] * w * c[1]
    inverse = ONE / (reach * reach)
    r, g, b = c[4], c[5], c[6]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        ey = np.float32(row) + HALF - y
        half = math.sqrt(max(reach * reach - ey * ey, ZERO)) + ONE
        x0 = clamp(np.int64(math.floor(x - half)), left, right)
        x0, x1 = _glow_span(area[0], x0, clamp(np.int64(math.ceil(x + half)), x0, right))
        line = room[_place(row, area) + x0 :]
        before = np.float32(x0) - x
        for i in range(x1 - x0):
            ex = before + ramp[i]
            rest = max(ONE - (ex * ex + ey * ey) * inverse, ZERO)
            cube = rest * rest * rest
            f = strength * cube * (cube * cube + SKIRT)
            f *= shown(line, i, w, sharp)
            line[RED + i] += f * r
            line[GREEN + i] += f * g
            line[BLUE + i] += f * b


@inner
def _across(c, dx, dy, inverse, px, py):
    """Where a pixel coordinate lies on a capsule: along it (0 to 1), and the square of how far off its axis.

    The square is -1 outside. `dx`, `dy` is the axis in the picture [pixels] and `inverse` one over its square.
    """
    ex, ey = px - c[8], py - c[9]
    fx, fy = px - c[10], py - c[11]
    if ex * c[20] + ey * c[21] < ZERO:
        return ZERO, -ONE
    if (c[22] != ZERO or c[23] != ZERO) and fx * c[22] + fy * c[23] >= ZERO:
        return ZERO, -ONE
    t = clamp((ex * dx + ey * dy) * inverse, ZERO, ONE)
    ox, oy = ex - t * dx, ey - t * dy
    return t, ox * ox + oy * oy


@inner
def _put_line(c, t, radius, z, px, py, alpha, w, sharp, camera, tile, count, p, mask):
    """What a round line shows: the normal turns from edge to edge; along the line all is linear in the picture."""
    tx, ty, tz = unit(c[3] - c[0], c[4] - c[1], c[5] - c[2])
    dx, dy = _ray(px, py, camera)
    vx, vy, vz = unit(-dx, -dy, -ONE)
    lx, ly, _ = unit(c[11] - c[9], c[10] - c[8], ZERO)  # to the left in the picture, in view coordinates
    side = vx * tx + vy * ty + vz * tz
    fx, fy, fz = unit(vx - side * tx, vy - side * ty, vz - side * tz)
    left = lx * (px - c[8]) - ly * (py - c[9])
    s = clamp(left / max(radius, ONE), np.float32(-0.95), np.float32(0.95))
    front = math.sqrt(ONE - s * s)
    dark = ONE - FALLOFF * (ONE - front) * (ONE - front)
    r, g, b = c[12] + t * (c[16] - c[12]), c[13] + t * (c[17] - c[13]), c[14] + t * (c[18] - c[14])
    waiting, spots = tile[2], tile[3]
    spots[0, count], spots[1, count] = p, mask
    put(
        waiting, count, dx * z, dy * z, z, s * lx + front * fx, s * ly + front * fy, front * fz,
        r * dark, g * dark, b * dark, GLOSS_LINE, alpha, w, sharp,
    )  # fmt: skip
    return count + 1


@inner
def _capsule_solid(c, box, area, tile, count, camera, offsets):
    room, samples = tile[0], tile[5]
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    dx, dy = c[10] - c[8], c[11] - c[9]
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        x0, x1 = _capsule_span(c, np.float32(row) + HALF, max(ra, rb) + ONE, left, right)
        start = _place(row, area)
        for column in range(x0, x1):
            hits, sx, sy = NONE, ZERO, ZERO
            mask = NONE
            p = start + column
            for k in range(samples):
                px, py = np.float32(column) + offsets[k, 0], np.float32(row) + offsets[k, 1]
                t, off = _across(c, dx, dy, inverse, px, py)
                radius = ra + t * (rb - ra)
                square = radius * radius
                if off >= ZERO and off < square:
                    # The surface bulges towards the eye by a part of the radius.
                    bulge = math.sqrt(ONE - off / square) * min(radius * camera[3], HALF)
                    near = (wa + t * (wb - wa)) / (ONE - bulge)
                    if near > room[k * BLOCK + NEAR + p]:
                        room[k * BLOCK + NEAR + p] = near
                        mask |= 1 << k
                        hits += 1
                        sx += px
                        sy += py
            if hits > 0:
                sx, sy = sx / np.float32(hits), sy / np.float32(hits)
                t, _ = _across(c, dx, dy, inverse, sx, sy)
                z = ONE / (wa + t * (wb - wa))
                radius = ra + t * (rb - ra)
                count = _put_line(c, t, radius, z, sx, sy, ONE, ZERO, ZERO, camera, tile, count, p, mask)
    return count


@inner
def _capsule_span(c, y, reach, left, right):
    """Pixels of a row that lie within `reach` of the capsule's axis."""
    dx, dy = c[10] - c[8], c[11] - c[9]
    x0, x1 = np.float32(left), np.float32(right)
    if abs(dy) > np.float32(1e-3):
        middle = c[8] + (y - c[9]) * dx / dy
        half = reach * math.sqrt(dx * dx + dy * dy) / abs(dy) + ONE
        low, high = clamp(middle - half, x0, x1), clamp(middle + half, x0, x1)
        x0, x1 = low, high
    return np.int64(math.floor(x0)), np.int64(math.ceil(x1))


@inner
def _capsule_soft(c, box, area, tile, count, camera):
    """A thin or clear line; thinner than a pixel it fades instead."""
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    dx, dy = c[10] - c[8], c[11] - c[9]
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        py = np.float32(row) + HALF
        x0, x1 = _capsule_span(c, py, max(ra, rb) + ONE, left, right)
        start = _place(row, area)
        for column in range(x0, x1):
            px = np.float32(column) + HALF
            t, off = _across(c, dx, dy, inverse, px, py)
            if off < ZERO:
                continue
            radius = ra + t * (rb - ra)
            shown = max(radius, HALF)
            alpha = c[15] + t * (c[19] - c[15])
            alpha *= radius / shown * clamp(shown + HALF - math.sqrt(off), ZERO, ONE)
            if alpha > ZERO:
                w = wa + t * (wb - wa)
                z = ONE / w
                sharp = z * camera[0] / shown
                count = _put_line(c, t, radius, z, px, py, alpha, w, sharp, camera, tile, count, start + column, NONE)
    return count


@inner
def _capsule_glow(c, box, area, room, ramp, camera):
    """A glowing line; thinner than MIN_LINE pixels it fades instead."""
    wa, wb = ONE / c[2], ONE / c[5]
    focal = camera[0]
    ra, rb = focal * c[6] * wa, focal * c[7] * wb
    wider, farther = rb - ra, wb - wa
    ax, ay, dx, dy = c[8], c[9], c[10] - c[8], c[11] - c[9]
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    ux, uy, vx, vy = c[20], c[21], c[22], c[23]
    beyond = ONE if vx == ZERO and vy == ZERO else ZERO  # a line that is not there cuts nothing
    r, g, b, alpha = c[12], c[13], c[14], c[15]
    more_r, more_g, more_b, more_alpha = c[16] - r, c[17] - g, c[18] - b, c[19] - alpha
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        py = np.float32(row) + HALF
        x0, x1 = _capsule_span(c, py, max(REACH * max(ra, rb), MIN_LINE), left, right)
        x0, x1 = _glow_span(area[0], x0, x1)
        line = room[_place(row, area) + x0 :]
        before, ey = np.float32(x0) - ax, py - ay
        for i in range(x1 - x0):
            ex = before + ramp[i]
            t = clamp((ex * dx + ey * dy) * inverse, ZERO, ONE)
            ox, oy = ex - t * dx, ey - t * dy
            radius = ra + t * wider
            reach = max(REACH * radius, MIN_LINE)
            shrunk = ONE / reach
            rest = max(ONE - (ox * ox + oy * oy) * shrunk * shrunk, ZERO)
            w = wa + t * farther
            f = (alpha + t * more_alpha) * REACH * radius * shrunk * rest * rest * rest
            f *= shown(line, i, w, focal / (w * max(radius, HALF)))
            outside = ex * ux + ey * uy < ZERO or (ex - dx) * vx + (ey - dy) * vy >= beyond
            f = ZERO if outside else f
            line[RED + i] += f * (r + t * more_r)
            line[GREEN + i] += f * (g + t * more_g)
            line[BLUE + i] += f * (b + t * more_b)


@inner
def _passed(s):
    """Integrals of (1 - x^2)^9 and (1 - x^2)^3 from 0 to s, for s from -1 to 1."""
    q = s * s
    core = q * (C8 + q * C9)
    core = q * (C5 + q * (C6 + q * (C7 + core)))
    core = q * (C2 + q * (C3 + q * (C4 + core)))
    return s * (ONE + q * (C1 + core)), s * (ONE + q * (-ONE + q * (S2 + q * S3)))


@inner
def _streak(c, box, area, room, ramp, camera):
    """A glowing point that moved: the mean of what `_ball_glow` gives on the way, so no light is won or lost.

    At a distance h from the way, both powers of 1 - h^2 - x^2 are integrated over x from the first end to the last.
    """
    wa, wb = ONE / c[2], ONE / c[5]
    full = HALO * HALF * camera[0] * (c[6] * wa + c[7] * wb)
    reach = max(full, MIN_GLOW)
    x, y, dx, dy = c[8], c[9], c[10] - c[8], c[11] - c[9]
    length = math.sqrt(dx * dx + dy * dy)
    ux, uy = dx / length, dy / length
    shrunk, inverse = ONE / reach, ONE / length
    strength = c[15] * (full * shrunk) * (full * shrunk) * reach * inverse
    farther = wb - wa
    sharp = TWO / (wa * wb * (c[6] + c[7]))
    r, g, b = c[12], c[13], c[14]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        py = np.float32(row) + HALF
        x0, x1 = _capsule_span(c, py, reach, left, right)
        x0, x1 = _glow_span(area[0], x0, x1)
        line = room[_place(row, area) + x0 :]
        before, ey = np.float32(x0) - x, py - y
        for i in range(x1 - x0):
            ex = before + ramp[i]
            along, off = ex * ux + ey * uy, (ex * uy - ey * ux) * shrunk
            rest = max(ONE - off * off, TINY)
            half = math.sqrt(rest)
            scale = shrunk / half
            core_b, skirt_b = _passed(clamp(along * scale, -ONE, ONE))
            core_a, skirt_a = _passed(clamp((along - length) * scale, -ONE, ONE))
            cube = rest * rest * rest
            f = strength * half * cube * (cube * cube * (core_b - core_a) + SKIRT * (skirt_b - skirt_a))
            w = wa + clamp(along * inverse, ZERO, ONE) * farther
            f *= shown(line, i, w, sharp)
            line[RED + i] += f * r
            line[GREEN + i] += f * g
            line[BLUE + i] += f * b


@inner
def _line_glow(c, box, area, room, ramp, camera):
    """A capsule that only adds its light."""
    if c[24] > ONE:
        _streak(c, box, area, room, ramp, camera)
    else:
        _capsule_glow(c, box, area, room, ramp, camera)


@inner
def _sprite(s, box, area, room, ramp):
    """A soft ellipse laid over; with u = 1 - d^2, u^3 is close to a Gaussian, and (hard u)^3 has a flat middle.

    Light comes from one side, so its colour changes from edge to edge.
    """
    x, y, a, b, c, hard = s[0], s[1], s[2], s[3], s[4], s[5]
    alpha, w, sharp = s[6], s[7], s[8]
    red, green, blue = s[9], s[10], s[11]
    more_red, more_green, more_blue, sx, sy = s[12], s[13], s[14], s[15], s[16]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        ey = np.float32(row) + HALF - y
        middle, rest = -b * ey / a, ONE - c * ey * ey
        half = math.sqrt(max(middle * middle + rest / a, ZERO)) + ONE
        x0 = clamp(np.int64(math.floor(x + middle - half)), left, right)
        x0, x1 = _glow_span(area[0], x0, clamp(np.int64(math.ceil(x + middle + half)), x0, right))
        line = room[_place(row, area) + x0 :]
        before, across, up = np.float32(x0) - x, (b + b) * ey, sy * ey
        for i in range(x1 - x0):
            ex = before + ramp[i]
            u = clamp(hard * (rest - (a * ex + across) * ex), ZERO, ONE)
            f = alpha * u * u * u * shown(line, i, w, sharp)
            side = sx * ex + up
            line[RED + i] += f * (red + side * more_red - line[RED + i])
            line[GREEN + i] += f * (green + side * more_green - line[GREEN + i])
            line[BLUE + i] += f * (blue + side * more_blue - line[BLUE + i])


def _round(draw_solid, draw_soft, draw_glow):
    """What draws a ball or a capsule, by the three ways to draw its kind.

    It is made here, and not handed three functions when it is called: then no caller could be kept on disk.
    """

    @inner
    def draw(c, box, area, solid, glows, tile, count, space):
        camera, offsets, _, ramp = space
        if solid:
            return draw_solid(c, box, area, tile, count, camera, offsets)
        if not glows:
            return draw_soft(c, box, area, tile, count, camera)
        for k in range(tile[4]):
            draw_glow(c, box, area, tile[0][k * BLOCK :], ramp, camera)
        return count

    return draw


_ball = _round(_ball_solid, _ball_soft, _ball_glow)
_capsule = _round(_capsule_solid, _capsule_soft, _line_glow)


@inner
def _fill(room, even, area, samples, colors):
    """A tile with nothing in it."""
    for row in range(area[2], area[3]):
        start = (row - area[2]) * TILE
        for channel in range(3):
            for p in range(start, start + TILE):
                room[channel * LINE + p] = colors[row, channel]
    for k in range(samples):
        for line in (NEAR, FAR, COVER):
            for p in range(AREA):
                room[k * BLOCK + line + p] = ZERO
    for p in range(AREA):
        even[p] = True


@inner
def _part(room, even, samples):
    """Every sample becomes a layer of its own."""
    for p in range(AREA):
        spread(room, even, p, samples)
        for k in range(samples):
            room[k * BLOCK + FAR + p] = room[k * BLOCK + NEAR + p]


@inner
def _mix(room, even, samples):
    """The mean of each pixel's samples into the first layer."""
    share = ONE / np.float32(samples)
    for p in range(AREA):
        if not even[p]:
            for channel in range(3):
                total = ZERO
                for k in range(samples):
                    total += room[k * BLOCK + channel * LINE + p]
                room[channel * LINE + p] = share * total


@inner
def _resolve(room, samples):
    """The depths of each pixel into the first layer: the nearest, the farthest, and the share of the nearest.

    As if there were two surfaces: then the mean tells how much of the pixel the nearer one covers.
    """
    share = ONE / np.float32(samples)
    for p in range(AREA):
        near = far = total = room[NEAR + p]
        for k in range(1, samples):
            deep = room[k * BLOCK + NEAR + p]
            near, far, total = max(near, deep), min(far, deep), total + deep
        room[NEAR + p], room[FAR + p] = near, far
        room[COVER + p] = clamp((total * share - far) / (near - far), ZERO, ONE) if near > far else ZERO


@inner
def _hand_over(room, area, picture, bright):
    """A tile into the picture, and what is brighter than the knee, at half the size; whether there is any."""
    left, right, top, bottom = area
    for channel in range(3):
        for row in range(top, bottom):
            start = (row - top) * TILE
            source, target = room[channel * LINE + start :], picture[channel, row, left:right]
            for i in range(right - left):
                target[i] = source[i]
    spilled = False
    for row in range(top // 2, (bottom + 1) // 2):
        for column in range(left // 2, (right + 1) // 2):
            r, g, b = ZERO, ZERO, ZERO
            for j in range(2):
                for i in range(2):
                    p = (min(2 * row + j, bottom - 1) - top) * TILE + min(2 * column + i, right - 1) - left
                    most = max(room[RED + p], room[GREEN + p], room[BLUE + p])
                    if most > KNEE:
                        share = np.float32(0.25) * (min(most, HOTTEST) - KNEE) / most
                        r += share * room[RED + p]
                        g += share * room[GREEN + p]
                        b += share * room[BLUE + p]
                        spilled = True
            bright[0, row, column], bright[1, row, column], bright[2, row, column] = r, g, b
    return spilled


@kernel
def sort_into_tiles(box, columns, rows):
    """Lists of the items that touch each tile, in the order given: where each list starts, and all lists.

    Parameters
    ----------
    box : first and one past the last column and row of each item, shape (k, 4).
    columns, rows : how many tiles there are.
    """
    starts = np.zeros(columns * rows + 1, dtype=np.int64)
    for i in range(box.shape[0]):
        for row in range(box[i, 2] // BAND, (box[i, 3] - 1) // BAND + 1):
            for column in range(box[i, 0] // TILE, (box[i, 1] - 1) // TILE + 1):
                starts[row * columns + column + 1] += 1
    for at in range(columns * rows):
        starts[at + 1] += starts[at]
    lists = np.empty(starts[columns * rows], dtype=np.int64)
    free = starts.copy()
    for i in range(box.shape[0]):
        for row in range(box[i, 2] // BAND, (box[i, 3] - 1) // BAND + 1):
            for column in range(box[i, 0] // TILE, (box[i, 1] - 1) // TILE + 1):
                lists[free[row * columns + column]] = i
                free[row * columns + column] += 1
    return starts, lists


@inner
def _any_below(items, bound):
    found = False
    for item in items:
        found |= item < bound
    return found


@inner
def _draw_all(items, solid, tables, area, tile, space):
    """The things of a tile, in their order."""
    faces, face_box, balls, ball_box, capsules, capsule_box, sprites, sprite_box = tables
    camera, offsets, steps, ramp = space
    ball_first, capsule_first = len(faces), len(faces) + len(balls)
    sprite_first = capsule_first + len(capsules)
    count = NONE
    for item in items:
        if item >= sprite_first:
            count = flush(tile, count)
            i = item - sprite_first
            for k in range(tile[4]):
                _sprite(sprites[i], sprite_box[i], area, tile[0][k * BLOCK :], ramp)
            continue
        kind = 0 if item < ball_first else (1 if item < capsule_first else 2)
        i = item - (0 if kind == 0 else (ball_first if kind == 1 else capsule_first))
        box = face_box[i] if kind == 0 else (ball_box[i] if kind == 1 else capsule_box[i])
        left, right, first, last = _cut(box, area)
        glows = not solid and (balls[i, 8] > ZERO if kind == 1 else (capsules[i, 24] > ZERO if kind == 2 else False))
        # Room for all it may show; and what lies behind a glow must be there before it.
        if glows or count + (right - left) * (last - first) > WAITING:
            count = flush(tile, count)
        if kind == 0:
            count = _face(faces[i], box, area, solid, tile, count, camera, offsets, steps)
        elif kind == 1:
            count = _ball(balls[i], box, area, solid, glows, tile, count, space)
        else:
            count = _capsule(capsules[i], box, area, solid, glows, tile, count, space)
    flush(tile, count)


@kernel
def draw(
    band, picture, bright, background, camera, offsets, solid_starts, solids, soft_starts, softs,
    faces, face_box, balls, ball_box, capsules, capsule_box, sprites, sprite_box, lamp, shadow, matrix,
    room, even, waiting, spots, steps, ramp,
):  # fmt: skip
    """Draw one band of tiles, in linear light; whether anything in it spills.

    Parameters
    ----------
    band : which one.
    picture : written, shape (3, height, width).
    bright : written; what spills around bright things, of half the size.
    background : colour of each row, shape (height, 3).
    camera : focal length, centre, one over the focal length [pixels].
    offsets : samples within a pixel, shape (s, 2).
    solid_starts, solids, soft_starts, softs : numbers of the things that touch each tile, and where each tile's begin;
        they count faces, then balls, then capsules, then sprites.
    faces, face_box, balls, ball_box, capsules, capsule_box, sprites, sprite_box : rows of the tables.
    lamp : directions and colours of the light, see `lamp.py`.
    shadow, matrix : the shadow map.
    room, even, waiting, spots, steps, ramp : room to work in, see `image.py`.
    """
    height, width = picture.shape[1], picture.shape[2]
    picture, bright, background = bare(picture), bare(bright), bare(background)
    camera, offsets, lamp, shadow, matrix = bare(camera), bare(offsets), bare(lamp), bare(shadow), bare(matrix)
    tables = (
        bare(faces), bare(face_box), bare(balls), bare(ball_box), bare(capsules), bare(capsule_box), bare(sprites),
        bare(sprite_box),
    )  # fmt: skip
    room, even, waiting, spots = bare(room), bare(even), bare(waiting), bare(spots)
    space = (camera, offsets, bare(steps), bare(ramp))
    most = len(offsets)
    columns = (width + TILE - 1) // TILE
    spilled = False
    for column in range(columns):
        area = (column * TILE, min((column + 1) * TILE, width), band * BAND, min((band + 1) * BAND, height))
        at = band * columns + column
        front, back = solids[solid_starts[at] : solid_starts[at + 1]], softs[soft_starts[at] : soft_starts[at + 1]]
        layered = most > 1 and _any_below(back, len(faces))  # clear faces need the samples apart until the end
        samples = most if layered or len(front) > 0 else 1
        layers = samples if layered else 1
        _fill(room, even, area, samples, background)
        # First what hides, then what is laid over: one walk is compiled for both.
        for solid in (True, False):
            if not solid and layered:
                _part(room, even, samples)
            elif not solid and samples > 1:
                _mix(room, even, samples)
                _resolve(room, samples)
            tile = (room, even, waiting, spots, layers, samples, lamp, shadow, matrix)
            _draw_all(front if solid else back, solid, tables, area, tile, space)
        if layered:
            _mix(room, even, samples)
        spilled |= _hand_over(room, area, picture, bright)
    return spilled
