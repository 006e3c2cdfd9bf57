"""Particles and damped springs by symplectic Euler: what cloth and hair have in common, reference and contestants.

A force of springs is f = -[k_s (L - rest) + k_d (dv . dx)/L] dx/L. Those that scatter go through the springs and add to
both ends (with atomic additions); those that gather go through the particles and their lists of neighbours.
"""

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.toolchain import compiled
from benchmarks.track import Array, Contestant, Judge, against
from benchmarks.workloads.peers import Ours, start_taichi, start_warp

TOLERANCE = 1e-3  # of the shortest spring
# 3 differences of x and of v, length 3, root 4, along 3, the law 3, 3 products and 6 sums; on a multiply-add unit these
# are 16, if a processor has adders of its own for the rest
SLOTS = 16


@dataclass(frozen=True)
class Springs:
    """Particles of one mass in SI units; y is up.

    Attributes
    ----------
    x : shape (n, 3). Everybody starts at rest.
    families : ends of the springs of each family, shape (e, 2).
    rest : lengths without force, by family.
    pinned : rows.
    offsets : on a lattice of rows and columns, the steps (row, column) of each family; else nothing.
    """

    x: Array
    families: tuple[NDArray[np.int32], ...]
    rest: tuple[Array, ...]
    pinned: NDArray[np.intp]
    mass: float
    k_s: float
    k_d: float
    dt: float
    substeps: int
    offsets: tuple[tuple[int, int], ...] = ()
    g: float = -9.81

    @property
    def pairs(self) -> NDArray[np.int32]:
        """All springs, shape (e, 2)."""
        return np.concatenate(self.families)

    @property
    def lengths(self) -> Array:
        """All rest lengths, shape (e,)."""
        return np.concatenate(self.rest)

    @property
    def w(self) -> Array:
        """Inverse masses, 0 where pinned."""
        w = np.full(len(self.x), 1 / self.mass)
        w[self.pinned] = 0
        return w

    def neighbours(self) -> tuple[NDArray[np.uint32], NDArray[np.uint32], Array]:
        """Start of each particle's list, shape (n + 1,); neighbours and rest lengths, shape (2 e,)."""
        a, b = self.pairs.T
        here, there = np.concatenate([a, b]), np.concatenate([b, a])
        order = np.lexsort((there, here))
        start = np.concatenate([[0], np.cumsum(np.bincount(here, minlength=len(self.x)))])
        rest = np.concatenate([self.lengths, self.lengths])[order]
        return start.astype(np.uint32), there[order].astype(np.uint32), rest.astype(np.float32)


def judge(p: Springs, scheme: str) -> Judge:
    """By the motion of all particles in float64; errors in shortest springs."""
    x, v = p.x.astype(np.float64), np.zeros(p.x.shape)
    for _ in range(p.substeps):
        x, v = numpy_step(p, x, v, p.pairs, p.lengths.astype(np.float64), p.w)
    return against(x, float(p.lengths.min()), TOLERANCE)


def numpy_step(p: Springs, x: Array, v: Array, pairs: Any, rest: Array, w: Array) -> tuple[Array, Array]:
    """A step on the edge list, in the type of x."""
    real, (a, b), n = x.dtype.type, pairs.T, len(x)
    d, dv = x[a] - x[b], v[a] - v[b]
    length2 = np.einsum("ij,ij->i", d, d)
    along = np.einsum("ij,ij->i", d, dv)
    size = -(real(p.k_s) * (1 - rest / np.sqrt(length2)) + real(p.k_d) * along / length2)
    d *= size[:, None]
    f = np.empty_like(x)
    for axis in range(3):
        f[:, axis] = np.bincount(a, d[:, axis], n) - np.bincount(b, d[:, axis], n)
    f *= w[:, None].astype(x.dtype)
    f[:, 1] += real(p.g) * (w > 0)
    v = v + real(p.dt) * f
    return x + real(p.dt) * v, v


class Pointmass(Ours):
    """The public API, as a user writes it."""

    def __init__(self, p: Springs) -> None:
        import pointmass as pm

        particles = pm.Particles(p.x, m=p.mass, dtype=np.float32)
        particles.pin(p.pinned)
        forces: list[Any] = [pm.Gravity((0, p.g, 0))]
        forces += [pm.Springs(a, p.k_s, p.k_d, r) for a, r in zip(p.families, p.rest, strict=True)]
        self.sim = pm.Simulation(pm.ParticleSystem(particles, forces), "symplectic_euler", p.dt)
        self.steps = p.substeps


