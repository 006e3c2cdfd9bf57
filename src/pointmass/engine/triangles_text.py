"""The nearest triangle of a mesh to one point, in scalars: the text of kernels, not a module to import.

`lookups` puts constants and laws before it: `triangle_of` and `outcome_of`, and names for the numbers of a surface's
row. It finds what `collisions.triangles` finds, in another way: the tree of boxes is walked without a stack, from a
bound that the cube around the point gives.
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
    """The cube of the coarse grid around a point, or that which is nearest to it."""
    row = k * ROW
    size = P[row + CUBE]
    u, v, w = (x - P[row + CUBES]) * size, (y - P[row + CUBES + 1]) * size, (z - P[row + CUBES + 2]) * size
    nx, ny, nz = P[row + ALONG], P[row + ALONG + 1], P[row + ALONG + 2]
    return (cube_along(u, nx) * int(ny) + cube_along(v, ny)) * int(nz) + cube_along(w, nz)


@njit(**FLAGS)
def triangles_bound(P, k, x, y, z):
    """A lower bound of the distance, at once; below 0 where there is none."""
    row = k * ROW
    size = P[row + CUBE]
    u, v, w = (x - P[row + CUBES]) * size, (y - P[row + CUBES + 1]) * size, (z - P[row + CUBES + 2]) * size
    u = max(max(-u, u - P[row + ALONG]), 0.0) / size  # beyond the grid
    v = max(max(-v, v - P[row + ALONG + 1]), 0.0) / size
    w = max(max(-w, w - P[row + ALONG + 2]), 0.0) / size
    least = P[int(P[row + DATA]) + int(P[row + BOUNDS]) + triangles_cube(P, k, x, y, z)]
    most = max(max(u, v), w)
    return least if most == 0.0 else max(least - length3(u, v, w), P[row + RIM] + most)


@njit(**FLAGS)
def triangles_look(P, k, x, y, z, guess):
    """Signed distance and normal: Triangulated.look. And the triangle; `guess` is one that may be near."""
    row = k * ROW
    boxes = int(P[row + DATA])
    triangles, normals = boxes + int(P[row + TRIANGLES]), boxes + int(P[row + NORMALS])
    count, leaves = int(P[row + COUNT]), int(P[row + LEAVES])
    cube = triangles_cube(P, k, x, y, z)
    which = int(P[boxes + int(P[row + HINTS]) + cube])
    at = triangles + TRIANGLE * which
    square, qx, qy, qz, feature = triangle_of(P, at, x - P[at], y - P[at + 1], z - P[at + 2])
    at = triangles + TRIANGLE * guess
    other, ax, ay, az, f = triangle_of(P, at, x - P[at], y - P[at + 1], z - P[at + 2])
    if other < square or (other == square and guess < which):
        square, qx, qy, qz, feature, which = other, ax, ay, az, f, guess
    slack = SLACK * (P[row + EXTENT] + abs(x) + abs(y) + abs(z))
    far = np.sqrt(square) + slack
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
                if abs(dot3(P[at + 9], P[at + 10], P[at + 11], px, py, pz)) <= far:
                    other, ax, ay, az, f = triangle_of(P, at, px, py, pz)
                    if other < square or (other == square and i < which):
                        square, qx, qy, qz, feature, which = other, ax, ay, az, f, i
                        far = np.sqrt(square) + slack
        while node & 1:  # the nodes above, of which this is the last part
            node >>= 1
        if node > 0:
            node += 1
    at = normals + 3 * (FEATURES * which + int(feature))
    gap, nx, ny, nz = outcome_of(P, row, qx, qy, qz, square, feature, P[at], P[at + 1], P[at + 2])
    return gap, nx, ny, nz, which
