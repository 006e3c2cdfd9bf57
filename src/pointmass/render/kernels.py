"""The loops that draw: triangles, balls and capsules, tile by tile.

The picture is cut into tiles of TILE x BAND pixels, whatever the number of threads. A tile walks the solid things that
touch it (near ones first, with a z-buffer of several samples for each pixel), then lays the soft things over them, far
ones first. No two threads write the same tile and every tile adds in the same order, so the bytes do not depend on
threads. A tile's room is small: it stays in the processor's memory, and an empty tile costs nothing.

Depths are compared as w = 1/z, which is linear in the picture; 0 is infinitely far.

In a tile, `light` has a line of pixels for red, green and blue of each layer, and `depth` one for each sample. Where
`even` holds, all samples of a pixel have the light of the first layer, and the other layers hold nothing yet.
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
from pointmass.render.kernels_shade import HALF, LINES, ONE, STEP, TINY, WAITING, ZERO, clamp, flush, lay, put, unit

TILE = 128  # columns of a tile, and
BAND = 16  # its rows; both even, for the bloom works at half the size
AREA = TILE * BAND
LINE = AREA + 48  # a tile's lines in memory: at powers of two they would push each other out of the cache

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
def _face(t, box, area, solid, tile, count, camera, offsets, steps):
    """One triangle: each sample in front is replaced (solid) or laid over; `steps` is a number for each sample."""
    ax, ay = np.float64(t[0]), np.float64(t[1])
    bx, by, cx, cy = t[2] - ax, t[3] - ay, t[4] - ax, t[5] - ay
    twice = bx * cy - by * cx
    if not abs(twice) > 1e-12:
        return count
    # Barycentric coordinates of b and c are linear: vx (x - ax) + vy (y - ay). So is 1/z.
    vx, vy, wx, wy = cy / twice, -cx / twice, -by / twice, bx / twice
    ux, uy = -vx - wx, -vy - wy
    nearer_b, nearer_c = np.float64(t[7]) - t[6], np.float64(t[8]) - t[6]
    zx, zy = vx * nearer_b + wx * nearer_c, vy * nearer_b + wy * nearer_c
    # Corners turn counter-clockwise seen from outside, and pixels count downwards.
    side = ONE if twice < 0.0 else -ONE
    depth, waiting, spots, samples = tile[1], tile[3], tile[4], tile[6]
    z0 = t[6] - zx * ax - zy * ay
    for k in range(samples):
        steps[k] = zx * offsets[k, 0] + zy * offsets[k, 1]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        y = row - ay
        v0, w0 = vy * y - vx * ax, wy * y - wx * ax
        u0 = 1.0 - v0 - w0
        x0, x1 = np.int64(left), np.int64(right)
        x0, x1 = _touching(vx, v0 + max(vy, 0.0) + max(vx, 0.0), x0, x1)
        x0, x1 = _touching(wx, w0 + max(wy, 0.0) + max(wx, 0.0), x0, x1)
        x0, x1 = _touching(ux, u0 + max(uy, 0.0) + max(ux, 0.0), x0, x1)
        within0, within1 = _inside(vx, v0 + min(vy, 0.0) + min(vx, 0.0), x0, x1)
        within0, within1 = _inside(wx, w0 + min(wy, 0.0) + min(wx, 0.0), within0, within1)
        within0, within1 = _inside(ux, u0 + min(uy, 0.0) + min(ux, 0.0), within0, within1)
        start = _place(row, area)
        for column in range(x0, x1):
            mask = 0
            p = start + column
            if within0 <= column < within1:
                near = z0 + zx * column + zy * row
                for k in range(samples):
                    if near + steps[k] > depth[k, p]:
                        if solid:
                            depth[k, p] = near + steps[k]
                        mask |= 1 << k
            else:
                for k in range(samples):
                    px, py = column + offsets[k, 0] - ax, row + offsets[k, 1] - ay
                    v, w = vx * px + vy * py, wx * px + wy * py
                    if v >= 0.0 and w >= 0.0 and v + w <= 1.0:
                        near = t[6] + zx * px + zy * py
                        if near > depth[k, p]:
                            if solid:
                                depth[k, p] = near
                            mask |= 1 << k
            if mask == 0:
                continue
            px, py = _middle(mask, offsets, samples)
            px, py = px + column - ax, py + row - ay
            v, w = np.float32(vx * px + vy * py), np.float32(wx * px + wy * py)
            u = (ONE - v - w) * t[6]
            v, w = v * t[7], w * t[8]
            z = ONE / (u + v + w)
            u, v, w = u * z, v * z, w * z
            dx, dy = _ray(np.float32(px + ax), np.float32(py + ay), camera)
            if count == WAITING:
                count = flush(tile, count)
            spots[0, count], spots[1, count] = p, mask
            put(
                waiting, count, dx * z, dy * z, z,
                side * (u * t[9] + v * t[12] + w * t[15]),
                side * (u * t[10] + v * t[13] + w * t[16]),
                side * (u * t[11] + v * t[14] + w * t[17]),
                u * t[18] + v * t[22] + w * t[26],
                u * t[19] + v * t[23] + w * t[27],
                u * t[20] + v * t[24] + w * t[28],
                GLOSS_MESH, ONE if solid else clamp(u * t[21] + v * t[25] + w * t[29], ZERO, ONE), ZERO, ZERO,
            )  # fmt: skip
            count += 1
    return count


@inner
def _closest(c, dx, dy):
    """Along a ray: where it is nearest to a ball's centre, the centre as seen from there, and the ray's square."""
    square = dx * dx + dy * dy + ONE
    along = (dx * c[0] + dy * c[1] + c[2]) / square
    return along, c[0] - along * dx, c[1] - along * dy, c[2] - along, square


@inner
def _put_ball(c, dx, dy, alpha, w, sharp, tile, count, p, mask):
    """What a ball shows along a ray; a ray that just misses sees the edge."""
    if count == WAITING:
        count = flush(tile, count)
    along, px, py, pz, square = _closest(c, dx, dy)
    half = math.sqrt(max(c[3] * c[3] - px * px - py * py - pz * pz, ZERO) / square)
    nx, ny, nz = unit(-px - half * dx, -py - half * dy, -pz - half)
    z = along - half
    # A ball is darker at its edge, as if it stood among others.
    turned = ONE + (nx * dx + ny * dy + nz) / math.sqrt(square)
    dark = ONE - FALLOFF * turned * turned
    waiting, spots = tile[3], tile[4]
    spots[0, count], spots[1, count] = p, mask
    put(
        waiting, count, dx * z, dy * z, z, nx, ny, nz,
        c[4] * dark, c[5] * dark, c[6] * dark, GLOSS_BALL, alpha, w, sharp,
    )  # fmt: skip
    return count + 1


@inner
def _ball_solid(c, box, area, tile, count, camera, offsets):
    depth, samples = tile[1], tile[6]
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        start = _place(row, area)
        for column in range(left, right):
            hits, sx, sy = 0, ZERO, ZERO
            mask = 0
            p = start + column
            for k in range(samples):
                dx, dy = _ray(np.float32(column) + offsets[k, 0], np.float32(row) + offsets[k, 1], camera)
                along, px, py, pz, square = _closest(c, dx, dy)
                rest = c[3] * c[3] - px * px - py * py - pz * pz
                if rest > ZERO:
                    near = ONE / (along - math.sqrt(rest / square))
                    if near > depth[k, p]:
                        depth[k, p] = near
                        mask |= 1 << k
                        hits += 1
                        sx += dx
                        sy += dy
            if hits > 0:
                share = ONE / np.float32(hits)
                count = _put_ball(c, sx * share, sy * share, ONE, ZERO, ZERO, tile, count, p, mask)
    return count


@inner
def _ball_soft(c, box, area, tile, count, camera):
    """A ball that is small or lets light through: coverage from the distance to its edge."""
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
                count = _put_ball(c, dx, dy, alpha, w, sharp, tile, count, start + column, 0)
    return count


@inner
def _ball_glow(c, box, area, tile, camera):
    """A bright core in a faint halo: with u = 1 - d^2, u^3 (u^6 + 0.15) is close to two Gaussians, but has an end."""
    light, depth, even, layers, hidden = tile[0], tile[1], tile[2], tile[5], tile[7]
    w = ONE / c[2]
    full = HALO * camera[0] * w * c[3]
    reach = max(full, MIN_GLOW)
    strength = c[7] * (full / reach) * (full / reach)
    sharp = c[2] * c[2] / c[3]
    x, y = camera[1] + camera[0] * w * c[0], camera[2] - camera[0] * w * c[1]
    inverse = ONE / (reach * reach)
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        ey = np.float32(row) + HALF - y
        start = _place(row, area)
        for column in range(left, right):
            ex = np.float32(column) + HALF - x
            rest = ONE - (ex * ex + ey * ey) * inverse
            if rest > ZERO:
                cube = rest * rest * rest
                f = strength * cube * (cube * cube + SKIRT)
                lay(light, depth, even, hidden, layers, start + column, w, sharp, f * c[4], f * c[5], f * c[6], ZERO)


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
    if count == WAITING:
        count = flush(tile, count)
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
    waiting, spots = tile[3], tile[4]
    spots[0, count], spots[1, count] = p, mask
    put(
        waiting, count, dx * z, dy * z, z, s * lx + front * fx, s * ly + front * fy, front * fz,
        r * dark, g * dark, b * dark, GLOSS_LINE, alpha, w, sharp,
    )  # fmt: skip
    return count + 1


@inner
def _capsule_solid(c, box, area, tile, count, camera, offsets):
    depth, samples = tile[1], tile[6]
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    dx, dy = c[10] - c[8], c[11] - c[9]
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        x0, x1 = _capsule_span(c, np.float32(row) + HALF, max(ra, rb) + ONE, left, right)
        start = _place(row, area)
        for column in range(x0, x1):
            hits, sx, sy = 0, ZERO, ZERO
            mask = 0
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
                    if near > depth[k, p]:
                        depth[k, p] = near
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
    """A thin, clear or glowing line; thinner than a pixel it fades instead."""
    light, depth, even, layers, hidden = tile[0], tile[1], tile[2], tile[5], tile[7]
    glow = c[24] > ZERO
    wa, wb = ONE / c[2], ONE / c[5]
    ra, rb = camera[0] * c[6] * wa, camera[0] * c[7] * wb
    dx, dy = c[10] - c[8], c[11] - c[9]
    inverse = ONE / max(dx * dx + dy * dy, TINY)
    widest = max(REACH * max(ra, rb), MIN_LINE) if glow else max(ra, rb) + ONE
    left, right, first, last = _cut(box, area)
    for row in range(first, last):
        py = np.float32(row) + HALF
        x0, x1 = _capsule_span(c, py, widest, left, right)
        start = _place(row, area)
        for column in range(x0, x1):
            px = np.float32(column) + HALF
            t, off = _across(c, dx, dy, inverse, px, py)
            if off < ZERO:
                continue
            radius = ra + t * (rb - ra)
            alpha = c[15] + t * (c[19] - c[15])
            if glow:
                full = REACH * radius
                reach = max(full, MIN_LINE)
                rest = reach * reach - off
                if rest > ZERO:
                    rest /= reach * reach
                    f = alpha * full / reach * rest * rest * rest
                    r, g, b = c[12] + t * (c[16] - c[12]), c[13] + t * (c[17] - c[13]), c[14] + t * (c[18] - c[14])
                    w = wa + t * (wb - wa)
                    sharp = camera[0] / (w * max(radius, HALF))
                    lay(light, depth, even, hidden, layers, start + column, w, sharp, f * r, f * g, f * b, ZERO)
            else:
                shown = max(radius, HALF)
                alpha *= radius / shown * clamp(shown + HALF - math.sqrt(off), ZERO, ONE)
                if alpha > ZERO:
                    w = wa + t * (wb - wa)
                    z = ONE / w
                    sharp = z * camera[0] / shown
                    count = _put_line(c, t, radius, z, px, py, alpha, w, sharp, camera, tile, count, start + column, 0)
    return count


@inner
def _fill(light, depth, even, area, samples, colors):
    """A tile with nothing in it."""
    for row in range(area[2], area[3]):
        start = (row - area[2]) * TILE
        for channel in range(3):
            light[channel, start : start + TILE] = colors[row, channel]
    for k in range(samples):
        depth[k, :AREA] = ZERO
    even[:] = True


@inner
def _mix(light, even, samples):
    """The mean of each pixel's samples into the first layer."""
    share = ONE / np.float32(samples)
    for p in range(AREA):
        if not even[p]:
            for channel in range(3):
                total = ZERO
                for k in range(samples):
                    total += light[3 * k + channel, p]
                light[channel, p] = share * total


