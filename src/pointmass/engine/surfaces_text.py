"""What keeps triangles and edges out of the colliders, in scalars: the text of a kernel, not a module to import.

`surfaces` puts the text of the colliders before it (see `contact`), constants, and `bound_of`. G is the scratch of one
triangle: its corner 0 and edges relative to the surface, how far off it has to stay (at corner 0, and what that changes
by along the edges), the deepest point so far, the pieces that are yet to be looked at, and the part of a piece where a
deeper point may be. Points of a triangle are s along its first edge and t along its second.
"""
# ruff: noqa: F821
# mypy: ignore-errors

import numpy as np
from numba import njit

# --- printed from here on


@njit(**FLAGS)
def depth_at(P, C, G, k, s, t):
    """How far a point of the triangle is beyond where it has to stay, and its slopes along s and t."""
    x = G[0] + s * G[3] + t * G[6]
    y = G[1] + s * G[4] + t * G[7]
    z = G[2] + s * G[5] + t * G[8]
    nx, ny, nz = normal_of(P, C, 0, k, x, y, z)
    gap = gap_of(P, C, 0, k, x, y, z) - (G[ROOM] + s * G[ROOM + 1] + t * G[ROOM + 2])
    along = dot3(nx, ny, nz, G[3], G[4], G[5]) - G[ROOM + 1]
    across = dot3(nx, ny, nz, G[6], G[7], G[8]) - G[ROOM + 2]
    return gap, along, across


@njit(**FLAGS)
def middle_of(G, at, count):
    """Centre of mass of a convex polygon; of one that is next to nothing the mean of its corners."""
    s0, t0 = G[at], G[at + 1]
    area = s = t = 0.0
    for j in range(1, count - 1):
        a, b = G[at + 2 * j] - s0, G[at + 2 * j + 1] - t0
        c, d = G[at + 2 * j + 2] - s0, G[at + 2 * j + 3] - t0
        twice = abs(a * d - b * c)
        area += twice
        s += twice * (a + c)
        t += twice * (b + d)
    if area > 1e-30:
        return s0 + s / (3.0 * area), t0 + t / (3.0 * area)
    s = t = 0.0
    for j in range(count):
        s += G[at + 2 * j]
        t += G[at + 2 * j + 1]
    return s / count, t / count


@njit(**FLAGS)
def lowest_corner(G, at, count, along, across):
    """The corner of a polygon that lies farthest down a slope."""
    s, t = G[at], G[at + 1]
    for j in range(1, count):
        a, b = G[at + 2 * j], G[at + 2 * j + 1]
        if along * a + across * b < along * s + across * t:
            s, t = a, b
    return s, t


@njit(**FLAGS)
def leap(P, C, G, k, at, count, s, t, gap, along, across):
    """Where a ball would be deepest that is curved like the surface near a point; the middle if that is cut off.

    A corner is such a ball, of radius 0, and so is a point of an edge; these alone count in a mesh.
    """
    aa, cc = dot3(G[3], G[4], G[5], G[3], G[4], G[5]), dot3(G[6], G[7], G[8], G[6], G[7], G[8])
    ac = dot3(G[3], G[4], G[5], G[6], G[7], G[8])
    area = aa * cc - ac * ac
    along, across = along + G[ROOM + 1], across + G[ROOM + 2]
    if area > 1e-12 * aa * cc:
        ds, dt = (cc * along - ac * across) / area, (aa * across - ac * along) / area
    else:
        ds, dt = along / aa, 0.0
    away = gap + G[ROOM] + s * G[ROOM + 1] + t * G[ROOM + 2]
    if P[k * ROW + LOOKUP] == 0:
        x = G[0] + s * G[3] + t * G[6]
        y = G[1] + s * G[4] + t * G[7]
        z = G[2] + s * G[5] + t * G[8]
        u, v, w = level_of(P, C, G, k, x, y, z, area > 1e-12 * aa * cc)
        bend = bending_of(P, k, x, y, z, u, v, w)
        away = dot3(u, v, w, u, v, w) / bend if bend > 0.0 else 0.0
    a, b = s - away * ds, t - away * dt
    return (a, b) if away > 0.0 and within(G, at, count, a, b) else middle_of(G, at, count)


@njit(**FLAGS)
def level_of(P, C, G, k, x, y, z, wide):
    """A direction along the surface at a point, in which the triangle does not rise; of an edge any across it."""
    nx, ny, nz = normal_of(P, C, 0, k, x, y, z)
    mx, my, mz = G[3], G[4], G[5]
    if wide:
        mx, my, mz = my * G[8] - mz * G[7], mz * G[6] - mx * G[8], mx * G[7] - my * G[6]
    return ny * mz - nz * my, nz * mx - nx * mz, nx * my - ny * mx


