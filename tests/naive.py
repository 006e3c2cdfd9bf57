"""The slow obvious versions of every force: plain Python, one particle, pair or element at a time.

They share nothing with the package. A law takes numbers; the loops below call it for every particle, pair or element.
"""

from __future__ import annotations

import itertools
import math

import numpy as np


def sub(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def scale(s, a):
    return [s * a[0], s * a[1], s * a[2]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def norm(a):
    return math.sqrt(dot(a, a))


# ------------------------------------------------------------------------------------------------ loops


def over_particles(law, state, numbers):
    return [law(state.x[i], state.v[i], state.m[i], state.t, **numbers(i)) for i in range(len(state.x))]


def over_pairs(law, state, numbers):
    result = [[0.0, 0.0, 0.0] for _ in state.x]
    for i in range(len(state.x)):
        for j in range(len(state.x)):
            if i != j:
                part = law(
                    state.x[i], state.v[i], state.m[i], numbers(i), state.x[j], state.v[j], state.m[j], numbers(j)
                )
                result[i] = [a + b for a, b in zip(result[i], part, strict=True)]
    return result


def over_crowd(law, state, numbers):
    """A law of one particle among all others."""
    result = []
    for i in range(len(state.x)):
        others = [(state.x[j], state.v[j], j) for j in range(len(state.x)) if j != i]
        result.append(law(state.x[i], state.v[i], state.m[i], others, **numbers(i)))
    return result


def over_elements(law, elements, state, numbers):
    result = [[0.0, 0.0, 0.0] for _ in state.x]
    for e, nodes in enumerate(elements):
        forces = law([state.x[i] for i in nodes], [state.v[i] for i in nodes], **numbers(e))
        for i, force in zip(nodes, forces, strict=True):
            result[i] = [a + b for a, b in zip(result[i], force, strict=True)]
    return result


# ------------------------------------------------------------------------------------------------ one particle


def gravity(x, v, m, t, g):
    return scale(m, g)


def gravity_energy(x, v, m, t, g):
    return -m * dot(g, x)


def drag(x, v, m, t, k):
    return scale(-k, v)


def quadratic_drag(x, v, m, t, c):
    return scale(-c * norm(v), v)


def attractor(x, v, m, t, mu, center, eps):
    d = sub(x, center)
    return scale(-mu * m / (dot(d, d) + eps**2) ** 1.5, d)


def attractor_energy(x, v, m, t, mu, center, eps):
    d = sub(x, center)
    return -mu * m / math.sqrt(dot(d, d) + eps**2)


def to_line(x, a, b):
    """From the nearest of many places of a line to x."""
    ways = [sub(x, [a[k] + j / 20000 * (b[k] - a[k]) for k in range(3)]) for j in range(20001)]
    return min(ways, key=norm)


def to_ring(x, center, axis, radius):
    """From the nearest of many places of a circle to x."""
    e = scale(1 / norm(axis), axis)
    p = cross(e, (1, 0, 0) if abs(e[0]) < 0.9 else (0, 1, 0))
    p = scale(radius / norm(p), p)
    q = cross(e, p)
    angles = [2 * math.pi * j / 20000 for j in range(20000)]
    places = ([center[k] + math.cos(s) * p[k] + math.sin(s) * q[k] for k in range(3)] for s in angles)
    return min((sub(x, place) for place in places), key=norm)


def pull(x, v, m, t, way, strength, power, eps, reach=None):
    """Towards shapes, with the way from each of them to x."""
    force = [0.0, 0.0, 0.0]
    for d in way(x):
        a = strength * norm(d) / math.hypot(norm(d), eps) ** (power + 1)
        if reach is not None:
            a *= (1 - (norm(d) / reach) ** 2) ** 2 if norm(d) < reach else 0
        force = [f - m * a * c / norm(d) if norm(d) > 0 else f for f, c in zip(force, d, strict=True)]
    return force


def pull_energy(x, v, m, t, way, strength, power, eps):
    far = [math.hypot(norm(d), eps) for d in way(x)]
    return sum(m * strength * (math.log(r) if power == 1 else (r ** (1 - power) - 1) / (1 - power)) for r in far)


def harmonic(x, v, m, t, k_s, center, k_d):
    return [-k_s * (x[a] - center[a]) - k_d * v[a] for a in range(3)]


def harmonic_energy(x, v, m, t, k_s, center, k_d):
    return 0.5 * k_s * norm(sub(x, center)) ** 2


def magnetic(x, v, m, t, B, q):
    return scale(q, cross(v, B))


def vortex(x, v, m, t, circulation, center, axis, eps):
    unit = scale(1 / norm(axis), axis)
    d = sub(x, center)
    radial = sub(d, scale(dot(d, unit), unit))
    r = norm(radial)
    if r == 0:
        return [0.0, 0.0, 0.0]
    speed = circulation * r / (2 * math.pi * (r**2 + eps**2))
    return scale(speed / r, cross(unit, radial))


def wind(x, v, m, t, air, k):
    return scale(k, sub(air(x, t), v))


def water(x, v, flow, drag):
    """On each corner of a triangle."""
    middle = [sum(p[k] for p in x) / 3 for k in range(3)]
    moves = sub([sum(p[k] for p in v) / 3 for k in range(3)], flow(middle))
    n = cross(sub(x[1], x[0]), sub(x[2], x[0]))
    area = norm(n) / 2
    n = scale(1 / norm(n), n)
    return [scale(min(0.0, -drag * area * dot(n, moves)) / 3, n)] * 3


def fins(x, v, flow, angle, area, drag, upright):
    """On each corner of a section."""
    middle = [sum(p[k] for p in x) / 4 for k in range(3)]
    up = [x[0][k] + x[1][k] - x[2][k] - x[3][k] for k in range(3)]
    right = [x[1][k] + x[2][k] - x[0][k] - x[3][k] for k in range(3)]
    up = scale(1 / norm(up), up)
    ahead = cross(up, right)
    ahead = scale(1 / norm(ahead), ahead)
    n = [math.cos(angle) * a + math.sin(angle) * u for a, u in zip(ahead, up, strict=True)]
    moves = sub([sum(p[k] for p in v) / 4 for k in range(3)], flow(middle))
    f = scale(-drag * area * dot(moves, n) / 4, n)
    upper, lower = [f[0], f[1] + upright, f[2]], [f[0], f[1] - upright, f[2]]
    return [upper, upper, lower, lower]


def plate_wind(x, v, air, density, drag, lift):
    """On each corner of a triangle."""
    middle = [sum(p[k] for p in x) / 3 for k in range(3)]
    w = sub(air(middle), [sum(p[k] for p in v) / 3 for k in range(3)])
    n = cross(sub(x[1], x[0]), sub(x[2], x[0]))
    area = norm(n) / 2
    if area == 0 or norm(w) == 0:
        return [[0.0, 0.0, 0.0]] * 3
    n = scale(math.copysign(1, dot(n, w)) / norm(n), n)
    e = scale(1 / norm(w), w)
    cosine = dot(n, e)
    force = scale(
        density / 2 * area * dot(w, w) * cosine, [drag * e[k] + lift * (n[k] - cosine * e[k]) for k in range(3)]
    )
    return [scale(1 / 3, force)] * 3


def formula(x, v, m, t, function):
    return list(function(x, v, m, t))


def formula_energy(x, v, m, t, function, energy):
    return energy(x, v, m, t)


def cushion(x, v, m, t, solids, k_s, thickness, damping):
    parts = []
    for distance, normal in solids(x):
        if distance < thickness:
            push = k_s * (thickness - distance) * max(1 - damping * dot(v, normal), 0)
            parts.append(scale(push, normal))
    return [sum(part[k] for part in parts) for k in range(3)]


def cushion_energy(x, v, m, t, solids, k_s, thickness, damping):
    return sum(0.5 * k_s * max(thickness - distance, 0) ** 2 for distance, _ in solids(x))


def cut(a, limit):
    return a if norm(a) <= limit else scale(limit / norm(a), a)


def seek(x, v, m, t, target, speed, rate, arrival, limit):
    way = sub(target, x)
    wanted = speed if norm(way) > arrival else speed * norm(way) / arrival
    return scale(m, cut(scale(rate, sub(scale(wanted / norm(way), way) if norm(way) else way, v)), limit))


def cruise(x, v, m, t, speed, rate, limit):
    return scale(m, cut(scale(rate * (speed / norm(v) - 1), v), limit)) if norm(v) else [0.0] * 3


def avoid(x, v, m, t, solids, strength, distance, horizon):
    force = [0.0] * 3
    for d, n in solids(x):
        reach = distance + horizon * max(-dot(v, n), 0)
        if d < reach:
            force = [f + m * strength * (1 - d / reach) * c for f, c in zip(force, n, strict=True)]
    return force


# ------------------------------------------------------------------------------------------------ a crowd


def visible(x, v, xj, cutoff, view):
    """Whether somebody is near enough and not in the blind angle."""
    way = sub(xj, x)
    if norm(way) >= cutoff:
        return False
    if norm(way) * norm(v) == 0 or view >= 360:
        return True
    return math.degrees(math.acos(max(-1, min(1, dot(way, v) / norm(way) / norm(v))))) <= view / 2


def flocking(x, v, m, others, cutoff, near, separation, alignment, cohesion, view, limit=math.inf, of=None):
    seen = [(xj, vj) for xj, vj, j in others if (of is None or j in of) and visible(x, v, xj, cutoff, view)]
    if not seen:
        return [0.0] * 3
    mean_x = [sum(xj[a] for xj, _ in seen) / len(seen) for a in range(3)]
    mean_v = [sum(vj[a] for _, vj in seen) / len(seen) for a in range(3)]
    a = [cohesion * (mean_x[k] - x[k]) + alignment * (mean_v[k] - v[k]) for k in range(3)]
    for xj, _ in seen:
        d = sub(x, xj)
        if 0 < norm(d) < near:
            a = [b + separation * (1 - norm(d) / near) * c / norm(d) for b, c in zip(a, d, strict=True)]
    return scale(m, cut(a, limit))


def flee(x, v, m, others, by, strength, cutoff, view):
    total, push = 0.0, [0.0] * 3
    for xj, _, j in others:
        d = sub(x, xj)
        if j in by and visible(x, v, xj, cutoff, view):
            w = 1 - norm(d) / cutoff
            total += w
            push = [p + w * c / norm(d) for p, c in zip(push, d, strict=True)] if norm(d) else push
    return scale(m * strength / max(total, 1), push)


# ------------------------------------------------------------------------------------------------ elements


def spring(x, v, k_s, k_d, rest):
    dx, dv = sub(x[0], x[1]), sub(v[0], v[1])
    length = norm(dx)
    if length == 0:
        return [[0.0] * 3, [0.0] * 3]
    f1 = scale(-(k_s * (length - rest) + k_d * dot(dv, dx) / length) / length, dx)
    return [f1, scale(-1, f1)]


def spring_energy(x, k_s, k_d, rest):
    return 0.5 * k_s * (norm(sub(x[0], x[1])) - rest) ** 2


def scales(x, v, level, k_s, damping, forward, backward, sideways, creep):
    s = [x[0][0] - x[1][0], 0.0, x[0][2] - x[1][2]]
    s = scale(1 / norm(s), s)
    result = []
    for place, velocity in zip(x, v, strict=True):
        bears = k_s * max(level - place[1], 0) * max(1 - damping * velocity[1], 0)
        flat = [velocity[0], 0.0, velocity[2]]
        ahead = scale(dot(flat, s), s)
        mu = forward if dot(flat, s) >= 0 else backward
        slow = math.sqrt(dot(flat, flat) + creep**2)
        drag = [mu * a + sideways * (u - a) for a, u in zip(ahead, flat, strict=True)]
        result.append([-bears * drag[0] / slow, bears, -bears * drag[2] / slow])
    return result


def slender_drag(x, v, along, across):
    link = sub(x[0], x[1])
    s, u = scale(1 / norm(link), link), scale(0.5, [a + b for a, b in zip(*v, strict=True)])
    ahead = scale(dot(u, s), s)
    half = [-0.5 * norm(link) * (along * a + across * (b - a)) for a, b in zip(ahead, u, strict=True)]
    return [half, half]


def joint_angle(x):
    e1, e2 = sub(x[1], x[0]), sub(x[2], x[1])
    return math.atan2(norm(cross(e1, e2)), dot(e1, e2))


def angle(x, v, k_s, k_d, rest):
    e1, e2 = sub(x[1], x[0]), sub(x[2], x[1])
    n = cross(e1, e2)
    if norm(n) == 0:
        return [[0.0] * 3] * 3
    n = scale(1 / norm(n), n)
    slope1, slope2 = scale(-1 / dot(e1, e1), cross(n, e1)), scale(1 / dot(e2, e2), cross(n, e2))
    rate = dot(slope1, sub(v[1], v[0])) + dot(slope2, sub(v[2], v[1]))
    moment = k_s * (joint_angle(x) - rest) + k_d * rate
    fa, fc = scale(moment, slope1), scale(-moment, slope2)
    return [fa, scale(-1, [fa[a] + fc[a] for a in range(3)]), fc]


def angle_energy(x, k_s, k_d, rest):
    return 0.5 * k_s * (joint_angle(x) - rest) ** 2


def hinge_angle(x):
    a, b, c, d = x
    e = sub(b, a)
    n1, n2 = cross(e, sub(c, a)), cross(sub(d, a), e)
    if norm(e) * norm(n1) * norm(n2) == 0:
        return 0.0
    fold = math.acos(max(-1.0, min(1.0, dot(n1, n2) / norm(n1) / norm(n2))))
    return math.copysign(fold, dot(n1, sub(d, a)))


def hinge(x, v, k_s, k_d, rest):
    """By the gradients in Bridson, Marino and Fedkiw 2003, each corner's by itself."""
    a, b, c, d = x
    e = sub(b, a)
    n1, n2, long = cross(e, sub(c, a)), cross(sub(d, a), e), norm(e)
    if long * norm(n1) * norm(n2) == 0:
        return [[0.0] * 3] * 4
    m1, m2 = scale(1 / dot(n1, n1), n1), scale(1 / dot(n2, n2), n2)
    slopes = [
        [dot(sub(c, b), e) / long * p + dot(sub(d, b), e) / long * q for p, q in zip(m1, m2, strict=True)],
        [-dot(sub(c, a), e) / long * p - dot(sub(d, a), e) / long * q for p, q in zip(m1, m2, strict=True)],
        scale(long, m1),
        scale(long, m2),
    ]
    rate = sum(dot(s, w) for s, w in zip(slopes, v, strict=True))
    moment = k_s * (hinge_angle(x) - rest) + k_d * rate
    return [scale(-moment, s) for s in slopes]


def hinge_energy(x, k_s, k_d, rest):
    return 0.5 * k_s * (hinge_angle(x) - rest) ** 2


def tetrahedron(x):
    """Six times the volume: the determinant, written out."""
    a, b, c = (sub(x[k], x[3]) for k in range(3))
    plus = a[0] * b[1] * c[2] + a[1] * b[2] * c[0] + a[2] * b[0] * c[1]
    return -(plus - a[2] * b[1] * c[0] - a[1] * b[0] * c[2] - a[0] * b[2] * c[1])


def volume(x, v, k_s, k_d, rest):
    slopes = [scale(1 / 6, cross(sub(x[b], x[c]), sub(x[a], x[c]))) for a, b, c in ((1, 2, 3), (0, 3, 2), (0, 1, 3))]
    slopes.append([-sum(s[k] for s in slopes) for k in range(3)])
    rate = sum(dot(slope, u) for slope, u in zip(slopes, v, strict=True))
    return [scale(-k_s * (tetrahedron(x) / 6 - rest) - k_d * rate, slope) for slope in slopes]


def volume_energy(x, k_s, k_d, rest):
    return 0.5 * k_s * (tetrahedron(x) / 6 - rest) ** 2


def bulk(x, v, k_s, k_d, rest):
    """A spring on the volume with the slope of `bulk_energy` for its tension."""
    j = tetrahedron(x) / 6 / rest
    tension = rest * ((j - j**-3) / 4 if j >= 0.2 else -31.2 + 469 * (j - 0.2))
    return volume(x, v, k_s, k_d, tetrahedron(x) / 6 - tension)


def bulk_energy(x, k_s, k_d, rest):
    """k_s rest^2 (J - 1/J)^2 / 8, and Taylor's series of that around a fifth, to the second order, below it."""
    j = tetrahedron(x) / 6 / rest
    if j >= 0.2:
        return k_s * rest**2 * (j - 1 / j) ** 2 / 8
    return k_s * rest**2 * (2.88 - 31.2 * (j - 0.2) + 234.5 * (j - 0.2) ** 2)


# ------------------------------------------------------------------------------------------------ pairs


def gravitation(xi, vi, mi, pi, xj, vj, mj, pj):
    d = sub(xi, xj)
    return scale(-pi["G"] * mi * mj / (dot(d, d) + pi["eps"] ** 2) ** 1.5, d)


def gravitation_energy(xi, mi, pi, xj, mj, pj):
    d = sub(xi, xj)
    return -pi["G"] * mi * mj / math.sqrt(dot(d, d) + pi["eps"] ** 2)


def point_vortices(xi, vi, mi, pi, xj, vj, mj, pj):
    dx, dy = xi[0] - xj[0], xi[1] - xj[1]
    r2 = dx**2 + dy**2 + pi["eps"] ** 2
    if r2 == 0:
        return [0.0, 0.0, 0.0]
    return [-pj["circulation"] * dy / (2 * math.pi * r2), pj["circulation"] * dx / (2 * math.pi * r2), 0.0]


def nearest_difference(xi, xj, box):
    """xi minus the image of xj that is nearest, in a periodic box or without one."""
    d = sub(xi, xj)
    return d if box is None else [min((d[a] + k * box[a] for k in range(-3, 4)), key=abs) for a in range(3)]


def near_pairs(x, cutoff, box=None):
    """All ordered pairs within a cut-off."""
    rows = range(len(x))
    return {(i, j) for i in rows for j in rows if i != j and norm(nearest_difference(x[i], x[j], box)) < cutoff}


def lennard_jones(xi, vi, mi, pi, xj, vj, mj, pj):
    d = nearest_difference(xi, xj, pi["box"])
    r = norm(d)
    if r >= pi["cutoff"]:
        return [0.0, 0.0, 0.0]
    a = pi["sigma"] / r
    return scale(24 * pi["epsilon"] * (2 * a**12 - a**6) / r**2, d)


def lennard_jones_energy(xi, mi, pi, xj, mj, pj):
    r = norm(nearest_difference(xi, xj, pi["box"]))
    a, edge = pi["sigma"] / r, pi["sigma"] / pi["cutoff"]
    return 4 * pi["epsilon"] * ((a**12 - a**6) - (edge**12 - edge**6)) if r < pi["cutoff"] else 0.0


def soft_sphere(xi, vi, mi, pi, xj, vj, mj, pj):
    d = nearest_difference(xi, xj, pi["box"])
    r = norm(d)
    overlap = pi["radius"] + pj["radius"] - r
    if overlap <= 0:
        return [0.0, 0.0, 0.0]
    damping = pi["k_d"] * (min(1.0, overlap / pi["onset"]) if pi["onset"] > 0 else 1.0)
    return scale((pi["k_s"] * overlap - damping * dot(sub(vi, vj), d) / r) / r, d)


def soft_sphere_energy(xi, mi, pi, xj, mj, pj):
    overlap = pi["radius"] + pj["radius"] - norm(nearest_difference(xi, xj, pi["box"]))
    return 0.5 * pi["k_s"] * max(overlap, 0.0) ** 2


# ------------------------------------------------------------------------------------------------ a grid


def interpolated(values, origin, spacing, times, outside, x, t):
    """Trilinear in space and linear in time, values[snapshot][i][j][k] being vectors."""
    shape = (len(values[0]), len(values[0][0]), len(values[0][0][0]))
    cells = []
    for axis in range(3):
        count = shape[axis]
        place = (x[axis] - origin[axis]) / spacing
        if count == 1:
            cells.append([(0, 1.0)])
            continue
        if outside == "wrap":
            place = place % count
        elif place < 0 or place > count - 1:
            if outside == "zero":
                return [0.0, 0.0, 0.0]
            place = min(max(place, 0.0), count - 1.0)
        low = math.floor(place)
        cells.append([(low % count, 1 - (place - low)), ((low + 1) % count, place - low)])
    moments = [(0, 1.0)]
    if t >= times[-1]:
        moments = [(len(times) - 1, 1.0)]
    elif t > times[0]:
        after = next(k for k, moment in enumerate(times) if moment > t)
        part = (t - times[after - 1]) / (times[after] - times[after - 1])
        moments = [(after - 1, 1 - part), (after, part)]
    result = [0.0, 0.0, 0.0]
    for s, ws in moments:
        for i, wi in cells[0]:
            for j, wj in cells[1]:
                for k, wk in cells[2]:
                    for axis in range(3):
                        result[axis] += ws * wi * wj * wk * values[s][i][j][k][axis]
    return result


def hashed(h):
    """lowbias32, on a whole number of 32 bits."""
    for shift, factor in ((16, 0x21F0AAAD), (15, 0x735A2D97), (15, 1)):
        h = ((h ^ (h >> shift)) * factor) % 2**32
    return h


def noise(place, t=None, seed=0, component=0):
    """Gradient noise, corner by corner."""

    def fade(u):
        return u * u * u * (u * (u * 6 - 15) + 10)

    prime, base = 0x165667B1, hashed((seed + 0x165667B1) % 2**32)
    whole = [math.floor(complex(a).real) for a in place]  # complex for its slopes
    total = 0.0
    for corner in itertools.product((0, 1), repeat=3):
        point = [(w + c) % 2**24 for w, c in zip(whole, corner, strict=True)]
        h = (
            hashed(
                sum(i * p for i, p in zip([*point, base], (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D, 1), strict=True)) % 2**32
            )
            + base
        )
        own = h + prime * (component + 1)

        def gradient(k, own=own):
            bits = hashed((own + k * 0x27D4EB2F) % 2**32)
            return [((bits >> 10 * axis) % 1024) - 511.5 for axis in range(3)]

        g = gradient(0)
        if t is not None:
            now = t + (h >> 8) % 2**24 / 2**24
            k, s = math.floor(now) % 2**24, fade(now - math.floor(now))
            g = [a + s * (b - a) for a, b in zip(gradient(k), gradient((k + 1) % 2**24), strict=True)]
        away = [a - w - c for a, w, c in zip(place, whole, corner, strict=True)]
        weight = math.prod(fade(1 + d if c else 1 - d) for c, d in zip(corner, away, strict=True))
        total += weight * dot(g, away)
    square = (1024**2 - 1) / 12 * 3 * 535 / 9009 * (181 / 231) ** (2 if t is None else 3)
    return total / math.sqrt(square)


def stream(size, speed, rate, octaves, gain, seed):
    """The stream function of curl noise, for a root mean square speed far from solids."""
    slope = slope_square(rate is not None)
    scale = speed * size / math.sqrt(6 * slope * sum(gain ** (2 * k) for k in range(octaves)))

    def psi(x, t):
        total = [0.0, 0.0, 0.0]
        for k in range(octaves):
            place = [2**k * a / size + k * o for a, o in zip(x, (0.37, 0.71, 0.23), strict=True)]
            for c in range(3):
                total[c] += (gain / 2) ** k * noise(place, None if rate is None else rate * t, seed + 65536 * k, c)
        return [scale * a for a in total]

    return psi


def slope_square(timed):
    """Mean square of d(noise)/dx, by adding up the squares of the polynomials at the middles of 10^4 pieces."""

    def mean(function):
        return sum(function((k + 0.5) / 10_000) for k in range(10_000)) / 10_000

    def s(u):
        return u**3 * (6 * u * u - 15 * u + 10)

    def ds(u):
        return 30 * (u * (1 - u)) ** 2

    near = [2 * mean(lambda u: s(u) ** 2), 2 * mean(lambda u: (s(u) * (1 - u)) ** 2)]
    steep = [2 * mean(lambda u: ds(u) ** 2), 2 * mean(lambda u: (s(u) - ds(u) * (1 - u)) ** 2)]
    return (steep[1] * near[0] ** 2 + 2 * steep[0] * near[0] * near[1]) / (3 * near[0] ** 2 * near[1])


def curl(x, v, m, t, psi, solids=()):
    """Curl of a stream function, by complex steps; `solids` are (reach, distance, normal)."""

    def around(x):
        free = psi(x, t)
        ramps = []
        for reach, distance, _ in solids:
            r = distance(x, t) / reach
            r = r if abs(complex(r).real) < 1 else math.copysign(1, complex(r).real)
            ramps.append(15 * r / 8 - 10 * r**3 / 8 + 3 * r**5 / 8)
        result = scale(math.prod(ramps), free)
        for k, (_, _, normal) in enumerate(solids):
            n = normal(x, t)
            others = math.prod(a for j, a in enumerate(ramps) if j != k)
            result = [a + others * (1 - ramps[k]) * dot(n, free) * b for a, b in zip(result, n, strict=True)]
        return result

    step = 1e-30
    slopes = [[p.imag / step for p in map(complex, around([a + 1j * step * (k == axis) for k, a in enumerate(x)]))]
              for axis in range(3)]  # fmt: skip
    return [slopes[1][2] - slopes[2][1], slopes[2][0] - slopes[0][2], slopes[0][1] - slopes[1][0]]


def vortex_line(x, v, m, t, a, b, circulation, eps):
    """By Gauss and Legendre's rule on many pieces, whose error is far below rounding."""
    nodes = [0.0, 0.5384693101056831, -0.5384693101056831, 0.906179845938664, -0.906179845938664]
    weights = [0.5688888888888889, 0.47862867049936647, 0.47862867049936647, 0.23692688505618908, 0.23692688505618908]
    total, pieces, line = [0.0, 0.0, 0.0], 400, sub(b, a)
    for k in range(pieces):
        for u, w in zip(nodes, weights, strict=True):
            d = sub(sub(x, a), scale((k + 0.5 + u / 2) / pieces, line))
            factor = w / 2 / pieces * circulation / (4 * math.pi) / (dot(d, d) + eps**2) ** 1.5
            total = [p + factor * q for p, q in zip(total, cross(line, d), strict=True)]
    return total


def vortex_ring(x, v, m, t, center, axis, radius, circulation, eps):
    """By the rule of rectangles, which on a circle converges faster than any power."""
    e = scale(1 / norm(axis), axis)
    helper = (1.0, 0.0, 0.0) if abs(e[0]) < 0.5 else (0.0, 1.0, 0.0)
    first = scale(1 / norm(cross(e, helper)), cross(e, helper))
    second = cross(e, first)
    total, pieces = [0.0, 0.0, 0.0], 1000
    for k in range(pieces):
        c, s = math.cos(2 * math.pi * k / pieces), math.sin(2 * math.pi * k / pieces)
        place = [p + radius * (c * q + s * r) for p, q, r in zip(center, first, second, strict=True)]
        ds = [2 * math.pi * radius / pieces * (c * r - s * q) for q, r in zip(first, second, strict=True)]
        d = sub(x, place)
        factor = circulation / (4 * math.pi) / (dot(d, d) + eps**2) ** 1.5
        total = [p + factor * q for p, q in zip(total, cross(ds, d), strict=True)]
    return total


def gust(x, t, velocity, intensity, length, lifetime, seed):
    place = [(a - t * u) / length for a, u in zip(x, velocity, strict=True)]
    size = intensity * norm(velocity)
    return [u + size * noise(place, t / lifetime, seed, c) for c, u in enumerate(velocity)]


def buoyancy(x, v, m, t, temperature, ambient, beta, density, alpha, up):
    return scale(m * (beta * (temperature - ambient) - alpha * density) / norm(up), up)


def draw(key, index, seed, component):
    """A random number of mean 0 and variance 1."""
    base = hashed((seed + 0x165667B1) % 2**32)
    who = hashed((round(key * 2**24) * 0x9E3779B1 + base) % 2**32) + base
    bits = hashed((who + index % 2**24 * 0x27D4EB2F + 0x165667B1 * (component + 1)) % 2**32)
    return (sum((bits >> 10 * k) % 1024 for k in range(3)) - 1534.5) / math.sqrt((1024**2 - 1) / 4)


def flutter(t, chance, strength, lifetime, seed):
    """Kicks of a cell each, the oldest first; `shorter` and `mean` follow from a cell of 1/4."""
    h, cells = 0.25, 24
    kick = math.sqrt(1 - math.exp(-2 * h))

    def variance(s):
        return math.exp(-2 * h * s) + (kick * (1 - math.exp(-h * s)) / (1 - math.exp(-h))) ** 2

    simpson = [1, *(4, 2) * 499, 4, 1]
    mean = sum(w * variance(k / 1000) for k, w in enumerate(simpson)) / 3000
    now = t / (2 * mean * math.tanh(h / 2) * lifetime) + chance
    cell = math.floor(now)
    u = [0.0, 0.0, 0.0]
    for k in range(cell - cells, cell):
        oldest = 1 - (now - cell) if k == cell - cells else 1.0
        u = [math.exp(-h) * a + oldest * kick * draw(chance, k, seed, axis) for axis, a in enumerate(u)]
    part = math.exp(-h * (now - cell))
    last = [kick * draw(chance, cell, seed, axis) for axis in range(3)]
    u = [part * a + (1 - part) / (1 - math.exp(-h)) * b for a, b in zip(u, last, strict=True)]
    return [s * a / math.sqrt(mean) for s, a in zip(strength, u, strict=True)]


# ------------------------------------------------------------------------------------------------ triangles


def nearest_on_segment(p, a, b):
    edge = sub(b, a)
    part = min(max(dot(sub(p, a), edge) / dot(edge, edge), 0.0), 1.0)
    return [a[k] + part * edge[k] for k in range(3)]


def distance_to_triangle(p, a, b, c):
    """To the plane where the foot of the perpendicular is inside, else to the nearest edge."""
    n = cross(sub(b, a), sub(c, a))
    above = dot(sub(p, a), n) / dot(n, n)
    foot = [p[k] - above * n[k] for k in range(3)]
    sides = [dot(cross(sub(v, u), sub(foot, u)), n) for u, v in ((a, b), (b, c), (c, a))]
    if all(s >= 0 for s in sides):
        return norm(sub(p, foot))
    return min(norm(sub(p, nearest_on_segment(p, u, v))) for u, v in ((a, b), (b, c), (c, a)))


def distance_to_triangles(p, vertices, faces):
    return min(distance_to_triangle(p, *(vertices[i] for i in face)) for face in faces)


def winding_number(p, vertices, faces):
    """1 inside of a closed mesh that faces outwards, 0 outside: solid angles over 4 pi (van Oosterom & Strackee)."""
    total = 0.0
    for face in faces:
        a, b, c = (sub(vertices[i], p) for i in face)
        la, lb, lc = norm(a), norm(b), norm(c)
        below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
        total += 2 * math.atan2(dot(a, cross(b, c)), below)
    return total / (4 * math.pi)


def deepest(collider, corners, t, points=40):
    """The least distance from a collider among many points of a triangle, or of triangles (k, 3, 3), at time t."""
    weights = [(i, j, points - i - j) for i in range(points + 1) for j in range(points + 1 - i)]
    places = np.tensordot(np.array(weights) / points, corners, axes=(1, -2))
    return collider.distance(places.reshape(-1, 3), t).min()
