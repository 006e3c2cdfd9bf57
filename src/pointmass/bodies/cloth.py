"""A rectangular cloth of springs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.body import Body, body
from pointmass.bodies.materials import Material, made_of
from pointmass.bodies.sheet import Ids, Sheet, sheet
from pointmass.errors import InvalidInput, number
from pointmass.forces.springs import Springs
from pointmass.particles import Particles

WEIGHT = 9.81  # of 1 kg [N], under which the bending length is meant
THICKNESS = 0.25  # radius of a particle, in cells


@body
def cloth(
    rows: int = 32,
    cols: int = 32,
    size: Any = 1.0,
    *,
    center: Any = (0.0, 0.0, 0.0),
    right: Any = (1.0, 0.0, 0.0),
    down: Any = (0.0, -1.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    material: str = "cotton",
    density: float | None = None,
    stretch: float | None = None,
    shear: float | None = None,
    bend: float | None = None,
    damping_ratio: float | None = None,
    radius: float | None = None,
    pinned: Any = "none",
) -> Body:
    """A grid of masses with springs to their neighbours ("stretch"), across cells ("shear") and two steps on ("bend").

    Sheets of one material hang alike whatever their rows and cols. A mass has the area around it: half a cell at an
    edge, a quarter at a corner; so has what pulls along an edge.

    Parameters
    ----------
    rows, cols : particles along the height and the width, each at least 2.
    size : width and height [m]; one number for a square.
    center : of the sheet [m].
    right, down : directions of its rows and of its columns; (1, 0, 0) and (0, 0, 1) for a sheet that lies.
    velocity : at the start [m/s].
    material : cotton, silk, denim, leather or rubber, which has the values that are not given below.
    density : mass of an area [kg/m^2].
    stretch : tension along the threads for each unit of strain [N/m], that is newtons for each metre of width.
    shear : likewise of a shear strain [N/m].
    bend : bending stiffness B [N m], at the curvature 1/c with which it hangs over an edge (see below).
    damping_ratio : of one spring between two of the masses, 1 = critical.
    radius : of a particle [m], its distance from what it lies on; a quarter of a cell by default.
    pinned : what is held: "top corners", "top edge", "left edge", "corners", "edges", ..., a list of such names, or
        "none". Particles have groups of these names.

    Raises
    ------
    InvalidInput
        A number that is not allowed, an unknown material or name of a part.

    Notes
    -----
    The families are those of the lecture (Provot 1995: structural, shear and flexion springs). In cells of dx x dy a
    diagonal of length d has the stiffness `shear` d^2 / (2 dx dy), which is `shear` in a square cell. Diagonals stretch
    too: what they bear along the threads is left out of the stretch springs, whose stiffness along x is stretch dy/dx -
    shear dx/dy. So the strains of the sheet have the energy (stretch exx^2 + stretch eyy^2 + 2 shear exx eyy + shear
    gamma^2)/2 on each unit of area, in cells of any form; stretch = 3 shear is a material with no grain.

    A spring over two steps bends a straight row with no force at first: its chord is shorter by dx^3 k^2 / 4 at a
    curvature k, so the energy of an area goes with k^4. It is the energy B k^2 / 2 of a sheet of stiffness B where k =
    1/c, if the spring has 16 B c^2 dy / dx^5; c = (B / (density 9.81 m/s^2))^(1/3) is the bending length of Peirce
    (J. Textile Inst. 21 (1930), T377), the radius at which a strip bends under its weight. Where that were stiffer than
    the stretch spring below it, it is as stiff as that: cells far smaller than c bend more softly.
    """
    grid = sheet(rows, cols, size)
    made = made_of(material, density=density, stretch=stretch, shear=shear, bend=bend, damping_ratio=damping_ratio)
    dx, dy = grid.cell
    m = made.density * dx * dy
    thick = THICKNESS * min(dx, dy) if radius is None else number("radius", radius, at_least=0, unit="m")
    particles = Particles(grid.places(center, right, down), velocity, m * grid.share.ravel(), thick)
    grid.tag(particles, pinned)
    corners = grid.triangles
    particles.cover("cloth", corners, grid.uv[corners])
    forces = [_springs(grid, family, parts, m, made.damping_ratio) for family, parts in _families(grid, made).items()]
    return Body(particles, [springs for springs in forces if springs is not None])


@dataclass(frozen=True)
class _Family:
    """Springs in one direction.

    Attributes
    ----------
    pairs : points at the ends, shape (k, 2).
    stiffness : of one inside of the sheet [N/m].
    share : of it that each has: 1, or a half along an edge, where it belongs to half a cell, shape (k,).
    """

    pairs: Ids
    stiffness: float
    share: NDArray[np.float64]


def _families(grid: Sheet, made: Material) -> dict[str, list[_Family]]:
    dx, dy = grid.cell
    along, across = made.stretch * dy / dx - made.shear * dx / dy, made.stretch * dx / dy - made.shear * dy / dx
    if min(along, across) <= 0:
        raise InvalidInput(
            f"shear = {made.shear} is not allowed in cells of {dx:.3g} m x {dy:.3g} m: it must be below "
            f"{made.stretch * min(dx / dy, dy / dx) ** 2:.4g} [N/m]; choose rows and cols for squarer cells"
        )
    diagonal = made.shear * (dx * dx + dy * dy) / (2 * dx * dy)
    length = (made.bend / (made.density * WEIGHT)) ** (1 / 3)
    bend_along = min(16 * made.bend * length**2 * dy / dx**5, along)
    bend_across = min(16 * made.bend * length**2 * dx / dy**5, across)
    return {
        "stretch": [_straight(grid, 0, 1, along), _straight(grid, 1, 0, across)],
        "shear": [_Family(p, diagonal, np.ones(len(p))) for p in (grid.pairs(1, 1), grid.pairs(1, -1))],
        "bend": [_straight(grid, 0, 2, bend_along), _straight(grid, 2, 0, bend_across)],
    }


def _straight(grid: Sheet, down: int, right: int, stiffness: float) -> _Family:
    """Springs along the rows or along the columns."""
    pairs = grid.pairs(down, right)
    row, column = np.divmod(pairs[:, 0], grid.cols)
    at_edge = np.isin(column, (0, grid.cols - 1)) if down else np.isin(row, (0, grid.rows - 1))
    return _Family(pairs, stiffness, np.where(at_edge, 0.5, 1.0))


def _springs(grid: Sheet, family: str, parts: list[_Family], m: float, damping_ratio: float) -> Springs | None:
    """All springs of a family, at rest in the flat sheet; None if there are none."""
    pairs = np.concatenate([part.pairs for part in parts])
    k_s = np.concatenate([part.stiffness * part.share for part in parts])
    k_d = np.concatenate([2 * damping_ratio * math.sqrt(part.stiffness * m / 2) * part.share for part in parts])
    if not k_s.any():
        return None
    row, column = np.divmod(pairs, grid.cols)
    (dx, dy), steps, down = grid.cell, np.diff(column, axis=1)[:, 0], np.diff(row, axis=1)[:, 0]
    return Springs(pairs, k_s, k_d, np.hypot(dx * steps, dy * down), family=family)