@inner
def _resolve(depth, samples):
    """The depths of each pixel into three lines: the nearest, the farthest, and the share of the nearest.

    As if there were two surfaces: then the mean tells how much of the pixel the nearer one covers.
    """
    share = ONE / np.float32(samples)
    for p in range(AREA):
        near = far = total = depth[0, p]
        for k in range(1, samples):
            near, far, total = max(near, depth[k, p]), min(far, depth[k, p]), total + depth[k, p]
        depth[0, p], depth[1, p] = near, far
        depth[2, p] = clamp((total * share - far) / (near - far), ZERO, ONE) if near > far else ZERO


@inner
def _hand_over(light, area, picture, bright):
    """A tile into the picture, and what is brighter than the knee, at half the size; whether there is any."""
    left, right, top, bottom = area
    for channel in range(3):
        for row in range(top, bottom):
            start = (row - top) * TILE
            picture[channel, row, left:right] = light[channel, start : start + right - left]
    spilled = False
    for row in range(top // 2, (bottom + 1) // 2):
        for column in range(left // 2, (right + 1) // 2):
            r, g, b = ZERO, ZERO, ZERO
            for j in range(2):
                for i in range(2):
                    p = (min(2 * row + j, bottom - 1) - top) * TILE + min(2 * column + i, right - 1) - left
                    most = max(light[0, p], light[1, p], light[2, p])
                    if most > KNEE:
                        share = np.float32(0.25) * (min(most, HOTTEST) - KNEE) / most
                        r += share * light[0, p]
                        g += share * light[1, p]
                        b += share * light[2, p]
                        spilled = True
            bright[0, row, column], bright[1, row, column], bright[2, row, column] = r, g, b
    return spilled


@njit(cache=True, error_model="numpy")
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


@njit(nogil=True, cache=True, error_model="numpy")
def draw(
    band, picture, bright, background, camera, offsets, solid_starts, solids, soft_starts, softs,
    faces, face_box, balls, ball_box, capsules, capsule_box, lamp, shadow, matrix,
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
        they count faces, then balls, then capsules.
    faces, face_box, balls, ball_box, capsules, capsule_box : rows of the tables.
    lamp : directions and colours of the light, see `lamp.py`.
    shadow, matrix : the shadow map.
    """
    height, width = picture.shape[1], picture.shape[2]
    room = np.empty((3 * len(offsets), LINE), dtype=np.float32)
    deep = np.empty((max(3, len(offsets)), LINE), dtype=np.float32)
    flags = np.empty(AREA, dtype=np.bool_)
    steps = np.empty(len(offsets), dtype=np.float32)
    table = np.empty(LINES * STEP, dtype=np.float32)
    places = np.empty((2, WAITING), dtype=np.int64)
    light, depth, even, waiting, spots = bare(room), bare(deep), bare(flags), bare(table), bare(places)
    picture, bright, background = bare(picture), bare(bright), bare(background)
    camera, offsets, lamp, shadow, matrix = bare(camera), bare(offsets), bare(lamp), bare(shadow), bare(matrix)
    faces, balls, capsules = bare(faces), bare(balls), bare(capsules)
    face_box, ball_box, capsule_box = bare(face_box), bare(ball_box), bare(capsule_box)
    ball_first, capsule_first = len(faces), len(faces) + len(balls)
    columns = (width + TILE - 1) // TILE
    spilled = False
    for column in range(columns):
        area = (column * TILE, min((column + 1) * TILE, width), band * BAND, min((band + 1) * BAND, height))
        at = band * columns + column
        layered = False  # clear faces need the samples apart until the end
        for i in range(soft_starts[at], soft_starts[at + 1]):
            layered |= softs[i] < ball_first
        hidden = solid_starts[at] < solid_starts[at + 1]
        samples = len(offsets) if hidden or layered else 1
        layered &= samples > 1
        _fill(light, depth, even, area, samples, background)
        for phase in range(2):
            solid = phase == 0
            tile = (light, depth, even, waiting, spots, samples, samples, hidden, lamp, shadow, matrix)
            if not solid and not layered:
                if hidden:
                    _mix(light, even, samples)
                    _resolve(depth, samples)
                tile = (light, depth, even, waiting, spots, 1, samples, hidden, lamp, shadow, matrix)
            first, last = (solid_starts[at], solid_starts[at + 1]) if solid else (soft_starts[at], soft_starts[at + 1])
            count = 0
            for i in range(first, last):
                item = solids[i] if solid else softs[i]
                if item < ball_first:
                    count = _face(faces[item], face_box[item], area, solid, tile, count, camera, offsets, steps)
                elif item < capsule_first:
                    ball, box = balls[item - ball_first], ball_box[item - ball_first]
                    if solid:
                        count = _ball_solid(ball, box, area, tile, count, camera, offsets)
                    elif ball[8] > ZERO:
                        count = flush(tile, count)  # what lies behind the glow
                        _ball_glow(ball, box, area, tile, camera)
                    else:
                        count = _ball_soft(ball, box, area, tile, count, camera)
                else:
                    line, box = capsules[item - capsule_first], capsule_box[item - capsule_first]
                    if solid:
                        count = _capsule_solid(line, box, area, tile, count, camera, offsets)
                    else:
                        if line[24] > ZERO:
                            count = flush(tile, count)
                        count = _capsule_soft(line, box, area, tile, count, camera)
            flush(tile, count)
        if layered:
            _mix(light, even, samples)
        spilled |= _hand_over(light, area, picture, bright)
    return spilled
