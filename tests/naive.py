"""The slow obvious versions of every force: plain Python, one particle, pair or element at a time.

They share nothing with the package. A law takes numbers; the loops below call it for every particle, pair or element.
"""

from __future__ import annotations

import math


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


def formula(x, v, m, t, function):
    return list(function(x, v, m, t))


def formula_energy(x, v, m, t, function, energy):
    return energy(x, v, m, t)


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
    return scale((pi["k_s"] * overlap - pi["k_d"] * dot(sub(vi, vj), d) / r) / r, d)


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
