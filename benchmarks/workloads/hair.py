"""Hair: many equal strands, each a chain of masses with springs to the next mass and to the next but one."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from benchmarks.track import Array, Race
from benchmarks.workloads import springs
from benchmarks.workloads.springs import Springs

TITLE = "Hair"
MASSES = 16  # of a strand
LINK = 0.01  # [m]
STIFFNESS = 0.1  # k_s dt^2 / m
DAMPING = 0.01  # k_d dt / m
SUBSTEPS = 16


def races(quick: bool) -> list[Race]:
    """Ten thousand strands."""
    strands = 100 if quick else 10_000
    make = partial(hair, strands)
    work = float(SUBSTEPS * strands * (2 * MASSES - 3))
    particles = strands * MASSES
    traffic = 48 * particles / work
    case = f"{strands:,} strands of {MASSES} masses"
    return [
        Race(TITLE, case, make, CONTESTANTS, springs.judge, "spring-steps", work, particles, springs.SLOTS, traffic)
    ]


def hair(strands: int) -> Springs:
    """Strands that stick out of a wall, held at their roots; near the origin, so that float32 can tell places apart."""
    dt, mass = 1 / 60 / SUBSTEPS, 1e-3
    at = np.arange(strands * MASSES).reshape(strands, MASSES)
    x = np.zeros((strands, MASSES, 3))
    x[..., 0] = LINK * np.arange(MASSES)
    row, column = np.divmod(np.arange(strands), max(1, round(strands**0.5)))
    x[..., 1], x[..., 2] = LINK * row[:, None], LINK * column[:, None]
    x += np.random.default_rng(0).normal(0.0, 0.01 * LINK, x.shape)
    families = [np.stack([at[:, :-k].ravel(), at[:, k:].ravel()], axis=1).astype(np.int32) for k in (1, 2)]
    return Springs(
        x=x.reshape(-1, 3).astype(np.float32),
        families=tuple(families),
        rest=tuple(np.full(len(family), k * LINK, np.float32) for k, family in zip((1, 2), families, strict=True)),
        pinned=at[:, 0],
        mass=mass,
        k_s=STIFFNESS * mass / dt**2,
        k_d=DAMPING * mass / dt,
        dt=dt,
        substeps=SUBSTEPS,
    )


class NumPyStrands(springs.NumPy):
    """All strands at once, neighbours by slices: no indices."""

    name = "NumPy, slices"

    def __init__(self, p: Springs) -> None:
        super().__init__(p)
        # Masses first: a slice of them is one piece of memory.
        self.x = np.ascontiguousarray(p.x.reshape(-1, MASSES, 3).transpose(1, 2, 0))
        self.v = np.zeros_like(self.x)

    def frame(self) -> None:
        p, x, v = self.problem, self.x, self.v
        k_s, k_d, h = np.float32(p.k_s), np.float32(p.k_d), np.float32(p.dt)
        push = h / np.float32(p.mass)
        for _ in range(p.substeps):
            f = np.zeros_like(x)
            for k in (1, 2):
                d, dv = x[:-k] - x[k:], v[:-k] - v[k:]
                length2 = np.einsum("ijk,ijk->ik", d, d)
                along = np.einsum("ijk,ijk->ik", d, dv)
                d *= (-(k_s * (1 - np.float32(k * LINK) / np.sqrt(length2)) + k_d * along / length2))[:, None]
                f[:-k] += d
                f[k:] -= d
            v[1:] += push * f[1:]
            v[1:, 1] += h * np.float32(p.g)
            x[1:] += h * v[1:]

    def result(self) -> Array:
        return self.x.transpose(2, 0, 1).reshape(-1, 3)


class TaichiStrands(springs.TaichiScatter):
    """A thread to a strand, the loop over substeps inside the kernel."""

    name = "Taichi, substeps fused by strand"

    def build(self, p: Springs) -> Any:
        ti, x, v = self.ti, self.x, self.v
        strands, substeps = len(p.x) // MASSES, p.substeps
        f = ti.Vector.field(3, ti.f32, len(p.x))
        h, push, k_s, k_d, g = p.dt, p.dt / p.mass, p.k_s, p.k_d, ti.Vector([0.0, p.g, 0.0])

        @ti.kernel
        def advance():
            for strand in range(strands):
                root = strand * MASSES
                for _ in range(substeps):
                    for k in range(MASSES):
                        f[root + k] = ti.Vector([0.0, 0.0, 0.0])
                    for family in ti.static((1, 2)):
                        for k in range(MASSES - family):
                            a = root + k
                            b = a + family
                            d, dv = x[a] - x[b], v[a] - v[b]
                            inverse = 1 / d.norm()
                            force = -(k_s * (1 - family * LINK * inverse) + k_d * d.dot(dv) * inverse * inverse) * d
                            f[a] = f[a] + force
                            f[b] = f[b] - force
                    for k in range(1, MASSES):
                        v[root + k] += push * f[root + k] + h * g
                        x[root + k] += h * v[root + k]

        return advance

    def frame(self) -> None:
        self.kernel()
        self.ti.sync()


CONTESTANTS = [
    springs.Pointmass,
    springs.TaichiScatter,
    TaichiStrands,
    springs.WarpScatter,
    springs.JAX,
    springs.NumPy,
    NumPyStrands,
    springs.C,
]
