"""Prints the look-up in a grid for one place: the operations of `GridLookup.columns`, in the same order.

The shape of a grid, its place and what holds outside of it are data.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.printing import indented
from pointmass.laws.grid import Grid, GridLookup

OUTSIDE = {"zero": 0, "clamp": 1, "wrap": 2}
SPACING = 3  # entry of the numbers of a grid where the spacings begin
ALONG = '''@njit(**FLAGS)
def along(x, origin, step, count, outside, order):
    """The neighbours of a place along an axis of a grid, and their weights."""
    if count == 1:
        return 0, 0, (R(1) if order == 0 else R(0)), R(0)
    place = (x - origin) / step
    last = count - 1
    there = R(1)
    if outside == 2:
        place = place - R(count) * np.floor(place / R(count))
        last = count
    else:
        within = place >= R(0) and place <= R(last)
        if outside == 0:
            there = R(0) if place < R(0) or place > R(last) else R(1)
        elif order > 0:
            there = R(1) if within else R(0)
        place = R(0) if place < R(0) else (R(last) if place > R(last) else place)
    below = np.floor(place)
    below = R(0) if not below >= R(0) else (R(last - 1) if below > R(last - 1) else below)
    low = int(below)
    a, b = weights(place - below, there, step, order)
    return low, (low + 1) % count, a, b


@njit(**FLAGS)
def weights(part, there, step, order):
    """Weights of two neighbours in the value, in its slope, and in its second derivative, which is 0."""
    if order == 0:
        return (R(1) - part) * there, part * there
    slope = there / step if order == 1 else R(0) * there
    return -slope, slope


@njit(**FLAGS)
def in_time(t, H, count, order):
    """The snapshots before and after a time, and their weights."""
    if count == 1:
        return 0, 0, (R(1) if order == 0 else R(0)), R(0)
    first, final = H[6], H[6 + count - 1]
    there = R(1) if order == 0 or (t >= first and t <= final) else R(0)
    low = 0
    while low < count - 2 and not t < H[6 + low + 1]:
        low += 1
    if not t == t:
        low = count - 2
    step = H[6 + low + 1] - H[6 + low]
    inside = first if t < first else (final if t > final else t)
    a, b = weights((inside - H[6 + low]) / step, there, step, order)
    return low, low + 1, a, b


'''


def numbers(grid: Grid, dtype: Any) -> NDArray[Any]:
    """Origin, spacing and times of a grid."""
    return np.concatenate([grid.origin, grid.spacing, grid.times]).astype(dtype)


def shape(grid: Grid) -> NDArray[np.int64]:
    """Snapshots, points along each axis, numbers at a point, and what holds outside."""
    return np.array([*grid.values.shape, OUTSIDE[grid.outside]], np.int64)


def look_up(lookup: GridLookup, name: str) -> str:
    """The function `name(x, y, z, t, G, H, N)` of a look-up: values, numbers and shape of the grid."""
    axes = [
        f"{index}0, {index}1, {axis}0, {axis}1 = along({axis}, H[{k}], H[{SPACING + k}], N[{k + 1}], N[5], "
        f"{lookup.orders[k]})"
        for k, (axis, index) in enumerate(zip("xyz", "abc", strict=True))
    ]
    sums = []
    for corner in product("01", repeat=4):
        weight = " * ".join(f"{axis}{side}" for axis, side in zip("txyz", corner, strict=True))
        j, a, b, c = (f"{index}{side}" for index, side in zip("jabc", corner, strict=True))
        point = f"(({j} * N[1] + {a}) * N[2] + {b}) * N[3] + {c}"
        add = f"total = total + {weight} * G[({point}) * N[4] + {lookup.component}]"
        # An axis of one point has one neighbour: the other does not count, not even as 0 times a number.
        there = " and ".join(f"N[{k}] > 1" for k, side in enumerate(corner) if side == "1")
        sums += [f"if {there}:", f"    {add}"] if there else [add]
    body = [f"j0, j1, t0, t1 = in_time(t, H, N[0], {lookup.orders[3]})", *axes, "total = R(0)", *sums, "return total"]
    return "\n".join(["@njit(**FLAGS)", f"def {name}(x, y, z, t, G, H, N):", *indented(body, 1), "", "", ""])
