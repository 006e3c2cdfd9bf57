"""What the colliders do to one particle, in scalars: the text of kernels, not a module to import.

`ContactText` puts constants and laws before it: `gap_of`, `normal_of`, `bending_of` of each kind of surface, and
`place_of`, `ground_of`, `push_of` (place, velocity and acceleration of a surface in time). Each function does what its
model in `collisions` or `engine.reference` does to one row, operation by operation; the model says why.
"""
# ruff: noqa: F821
# mypy: ignore-errors

import numpy as np
from numba import njit

# --- printed from here on


@njit(**APART)
def dot3(ax, ay, az, bx, by, bz):
    """Scalar product."""
    return ax * bx + ay * by + az * bz


@njit(**APART)
def length3(x, y, z):
    """Length of a vector."""
    return np.sqrt(x * x + y * y + z * z)


@njit(**APART)
def size3(x, y, z):
    """The largest of three sizes."""
    return max(abs(x), abs(y), abs(z))


@njit(**APART)
def distance(P, C, o, k, t, x, y, z):
    """Signed distance of surface k."""
    px, py, pz = place_of(P, k, t)
    return gap_of(P, C, o, k, x - px, y - py, z - pz)


@njit(**APART)
def remembered(P, C, o, k, x, y, z):
    """Where the distance and the normal of surface k, one that is looked up, are kept for a point: it asks in turns."""
    m = o + MEMORY + REMEMBERED * k
    if not (C[m] == 1.0 and C[m + 1] == x and C[m + 2] == y and C[m + 3] == z):
        C[m], C[m + 1], C[m + 2], C[m + 3] = 1.0, x, y, z
        C[m + 4], C[m + 5], C[m + 6], C[m + 7] = look_of(P, C, m + 8, k, x, y, z)
    return m + 4


@njit(**FLAGS)
def far_from(P, C, o, k, x, y, z, way):
    """Whether a point is farther from surface k, one that is looked up, than `way`: by where it looked last, at once.

    Where it does not hold nothing is known. The margin is more than the roundings of distances.
    """
    m = o + MEMORY + REMEMBERED * k
    if C[m] != 1.0:
        return False
    moved = length3(x - C[m + 1], y - C[m + 2], z - C[m + 3])
    return C[m + 4] > WIDE * (way + P[k * ROW + STEEP] * moved) + MARGIN * P[k * ROW + NEAR]


# ------------------------------------------------------------------------------------------------- resting contact


@njit(**APART)
def near(P, C, o, t, x, y, z, radius):
    """Whether a particle is within reach of a surface: if so, `find` wants to know its acceleration."""
    for k in range(SURFACES):
        if KILLS and P[k * ROW + RESPONSE] == KILL:
            continue
        if LOOKUPS and P[k * ROW + LOOKUP] != 0:
            px, py, pz = place_of(P, k, t)
            if far_from(P, C, o, k, x - px, y - py, z - pz, radius + P[k * ROW + NEAR]):
                continue
        if distance(P, C, o, k, t, x, y, z) - radius <= P[k * ROW + NEAR]:
            return True
    return False


@njit(**APART)
def find(P, C, o, t, x, y, z, vx, vy, vz, m, ax, ay, az, radius, braking):
    """Who stands on what: Contacts.find. Returns the velocity, stopped."""
    count = 0
    for k in range(SURFACES):
        if KILLS and P[k * ROW + RESPONSE] == KILL:
            continue
        px, py, pz = place_of(P, k, t)
        lx, ly, lz = x - px, y - py, z - pz
        gap = gap_of(P, C, o, k, lx, ly, lz) - radius
        if not gap <= P[k * ROW + NEAR]:
            continue
        nx, ny, nz = normal_of(P, C, o, k, lx, ly, lz)
        gx, gy, gz = ground_of(P, k, t)
        if ORDER == 1:
            lift = dot3(ax - gx, ay - gy, az - gz, nx, ny, nz)
            stands = lift < 0
        else:
            ux, uy, uz = vx - gx, vy - gy, vz - gz
            bx, by, bz = push_of(P, k, t)
            lift = dot3(ax - bx, ay - by, az - bz, nx, ny, nz) + bending_of(P, k, lx, ly, lz, ux, uy, uz)
            slow = abs(dot3(ux, uy, uz, nx, ny, nz)) <= np.sqrt(2 * P[k * ROW + NEAR] * abs(lift))
            stands = lift < 0 and slow
        if STICKY:
            stands = stands or P[k * ROW + RESPONSE] == STICK
        if stands:
            r = o + 1 + RECORD * count
            count += 1
            C[r + ON] = k
            C[r + LEVEL] = gap if gap < -P[k * ROW + NEAR] else 0.0
            C[r + START], C[r + START + 1], C[r + START + 2] = lx, ly, lz
            C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2] = 0.0, 0.0, 0.0
            C[r + SPEED] = 0.0
            C[r + LOAD] = -lift * m
            C[r + GIVEN], C[r + GIVEN + 1], C[r + GIVEN + 2] = 0.0, 0.0, 0.0
            C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2] = nx, ny, nz
            C[r + PRESSED], C[r + HELD], C[r + STICKS], C[r + DRAG] = 0.0, 0.0, 1.0, 0.0
    C[o] = count
    if ORDER == 1 or count == 0:
        return vx, vy, vz
    for _ in range(PASSES if count > 1 else 1):
        moving = False
        for c in range(count):
            r = o + 1 + RECORD * c
            gx, gy, gz = ground_of(P, int(C[r]), t)
            nx, ny, nz = C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2]
            speed = dot3(vx - gx, vy - gy, vz - gz, nx, ny, nz)
            vx, vy, vz = vx - speed * nx, vy - speed * ny, vz - speed * nz
            moving = moving or abs(speed) > ROUND * (size3(vx, vy, vz) + size3(gx, gy, gz))
        if not moving:
            break
    for c in range(count):
        vx, vy, vz = choose_slide(P, C, o + 1 + RECORD * c, t, vx, vy, vz, m, ax, ay, az, braking)
    return vx, vy, vz