class NumPy(Contestant):
    """Edge list, sums by bincount."""

    name = "NumPy"

    def __init__(self, p: Springs) -> None:
        super().__init__(p)
        self.pairs, self.rest, self.w = p.pairs, p.lengths.astype(np.float32), p.w
        self.x, self.v = p.x.astype(np.float32), np.zeros(p.x.shape, np.float32)

    def frame(self) -> None:
        for _ in range(self.problem.substeps):
            self.x, self.v = numpy_step(self.problem, self.x, self.v, self.pairs, self.rest, self.w)

    def result(self) -> Array:
        return self.x


class C(Contestant):
    """Gathers, with positions and velocities of a particle side by side."""

    name = "C + OpenMP, gather"

    def __init__(self, p: Springs) -> None:
        super().__init__(p)
        self.function = compiled(Path(__file__).with_name("springs.c")).frame
        self.now, self.then = np.zeros((len(p.x), 8), np.float32), np.zeros((len(p.x), 8), np.float32)
        self.now[:, :3] = p.x
        arrays = [self.now, self.then, *p.neighbours(), p.w.astype(np.float32)]
        self.kept = arrays
        a, b, *rest = (array.ctypes.data_as(ctypes.c_void_p) for array in arrays)
        numbers = (ctypes.c_float(q) for q in (p.k_s, p.k_d, p.dt, p.g))
        self.arguments = (a, b, ctypes.c_long(len(p.x)), *rest, p.substeps, *numbers)

    def frame(self) -> None:
        self.function(*self.arguments)

    def result(self) -> Array:
        return self.now[:, :3]


class TaichiScatter(Contestant):
    """Over the springs, with atomic additions; one kernel for each substep."""

    name = "Taichi, scatter"

    def __init__(self, p: Springs) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti = ti
        n = len(p.x)
        self.x, self.v = ti.Vector.field(3, ti.f32, n), ti.Vector.field(3, ti.f32, n)
        self.w = ti.field(ti.f32, n)
        self.x.from_numpy(p.x.astype(np.float32))
        self.w.from_numpy(p.w.astype(np.float32))
        self.kernel = self.build(p)

    def build(self, p: Springs) -> Any:
        ti, x, v, w = self.ti, self.x, self.v, self.w
        f = ti.Vector.field(3, ti.f32, len(p.x))
        ends, rest = ti.Vector.field(2, ti.i32, len(p.pairs)), ti.field(ti.f32, len(p.pairs))
        ends.from_numpy(p.pairs)
        rest.from_numpy(p.lengths.astype(np.float32))
        h, k_s, k_d, g = p.dt, p.k_s, p.k_d, ti.Vector([0.0, p.g, 0.0])

        @ti.kernel
        def advance():
            for i in f:
                f[i] = ti.Vector([0.0, 0.0, 0.0])
            for e in ends:
                a, b = ends[e][0], ends[e][1]
                d, dv = x[a] - x[b], v[a] - v[b]
                inverse = 1 / d.norm()
                force = -(k_s * (1 - rest[e] * inverse) + k_d * d.dot(dv) * inverse * inverse) * d
                f[a] += force
                f[b] -= force
            for i in x:
                if w[i] > 0:
                    v[i] += h * (w[i] * f[i] + g)
                    x[i] += h * v[i]

        return advance

    def frame(self) -> None:
        for _ in range(self.problem.substeps):
            self.kernel()
        self.ti.sync()

    def result(self) -> Array:
        return self.x.to_numpy().reshape(-1, 3)


