"""Two simplices that may meet: a point and a triangle, or two edges. How near they are, and when they meet.

A pair is four corners: the point and the triangle's corners, or the ends of one edge and those of the other. A place on
each is a sum over the corners, and so is what lies between the two places: signed weights (1, -u, -v, -w) of a point
and a triangle, (1 - s, s, -(1 - t), -t) of two edges. Corners move on straight lines while the time goes from 0 to 1.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

from pointmass.kernels_base import inner

PARALLEL = 1e-2  # squared sine of the angle of two edges below which what lies between them has no sure direction
FLAT = 1e-13  # a cubic smaller than this, relative to the cube of the lengths in it, is rounding
TINY = 1e-300  # square of the length of an edge without any
MOST_HALVINGS = 80
MOST_ADVANCES = 200
NEVER = 2.0  # a time after all


@inner
def at(x, i):
    """Row i."""
    return x[i, 0], x[i, 1], x[i, 2]


@inner
def minus(a, b):
    """The vector from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def between(a, b, t):
    """The point at a share t of the way from a to b."""
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])


@inner
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def weighed(w, p):
    """Sum of four points with weights."""
    a, b, c, d = p
    return (
        w[0] * a[0] + w[1] * b[0] + w[2] * c[0] + w[3] * d[0],
        w[0] * a[1] + w[1] * b[1] + w[2] * c[1] + w[3] * d[1],
        w[0] * a[2] + w[1] * b[2] + w[2] * c[2] + w[3] * d[2],
    )


@inner
def clamp(value):
    """The value, or the end of [0, 1] that it has passed."""
    return min(max(value, 0.0), 1.0)


