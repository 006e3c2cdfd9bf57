"""The kernel of attachments to triangles. Whoever needs it imports it then, for it imports Numba."""

# Numba infers the types of kernels.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, untyped-decorator"

import numpy as np
from numba import njit

from pointmass.kernels_base import inner


@njit(cache=True, nogil=True, error_model="numpy")
def put_over(rows, weights, height, w, x, sweeps):
    """Put particles over their triangles, one after the other; `x` in place.

    A particle belongs at y = sum_j b_j x_j + h n. Where the corners x_j move by d_j, y moves by sum_j G_j d_j with the
    slopes G_j = b_j - (h / |N|) (1 - n n^T) [e_j], of the normal N = |N| n, the opposite edge e_j and the matrix [e] d
    = e x d. The way to y is shared by inverse masses along these slopes, as in position-based dynamics, so that what
    both sides get has neither momentum nor angular momentum.

    Parameters
    ----------
    rows : of each particle and of the three corners that it is tied to, shape (k, 4).
    weights : b of the corners, shape (k, 3).
    height : h [m], shape (k,).
    w : inverse masses, shape (n,); 0 = held.
    x : positions [m], shape (n, 3).
    sweeps : times that all ties are looked at, unless nothing is left to do.
    """
    slope, gap, way = np.zeros((3, 3, 3), x.dtype), np.zeros(3, x.dtype), np.zeros(3, x.dtype)
    for _ in range(sweeps):
        moved = False
        for k in range(len(rows)):
            i, corners = rows[k, 0], rows[k, 1:]
            _foot(corners, weights[k], height[k], x, slope, gap)
            for q in range(3):
                gap[q] = x[i, q] - gap[q]
            if _shared(w[i], w, corners, slope, gap, way):
                moved = _go(x, i, -w[i], way) or moved
                for j in range(3):
                    for q in range(3):
                        gap[q] = slope[j, 0, q] * way[0] + slope[j, 1, q] * way[1] + slope[j, 2, q] * way[2]
                    moved = _go(x, corners[j], w[corners[j]], gap) or moved
        if not moved:
            break


@inner
def _foot(corners, weights, height, x, slope, y):
    """The place over a triangle, and how it moves with each corner."""
    a, b, c = x[corners[0]], x[corners[1]], x[corners[2]]
    u0, u1, u2, v0, v1, v2 = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    part = height / size if size > 0 else size
    for q, n in enumerate((n0, n1, n2)):
        y[q] = weights[0] * a[q] + weights[1] * b[q] + weights[2] * c[q] + part * n
    if size > 0:
        n0, n1, n2 = n0 / size, n1 / size, n2 / size
    for j in range(3):
        p, r = x[corners[(j + 1) % 3]], x[corners[(j + 2) % 3]]
        e0, e1, e2 = part * (p[0] - r[0]), part * (p[1] - r[1]), part * (p[2] - r[2])
        m0, m1, m2 = n1 * e2 - n2 * e1, n2 * e0 - n0 * e2, n0 * e1 - n1 * e0
        slope[j, 0, 0], slope[j, 0, 1], slope[j, 0, 2] = weights[j] + n0 * m0, e2 + n0 * m1, n0 * m2 - e1
        slope[j, 1, 0], slope[j, 1, 1], slope[j, 1, 2] = n1 * m0 - e2, weights[j] + n1 * m1, e0 + n1 * m2
        slope[j, 2, 0], slope[j, 2, 1], slope[j, 2, 2] = e1 + n2 * m0, n2 * m1 - e0, weights[j] + n2 * m2


@inner
def _shared(own, w, corners, slope, gap, way):
    """Solve (w + sum_j w_j G_j G_j^T) way = gap; False if nobody is free."""
    a00, a01, a02, a11, a12, a22 = own, own - own, own - own, own, own - own, own
    for j in range(3):
        m, g = w[corners[j]], slope[j]
        a00 += m * (g[0, 0] * g[0, 0] + g[0, 1] * g[0, 1] + g[0, 2] * g[0, 2])
        a01 += m * (g[0, 0] * g[1, 0] + g[0, 1] * g[1, 1] + g[0, 2] * g[1, 2])
        a02 += m * (g[0, 0] * g[2, 0] + g[0, 1] * g[2, 1] + g[0, 2] * g[2, 2])
        a11 += m * (g[1, 0] * g[1, 0] + g[1, 1] * g[1, 1] + g[1, 2] * g[1, 2])
        a12 += m * (g[1, 0] * g[2, 0] + g[1, 1] * g[2, 1] + g[1, 2] * g[2, 2])
        a22 += m * (g[2, 0] * g[2, 0] + g[2, 1] * g[2, 1] + g[2, 2] * g[2, 2])
    b00, b01, b02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    whole = a00 * b00 + a01 * b01 + a02 * b02
    if not whole > 0:
        return False
    b11, b12, b22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    way[0] = (b00 * gap[0] + b01 * gap[1] + b02 * gap[2]) / whole
    way[1] = (b01 * gap[0] + b11 * gap[1] + b12 * gap[2]) / whole
    way[2] = (b02 * gap[0] + b12 * gap[1] + b22 * gap[2]) / whole
    return True


@inner
def _go(x, row, share, way):
    """Move a particle by a share of a way, unless it is held; whether it has moved."""
    moved = False
    if share != 0:
        for q in range(3):
            old = x[row, q]
            x[row, q] += share * way[q]
            moved = moved or x[row, q] != old
    return moved