@njit(**FLAGS)
def within(G, at, count, s, t):
    """Whether a point is within a convex polygon."""
    left = right = False
    for j in range(count):
        i = j + 1 if j + 1 < count else 0
        a, b = G[at + 2 * j], G[at + 2 * j + 1]
        side = (G[at + 2 * i] - a) * (t - b) - (G[at + 2 * i + 1] - b) * (s - a)
        left, right = left or side > 0.0, right or side < 0.0
    return not (left and right)


@njit(**FLAGS)
def cut(G, at, to, count, along, across, limit):
    """The part of a convex polygon where along s + across t <= limit, written to `to`: how many corners it has."""
    left = 0
    for j in range(count):
        i = j + 1 if j + 1 < count else 0
        s, t, a, b = G[at + 2 * j], G[at + 2 * j + 1], G[at + 2 * i], G[at + 2 * i + 1]
        here, there = along * s + across * t - limit, along * a + across * b - limit
        if here <= 0.0:
            G[to + 2 * left], G[to + 2 * left + 1] = s, t
            left += 1
        if (here < 0.0 and there > 0.0) or (here > 0.0 and there < 0.0):
            part = here / (here - there)
            G[to + 2 * left], G[to + 2 * left + 1] = s + part * (a - s), t + part * (b - t)
            left += 1
    return left


@njit(**FLAGS)
def search(P, C, G, k, precision):
    """Find the deepest point of the piece that is in G from PART on, if it is deeper than the one so far.

    Where the distance is convex, it lies nowhere below its tangent planes: what they show to be above the deepest point
    so far is cut off, and nothing that is deeper by the precision is missed.
    """
    at, to, count = PART, PART + 2 * MOST_CORNERS, 3
    s = t = gap = along = across = 0.0
    for j in range(MOST_CUTS):
        if j == 1:
            s, t = lowest_corner(G, at, count, along, across)
        elif j & 1:
            s, t = leap(P, C, G, k, at, count, s, t, gap, along, across)
        else:
            s, t = middle_of(G, at, count)
        gap, along, across = depth_at(P, C, G, k, s, t)
        if gap < G[BEST]:
            G[BEST], G[BEST + 1], G[BEST + 2] = gap, s, t
        limit = G[BEST] - precision - gap + along * s + across * t
        count = cut(G, at, to, count, along, across, limit)
        if count < 3:
            return
        at, to = to, at


@njit(**FLAGS)
def deepest(P, C, G, k, precision, detail):
    """Find the deepest point of the triangle: 0 or above, or where it is.

    Triangles that are larger than the details of a surface are quartered, and quarters that are too far away to have a
    deeper point are left out.
    """
    G[BEST], G[BEST + 1], G[BEST + 2] = precision, 0.0, 0.0
    most = G[ROOM] + max(max(G[ROOM + 1], G[ROOM + 2]), 0.0)
    put(G, STACK, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0)
    top = 1
    while top > 0:
        top -= 1
        q = STACK + PIECE * top
        s0, t0, s1, t1, s2, t2 = G[q], G[q + 1], G[q + 2], G[q + 3], G[q + 4], G[q + 5]
        depth = G[q + 6]
        s, t = (s0 + s1 + s2) / 3.0, (t0 + t1 + t2) / 3.0
        reach = max(max(way_of(G, s0 - s, t0 - t), way_of(G, s1 - s, t1 - t)), way_of(G, s2 - s, t2 - t))
        x = G[0] + s * G[3] + t * G[6]
        y = G[1] + s * G[4] + t * G[7]
        z = G[2] + s * G[5] + t * G[8]
        gap = gap_of(P, C, 0, k, x, y, z)
        if not gap - most - WIDE * P[k * ROW + STEEP] * reach < G[BEST] - precision:
            continue
        gap -= G[ROOM] + s * G[ROOM + 1] + t * G[ROOM + 2]
        if gap < G[BEST]:
            G[BEST], G[BEST + 1], G[BEST + 2] = gap, s, t
        if reach > detail and depth < MOST_QUARTERED:
            u0, v0, u1, v1 = 0.5 * (s0 + s1), 0.5 * (t0 + t1), 0.5 * (s1 + s2), 0.5 * (t1 + t2)
            u2, v2 = 0.5 * (s2 + s0), 0.5 * (t2 + t0)
            put(G, q, s0, t0, u0, v0, u2, v2, depth + 1.0)
            put(G, q + PIECE, s1, t1, u1, v1, u0, v0, depth + 1.0)
            put(G, q + 2 * PIECE, s2, t2, u2, v2, u1, v1, depth + 1.0)
            put(G, q + 3 * PIECE, u0, v0, u1, v1, u2, v2, depth + 1.0)
            top += 4
            continue
        put(G, PART, s0, t0, s1, t1, s2, t2, 0.0)
        search(P, C, G, k, precision)