@njit(**APART)
def choose_slide(P, C, r, t, vx, vy, vz, m, ax, ay, az, braking):
    """Contacts._choose_slide; returns the velocity."""
    k = int(C[r])
    gx, gy, gz = ground_of(P, k, t)
    if STICKY and P[k * ROW + RESPONSE] == STICK:
        return gx, gy, gz
    nx, ny, nz = C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2]
    ux, uy, uz = vx - gx, vy - gy, vz - gz
    across = dot3(ux, uy, uz, nx, ny, nz)
    ux, uy, uz = ux - across * nx, uy - across * ny, uz - across * nz
    speed = length3(ux, uy, uz)
    bounce = np.sqrt(2 * P[k * ROW + NEAR] * C[r + LOAD] / m)
    if not speed > ROUND * (size3(vx, vy, vz) + size3(gx, gy, gz)) + CREEP * bounce:
        speed = 0.0
    C[r + SPEED] = speed
    if speed > 0:
        C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2] = ux / speed, uy / speed, uz / speed
    if speed == 0:
        vx, vy, vz = gx, gy, gz
    if LAGGED:
        bx, by, bz = push_of(P, k, t)
        bx, by, bz = ax - bx, ay - by, az - bz
        across = dot3(bx, by, bz, nx, ny, nz)
        bx, by, bz = bx - across * nx, by - across * ny, bz - across * nz
        pull = length3(bx, by, bz)
        if speed == 0 and pull * m > P[k * ROW + FRICTION] * C[r + LOAD] and pull > 0:
            C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2] = bx / pull, by / pull, bz / pull
        vx, vy, vz = choose_drag(P, C, r, vx, vy, vz, m, bx, by, bz, gx, gy, gz, braking)
    C[r + STICKS] = C[r + SLIDE] == 0 and C[r + SLIDE + 1] == 0 and C[r + SLIDE + 2] == 0
    return vx, vy, vz


@njit(**APART)
def choose_drag(P, C, r, vx, vy, vz, m, bx, by, bz, gx, gy, gz, braking):
    """Contacts._choose_drag; returns the velocity."""
    sx, sy, sz, friction = C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2], P[int(C[r]) * ROW + FRICTION]
    if not (braking > 0 and friction > 0 and not (sx == 0 and sy == 0 and sz == 0)):
        return vx, vy, vz
    most = friction * C[r + LOAD]
    later = C[r + SPEED] + braking * (dot3(bx, by, bz, sx, sy, sz) - most / m)
    C[r + SPEED] = 0.0
    if later > 0:
        C[r + DRAG] = most / later
        return vx, vy, vz
    C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2] = 0.0, 0.0, 0.0
    return gx, gy, gz


@njit(**APART)
def drag_of(C, o):
    """Contacts.drag of one particle."""
    result = 0.0
    for c in range(int(C[o])):
        result = result + C[o + 1 + RECORD * c + DRAG]
    return result


