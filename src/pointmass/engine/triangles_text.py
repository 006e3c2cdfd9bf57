"""The nearest triangle of a mesh to one point, in scalars: the text of kernels, not a module to import.

`lookups` puts constants and laws before it: `triangle_of` and `outcome_of`, and names for the numbers of a surface's
row. It finds what `collisions.triangles` finds, in another way: the tree of boxes is walked without a stack, from a
bound that the triangles give which were near the last time, or one near the cube around the point.
"""
# ruff: noqa: F821
# mypy: ignore-errors

import numpy as np
from numba import njit

# --- printed from here on


@njit(**FLAGS)
def cube_along(u, count):
    """The number of a cube along an axis; 0 for NaN."""
    u = u if u > 0.0 else 0.0
    return int(u if u < count - 1.0 else count - 1.0)


@njit(**FLAGS)
def triangles_cube(P, k, x, y, z):
    """The cube of the coarse grid around a point, or one that is near, and how far the point is from its middle."""
    row = k * ROW
    size = P[row + CUBE]
    u, v, w = (x - P[row + CUBES]) * size, (y - P[row + CUBES + 1]) * size, (z - P[row + CUBES + 2]) * size
    nx, ny, nz = P[row + ALONG], P[row + ALONG + 1], P[row + ALONG + 2]
    i, j, k = cube_along(u, nx), cube_along(v, ny), cube_along(w, nz)
    away = length3(u - i - 0.5, v - j - 0.5, w - k - 0.5) / size
    return (i * int(ny) + j) * int(nz) + k, away


@njit(**FLAGS)
def triangles_apart(P, k, x, y, z):
    """A lower bound of the distance for places beyond the coarse grid; for others not above 0."""
    row = k * ROW
    size = P[row + CUBE]
    u, v, w = (x - P[row + CUBES]) * size, (y - P[row + CUBES + 1]) * size, (z - P[row + CUBES + 2]) * size
    beyond = max(max(-u, u - P[row + ALONG]), max(-v, v - P[row + ALONG + 1]))
    beyond = max(beyond, max(-w, w - P[row + ALONG + 2]))
    return P[row + RIM] + beyond / size if beyond > 0.0 else 0.0


@njit(**FLAGS)
def triangles_bound(P, k, x, y, z):
    """The same for all places, at once; below 0 deep in a solid."""
    apart = triangles_apart(P, k, x, y, z)
    if apart > 0.0:
        return apart
    cube, away = triangles_cube(P, k, x, y, z)
    return P[int(P[k * ROW + DATA]) + int(P[k * ROW + BOUNDS]) + cube] - away


@njit(**FLAGS)
def triangles_look(P, C, m, k, x, y, z):
    """Signed distance and normal: Triangulated.look.

    From m on, C remembers the last search: where that was, which triangles were near (the first `LISTED` of them), and
    how far all others were at least. Where they cannot be the nearest here either, only those that were near are asked.
    """
    row = k * ROW
    boxes = int(P[row + DATA])
    triangles = boxes + int(P[row + TRIANGLES])
    slack = SLACK * (P[row + EXTENT] + abs(x) + abs(y) + abs(z))
    moved = length3(x - C[m + SEARCHED], y - C[m + SEARCHED + 1], z - C[m + SEARCHED + 2]) + slack
    if not moved < C[m + OTHERS]:
        cube, _ = triangles_cube(P, k, x, y, z)
        C[m + LISTED], C[m + LIST] = 1.0, P[boxes + int(P[row + HINTS]) + cube]
        C[m + OTHERS] = C[m + LEAST] = 0.0
    which = -1
    square = qx = qy = qz = feature = 0.0
    far = np.inf
    for j in range(int(C[m + LISTED])):
        if C[m + LEAST + j] - moved > far:
            continue
        i = int(C[m + LIST + j])
        at = triangles + TRIANGLE * i
        other, ax, ay, az, f = triangle_of(P, at, x - P[at], y - P[at + 1], z - P[at + 2])
        if which < 0 or other < square or (other == square and i < which):
            square, qx, qy, qz, feature, which = other, ax, ay, az, f, i
            far = np.sqrt(square)
    if not far + moved < C[m + OTHERS]:
        square, qx, qy, qz, feature, which = triangles_search(P, C, m, k, x, y, z, square, qx, qy, qz, feature, which)
    at = boxes + int(P[row + NORMALS]) + 3 * (FEATURES * which + int(feature))
    return outcome_of(P, row, qx, qy, qz, square, feature, P[at], P[at + 1], P[at + 2])


@njit(**FLAGS)
def triangles_search(P, C, m, k, x, y, z, square, qx, qy, qz, feature, which):
    """The nearest triangle, beginning with one that may be; C remembers what else is near."""
    row = k * ROW
    boxes = int(P[row + DATA])
    triangles = boxes + int(P[row + TRIANGLES])
    count, leaves = int(P[row + COUNT]), int(P[row + LEAVES])
    slack = SLACK * (P[row + EXTENT] + abs(x) + abs(y) + abs(z))
    reserve = slack + RESERVE * np.sqrt(P[triangles + TRIANGLE * which + LONG])
    far = np.sqrt(square) + reserve
    listed, dropped = 1, np.inf
    node = 1
    while node > 0:
        b = boxes + 6 * node
        ux = max(max(P[b] - x, x - P[b + 3]), 0.0)
        uy = max(max(P[b + 1] - y, y - P[b + 4]), 0.0)
        uz = max(max(P[b + 2] - z, z - P[b + 5]), 0.0)
        if ux * ux + uy * uy + uz * uz <= far * far:
            if node < leaves:
                node = 2 * node
                continue
            leaf = node - leaves
            for i in range(leaf * count // leaves, (leaf + 1) * count // leaves):
                at = triangles + TRIANGLE * i
                px, py, pz = x - P[at], y - P[at + 1], z - P[at + 2]
                if i != which and abs(dot3(P[at + 9], P[at + 10], P[at + 11], px, py, pz)) <= far:
                    other, ax, ay, az, f = triangle_of(P, at, px, py, pz)
                    farther, beaten = other, i
                    if other < square or (other == square and i < which):
                        farther, beaten = square, which
                        square, qx, qy, qz, feature, which = other, ax, ay, az, f, i
                        far = np.sqrt(square) + reserve
                    if farther <= far * far:
                        if listed < MOST_LISTED:
                            C[m + LIST + listed], C[m + LEAST + listed] = beaten, np.sqrt(farther)
                            listed += 1
                        else:
                            dropped = min(dropped, farther)
        while node & 1:  # the nodes above, of which this is the last part
            node >>= 1
        if node > 0:
            node += 1
    C[m + SEARCHED], C[m + SEARCHED + 1], C[m + SEARCHED + 2] = x, y, z
    C[m + LIST], C[m + LEAST], C[m + LISTED] = which, 0.0, listed
    C[m + OTHERS] = min(np.sqrt(dropped), far) - slack
    return square, qx, qy, qz, feature, which