@njit(**FLAGS)
def way_of(G, s, t):
    """Length of a way in the triangle."""
    return length3(s * G[3] + t * G[6], s * G[4] + t * G[7], s * G[5] + t * G[8])


@njit(**FLAGS)
def put(G, q, s0, t0, s1, t1, s2, t2, depth):
    """Write down a piece."""
    G[q], G[q + 1], G[q + 2], G[q + 3], G[q + 4], G[q + 5], G[q + 6] = s0, t0, s1, t1, s2, t2, depth


@njit(**FLAGS)
def room_of(P, C, k, x, y, z, held, thickness):
    """How far off a corner has to stay: one that is pinned nearer cannot."""
    if held:
        return min(thickness, gap_of(P, C, 0, k, x, y, z))
    return thickness


@njit(**FLAGS)
def laid(P, C, G, k, t, x, w, a, b, c, thickness):
    """Write a triangle into G, relative to a surface; its longest edge."""
    px, py, pz = place_of(P, k, t)
    ax, ay, az = np.float64(x[a, 0]) - px, np.float64(x[a, 1]) - py, np.float64(x[a, 2]) - pz
    bx, by, bz = np.float64(x[b, 0]) - px, np.float64(x[b, 1]) - py, np.float64(x[b, 2]) - pz
    cx, cy, cz = np.float64(x[c, 0]) - px, np.float64(x[c, 1]) - py, np.float64(x[c, 2]) - pz
    G[0], G[1], G[2] = ax, ay, az
    G[3], G[4], G[5] = bx - ax, by - ay, bz - az
    G[6], G[7], G[8] = cx - ax, cy - ay, cz - az
    G[ROOM] = room_of(P, C, k, ax, ay, az, w[a] == 0, thickness)
    G[ROOM + 1] = room_of(P, C, k, bx, by, bz, w[b] == 0, thickness) - G[ROOM]
    G[ROOM + 2] = room_of(P, C, k, cx, cy, cz, w[c] == 0, thickness) - G[ROOM]
    third = length3(cx - bx, cy - by, cz - bz)
    return max(max(length3(G[3], G[4], G[5]), length3(G[6], G[7], G[8])), third)


@njit(**FLAGS)
def faces_matter(P, k):
    """Whether a surface may reach into a triangle whose corners are all outside of it."""
    solid = P[k * ROW + BULGES] != 0 or P[k * ROW + LOOKUP] != 0
    return solid and P[k * ROW + RESPONSE] != KILL


@njit(**FLAGS)
def share(x, a, b, c, wa, wb, wc, j):
    """A coordinate of the point with weights of three particles."""
    return wa * np.float64(x[a, j]) + wb * np.float64(x[b, j]) + wc * np.float64(x[c, j])


@njit(**FLAGS)
def move(x, a, b, c, sa, sb, sc, dx, dy, dz):
    """Move three particles by parts of a vector."""
    move_one(x, a, sa, dx, dy, dz)
    move_one(x, b, sb, dx, dy, dz)
    if c != a:
        move_one(x, c, sc, dx, dy, dz)


@njit(**FLAGS)
def move_one(x, i, part, dx, dy, dz):
    """Move one particle, unless it is held."""
    if part != 0.0:
        x[i, 0] = R(np.float64(x[i, 0]) + part * dx)
        x[i, 1] = R(np.float64(x[i, 1]) + part * dy)
        x[i, 2] = R(np.float64(x[i, 2]) + part * dz)


@njit(**FLAGS)
def weights_of(a, c, s, t):
    """Weights of the corners at a point; an edge is a triangle whose third corner is its first."""
    if a == c:
        return 1.0 - s, s, 0.0
    return 1.0 - s - t, s, t


