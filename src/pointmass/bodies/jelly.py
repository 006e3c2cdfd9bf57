"""A block of jelly: an elastic solid of springs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.bodies.block import Block, Ids, Step, block
from pointmass.bodies.body import Body, body, pin_parts
from pointmass.errors import InvalidInput, number
from pointmass.forces.bulk import Bulk
from pointmass.forces.springs import Springs
from pointmass.particles import Particles

ACROSS = 0.5  # of the resistance to shear that body diagonals have, the rest is that of the diagonals of faces
SPRINGY = 0.25  # Poisson's ratio of springs alone
FAMILIES = {"stretch": 1, "shear": 2, "volume": 3}  # steps between the ends: along an edge, a face, the body
# Corners of the five tetrahedra in a cell, one in the middle and four cut off; in every other cell they are mirrored,
# so that neighbours cut the face between them along the same diagonal.
MIDDLE = ((0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1))
CUT_OFF = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1))


@body
def jelly(
    counts: Any = (7, 7, 7),
    size: Any = (0.3, 0.3, 0.3),
    *,
    center: Any = (0.0, 0.0, 0.0),
    velocity: Any = (0.0, 0.0, 0.0),
    tilt: float = 0.0,
    stiffness: float = 3e4,
    poisson: float = 0.35,
    viscosity: float = 100.0,
    density: float = 1000.0,
    radius: float = 0.0,
    pinned: Any = "none",
) -> Body:
    """An elastic block: springs along edges ("stretch"), face diagonals ("shear") and body diagonals ("volume") of its
    cells, and tetrahedra in them that keep their volumes (`Bulk`).

    Blocks of one material sag and swing alike whatever their counts. A mass has the volume around it: half a cell on a
    face, a quarter at an edge, an eighth at a corner; so has a spring. Its surface is drawn in place of its particles.

    Parameters
    ----------
    counts : particles along x, y and z, each at least 2, such that the cells are nearly cubes.
    size : of the block [m].
    center, velocity : [m], [m/s].
    tilt : turn about z and then about x by this angle [degrees], so that it lands on a corner.
    stiffness : Young's modulus E [Pa]; of gelatine some 1e4, of soft rubber 1e6.
    poisson : Poisson's ratio, from 0.25 to 0.49: how much narrower it becomes for each unit of stretch. Near the upper
        end coarse blocks are too firm, as few volumes leave few ways to move; at 0.25 nothing holds the volume.
    viscosity : stress for each unit of strain in a second, in addition [Pa s].
    density : [kg/m^3].
    radius : of a particle [m], its distance from what it lies on.
    pinned : what is held: "bottom", "top", "left", "right", "front", "back", "top corners", "bottom corners",
        "corners", a list of such names, or "none". Particles have groups of these names, and "surface".

    Raises
    ------
    InvalidInput
        A number that is not allowed, cells that are far from cubes, an unknown name of a part.

    Notes
    -----
    Springs of stiffness k and length l in directions n have the moduli C_ijkl = sum k l^2 n_i n_j n_k n_l / V of a cell
    of volume V = dx dy dz (Born & Huang, Dynamical Theory of Crystal Lattices, 1954). With mu = E / (2 (1 + poisson)),
    an edge along x has k = mu V (3/dx^2 - 1/dy^2 - 1/dz^2 + dx^2/(2 g)), a diagonal across x and y has
    k = mu V (1 - dx^2 dy^2/(2 g)) (dx^2 + dy^2)/(2 dx^2 dy^2), a body diagonal k = mu V (dx^2 + dy^2 + dz^2)/(8 g),
    where g is the largest of dx^2 dy^2, dy^2 dz^2 and dz^2 dx^2: the solid is then isotropic, with Lame's constants
    lambda = mu, that is a Poisson's ratio of 1/4, the only one that springs can have (Cauchy). What lambda is above mu
    the volumes add, with k = (lambda - mu) / rest each (`Bulk`): they keep a block from collapsing, and from turning
    inside out, which springs would not notice. Squeezed tetrahedra are stiffer, up to 469 times at a fifth of their
    volume, and explicit steps must suit that. Damping is that of Kelvin and Voigt: k_d / k_s = viscosity / E
    throughout, so that a motion of frequency w has the damping ratio w viscosity / (2 E).
    """
    grid = block(counts, size)
    young = number("stiffness", stiffness, above=0, unit="Pa")
    ratio = number("poisson", poisson, at_least=SPRINGY, at_most=0.49)
    delay = number("viscosity", viscosity, at_least=0, unit="Pa s") / young
    m = number("density", density, above=0, unit="kg/m^3") * float(np.prod(grid.cell)) * grid.share
    particles = Particles(grid.places(center, tilt), velocity, m, number("radius", radius, at_least=0, unit="m"))
    for name, rows in grid.parts.items():
        particles.tag(name, rows)
    pin_parts(particles, pinned)
    particles.cover("jelly", *grid.triangles, inside=np.setdiff1d(grid.number, grid.parts["surface"]))
    mu = young / (2 * (1 + ratio))
    forces: list[Any] = [_springs(grid, family, steps, mu, delay) for family, steps in FAMILIES.items()]
    if ratio > SPRINGY:
        tetrahedra = _tetrahedra(grid)
        rest = Bulk.at(grid.straight[tetrahedra])
        k = (2 * mu * ratio / (1 - 2 * ratio) - mu) / rest
        forces.append(Bulk(tetrahedra, k, delay * k, rest))
    return Body(particles, forces)


def _springs(grid: Block, family: str, steps: int, mu: float, delay: float) -> Springs:
    """Springs over so many steps along axes."""
    parts = []
    for step in grid.steps(steps):
        pairs, share = grid.pairs(step)
        length = float(np.linalg.norm(step * grid.cell))
        parts.append((pairs, _stiffness(grid, step, mu) * share, np.full(len(pairs), length)))
    pairs, k_s, rest = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Springs(pairs, k_s, delay * k_s, rest, family=family)


def _stiffness(grid: Block, step: Step, mu: float) -> float:
    """Of a spring inside of the block [N/m]."""
    squares = grid.cell**2
    volume = float(np.prod(grid.cell))
    across = max(squares[0] * squares[1], squares[1] * squares[2], squares[2] * squares[0])
    along = squares[np.array(step) != 0]
    if len(along) == 3:
        return float(0.25 * ACROSS * mu * volume * squares.sum() / across)
    if len(along) == 2:
        return float(mu * volume * (1 - ACROSS * along.prod() / across) * along.sum() / (2 * along.prod()))
    k = float(mu * volume * (4 / along[0] - (1 / squares).sum() + ACROSS * along[0] / across))
    if k <= 0:
        cell = " x ".join(f"{side:.3g}" for side in grid.cell)
        raise InvalidInput(f"counts = {grid.counts} is not allowed: its cells of {cell} m must be nearly cubes")
    return k


def _tetrahedra(grid: Block) -> Ids:
    """Five of each cell, which wind like right-handed screws, shape (k, 4)."""
    first = grid.grid[(grid.grid < np.array(grid.counts) - 1).all(axis=1)]
    odd = first.sum(axis=1) % 2
    found = [_corners(grid, first, odd, MIDDLE)]
    for corner in CUT_OFF:
        near = [other for other in MIDDLE if np.abs(np.subtract(corner, other)).sum() == 1]
        found.append(_corners(grid, first, odd, (corner, *near)))
    tetrahedra = np.stack(found, axis=1).reshape(-1, 4)
    left = Bulk.at(grid.straight[tetrahedra]) < 0
    tetrahedra[left] = tetrahedra[left][:, [0, 1, 3, 2]]
    return tetrahedra


def _corners(grid: Block, first: Ids, odd: NDArray[np.int64], corners: tuple[Step, ...]) -> Ids:
    """Particles at corners of cells, mirrored in x where they are odd, shape (k, 4)."""
    result = []
    for corner in corners:
        x = np.where(odd, 1 - corner[0], corner[0])
        result.append(grid.number[first[:, 0] + x, first[:, 1] + corner[1], first[:, 2] + corner[2]])
    return np.stack(result, axis=1)
