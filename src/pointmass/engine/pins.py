"""Pins that move, in kernels: in each step they are put where the solver sees them, by maps from the shell.

Which particle is led by which motion, and the arms, are columns or lists; the maps of a span's steps are one small
array. The operations are those of `motions.Motions.put`, in order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.binding import Table
from pointmass.motions import Motions
from pointmass.particles import Particles

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]
AXES = "xyz"
PIN_LISTS = ("pin_first", "pins", "pin_motion", "arms")
MAP = 24  # numbers of a motion in a step: two 3x4 matrices, for x and for v


def maps(motions: Motions, times: Sequence[float], dtype: Any) -> Array:
    """The maps of some steps between times [s], flat.

    Raises
    ------
    InvalidInput
        A formula is not finite in one of the steps.
    """
    grid = np.array(times)
    return motions.seen(grid[:-1], grid[1:]).astype(dtype).ravel()


def columns(motions: Motions, particles: Particles) -> dict[str, Callable[[], Array]]:
    """Columns of the particles: the number of the motion, from 1 on, or 0; and arms."""
    return {
        name: lambda k=k: motions.led(particles).columns[k]  # type: ignore[misc]
        for k, name in enumerate(("led", *(f"arm {a}" for a in AXES)))
    }


def put(motions: Motions, particles: Particles, table: Table, index: str, places: Mapping[str, str]) -> list[str]:
    """Statements that put one lane where it has to be, if it is led; the maps of the step begin at `o` in pin_maps.

    Parameters
    ----------
    table : has the `columns`.
    places : where the regions X x, ..., V z are, and X0 x, ... where the solver begins from these.
    """
    which, *arms = (table.column(name, get, index) for name, get in columns(motions, particles).items())
    lines = [f"which = {which}", *(f"arm_{a} = {entry}" for a, entry in zip(AXES, arms, strict=True))]
    for k in range(len(motions.motions)):
        for q, quantity in enumerate("XV"):
            for r, axis in enumerate(AXES):
                m = [f"pin_maps[o + {MAP * k + 12 * q + 4 * r + c}]" for c in range(4)]
                lines.append(f"there = arm_x * {m[0]} + arm_y * {m[1]} + arm_z * {m[2]} + {m[3]}")
                for name, place in places.items():
                    if name in (f"{quantity} {axis}", f"{quantity}0 {axis}"):
                        lines.append(f"{place} = select(which == R({k + 1}), there, {place})")
    return lines


def pin_lists(motions: Motions, particles: Particles, place: Rows, first: NDArray[np.int64]) -> list[NDArray[Any]]:
    """Who is led in each of some islands: the arrays `PIN_LISTS`.

    Parameters
    ----------
    place : row in the group of each particle, or -1.
    first : first row of each island, and the end.
    """
    led = motions.led(particles)
    mine = np.flatnonzero(place[led.rows] >= 0)
    mine = mine[np.argsort(place[led.rows[mine]], kind="stable")]
    rows = place[led.rows[mine]].astype(np.int64)
    arms = led.arms[mine].astype(particles.dtype).ravel()
    return [np.searchsorted(rows, first).astype(np.int64), rows, led.motion[mine].astype(np.int64), arms]


def lead_lines(motions: int, arrays: Sequence[tuple[str, str]]) -> list[str]:
    """Statements that put those of an island where they have to be in step `s` of the span.

    Parameters
    ----------
    arrays : pairs of those that are to hold places and velocities.
    """
    row = " + ".join(f"arms[3 * j + {c}] * pin_maps[o + {{0}} + {c}]" for c in range(3)) + " + pin_maps[o + {0} + 3]"
    puts = [
        f"    {array}[3 * (pins[j] - base) + {axis}] = {row.replace('{0}', str(12 * q + 4 * axis))}"
        for pair in arrays
        for q, array in enumerate(pair)
        for axis in range(3)
    ]
    head = "for j in range(pin_first[island], pin_first[island + 1]):"
    return [head, f"    o = {MAP} * ({motions} * s + pin_motion[j])", *puts]