@njit(**APART)
def bear(P, C, o, t, x, y, z, vx, vy, vz, m, fx, fy, fz):
    """The force on a particle, filtered by its contacts: Contacts.forces."""
    count = int(C[o])
    if count == 0:
        return fx, fy, fz
    for c in range(count):
        r = o + 1 + RECORD * c
        k = int(C[r])
        px, py, pz = place_of(P, k, t)
        lx, ly, lz = x - px, y - py, z - pz
        C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2] = normal_of(P, C, o, k, lx, ly, lz)
        C[r + GIVEN], C[r + GIVEN + 1], C[r + GIVEN + 2] = 0.0, 0.0, 0.0
        gx, gy, gz = ground_of(P, k, t)
        if ORDER == 1:
            C[r + CARRIED], C[r + CARRIED + 1], C[r + CARRIED + 2] = gx, gy, gz
            C[r + BEND] = 0.0
        else:
            bx, by, bz = push_of(P, k, t)
            C[r + CARRIED], C[r + CARRIED + 1], C[r + CARRIED + 2] = m * bx, m * by, m * bz
            ux, uy, uz = vx - gx, vy - gy, vz - gz
            C[r + BEND] = m * bending_of(P, k, lx, ly, lz, ux, uy, uz)
            if C[r + DRAG] > 0:
                nx, ny, nz = C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2]
                across = dot3(ux, uy, uz, nx, ny, nz)
                C[r + DRIFT], C[r + DRIFT + 1], C[r + DRIFT + 2] = ux - across * nx, uy - across * ny, uz - across * nz
    alone = count == 1
    if alone:
        fx, fy, fz, _ = bear_one(P, C, o + 1, alone, fx, fy, fz)
        return fx, fy, fz
    for friction in (False, True):
        for _ in range(PASSES):
            changed = False
            for c in range(count):
                fx, fy, fz, other = bear_one(P, C, o + 1 + RECORD * c, friction, fx, fy, fz)
                changed = changed or other
            if not changed:
                break
    return fx, fy, fz


@njit(**APART)
def bear_one(P, C, r, friction, fx, fy, fz):
    """Contacts._bear: the force, and whether the contact bears another one than before."""
    k = int(C[r])
    nx, ny, nz = C[r + NORMAL], C[r + NORMAL + 1], C[r + NORMAL + 2]
    qx, qy, qz = fx - C[r + GIVEN], fy - C[r + GIVEN + 1], fz - C[r + GIVEN + 2]
    qx, qy, qz = qx - C[r + CARRIED], qy - C[r + CARRIED + 1], qz - C[r + CARRIED + 2]
    if STICKY and P[k * ROW + RESPONSE] == STICK:
        C[r + HELD] = 1.0
        return give(C, r, -qx, -qy, -qz, fx, fy, fz)
    into = dot3(qx, qy, qz, nx, ny, nz)
    load = -(into + C[r + BEND])
    if LAGGED:
        C[r + PRESSED] = 1.0
    else:
        C[r + PRESSED] = load > 0
        if not load > 0:
            load = 0.0
    wx, wy, wz = load * nx, load * ny, load * nz
    if friction and ORDER == 2 and P[k * ROW + FRICTION] > 0:
        hx, hy, hz = qx - into * nx, qy - into * ny, qz - into * nz
        sticks = C[r + STICKS] != 0
        if LAGGED:
            most = P[k * ROW + FRICTION] * C[r + LOAD]
            C[r + HELD] = C[r + STICKS]
        else:
            most = P[k * ROW + FRICTION] * load
            size = length3(hx, hy, hz)
            C[r + HELD] = sticks and size <= most
            part = min(most / (size if size > 0 else 1.0), 1.0)
            hx, hy, hz = part * hx, part * hy, part * hz
        if C[r + DRAG] > 0:
            drag = C[r + DRAG]
            hx, hy, hz = drag * C[r + DRIFT], drag * C[r + DRIFT + 1], drag * C[r + DRIFT + 2]
        elif not sticks:
            hx, hy, hz = most * C[r + SLIDE], most * C[r + SLIDE + 1], most * C[r + SLIDE + 2]
        wx, wy, wz = wx + -hx, wy + -hy, wz + -hz
    return give(C, r, wx, wy, wz, fx, fy, fz)


@njit(**APART)
def give(C, r, wx, wy, wz, fx, fy, fz):
    """Contacts._give."""
    dx, dy, dz = wx - C[r + GIVEN], wy - C[r + GIVEN + 1], wz - C[r + GIVEN + 2]
    C[r + GIVEN], C[r + GIVEN + 1], C[r + GIVEN + 2] = wx, wy, wz
    return fx + dx, fy + dy, fz + dz, length3(dx, dy, dz) > SETTLED * length3(wx, wy, wz)


@njit(**APART)
def product(a, b, c):
    """c = a b of 3 x 3 matrices, as flat arrays; c is another array than a and b."""
    for i in range(3):
        for j in range(3):
            c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]