class TaichiGather(TaichiScatter):
    """Over the particles and their lists of neighbours: nothing atomic."""

    name = "Taichi, gather"

    def build(self, p: Springs) -> Any:
        ti, x, v, w = self.ti, self.x, self.v, self.w
        start, near, lengths = p.neighbours()
        begin, other, rest = ti.field(ti.i32, len(start)), ti.field(ti.i32, len(near)), ti.field(ti.f32, len(near))
        begin.from_numpy(start.astype(np.int32))
        other.from_numpy(near.astype(np.int32))
        rest.from_numpy(lengths)
        h, k_s, k_d, g = p.dt, p.k_s, p.k_d, ti.Vector([0.0, p.g, 0.0])

        @ti.kernel
        def advance():
            for i in x:
                xi, vi = x[i], v[i]
                f = ti.Vector([0.0, 0.0, 0.0])
                for e in range(begin[i], begin[i + 1]):
                    d, dv = xi - x[other[e]], vi - v[other[e]]
                    inverse = 1 / d.norm()
                    f -= (k_s * (1 - rest[e] * inverse) + k_d * d.dot(dv) * inverse * inverse) * d
                if w[i] > 0:
                    u[i] = vi + h * (w[i] * f + g)
            for i in x:
                v[i] = u[i]
                x[i] += h * u[i]

        u = ti.Vector.field(3, ti.f32, len(p.x))
        return advance


class TaichiLattice(TaichiScatter):
    """Over a two-dimensional field, with the twelve neighbours written out: the way of Taichi's own cloth example."""

    name = "Taichi, lattice stencil"

    def build(self, p: Springs) -> Any:
        ti = self.ti
        side = round(len(p.x) ** 0.5)
        self.x = x = ti.Vector.field(3, ti.f32, (side, side))
        v, u = ti.Vector.field(3, ti.f32, (side, side)), ti.Vector.field(3, ti.f32, (side, side))
        w = ti.field(ti.f32, (side, side))
        x.from_numpy(p.x.astype(np.float32).reshape(side, side, 3))
        w.from_numpy(p.w.astype(np.float32).reshape(side, side))
        steps = [
            (s * a, s * b, float(np.mean(r))) for (a, b), r in zip(p.offsets, p.rest, strict=True) for s in (1, -1)
        ]
        h, k_s, k_d, g = p.dt, p.k_s, p.k_d, ti.Vector([0.0, p.g, 0.0])

        @ti.kernel
        def advance():
            for i, j in x:
                xi, vi = x[i, j], v[i, j]
                f = ti.Vector([0.0, 0.0, 0.0])
                for q in ti.static(range(len(steps))):
                    row, column = i + steps[q][0], j + steps[q][1]
                    if 0 <= row < side and 0 <= column < side:
                        d, dv = xi - x[row, column], vi - v[row, column]
                        inverse = 1 / d.norm()
                        f -= (k_s * (1 - steps[q][2] * inverse) + k_d * d.dot(dv) * inverse * inverse) * d
                if w[i, j] > 0:
                    u[i, j] = vi + h * (w[i, j] * f + g)
            for i, j in x:
                v[i, j] = u[i, j]
                x[i, j] += h * u[i, j]

        return advance


class WarpScatter(Contestant):
    """Over the springs, with atomic additions; Warp has one thread on a processor."""

    name = "Warp, scatter"

    def __init__(self, p: Springs) -> None:
        import warp as wp

        start_warp(wp)
        super().__init__(p)
        n, h, k_s, k_d, g = len(p.x), p.dt, p.k_s, p.k_d, wp.vec3(0.0, p.g, 0.0)
        self.x, v, self.f = (wp.zeros(n, dtype=wp.vec3, device="cpu") for _ in range(3))
        self.x.assign(p.x.astype(np.float32))
        ends = wp.array(p.pairs, dtype=wp.vec2i, device="cpu")
        lengths, inverse_mass = (wp.array(q, dtype=float, device="cpu") for q in (p.lengths, p.w))

        @wp.kernel
        def pull(
            x: wp.array(dtype=wp.vec3),
            v: wp.array(dtype=wp.vec3),
            f: wp.array(dtype=wp.vec3),
            ends: wp.array(dtype=wp.vec2i),
            rest: wp.array(dtype=float),
        ):
            e = wp.tid()
            a = ends[e][0]
            b = ends[e][1]
            d = x[a] - x[b]
            inverse = 1.0 / wp.length(d)
            along = wp.dot(d, v[a] - v[b])
            force = -(k_s * (1.0 - rest[e] * inverse) + k_d * along * inverse * inverse) * d
            wp.atomic_add(f, a, force)
            wp.atomic_sub(f, b, force)

        @wp.kernel
        def move(
            x: wp.array(dtype=wp.vec3),
            v: wp.array(dtype=wp.vec3),
            f: wp.array(dtype=wp.vec3),
            w: wp.array(dtype=float),
        ):
            i = wp.tid()
            if w[i] > 0.0:
                v[i] = v[i] + h * (w[i] * f[i] + g)
                x[i] = x[i] + h * v[i]
            f[i] = wp.vec3()

        self.launches = [
            wp.launch(pull, len(p.pairs), [self.x, v, self.f, ends, lengths], device="cpu", record_cmd=True),
            wp.launch(move, n, [self.x, v, self.f, inverse_mass], device="cpu", record_cmd=True),
        ]

    def frame(self) -> None:
        for _ in range(self.problem.substeps):
            for launch in self.launches:
                launch.launch()

    def result(self) -> Array:
        return self.x.numpy()


