"""Cloth by explicit steps: stretch, shear and bend springs, on a lattice and on an irregular mesh."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.track import Race
from benchmarks.workloads import springs
from benchmarks.workloads.springs import Springs

TITLE = "Cloth, explicit steps"
COST = "Cloth, explicit steps: cost over size"
SUBSTEPS = 64
STIFFNESS = 0.05  # k_s dt^2 / m: a quarter of what a lattice of 12 springs to a particle can bear
DAMPING = 0.005  # k_d dt / m
RUFFLE = 0.01  # of the spacing, by which each particle is away from its place at first
FAMILIES = ((0, 1), (1, 0), (1, 1), (1, -1), (0, 2), (2, 0))


def races(quick: bool) -> list[Race]:
    """A lattice, an irregular mesh of as many particles, and the cost from 64 x 64 to 1024 x 1024."""
    side = 32 if quick else 256
    lattice = [
        springs.Pointmass,
        springs.TaichiScatter,
        springs.TaichiGather,
        springs.TaichiLattice,
        springs.WarpScatter,
        springs.WarpGather,
        springs.JAX,
        springs.NumPy,
        springs.C,
    ]
    mesh = [kind for kind in lattice if kind is not springs.TaichiLattice]
    result = [
        _race(TITLE, f"lattice, {side} x {side}", partial(cloth, side), lattice),
        _race(TITLE, f"irregular mesh, {side * side:,} particles", partial(irregular, side), mesh),
    ]
    for size in (16, 32) if quick else (64, 128, 256, 512, 1024):
        result.append(_race(COST, f"{size} x {size}", partial(cloth, size), [springs.Pointmass]))
    return result


def _race(title: str, case: str, make: Any, contestants: Any) -> Race:
    p = make()
    work = float(p.substeps * len(p.pairs))
    traffic = 48 * len(p.x) / work  # the state once a frame
    return Race(title, case, make, contestants, springs.judge, "spring-steps", work, len(p.x), springs.SLOTS, traffic)


def cloth(side: int) -> Springs:
    """A square of 1 m and 1 kg, hung up at two corners, with neighbours, diagonals and neighbours but one joined."""
    at = np.arange(side * side).reshape(side, side)
    families, rest = [], []
    for down, right in FAMILIES:
        ends = at[: side - down, : side - abs(right)], at[down:, abs(right) :]
        if right < 0:
            ends = at[: side - down, -right:], at[down:, :right]
        families.append(np.stack([end.ravel() for end in ends], axis=1).astype(np.int32))
        rest.append(np.full(len(families[-1]), np.hypot(down, right) / (side - 1)))
    row, column = np.divmod(np.arange(side * side), side)
    flat = np.stack([column, np.zeros(side * side), row], axis=1) / (side - 1)
    return _hung(flat, side, families, rest, FAMILIES)


def irregular(side: int) -> Springs:
    """As many particles scattered over the square: springs along the edges of their triangulation, and across them."""
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(2)
    row, column = np.divmod(np.arange(side * side), side)
    flat = np.stack([column, row], axis=1) + rng.uniform(-0.3, 0.3, (side * side, 2))
    corners = Delaunay(flat).simplices
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    opposite = np.concatenate([corners[:, 2], corners[:, 0], corners[:, 1]])
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, opposite = edges[order], opposite[order]
    twin = np.flatnonzero((edges[:-1] == edges[1:]).all(axis=1))
    across = np.stack([opposite[twin], opposite[twin + 1]], axis=1)
    families = [np.unique(edges, axis=0).astype(np.int32), across.astype(np.int32)]
    x = np.insert(flat, 1, 0.0, axis=1) / (side - 1)
    rest = [np.linalg.norm(x[a[:, 0]] - x[a[:, 1]], axis=1) for a in families]
    return _hung(x, side, families, rest, ())


def _hung(x: Any, side: int, families: Any, rest: Any, offsets: Any) -> Springs:
    n, dt = side * side, 1 / 60 / SUBSTEPS
    x = x + np.random.default_rng(0).normal(0.0, RUFFLE / (side - 1), x.shape)
    return Springs(
        x=x.astype(np.float32),
        families=tuple(families),
        rest=tuple(r.astype(np.float32) for r in rest),
        pinned=np.array([0, side - 1]),
        mass=1 / n,
        k_s=STIFFNESS / n / dt**2,
        k_d=DAMPING / n / dt,
        dt=dt,
        substeps=SUBSTEPS,
        offsets=tuple(offsets),
    )