@njit(**APART)
def project(P, C, o, a, w):
    """Contacts.projection of one particle: the 3 x 3 matrix a, row by row; w is scratch of 18 numbers."""
    count = int(C[o])
    for i in range(9):
        a[i] = 1.0 if i % 4 == 0 else 0.0
    b, across = w[:9], w[9:]
    for c in range(count):
        r = o + 1 + RECORD * c
        if C[r + STICKS] != 0 and P[int(C[r]) * ROW + FRICTION] > 0:
            for i in range(9):
                a[i] = 0.0
            continue
        for i in range(3):
            for j in range(3):
                across[3 * i + j] = (1.0 if i == j else 0.0) - C[r + NORMAL + i] * C[r + NORMAL + j]
        product(across, a, b)
        for i in range(9):
            a[i] = b[i]
    if count > 1:
        for _ in range(SQUARINGS):
            product(a, a, b)
            for i in range(9):
                a[i] = b[i]


@njit(**APART)
def settle(P, C, o, t, h, x, y, z, vx, vy, vz, radius):
    """Bring one that stood back to its surfaces at the end t of a piece of length h: Contacts.settle."""
    count = int(C[o])
    if count == 0 or not h > 0:
        return x, y, z, vx, vy, vz
    for c in range(count):
        r = o + 1 + RECORD * c
        k = int(C[r])
        holds = ORDER == 2 and P[k * ROW + FRICTION] != 0
        if STICKY:
            holds = holds or P[k * ROW + RESPONSE] == STICK
        if not holds:
            continue
        px, py, pz = place_of(P, k, t)
        gx, gy, gz = ground_of(P, k, t)
        qx, qy, qz = C[r + START], C[r + START + 1], C[r + START + 2]
        if C[r + HELD] != 0:
            x, y, z = qx + px, qy + py, qz + pz
            vx, vy, vz = gx, gy, gz
        sx, sy, sz, speed = C[r + SLIDE], C[r + SLIDE + 1], C[r + SLIDE + 2], C[r + SPEED]
        now = dot3(vx - gx, vy - gy, vz - gz, sx, sy, sz)
        if now < 0 and speed > 0:
            way = 0.5 * h * (speed * speed) / (speed - now)
            beyond = dot3(x - px - qx, y - py - qy, z - pz - qz, sx, sy, sz) - way
            x, y, z = x - beyond * sx, y - beyond * sy, z - beyond * sz
            vx, vy, vz = vx - now * sx, vy - now * sy, vz - now * sz
    for _ in range(PASSES if count > 1 else 1):
        moved = False
        for c in range(count):
            r = o + 1 + RECORD * c
            k = int(C[r])
            px, py, pz = place_of(P, k, t)
            lx, ly, lz = x - px, y - py, z - pz
            gap = gap_of(P, C, o, k, lx, ly, lz) - radius - C[r + LEVEL]
            pressed = C[r + PRESSED] != 0
            if LOOKUPS:
                pressed = pressed and not (P[k * ROW + LOOKUP] != 0 and gap > P[k * ROW + NEAR])
            if not (pressed or gap < 0):
                continue
            nx, ny, nz = normal_of(P, C, o, k, lx, ly, lz)
            off = gap if gap < 0 or gap > P[k * ROW + NEAR] else 0.0
            x, y, z = x - off * nx, y - off * ny, z - off * nz
            if ORDER == 2:
                gx, gy, gz = ground_of(P, k, t)
                speed = dot3(vx - gx, vy - gy, vz - gz, nx, ny, nz)
                if pressed or speed < 0:
                    vx, vy, vz = vx - speed * nx, vy - speed * ny, vz - speed * nz
            moved = moved or abs(off) > ROUND * (size3(x, y, z) + size3(px, py, pz))
        if not moved:
            break
    return x, y, z, vx, vy, vz


# ------------------------------------------------------------------------------------------------------- impacts


@njit(**APART)
def respond(vx, vy, vz, nx, ny, nz, gx, gy, gz, restitution, friction):
    """Velocity after an impact: response.respond."""
    ux, uy, uz = vx - gx, vy - gy, vz - gz
    toward = dot3(nx, ny, nz, ux, uy, uz)
    if not toward < 0:
        return vx, vy, vz
    ax, ay, az = toward * nx, toward * ny, toward * nz
    ux, uy, uz = ux - ax, uy - ay, uz - az
    speed = length3(ux, uy, uz)
    loss = min(friction * (1 + restitution) * abs(toward), speed)
    kept = 1 - loss / (speed if speed > 0 else 1.0)
    wx, wy, wz = kept * ux - restitution * ax, kept * uy - restitution * ay, kept * uz - restitution * az
    return gx + wx, gy + wy, gz + wz