class WarpGather(Contestant):
    """Over the particles and their lists of neighbours; Warp has one thread on a processor."""

    name = "Warp, gather"

    def __init__(self, p: Springs) -> None:
        import warp as wp

        start_warp(wp)
        super().__init__(p)
        n, h, k_s, k_d, g = len(p.x), p.dt, p.k_s, p.k_d, wp.vec3(0.0, p.g, 0.0)
        self.x, v, y, u = (wp.zeros(n, dtype=wp.vec3, device="cpu") for _ in range(4))
        self.x.assign(p.x.astype(np.float32))
        start, near, rest = p.neighbours()
        lists = [wp.array(q.astype(np.int32), dtype=int, device="cpu") for q in (start, near)]
        lists += [wp.array(q, dtype=float, device="cpu") for q in (rest, p.w)]

        @wp.kernel
        def advance(
            x: wp.array(dtype=wp.vec3),
            v: wp.array(dtype=wp.vec3),
            y: wp.array(dtype=wp.vec3),
            u: wp.array(dtype=wp.vec3),
            start: wp.array(dtype=int),
            near: wp.array(dtype=int),
            rest: wp.array(dtype=float),
            w: wp.array(dtype=float),
        ):
            i = wp.tid()
            f = wp.vec3()
            for e in range(start[i], start[i + 1]):
                d = x[i] - x[near[e]]
                inverse = 1.0 / wp.length(d)
                along = wp.dot(d, v[i] - v[near[e]])
                f -= (k_s * (1.0 - rest[e] * inverse) + k_d * along * inverse * inverse) * d
            a = v[i]
            if w[i] > 0.0:
                a = a + h * (w[i] * f + g)
            u[i] = a
            y[i] = x[i] + h * a

        there, back = [self.x, v, y, u, *lists], [y, u, self.x, v, *lists]
        self.launches = [wp.launch(advance, n, a, device="cpu", record_cmd=True) for a in (there, back)]

    def frame(self) -> None:
        for _ in range(self.problem.substeps // 2):
            for launch in self.launches:
                launch.launch()

    def result(self) -> Array:
        return self.x.numpy()


class JAX(Contestant):
    """Edge list, sums by indexed addition; one compiled loop over the substeps."""

    name = "JAX"

    def __init__(self, p: Springs) -> None:
        import jax
        import jax.numpy as jnp

        super().__init__(p)
        a, b, rest = *jnp.array(p.pairs.T), jnp.array(p.lengths, jnp.float32)
        w = jnp.array(p.w, jnp.float32)[:, None]
        g = jnp.array([0, p.g, 0], jnp.float32) * (w > 0)

        def substep(_: Any, state: Any) -> Any:
            x, v = state
            d, dv = x[a] - x[b], v[a] - v[b]
            inverse = jax.lax.rsqrt((d * d).sum(axis=1))
            size = -(p.k_s * (1 - rest * inverse) + p.k_d * (d * dv).sum(axis=1) * inverse * inverse)
            force = size[:, None] * d
            v = v + p.dt * (w * jnp.zeros_like(x).at[a].add(force).at[b].add(-force) + g)
            return x + p.dt * v, v

        self.run = jax.jit(lambda x, v: jax.lax.fori_loop(0, p.substeps, substep, (x, v)), donate_argnums=(0, 1))
        self.x, self.v = jnp.array(p.x, jnp.float32), jnp.zeros(p.x.shape, jnp.float32)

    def frame(self) -> None:
        self.x, self.v = self.run(self.x, self.v)
        self.x.block_until_ready()

    def result(self) -> Array:
        return np.asarray(self.x)
