"""The distance in a grid of them at one point, in scalars: the text of kernels, not a module to import.

`lookups` puts the laws before it: `cell_of` and `distance_of`, and names for the numbers of a surface's row.
"""
# ruff: noqa: F821
# mypy: ignore-errors

from numba import njit

# --- printed from here on


@njit(**FLAGS)
def distances_look(P, k, x, y, z):
    """Signed distance and normal: DistanceGrid.look."""
    row = k * ROW
    x, y, z = x - P[row + ORIGIN], y - P[row + ORIGIN + 1], z - P[row + ORIGIN + 2]
    first, second, third, u, v, w = cell_of(P, row, x, y, z)
    along = int(P[row + COUNTS + 2])
    across = along * int(P[row + COUNTS + 1])
    at = int(P[row + DATA]) + int(first) * across + int(second) * along + int(third)
    return distance_of(P, row, at, across, along, x, y, z, u, v, w)


@njit(**FLAGS)
def distances_apart(P, k, x, y, z):
    """A lower bound of the way to the surface for places beyond the grid; for others not above 0."""
    row = k * ROW
    x, y, z = x - P[row + ORIGIN], y - P[row + ORIGIN + 1], z - P[row + ORIGIN + 2]
    beyond = max(max(-x, x - P[row + REACH]), max(-y, y - P[row + REACH + 1]))
    beyond = max(beyond, max(-z, z - P[row + REACH + 2]))
    return beyond / P[row + STEEP] if P[row + FREE] > 0.0 else 0.0


@njit(**FLAGS)
def distances_bound(P, k, x, y, z):
    """The same for all places."""
    gap, _, _, _ = distances_look(P, k, x, y, z)
    return gap / P[k * ROW + STEEP]
