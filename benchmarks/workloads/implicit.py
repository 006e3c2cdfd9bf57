"""A step of implicit Euler on a cloth that is stretched over a frame: one linear system, as Baraff and Witkin do it.

(M + h^2 K) dv = h (f - h K v), with K = -df/dx at the start of the step. The springs stay stretched, so the matrix is
positive definite. The judge looks at velocities.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from benchmarks.track import Array, Contestant, Judge, Race
from benchmarks.workloads.cloth import cloth
from benchmarks.workloads.peers import Ours
from benchmarks.workloads.springs import Springs

TITLE = "Implicit step of a cloth"
TOLERANCE = 1e-4  # |b - A dv| / |b|
STIFFNESS = 10.0  # [N/m]
STRETCH = 1.05
H = 1 / 60  # [s]
# Without a matrix, in each iteration: 10 for each of 6 springs, three sums of vectors, two products, the preconditioner
SLOTS = 6 * 10 + 3 * 3 + 2 * 3 + 9


def races(quick: bool) -> list[Race]:
    """A cloth of 128 x 128."""
    side = 16 if quick else 128
    make = partial(drum, side)
    p = make()
    iterations = count_iterations(p)
    case = f"{side} x {side}, {iterations} iterations of preconditioned CG"
    slots = float(SLOTS * iterations)
    return [Race(TITLE, case, make, CONTESTANTS, judge, "particle-steps", float(side**2), side**2, slots, double=True)]


def drum(side: int) -> Springs:
    """The cloth of the explicit race, stiffer, stretched by a twentieth, and held at its whole rim."""
    flat = cloth(side)
    at = np.arange(side * side).reshape(side, side)
    rim = np.unique(np.concatenate([at[0], at[-1], at[:, 0], at[:, -1]]))
    rest = tuple((r / STRETCH).astype(np.float32) for r in flat.rest)
    return replace(flat, rest=rest, pinned=rim, k_s=STIFFNESS, k_d=0.0, dt=H, substeps=1)


@dataclass
class Assembly:
    """Matrix and right side, in blocks of 3 x 3; the places of the blocks are found once."""

    p: Springs

    def __post_init__(self) -> None:
        p, n = self.p, len(self.p.x)
        self.a, self.b = p.pairs.T
        self.rest = p.lengths.astype(np.float64)
        self.free = p.w > 0
        rows = np.concatenate([np.arange(n), self.a, self.b])
        columns = np.concatenate([np.arange(n), self.b, self.a])
        self.order = np.lexsort((columns, rows))
        self.columns = columns[self.order].astype(np.int32)
        self.starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))]).astype(np.int32)

    def __call__(self, x: Array, v: Array) -> tuple[Any, Array, Array]:
        """Matrix, right side, and the blocks on the diagonal."""
        from scipy.sparse import bsr_array

        p, n, a, b = self.p, len(x), self.a, self.b
        d = x[a] - x[b]
        length = np.sqrt(np.einsum("ij,ij->i", d, d))
        d /= length[:, None]
        pull = p.k_s * (length - self.rest)
        f = np.zeros_like(x)
        for axis in range(3):
            f[:, axis] = np.bincount(b, pull * d[:, axis], n) - np.bincount(a, pull * d[:, axis], n)
        f[:, 1] += p.g * p.mass
        across = pull / length
        blocks = np.einsum("e,ei,ej->eij", p.k_s - across, d, d)
        blocks[:, range(3), range(3)] += across[:, None]
        blocks *= p.dt**2
        load = p.dt * f
        bent = np.einsum("eij,ej->ei", blocks, v[a] - v[b])
        for axis in range(3):
            load[:, axis] += np.bincount(b, bent[:, axis], n) - np.bincount(a, bent[:, axis], n)
        diagonal = np.empty((n, 3, 3))
        for i in range(3):
            for j in range(3):
                diagonal[:, i, j] = np.bincount(a, blocks[:, i, j], n) + np.bincount(b, blocks[:, i, j], n)
        diagonal[:, range(3), range(3)] += p.mass
        blocks *= (self.free[a] & self.free[b])[:, None, None]
        diagonal[~self.free] = np.eye(3)
        load[~self.free] = 0
        data = np.concatenate([diagonal, -blocks, -blocks])[self.order]
        return bsr_array((data, self.columns, self.starts), shape=(3 * n, 3 * n)), load.ravel(), diagonal


def judge(p: Springs, scheme: str) -> Judge:
    """By the residual of the linear system, which is the same for all, in float64."""
    x = p.x.astype(np.float64)
    matrix, load, _ = Assembly(p)(x, np.zeros_like(x))
    norm = np.linalg.norm(load)
    return Judge(None, lambda v: float(np.linalg.norm(matrix @ v.ravel() - load) / norm), 1.5 * TOLERANCE)


def count_iterations(p: Springs) -> int:
    """Of conjugate gradients with block-Jacobi preconditioning, in the first step."""
    x = p.x.astype(np.float64)
    return solved(*Assembly(p)(x, np.zeros_like(x)), precondition=True)[1]


def solved(matrix: Any, load: Array, diagonal: Array, precondition: bool) -> tuple[Array, int]:
    """dv by SciPy's conjugate gradients, and the number of iterations."""
    from scipy.sparse.linalg import LinearOperator, cg

    inverse = np.linalg.inv(diagonal)
    operator = LinearOperator(matrix.shape, lambda r: np.einsum("nij,nj->ni", inverse, r.reshape(-1, 3)).ravel())
    count = [0]

    def tick(_: Any) -> None:
        count[0] += 1

    dv, _ = cg(matrix, load, rtol=TOLERANCE, atol=0.0, M=operator if precondition else None, callback=tick)
    return dv, count[0]