@njit(**FLAGS)
def push(P, C, G, k, t0, t1, x, x0, w, a, b, c, L, r):
    """Push the deepest point out along the normal, hold it by friction, and write the contact down at L[r]."""
    gap, s, t = G[BEST], G[BEST + 1], G[BEST + 2]
    wa, wb, wc = weights_of(a, c, s, t)
    sa, sb, sc = wa * np.float64(w[a]), wb * np.float64(w[b]), wc * np.float64(w[c])
    give = wa * sa + wb * sb + wc * sc
    if not give > 0.0:
        return False
    qx, qy, qz = G[0] + s * G[3] + t * G[6], G[1] + s * G[4] + t * G[7], G[2] + s * G[5] + t * G[8]
    nx, ny, nz = normal_of(P, C, 0, k, qx, qy, qz)
    by = -gap / give
    move(x, a, b, c, sa, sb, sc, by * nx, by * ny, by * nz)
    px, py, pz = place_of(P, k, t1)
    ox, oy, oz = place_of(P, k, t0)
    ux = share(x, a, b, c, wa, wb, wc, 0) - share(x0, a, b, c, wa, wb, wc, 0) - (px - ox)
    uy = share(x, a, b, c, wa, wb, wc, 1) - share(x0, a, b, c, wa, wb, wc, 1) - (py - oy)
    uz = share(x, a, b, c, wa, wb, wc, 2) - share(x0, a, b, c, wa, wb, wc, 2) - (pz - oz)
    across = dot3(ux, uy, uz, nx, ny, nz)
    ux, uy, uz = ux - across * nx, uy - across * ny, uz - across * nz
    slid = length3(ux, uy, uz)
    held = P[k * ROW + FRICTION] * -gap
    part = 1.0 if slid <= held else held / slid
    back = -part / give
    move(x, a, b, c, sa, sb, sc, back * ux, back * uy, back * uz)
    q = r * CONTACT
    L[q], L[q + 1], L[q + 2], L[q + 3] = a, b, c, k
    L[q + 4], L[q + 5], L[q + 6] = wa, wb, wc
    L[q + 7], L[q + 8], L[q + 9] = nx, ny, nz
    L[q + 10] = L[q + 11] = L[q + 12] = L[q + 13] = L[q + 14] = 0.0
    return True


@njit(**FLAGS)
def rebound_of(P, t0, t1, v, v0, L, q):
    """How fast a contact parts after an impact: k_r times the speed with which it came, before and after the step."""
    a, b, c, k = int(L[q]), int(L[q + 1]), int(L[q + 2]), int(L[q + 3])
    nx, ny, nz = L[q + 7], L[q + 8], L[q + 9]
    least = np.inf
    for end in range(2):
        gx, gy, gz = ground_of(P, k, t1 if end else t0)
        y = v if end else v0
        ux = share(y, a, b, c, L[q + 4], L[q + 5], L[q + 6], 0) - gx
        uy = share(y, a, b, c, L[q + 4], L[q + 5], L[q + 6], 1) - gy
        uz = share(y, a, b, c, L[q + 4], L[q + 5], L[q + 6], 2) - gz
        least = min(least, max(-dot3(ux, uy, uz, nx, ny, nz), 0.0))
    return P[k * ROW + RESTITUTION] * least


@njit(**FLAGS)
def strike_once(P, t1, v, w, L, q):
    """Give a contact the impulse that it takes, on top of those that it has got: normal, then friction."""
    a, b, c, k = int(L[q]), int(L[q + 1]), int(L[q + 2]), int(L[q + 3])
    wa, wb, wc = L[q + 4], L[q + 5], L[q + 6]
    nx, ny, nz = L[q + 7], L[q + 8], L[q + 9]
    sa, sb, sc = wa * np.float64(w[a]), wb * np.float64(w[b]), wc * np.float64(w[c])
    give = wa * sa + wb * sb + wc * sc
    gx, gy, gz = ground_of(P, k, t1)
    ux = share(v, a, b, c, wa, wb, wc, 0) - gx
    uy = share(v, a, b, c, wa, wb, wc, 1) - gy
    uz = share(v, a, b, c, wa, wb, wc, 2) - gz
    across = dot3(ux, uy, uz, nx, ny, nz)
    load = max(L[q + 10] + (L[q + 14] - across) / give, 0.0)
    more = load - L[q + 10]
    L[q + 10] = load
    fx = L[q + 11] - (ux - across * nx) / give
    fy = L[q + 12] - (uy - across * ny) / give
    fz = L[q + 13] - (uz - across * nz) / give
    size = length3(fx, fy, fz)
    held = P[k * ROW + FRICTION] * load if load > 0.0 else 0.0
    if size > held:
        fx, fy, fz = fx * (held / size), fy * (held / size), fz * (held / size)
    dx, dy, dz = more * nx + (fx - L[q + 11]), more * ny + (fy - L[q + 12]), more * nz + (fz - L[q + 13])
    L[q + 11], L[q + 12], L[q + 13] = fx, fy, fz
    move(v, a, b, c, sa, sb, sc, dx, dy, dz)