@njit(**APART)
def bounce(P, C, o, t, x, y, z, vx, vy, vz, radius):
    """The lecture's test at the end of a step, for surfaces of discrete contact: discrete.bounce.

    Returns the state, and 1 if something was hit, KILLED if that was deadly, else 0.
    """
    hit = 0
    for k in range(SURFACES):
        if P[k * ROW + SWEPT] != 0:
            continue
        px, py, pz = place_of(P, k, t)
        gap = gap_of(P, C, o, k, x - px, y - py, z - pz) - radius
        if not gap < P[k * ROW + NEAR]:
            continue
        nx, ny, nz = normal_of(P, C, o, k, x - px, y - py, z - pz)
        gx, gy, gz = ground_of(P, k, t)
        if dot3(nx, ny, nz, vx - gx, vy - gy, vz - gz) < 0:
            hit = max(hit, 1)
            if KILLS:
                hit = KILLED if P[k * ROW + RESPONSE] == KILL else hit
            vx, vy, vz = respond(vx, vy, vz, nx, ny, nz, gx, gy, gz, P[k * ROW + RESTITUTION], P[k * ROW + FRICTION])
            sunk = gap if gap < 0 else 0.0
            x, y, z = x - sunk * nx, y - sunk * ny, z - sunk * nz
    return x, y, z, vx, vy, vz, hit


@njit(**APART)
def position(s, h, a, b, c, d):
    """A coordinate of the cubic path at the fraction s: Paths.position; a, c at the ends, b, d their rates."""
    r = 1.0 - s
    return a * (r * r * (1.0 + 2.0 * s)) + c * (s * s * (3.0 - 2.0 * s)) + h * (b * (s * r * r) - d * (s * s * r))


@njit(**APART)
def velocity(s, h, a, b, c, d):
    """Its rate: Paths.velocity."""
    chord = (c - a) / (h if h > 0 else 1.0)
    return chord * (6.0 * s * (1.0 - s)) + b * ((1 - s) * (1 - 3 * s)) + d * (s * (3 * s - 2))


@njit(**APART)
def local_at(P, k, s, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h):
    """Place on the path relative to surface k: _Approach.local."""
    px, py, pz = place_of(P, k, t0 + s * h)
    x, y, z = position(s, h, x0, u0, x1, u1), position(s, h, y0, v0, y1, v1), position(s, h, z0, w0, z1, w1)
    return x - px, y - py, z - pz


@njit(**APART)
def swing_of(P, k, t0, h):
    """How far a surface gets away from uniform motion: swept._swing."""
    most = 0.0
    for j in range(3):
        ax, ay, az = push_of(P, k, t0 + 0.5 * j * h)
        most = max(most, length3(ax, ay, az))
    return most * (h * h)


@njit(**APART)
def reach_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h):
    """Length of the control polygon: Paths.reach."""
    ax, ay, az = h * u0 / 3, h * v0 / 3, h * w0 / 3
    cx, cy, cz = h * u1 / 3, h * v1 / 3, h * w1 / 3
    middle = length3(x1 - x0 - ax - cx, y1 - y0 - ay - cy, z1 - z0 - az - cz)
    return length3(ax, ay, az) + middle + length3(cx, cy, cz)


@njit(**APART)
def bend_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h):
    """Bound of the second derivative: Paths.bends."""
    ax, ay, az = 6 * (x1 - x0), 6 * (y1 - y0), 6 * (z1 - z0)
    sx, sy, sz = ax - h * (4 * u0 + 2 * u1), ay - h * (4 * v0 + 2 * v1), az - h * (4 * w0 + 2 * w1)
    ex, ey, ez = h * (2 * u0 + 4 * u1) - ax, h * (2 * v0 + 4 * v1) - ay, h * (2 * w0 + 4 * w1) - az
    return max(length3(sx, sy, sz), length3(ex, ey, ez))


@njit(**APART)
def enters(P, C, o, k, ax, ay, az, bx, by, bz, radius, level):
    """Fraction from a at which a convex surface is met on the way to b: swept._newton; infinite if it is not."""
    dx, dy, dz = bx - ax, by - ay, bz - az
    s = 0.0
    for _ in range(NEWTON_STEPS):
        x, y, z = ax + s * dx, ay + s * dy, az + s * dz
        gap = gap_of(P, C, o, k, x, y, z) - radius - level
        nx, ny, nz = normal_of(P, C, o, k, x, y, z)
        slope = dot3(nx, ny, nz, dx, dy, dz)
        if not slope < 0:
            return np.inf
        if gap <= 0:
            return s
        step = -gap / slope
        if s + step > 1:
            return np.inf
        s = s + step
        if not step > 1e-15:
            break
    return s