@inner
def on_triangle(p):
    """Weights of the closest points of a point and a triangle, and whether the point is over its inside.

    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    x, a, b, c = p
    ab, ac, ax = minus(b, a), minus(c, a), minus(x, a)
    d1, d2 = dot(ab, ax), dot(ac, ax)
    if d1 <= 0.0 and d2 <= 0.0:
        return (1.0, -1.0, 0.0, 0.0), False
    bx = minus(x, b)
    d3, d4 = dot(ab, bx), dot(ac, bx)
    if d3 >= 0.0 and d4 <= d3:
        return (1.0, 0.0, -1.0, 0.0), False
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
        return (1.0, v - 1.0, -v, 0.0), False
    cx = minus(x, c)
    d5, d6 = dot(ab, cx), dot(ac, cx)
    if d6 >= 0.0 and d5 <= d6:
        return (1.0, 0.0, 0.0, -1.0), False
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
        return (1.0, w - 1.0, 0.0, -w), False
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return (1.0, 0.0, w - 1.0, -w), False
    total = va + vb + vc
    v, w = vb / total, vc / total
    return (1.0, v + w - 1.0, -v, -w), True


@inner
def on_edges(p):
    """Weights of the closest points of two edges, and whether both are inside of edges that cross at a fair angle.

    Ericson, section 5.1.9.
    """
    a, b, c, d = p
    e, f, r = minus(b, a), minus(d, c), minus(a, c)
    ee, ff, ef = max(dot(e, e), TINY), max(dot(f, f), TINY), dot(e, f)
    er, fr = dot(e, r), dot(f, r)
    sine = ee * ff - ef * ef
    s = 0.0
    if sine > 0.0:
        s = clamp((ef * fr - er * ff) / sine)
    t = (ef * s + fr) / ff
    if t < 0.0:
        t = 0.0
        s = clamp(-er / ee)
    elif t > 1.0:
        t = 1.0
        s = clamp((ef - er) / ee)
    inside = 0.0 < s < 1.0 and 0.0 < t < 1.0 and sine > PARALLEL * ee * ff
    return (1.0 - s, s, t - 1.0, -t), inside


@inner
def closest(edges, p):
    """Weights of the closest points of a pair, and whether they are inside of both."""
    if edges:
        return on_edges(p)
    return on_triangle(p)


@inner
def corners_at(p, q, t):
    """The corners on their way from p to q."""
    return between(p[0], q[0], t), between(p[1], q[1], t), between(p[2], q[2], t), between(p[3], q[3], t)


@inner
def distance_at(edges, p, q, t):
    """Distance of a pair at a time, and the weights of the closest points."""
    now = corners_at(p, q, t)
    w, _ = closest(edges, now)
    r = weighed(w, now)
    return math.sqrt(dot(r, r)), w


@inner
def room_along(edges, n, p):
    """How far the corners of one lie beyond those of the other along a direction, at least."""
    a, b, c, d = dot(n, p[0]), dot(n, p[1]), dot(n, p[2]), dot(n, p[3])
    if edges:
        return min(a, b) - max(c, d)
    return a - max(b, c, d)


@inner
def pace(edges, p, q):
    """How far a corner of one moves relative to one of the other, at most."""
    f = minus(q[0], p[0]), minus(q[1], p[1]), minus(q[2], p[2]), minus(q[3], p[3])
    most = 0.0
    for i in range(2 if edges else 1):
        for j in range(2 if edges else 1, 4):
            g = minus(f[i], f[j])
            most = max(most, dot(g, g))
    return math.sqrt(most)


@inner
def cubic(p, q):
    """Six times the volume between the corners, as a cubic of time, and the size of its terms."""
    e1, e2, e3 = minus(p[1], p[0]), minus(p[2], p[0]), minus(p[3], p[0])
    f1, f2, f3 = minus(minus(q[1], q[0]), e1), minus(minus(q[2], q[0]), e2), minus(minus(q[3], q[0]), e3)
    ee, ff = cross(e1, e2), cross(f1, f2)
    fe, ef = cross(f1, e2), cross(e1, f2)
    c0 = dot(ee, e3)
    c1 = dot(fe, e3) + dot(ef, e3) + dot(ee, f3)
    c2 = dot(ff, e3) + dot(fe, f3) + dot(ef, f3)
    c3 = dot(ff, f3)
    long = max(dot(e1, e1), dot(e2, e2), dot(e3, e3), dot(f1, f1), dot(f2, f2), dot(f3, f3))
    return (c0, c1, c2, c3), long * math.sqrt(long)


@inner
def value(c, t):
    """Of a cubic."""
    return ((c[3] * t + c[2]) * t + c[1]) * t + c[0]


@inner
def turning(c):
    """Times in [0, 1] at which a cubic turns, in order; 1 where there is none."""
    a, b, d = 3.0 * c[3], c[2], c[1]  # a t^2 + 2 b t + d = 0
    square = b * b - a * d
    if square < 0.0:
        return 1.0, 1.0
    far = -(b + math.copysign(math.sqrt(square), b))
    s = far / a if a != 0.0 else 1.0
    t = d / far if far != 0.0 else 1.0
    s, t = min(s, t), max(s, t)
    if not 0.0 < s < 1.0:
        s = 1.0
    if not 0.0 < t < 1.0:
        t = 1.0
    return min(s, t), max(s, t)


@inner
def root(c, low, high):
    """Where a cubic with two signs at the ends of a monotone piece is zero: regula falsi (Illinois), then halves."""
    f, g = value(c, low), value(c, high)
    if f == 0.0:
        return low
    side = 0
    for k in range(MOST_HALVINGS):
        t = (f * high - g * low) / (f - g)
        if k >= 12 or not low < t < high:
            t = 0.5 * (low + high)
        if not low < t < high:
            break
        h = value(c, t)
        if h == 0.0:
            return t
        if (h > 0.0) == (g > 0.0):
            high, g = t, h
            if side == 1:
                f *= 0.5
            side = 1
        else:
            low, f = t, h
            if side == 2:
                g *= 0.5
            side = 2
    return 0.5 * (low + high)


@inner
def advanced(edges, p, q, tolerance):
    """When a pair first comes within a tolerance, by steps too short to pass it: for corners that stay in one plane.

    Mirtich's conservative advancement. A pair that takes too many steps counts as one that meets.
    """
    most = pace(edges, p, q)
    t = 0.0
    for _ in range(MOST_ADVANCES):
        d, w = distance_at(edges, p, q, t)
        if d <= tolerance:
            return t, w
        if not most > 0.0:
            return NEVER, w
        t += (d - 0.5 * tolerance) / most
        if t > 1.0:
            return NEVER, w
    return t, w


@inner
def meeting(edges, p, q, tolerance):
    """When corners that move from p to q first meet, from 0 to 1, and the weights of where; `NEVER` if they do not.

    Two simplices meet where their corners lie in one plane and their distance is at most `tolerance`; so they do if
    that is their distance at the end. Bridson, Fedkiw and Anderson (2002), section 6.1, after Provot (1997).
    """
    c, size = cubic(p, q)
    if max(abs(c[0]), abs(c[1]), abs(c[2]), abs(c[3])) <= FLAT * size:
        return advanced(edges, p, q, tolerance)
    s, t = turning(c)
    low = 0.0
    for high in (s, t, 1.0):
        if not high > low:
            continue
        f, g = value(c, low), value(c, high)
        if (f > 0.0) != (g > 0.0) or f == 0.0:
            when = root(c, low, high)
            d, w = distance_at(edges, p, q, when)
            if d <= tolerance:
                return when, w
        d, w = distance_at(edges, p, q, high)
        if d <= tolerance:
            return high, w
        low = high
    return NEVER, (0.0, 0.0, 0.0, 0.0)