@njit(**FLAGS)
def evict_one(P, C, t, x, i, radius):
    """Put a particle that was pushed into a surface back on it; whether it was."""
    moved = False
    for k in range(SURFACES):
        if P[k * ROW + RESPONSE] == KILL:
            continue
        px, py, pz = place_of(P, k, t)
        lx, ly, lz = np.float64(x[i, 0]) - px, np.float64(x[i, 1]) - py, np.float64(x[i, 2]) - pz
        if bound_of(P, C, k, lx, ly, lz) > radius:
            continue
        gap = gap_of(P, C, 0, k, lx, ly, lz) - radius
        if gap < 0.0:
            nx, ny, nz = normal_of(P, C, 0, k, lx, ly, lz)
            x[i, 0] = R(np.float64(x[i, 0]) - gap * nx)
            x[i, 1] = R(np.float64(x[i, 1]) - gap * ny)
            x[i, 2] = R(np.float64(x[i, 2]) - gap * nz)
            moved = True
    return moved


@njit(**FLAGS)
def find_near(P, C, x, elements, thickness, t, N):
    """Which triangle is near which surface, in pairs of numbers: the next pair in N, and how many there are."""
    count = 0
    for e in range(len(elements)):
        a, b, c = elements[e, 0], elements[e, 1], elements[e, 2]
        mx, my, mz = middle_along(x, a, b, c, 0), middle_along(x, a, b, c, 1), middle_along(x, a, b, c, 2)
        reach = max(max(way_to(x, a, mx, my, mz), way_to(x, b, mx, my, mz)), way_to(x, c, mx, my, mz))
        for k in range(SURFACES):
            if not faces_matter(P, k):
                continue
            px, py, pz = place_of(P, k, t)
            # A quarter more: others push it.
            if bound_of(P, C, k, mx - px, my - py, mz - pz) <= thickness + 1.25 * P[k * ROW + STEEP] * reach:
                if count < len(N):
                    N[count, 0], N[count, 1], N[count, 2] = e, k, 0
                count += 1
    return count


@njit(**FLAGS)
def middle_along(x, a, b, c, j):
    """A coordinate of the middle of three particles."""
    return (np.float64(x[a, j]) + np.float64(x[b, j]) + np.float64(x[c, j])) / 3.0


@njit(**FLAGS)
def way_to(x, i, mx, my, mz):
    """How far a particle is from a point."""
    return length3(np.float64(x[i, 0]) - mx, np.float64(x[i, 1]) - my, np.float64(x[i, 2]) - mz)


@njit(**ENTRY)
def keep_out(P, C, G, D, x, v, x0, v0, w, radius, elements, thickness, t0, t1, rounds, N, M, L):
    """Push triangles that are near surfaces out of them: how many were near, and how often one was pushed.

    Nothing is done if more are near than N has room for.

    Parameters
    ----------
    D : size of the details of each surface.
    N : room for the pairs of a triangle and a surface near it, and the round in which it was looked at last.
    M : the round in which each particle was moved last, 0 at first.
    L : room for the contacts, one for each pair and round.
    """
    count, found = find_near(P, C, x, elements, thickness, t1, N), 0
    if count > len(N):
        return count, found
    for turn in range(1, rounds + 1):
        before = found
        for j in range(count):
            q = j if turn & 1 else count - 1 - j  # there and back, so that no side comes first
            e, k = N[q, 0], N[q, 1]
            a, b, c = elements[e, 0], elements[e, 1], elements[e, 2]
            if max(max(M[a], M[b]), M[c]) < N[q, 2]:
                continue
            N[q, 2] = turn
            precision = PRECISION * laid(P, C, G, k, t1, x, w, a, b, c, thickness)
            deepest(P, C, G, k, precision, D[k])
            if G[BEST] < 0.0 and push(P, C, G, k, t0, t1, x, x0, w, a, b, c, L, found):
                found += 1
                M[a] = M[b] = M[c] = turn
        if found == before:
            break
        for i in range(len(M)):
            if M[i] == turn and w[i] > 0:
                evict_one(P, C, t1, x, i, np.float64(radius[i]))
    for j in range(found):
        L[j * CONTACT + 14] = rebound_of(P, t0, t1, v, v0, L, j * CONTACT)
    for turn in range(rounds):
        for j in range(found):
            strike_once(P, t1, v, w, L, (j if turn & 1 else found - 1 - j) * CONTACT)
    return count, found