@njit(**APART)
def chords_for(bend, eps):
    """How many chords stay within eps: _Approach.chords."""
    ratio = bend / (8 * eps)
    return int(min(np.ceil(np.sqrt(ratio)), MOST_CHORDS)) if ratio > 1 else 1


@njit(**APART)
def pace_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h):
    """Bound of the first derivative: Paths.pace."""
    ax, ay, az, cx, cy, cz = h * u0, h * v0, h * w0, h * u1, h * v1, h * w1
    middle = length3(3 * (x1 - x0) - ax - cx, 3 * (y1 - y0) - ay - cy, 3 * (z1 - z0) - az - cz)
    return max(max(length3(ax, ay, az), length3(cx, cy, cz)), middle)


@njit(**APART)
def march(P, C, o, k, gap, pace, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level):
    """Fractions between which a path goes into surface k, and the gaps there: swept._march; the first is infinite where
    it does not."""
    s = 0.0
    least = MARGIN * P[k * ROW + NEAR]
    for _ in range(MOST_LOOKS):
        end = s + (gap if gap > least else least) / (pace if pace > 0 else least)
        end = end if end < 1.0 else 1.0
        lx, ly, lz = local_at(P, k, end, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
        ahead = gap_of(P, C, o, k, lx, ly, lz) - radius - level
        if ahead < 0:
            return s, end, gap, ahead
        if not s < end < 1.0:
            return np.inf, np.inf, gap, ahead
        s, gap = end, ahead
    return s, s, gap, gap


@njit(forceinline=True, **FLAGS)
def curved_hit(P, C, o, k, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius):
    """Fraction at which a path first meets surface k: swept.first_hit; infinite where it does not."""
    swing = beyond = 0.0  # of a surface at rest
    way = reach_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h)
    if MOVING and P[k * ROW + MOTION] != 0:
        px, py, pz = place_of(P, k, t0)
        qx, qy, qz = place_of(P, k, t0 + h)
        swing = swing_of(P, k, t0, h)
        beyond = length3(qx - px, qy - py, qz - pz) + swing
        way = way + beyond
    if LOOKUPS and P[k * ROW + LOOKUP] != 0:
        way = P[k * ROW + STEEP] * way
        px, py, pz = place_of(P, k, t0)
        if far_from(P, C, o, k, x0 - px, y0 - py, z0 - pz, radius + way):
            return np.inf
    start = distance(P, C, o, k, t0, x0, y0, z0) - radius
    if LOOKUPS and P[k * ROW + LOOKUP] != 0 and far_from(P, C, o, k, x0 - px, y0 - py, z0 - pz, radius + way):
        return np.inf
    end = distance(P, C, o, k, t0 + h, x1, y1, z1) - radius
    level = min(start, 0.0)
    if not (start - level < way or end < level):
        return np.inf
    if LOOKUPS and P[k * ROW + LOOKUP] != 0:
        pace = P[k * ROW + STEEP] * (pace_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h) + beyond)
        low, high, g_low, g_high = march(
            P, C, o, k, start - level, pace,
            x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level,
        )  # fmt: skip
        if low < high:
            low = root(
                P, C, o, k, low, high, g_low, g_high,
                x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level,
            )  # fmt: skip
        return low
    if CHORDS:
        return chord_hit(P, C, o, k, swing, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level)
    return np.inf


