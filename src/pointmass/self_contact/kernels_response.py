"""What keeps pairs apart: rows of a problem of least change, and sweeps that solve it.

A row says that what lies between two places of a pair, as a sum over four corners, is at least so long along a normal.
Impulses along normals only push; impulses across them, of friction, are at most mu times as large.
"""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator, no-any-return, call-arg"

import math

from pointmass.kernels_base import inner
from pointmass.self_contact.kernels_base import kernel
from pointmass.self_contact.kernels_geometry import (
    NEVER,
    at,
    closest,
    dot,
    meeting,
    room_along,
    weighed,
)


@kernel
def look(corners, points, x, gaps, normals, weights, inside, first, last):
    """Distance, direction and weights of the closest points of the pairs first to last; the first `points` of all are
    of a point and a triangle. The direction is 0 where they touch."""
    for k in range(first, last):
        c = corners[k]
        p = at(x, c[0]), at(x, c[1]), at(x, c[2]), at(x, c[3])
        w, within = closest(k >= points, p)
        r = weighed(w, p)
        gap = math.sqrt(dot(r, r))
        scale = 1.0 / gap if gap > 0.0 else 0.0
        gaps[k] = gap
        inside[k] = within
        for axis in range(3):
            normals[k, axis] = r[axis] * scale
        for j in range(4):
            weights[k, j] = w[j]


@kernel
def sweep(corners, points, x0, x1, gaps, normals, touching, tolerance, stale, times, weights, first, last):
    """When the pairs first to last meet on their ways, and where; `NEVER` for those that do not.

    A plane between two that are apart at the start and at the end is between them all the time.

    Parameters
    ----------
    gaps, normals : at the start, from `look`.
    touching : [m]; who is as near as this at the start is not judged.
    tolerance : [m], see `meeting`; half of the gap at the start, if that is less.
    stale : particles that have moved since the last time; a pair of others keeps what is known of it.
    times, weights : written.
    """
    for k in range(first, last):
        c = corners[k]
        if not (stale[c[0]] or stale[c[1]] or stale[c[2]] or stale[c[3]]):
            continue
        times[k] = NEVER
        if gaps[k] <= touching:
            continue
        edges = k >= points
        near = min(tolerance, 0.5 * gaps[k])
        q = at(x1, c[0]), at(x1, c[1]), at(x1, c[2]), at(x1, c[3])
        if room_along(edges, at(normals, k), q) > near:
            continue
        p = at(x0, c[0]), at(x0, c[1]), at(x0, c[2]), at(x0, c[3])
        times[k], w = meeting(edges, p, q, near)
        for j in range(4):
            weights[k, j] = w[j]


@inner
def push(x, c, a, w, dx, dy, dz):
    """Move four corners by their shares of an impulse."""
    for j in range(4):
        share = a[j] * w[c[j]]
        if share != 0.0:
            x[c[j], 0] += share * dx
            x[c[j], 1] += share * dy
            x[c[j], 2] += share * dz


@kernel
def relax(corners, weights, normals, targets, frictions, starts, pushed, dragged, x, w, sweeps, enough):
    """Gauss-Seidel sweeps over the rows, in order: Hildreth's method for the smallest change, with Coulomb friction.

    Parameters
    ----------
    corners, weights : of each row, shape (k, 4).
    normals, targets : the sum is to reach at least as far as the target [m] along the normal.
    frictions : mu of each row.
    starts : the sum at the start of the step, shape (k, 3): friction is against what it moves from there.
    pushed, dragged : impulses so far, of length times mass, shape (k,) and (k, 3).
    x : moved, shape (n, 3).
    w : inverse masses.
    sweeps : at most so many.
    enough : [m]; it ends after a sweep in which no row had to move more.
    """
    for _ in range(sweeps):
        largest = 0.0
        for k in range(len(corners)):
            c, a = corners[k], weights[k]
            ease = 0.0
            for j in range(4):
                ease += a[j] * a[j] * w[c[j]]
            if not ease > 0.0:
                continue
            n = at(normals, k)
            r = weighed(a, (at(x, c[0]), at(x, c[1]), at(x, c[2]), at(x, c[3])))
            before = pushed[k]
            pushed[k] = max(before + (targets[k] - dot(n, r)) / ease, 0.0)
            more = pushed[k] - before
            if more != 0.0:
                push(x, c, a, w, more * n[0], more * n[1], more * n[2])
                largest = max(largest, abs(more) * ease)
            if frictions[k] == 0.0 or (pushed[k] == 0.0 and before == 0.0):
                continue
            r = weighed(a, (at(x, c[0]), at(x, c[1]), at(x, c[2]), at(x, c[3])))
            ux, uy, uz = r[0] - starts[k, 0], r[1] - starts[k, 1], r[2] - starts[k, 2]
            along = ux * n[0] + uy * n[1] + uz * n[2]
            tx = dragged[k, 0] - (ux - along * n[0]) / ease
            ty = dragged[k, 1] - (uy - along * n[1]) / ease
            tz = dragged[k, 2] - (uz - along * n[2]) / ease
            size = math.sqrt(tx * tx + ty * ty + tz * tz)
            most = frictions[k] * pushed[k]
            if size > most:
                tx, ty, tz = tx * most / size, ty * most / size, tz * most / size
            dx, dy, dz = tx - dragged[k, 0], ty - dragged[k, 1], tz - dragged[k, 2]
            if dx != 0.0 or dy != 0.0 or dz != 0.0:
                push(x, c, a, w, dx, dy, dz)
                dragged[k, 0], dragged[k, 1], dragged[k, 2] = tx, ty, tz
                largest = max(largest, math.sqrt(dx * dx + dy * dy + dz * dz) * ease)
        if largest <= enough:
            return