class Pointmass(Ours):
    """The public API, as a user writes it."""

    name = "pointmass, float64"
    steps = 1
    dtype: ClassVar[type[np.floating[Any]]] = np.float64

    def __init__(self, p: Springs) -> None:
        import pointmass as pm

        particles = pm.Particles(p.x, m=p.mass, dtype=self.dtype)
        particles.pin(p.pinned)
        forces: list[Any] = [pm.Gravity((0, p.g, 0))]
        forces += [pm.Springs(a, p.k_s, 0.0, r) for a, r in zip(p.families, p.rest, strict=True)]
        solver = pm.ImplicitEuler(linear_solver="cg", newton="one", cg_tolerance=TOLERANCE)
        self.sim = pm.Simulation(pm.ParticleSystem(particles, forces), solver, p.dt)

    def result(self) -> Array:
        return self.sim.system.particles.v


class Pointmass32(Pointmass):
    """In float32."""

    name = "pointmass, float32"
    dtype = np.float32


class SciPy(Contestant):
    """The assembled matrix, and conjugate gradients with block-Jacobi preconditioning."""

    name = "SciPy, CG + block Jacobi"

    def __init__(self, p: Springs) -> None:
        super().__init__(p)
        self.assembly = Assembly(p)
        self.x = p.x.astype(np.float64)
        self.v = np.zeros_like(self.x)

    def frame(self) -> None:
        matrix, load, diagonal = self.assembly(self.x, self.v)
        self.v += self.solve(matrix, load, diagonal).reshape(-1, 3)
        self.x += self.problem.dt * self.v

    def solve(self, matrix: Any, load: Array, diagonal: Array) -> Array:
        return solved(matrix, load, diagonal, precondition=True)[0]

    def result(self) -> Array:
        return self.v

    def note(self) -> str:
        start = time.perf_counter()
        system = self.assembly(self.x, self.v)
        middle = time.perf_counter()
        self.solve(*system)
        end = time.perf_counter()
        return f"the matrix takes {1000 * (middle - start):.0f} ms, the solution {1000 * (end - middle):.0f} ms"


class SciPyPlain(SciPy):
    """Without a preconditioner."""

    name = "SciPy, CG"

    def solve(self, matrix: Any, load: Array, diagonal: Array) -> Array:
        return solved(matrix, load, diagonal, precondition=False)[0]


class SciPyDirect(SciPy):
    """By LU factors: no tolerance."""

    name = "SciPy, LU"

    def solve(self, matrix: Any, load: Array, diagonal: Array) -> Array:
        from scipy.sparse.linalg import splu

        return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(load)


CONTESTANTS = [Pointmass, Pointmass32, SciPy, SciPyPlain, SciPyDirect]