@njit(forceinline=True, **FLAGS)
def chord_hit(P, C, o, k, swing, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level):
    """The same by chords: swept._brackets."""
    bend = bend_of(x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, h) + swing
    chords = chords_for(bend, P[k * ROW + NEAR])
    ax, ay, az = local_at(P, k, 0.0, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
    low = 0.0
    for j in range(1, chords + 1):
        stop = min(j / chords, 1.0)
        bx, by, bz = local_at(P, k, stop, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
        high = np.inf
        if gap_of(P, C, o, k, bx, by, bz) - radius - level < 0:
            high = stop
        elif BULGING and P[k * ROW + BULGES] != 0:
            enter = enters(P, C, o, k, ax, ay, az, bx, by, bz, radius, level)
            if enter < np.inf:
                leave = enters(P, C, o, k, bx, by, bz, ax, ay, az, radius, level)
                if enter + leave < 1:
                    high = low + 0.5 * (enter + (1 - leave)) * (stop - low)
        if high < np.inf:
            lx, ly, lz = local_at(P, k, high, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
            g_high = gap_of(P, C, o, k, lx, ly, lz) - radius - level
            if g_high < 0:
                g_low = gap_of(P, C, o, k, ax, ay, az) - radius - level
                return root(
                    P, C, o, k, low, high, g_low, g_high,
                    x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level,
                )  # fmt: skip
        ax, ay, az = bx, by, bz
        low = stop
    return np.inf


@njit(forceinline=True, **FLAGS)
def flat_hit(P, C, o, k, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius):
    """curved_hit for a flat surface at rest: swept._FlatApproach."""
    px, py, pz = place_of(P, k, t0)
    nx, ny, nz = normal_of(P, C, o, k, x0, y0, z0)
    start = gap_of(P, C, o, k, x0 - px, y0 - py, z0 - pz) - radius
    level = min(start, 0.0)
    start = start - level
    end = gap_of(P, C, o, k, x1 - px, y1 - py, z1 - pz) - radius - level
    leave, arrive = h * dot3(nx, ny, nz, u0, v0, w0), h * dot3(nx, ny, nz, u1, v1, w1)
    if not (start + leave / 3 < 0 or end - arrive / 3 < 0 or end < 0):
        return np.inf
    rise = end - start
    square = 3 * rise - (2 * leave + arrive)
    cube = (leave + arrive) - 2 * rise
    bend = max(abs(2 * square), abs(2 * square + 6 * cube))
    chords = chords_for(bend, P[k * ROW + NEAR])
    a, g_low, g_high, b = 0.0, start, end, 1.0
    for j in range(1, chords + 1):
        b = min(j / chords, 1.0)
        g_high = end if b == 1.0 else start + b * (leave + b * (square + b * cube))
        if g_high < 0:
            break
        a, g_low = b, g_high
    else:
        return np.inf
    last = b - a
    s = a + (b - a) * (g_low / (g_low - g_high))
    for _ in range(ROOT_STEPS):
        gap = end if s == 1.0 else start + s * (leave + s * (square + s * cube))
        slope = leave + s * (2 * square + s * (3 * cube))
        a, b, s, last, done = narrowed(a, b, s, last, gap, slope)
        if done:
            break
    back = RESOLUTION
    for _ in range(BACK_STEPS):
        lx, ly, lz = local_at(P, k, a, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
        if not (gap_of(P, C, o, k, lx, ly, lz) - radius - level < 0 and a > 0):
            break
        a = max(a - back, 0.0)
        back = 2 * back
    return a


@njit(**APART)
def narrowed(a, b, s, last, gap, slope):
    """A step of swept._root: the bracket, the next place to look, how far it went, and whether that was all."""
    free, falls = gap >= 0, slope < 0
    if free:
        a = s
    else:
        b = s
    step = -gap / (slope if falls else -1.0)
    arrived = free and falls and step <= 2 * RESOLUTION
    aim = s + step - RESOLUTION
    if falls and a < aim and aim < b and abs(step) <= 0.5 * last:
        s = aim
        last = abs(step)
    else:
        s = 0.5 * (a + b)
        last = 0.5 * (b - a)
    return a, b, s, last, arrived or not (b - a > RESOLUTION and a < s < b)


@njit(**APART)
def root(P, C, o, k, a, b, g_low, g_high, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius, level):
    """The crossing between a and b, on the free side: swept._root."""
    last = b - a
    s = a + (b - a) * (g_low / (g_low - g_high))
    for _ in range(ROOT_STEPS):
        lx, ly, lz = local_at(P, k, s, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h)
        gap = gap_of(P, C, o, k, lx, ly, lz) - radius - level
        nx, ny, nz = normal_of(P, C, o, k, lx, ly, lz)
        gx, gy, gz = ground_of(P, k, t0 + s * h)
        ux = velocity(s, h, x0, u0, x1, u1) - gx
        uy = velocity(s, h, y0, v0, y1, v1) - gy
        uz = velocity(s, h, z0, w0, z1, w1) - gz
        slope = dot3(nx, ny, nz, ux, uy, uz) * h
        a, b, s, last, done = narrowed(a, b, s, last, gap, slope)
        if done:
            break
    return a


@njit(forceinline=True, **FLAGS)
def first_hits(P, C, o, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius):
    """Earliest hit of a path, and the surface: ReferenceEngine._first_hits. Surfaces that it stands on are left out."""
    theta, which = np.inf, 0
    count = int(C[o])
    for k in range(SURFACES):
        stands = P[k * ROW + SWEPT] == 0
        for c in range(count):
            stands = stands or C[o + 1 + RECORD * c] == k
        if not stands:
            hit = np.inf
            if FLATS and P[k * ROW + FLAT] != 0:
                hit = flat_hit(P, C, o, k, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius)
            if CURVED and P[k * ROW + FLAT] == 0:
                hit = curved_hit(P, C, o, k, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius)
            if hit < theta:
                theta, which = hit, k
    return theta, which


@njit(**APART)
def strike(P, C, o, alone, events, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius):
    """Cast a path against the surfaces of swept contact and respond: ReferenceEngine._impacts for one particle.

    The path goes from (x0, y0, z0), with the velocity (u0, v0, w0), to (x1, y1, z1) with (u1, v1, w1), in [t0, t0 + h].
    A particle of an island of its own (`alone`) is set back to its impact; one of a larger island flies on to the end.

    Returns
    -------
    x, y, z, vx, vy, vz : state at `clock`.
    clock : time of the impact for one that is set back, else t0 + h.
    events : how many impacts it had in this step, for the next call.
    gx, gy, gz : velocity of the surface that it hit last, 0 without a hit.
    """
    x, y, z, vx, vy, vz = x1, y1, z1, u1, v1, w1
    clock, end = t0 + h, t0 + h
    gx = gy = gz = 0.0
    if not alone or ORDER == 1:
        length = h if h > 0 else 1.0
        u0, v0, w0 = (x1 - x0) / length, (y1 - y0) / length, (z1 - z0) / length
        u1, v1, w1 = u0, v0, w0
    while True:
        s, k = first_hits(P, C, o, x0, y0, z0, u0, v0, w0, x1, y1, z1, u1, v1, w1, t0, h, radius)
        if not s < np.inf:
            break
        x, y, z = position(s, h, x0, u0, x1, u1), position(s, h, y0, v0, y1, v1), position(s, h, z0, w0, z1, w1)
        vx, vy, vz = velocity(s, h, x0, u0, x1, u1), velocity(s, h, y0, v0, y1, v1), velocity(s, h, z0, w0, z1, w1)
        now = t0 + s * h
        end = t0 + h
        events += 1
        if KILLS:
            events += KILLED if P[k * ROW + RESPONSE] == KILL else 0
        px, py, pz = place_of(P, k, now)
        nx, ny, nz = normal_of(P, C, o, k, x - px, y - py, z - pz)
        gx, gy, gz = ground_of(P, k, now)
        vx, vy, vz = respond(vx, vy, vz, nx, ny, nz, gx, gy, gz, P[k * ROW + RESTITUTION], P[k * ROW + FRICTION])
        if events > MOST_EVENTS:
            vx, vy, vz = ground_of(P, k, end)
            qx, qy, qz = place_of(P, k, end)
            x, y, z = x + (qx - px), y + (qy - py), z + (qz - pz)
            break
        if alone:
            clock = now
            break
        if not now < end:
            break
        h = end - now
        t0 = now
        x0, y0, z0, u0, v0, w0 = x, y, z, vx, vy, vz
        x, y, z = x + h * vx, y + h * vy, z + h * vz
        x1, y1, z1, u1, v1, w1 = x, y, z, vx, vy, vz
    return x, y, z, vx, vy, vz, clock, events, gx, gy, gz


@njit(**APART)
def evict(P, C, o, t, x, y, z, vx, vy, vz, radius, bx, by, bz, began):
    """Put one out that a surface pushed into another one: ReferenceEngine._evict.

    (bx, by, bz) is where it was at `began`, the beginning of the whole step or its birth. Returns the state.
    """
    for _ in range(EVICTIONS):
        clean = True
        for k in range(SURFACES):
            if ORDER == 1 and P[k * ROW + SWEPT] == 0:
                continue
            px, py, pz = place_of(P, k, t)
            if LOOKUPS and P[k * ROW + LOOKUP] != 0 and far_from(P, C, o, k, x - px, y - py, z - pz, radius):
                continue
            gap = gap_of(P, C, o, k, x - px, y - py, z - pz) - radius
            if not gap < 0:
                continue
            sunk = min(gap - min(distance(P, C, o, k, began, bx, by, bz) - radius, 0.0), 0.0)
            if sunk < 0:
                nx, ny, nz = normal_of(P, C, o, k, x - px, y - py, z - pz)
                gx, gy, gz = ground_of(P, k, t)
                x, y, z = x - sunk * nx, y - sunk * ny, z - sunk * nz
                vx, vy, vz = respond(vx, vy, vz, nx, ny, nz, gx, gy, gz, 0.0, 0.0)
                clean = clean and not sunk < -ROUND * (1 + size3(x, y, z))
        if clean:
            return x, y, z, vx, vy, vz
    for k in range(SURFACES):
        if ORDER == 1 and P[k * ROW + SWEPT] == 0:
            continue
        gap = distance(P, C, o, k, t, x, y, z) - radius
        depth = min(distance(P, C, o, k, began, bx, by, bz) - radius, 0.0)
        if gap < depth - ROUND * (1 + size3(x, y, z)):
            x, y, z = bx, by, bz
            vx, vy, vz = ground_of(P, k, t)
    return x, y, z, vx, vy, vz
