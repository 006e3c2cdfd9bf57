"""Free particles: gravity, drag, for RK4 an attractor too, and a floor to bounce off."""

import ctypes
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from benchmarks.toolchain import compiled
from benchmarks.track import Array, Contestant, Judge, Race, against
from benchmarks.workloads.peers import Ours, start_taichi, start_warp

TITLE = "Free particles"
COST = "Free particles: cost over size"
SAMPLE = 2000  # particles that the judge looks at; each goes its own way
LOWEST = 0.02  # [m]: nobody is so slow at first that pointmass would let it rest where the others bounce
THROW = 2.0  # [m/s] downwards
BLOCK = 8192  # particles whose state fits the cache, for the NumPy that works in blocks
BISECTIONS = 60
TOLERANCE = 1e-5  # of positions [m], some ten roundings of float32; without drag a frame ends 5e-5 m off


@dataclass(frozen=True)
class Problem:
    """Particles of mass 1 over a floor at y = 0; SI units."""

    n: int
    solver: str = "symplectic_euler"
    substeps: int = 32
    g: float = -9.81
    k: float = 0.1
    restitution: float = 0.8
    eps: float = 1e-4
    mu: float = 0.0
    center: tuple[float, float, float] = (0.5, 3.0, 0.5)
    soft: float = 0.5
    x: Array = field(init=False)
    v: Array = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(1)
        x = rng.random((self.n, 3), dtype=np.float32)
        v = rng.standard_normal((self.n, 3), dtype=np.float32)
        x[:, 1] = LOWEST + 2 * x[:, 1]
        v[:, 1] -= THROW
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "v", v)

    @property
    def dt(self) -> float:
        """Step [s]."""
        return 1 / 60 / self.substeps

    @property
    def rk4(self) -> bool:
        """Whether the solver is RK4, else it is symplectic Euler."""
        return self.solver == "rk4"


def races(quick: bool) -> list[Race]:
    """A million particles by symplectic Euler and by RK4, and the cost from ten thousand to ten million."""
    n = 20_000 if quick else 1_000_000
    euler, rk4 = partial(Problem, n), partial(Problem, n, solver="rk4", mu=2.0)
    result = [
        # v = v (1 - k h) + h g, x = x + h v: 6; the floor: two tests, a product and a choice
        _race(TITLE, f"{n:,} particles, symplectic Euler", euler, CONTESTANTS, n, 10),
        # 4 slopes (drag 3, distance 6, root 4, pull 6), 3 stage states (6 each), 2 sums (12 each), the floor 4
        _race(TITLE, f"{n:,} particles, RK4, three laws", rk4, CONTESTANTS, n, 4 * 19 + 3 * 6 + 2 * 12 + 4),
    ]
    for size in (1_000, 10_000) if quick else (10_000, 100_000, 1_000_000, 10_000_000):
        result.append(_race(COST, f"{size:,} particles", partial(Problem, size), [Pointmass], size, 10))
    return result


def _race(title: str, case: str, make: Any, contestants: Any, n: int, slots: float) -> Race:
    substeps = Problem.substeps
    return Race(title, case, make, contestants, judge, "particle-steps", float(n * substeps), n, slots, 48 / substeps)


# ---------------------------------------------------------------------------------------------------- the reference


def judge(p: Problem, scheme: str) -> Judge:
    """By the float64 motion of a sample, with the contact of the contestant: swept or discrete; errors in metres."""
    rows = np.union1d(np.arange(0, p.n, max(1, p.n // SAMPLE)), np.argsort(p.x[:, 1])[:SAMPLE])  # the low ones bounce
    x, v = p.x[rows].astype(np.float64), p.v[rows].astype(np.float64)
    for _ in range(p.substeps):
        x, v = _swept(p, x, v) if scheme == "swept" else _discrete(p, x, v)
    return against(x, 1.0, TOLERANCE, rows)


def slope(p: Problem, x: Array, v: Array) -> Array:
    """Accelerations, shape (n, 3)."""
    a = -p.k * v
    a[:, 1] += p.g
    if p.mu:
        d = x - np.array(p.center, x.dtype)
        r2 = (d * d).sum(axis=1) + p.soft**2
        a -= (p.mu / (r2 * np.sqrt(r2)))[:, None] * d
    return a


def step(p: Problem, x: Array, v: Array, h: Any) -> tuple[Array, Array]:
    """A step without a floor; h is a number or of shape (n, 1)."""
    if not p.rk4:
        v = v + h * slope(p, x, v)
        return x + h * v, v
    a = slope(p, x, v)
    v2 = v + h / 2 * a
    b = slope(p, x + h / 2 * v, v2)
    v3 = v + h / 2 * b
    c = slope(p, x + h / 2 * v2, v3)
    v4 = v + h * c
    d = slope(p, x + h * v3, v4)
    return x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a + 2 * b + 2 * c + d)


def _discrete(p: Problem, x: Array, v: Array) -> tuple[Array, Array]:
    x, v = step(p, x, v, p.dt)
    hit = (x[:, 1] < p.eps) & (v[:, 1] < 0)
    v[hit, 1] *= -p.restitution
    x[hit, 1] = np.maximum(x[hit, 1], 0)
    return x, v


def _swept(p: Problem, x: Array, v: Array) -> tuple[Array, Array]:
    """A step, and where it would end below the floor: to the impact on its cubic, the bounce, the rest of the step."""
    x1, v1 = step(p, x, v, p.dt)
    for row in np.flatnonzero(x1[:, 1] < 0):
        y, u, left = x[row : row + 1], v[row : row + 1], p.dt
        for _ in range(8):
            end, speed = step(p, y, u, left)
            if end[0, 1] >= 0:
                break
            low, high = 0.0, 1.0
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                above = _cubic(y, u, end, speed, left, middle)[0][0, 1] > 0
                low, high = (middle, high) if above else (low, middle)
            y, u = _cubic(y, u, end, speed, left, low)
            u[0, 1] *= -p.restitution
            left *= 1 - low
        x1[row], v1[row] = end[0], speed[0]
    return x1, v1


def _cubic(x0: Array, v0: Array, x1: Array, v1: Array, h: float, s: float) -> tuple[Array, Array]:
    """Position and velocity at the fraction s of a step, from both ends."""
    r, chord = 1 - s, (x1 - x0) / h
    x = x0 * (r * r * (1 + 2 * s)) + x1 * (s * s * (3 - 2 * s)) + h * (v0 * (s * r * r) - v1 * (s * s * r))
    return x, chord * (6 * s * r) + v0 * (r * (1 - 3 * s)) + v1 * (s * (3 * s - 2))


# ---------------------------------------------------------------------------------------------------- contestants


class Pointmass(Ours):
    """The public API, as a user writes it."""

    name = "pointmass, swept contact"
    scheme = "swept"

    def __init__(self, p: Problem) -> None:
        import pointmass as pm

        forces: list[pm.Force] = [pm.Gravity((0, p.g, 0)), pm.Drag(p.k)]
        if p.mu:
            forces.append(pm.Attractor(p.mu, p.center, p.soft))
        floor = pm.Plane(restitution=p.restitution, friction=0.0, eps=p.eps, contact=self.scheme)
        particles = pm.Particles(p.x, p.v, dtype=np.float32)
        self.sim = pm.Simulation(pm.ParticleSystem(particles, forces, floor), p.solver, p.dt)
        self.steps = p.substeps


class PointmassDiscrete(Pointmass):
    """With the test at the end of each step that everybody else makes."""

    name = "pointmass, discrete contact"
    scheme = "discrete"


class NumPy(Contestant):
    """Whole arrays, one pass after another."""

    name = "NumPy"

    def __init__(self, p: Problem) -> None:
        super().__init__(p)
        self.x, self.v = p.x.copy(), p.v.copy()

    def frame(self) -> None:
        for _ in range(self.problem.substeps):
            self.x, self.v = numpy_step(self.problem, self.x, self.v)

    def result(self) -> Array:
        return self.x


class NumPyBlocks(NumPy):
    """All substeps on a block of particles while it is in the cache."""

    name = "NumPy in blocks"

    def frame(self) -> None:
        for first in range(0, self.problem.n, BLOCK):
            block = slice(first, first + BLOCK)
            x, v = self.x[block], self.v[block]
            for _ in range(self.problem.substeps):
                x, v = numpy_step(self.problem, x, v)
            self.x[block], self.v[block] = x, v


def numpy_step(p: Problem, x: Array, v: Array) -> tuple[Array, Array]:
    """In float32, and in place where that helps."""
    h = np.float32(p.dt)
    if p.rk4:
        x, v = step(p, x, v, h)
    else:
        a = np.multiply(v, np.float32(-p.k))
        a[:, 1] += np.float32(p.g)
        a *= h
        v += a
        x += np.multiply(v, h, out=a)
    hit = np.flatnonzero((x[:, 1] < p.eps) & (v[:, 1] < 0))
    v[hit, 1] *= np.float32(-p.restitution)
    x[hit, 1] = np.maximum(x[hit, 1], 0)
    return x, v


class C(Contestant):
    """C and OpenMP, one pass for each substep."""

    name = "C + OpenMP"
    fused: ClassVar[int] = 0

    def __init__(self, p: Problem) -> None:
        super().__init__(p)
        self.function = compiled(Path(__file__).with_name("free.c")).frame
        self.state = np.ascontiguousarray(np.concatenate([p.x.T, p.v.T]))
        numbers = (p.dt, p.g, p.k, p.restitution, p.eps, p.mu, *p.center, p.soft**2)
        self.numbers = (ctypes.c_float * len(numbers))(*numbers)

    def frame(self) -> None:
        p = self.problem
        state = self.state.ctypes.data_as(ctypes.c_void_p)
        self.function(state, ctypes.c_long(p.n), p.substeps, self.fused, int(p.rk4), self.numbers)

    def result(self) -> Array:
        return self.state[:3].T


class CFused(C):
    """All substeps on a tile of 256 particles while it is in the cache: by hand what pointmass does."""

    name = "C + OpenMP, substeps fused"
    fused = 1


class Taichi(Contestant):
    """A kernel for each substep."""

    name = "Taichi"
    fused: ClassVar[bool] = False

    def __init__(self, p: Problem) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti = ti
        layout = ti.Layout.SOA if p.rk4 else ti.Layout.AOS  # whichever is faster
        self.x = ti.Vector.field(3, ti.f32, p.n, layout=layout)
        self.v = ti.Vector.field(3, ti.f32, p.n, layout=layout)
        self.x.from_numpy(p.x)
        self.v.from_numpy(p.v)
        self.kernel = self.build(p, p.substeps if self.fused else 1)

    def build(self, p: Problem, inner: int) -> Any:
        import taichi as ti

        x, v = self.x, self.v
        h, k, restitution, eps, mu, soft2 = p.dt, p.k, p.restitution, p.eps, p.mu, p.soft**2
        g, center, rk4 = ti.Vector([0.0, p.g, 0.0]), ti.Vector(p.center), p.rk4

        @ti.func
        def slope(xi, vi):
            a = g - k * vi
            if ti.static(mu != 0):
                d = xi - center
                r2 = d.dot(d) + soft2
                a -= mu / (r2 * ti.sqrt(r2)) * d
            return a

        @ti.kernel
        def advance():
            for i in x:
                xi, vi = x[i], v[i]
                for _ in range(inner):
                    if ti.static(rk4):
                        a = slope(xi, vi)
                        v2 = vi + 0.5 * h * a
                        b = slope(xi + 0.5 * h * vi, v2)
                        v3 = vi + 0.5 * h * b
                        c = slope(xi + 0.5 * h * v2, v3)
                        v4 = vi + h * c
                        d = slope(xi + h * v3, v4)
                        xi += h / 6 * (vi + 2 * v2 + 2 * v3 + v4)
                        vi += h / 6 * (a + 2 * b + 2 * c + d)
                    else:
                        vi += h * slope(xi, vi)
                        xi += h * vi
                    if xi[1] < eps and vi[1] < 0:
                        vi[1] *= -restitution
                        xi[1] = ti.max(xi[1], 0.0)
                x[i], v[i] = xi, vi

        return advance

    def frame(self) -> None:
        for _ in range(1 if self.fused else self.problem.substeps):
            self.kernel()
        self.ti.sync()

    def result(self) -> Array:
        return self.x.to_numpy()


class TaichiFused(Taichi):
    """The loop over substeps inside the kernel, by hand."""

    name = "Taichi, substeps fused"
    fused = True


class Warp(Contestant):
    """A launch for each substep; Warp has one thread on a processor."""

    name = "Warp"
    fused: ClassVar[bool] = False

    def __init__(self, p: Problem) -> None:
        import warp as wp

        start_warp(wp)
        super().__init__(p)
        self.x = wp.array(p.x, dtype=wp.vec3, device="cpu")
        self.v = wp.array(p.v, dtype=wp.vec3, device="cpu")
        h, g, k = p.dt, wp.vec3(0.0, p.g, 0.0), p.k
        restitution, eps, mu, center, soft2 = p.restitution, p.eps, p.mu, wp.vec3(*p.center), p.soft**2

        @wp.func
        def slope(x: wp.vec3, v: wp.vec3):
            d = x - center
            r2 = wp.dot(d, d) + soft2
            return g - k * v - mu / (r2 * wp.sqrt(r2)) * d

        @wp.func
        def euler(x: wp.vec3, v: wp.vec3):
            u = v + h * (g - k * v)
            return x + h * u, u

        @wp.func
        def rk4(x: wp.vec3, v: wp.vec3):
            a = slope(x, v)
            v2 = v + 0.5 * h * a
            b = slope(x + 0.5 * h * v, v2)
            v3 = v + 0.5 * h * b
            c = slope(x + 0.5 * h * v2, v3)
            v4 = v + h * c
            d = slope(x + h * v3, v4)
            return x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)

        step = rk4 if p.rk4 else euler

        @wp.kernel(enable_backward=False)
        def advance(xs: wp.array(dtype=wp.vec3), vs: wp.array(dtype=wp.vec3), inner: int):
            i = wp.tid()
            x = xs[i]
            v = vs[i]
            for _ in range(inner):
                x, v = step(x, v)
                if x[1] < eps and v[1] < 0.0:
                    v = wp.vec3(v[0], -restitution * v[1], v[2])
                    x = wp.vec3(x[0], wp.max(x[1], 0.0), x[2])
            xs[i] = x
            vs[i] = v

        inner = p.substeps if self.fused else 1
        self.launch = wp.launch(advance, dim=p.n, inputs=[self.x, self.v, inner], device="cpu", record_cmd=True)

    def frame(self) -> None:
        for _ in range(1 if self.fused else self.problem.substeps):
            self.launch.launch()

    def result(self) -> Array:
        return self.x.numpy()


class WarpFused(Warp):
    """The loop over substeps inside the kernel, by hand."""

    name = "Warp, substeps fused"
    fused = True


class JAX(Contestant):
    """One compiled loop over the substeps."""

    name = "JAX"

    def __init__(self, p: Problem) -> None:
        import jax
        import jax.numpy as jnp

        super().__init__(p)
        h = jnp.float32(p.dt)
        g, center = jnp.array([0, p.g, 0], jnp.float32), jnp.array(p.center, jnp.float32)

        def slope(x: Any, v: Any) -> Any:
            a = g - p.k * v
            if p.mu:
                d = x - center
                r2 = (d * d).sum(axis=1, keepdims=True) + p.soft**2
                a = a - p.mu / (r2 * jnp.sqrt(r2)) * d
            return a

        def substep(_: Any, state: Any) -> Any:
            x, v = state
            if p.rk4:
                a = slope(x, v)
                v2 = v + h / 2 * a
                b = slope(x + h / 2 * v, v2)
                v3 = v + h / 2 * b
                c = slope(x + h / 2 * v2, v3)
                v4 = v + h * c
                d = slope(x + h * v3, v4)
                x, v = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a + 2 * b + 2 * c + d)
            else:
                v = v + h * slope(x, v)
                x = x + h * v
            up = jnp.array([False, True, False])
            hit = up & (x[:, 1:2] < p.eps) & (v[:, 1:2] < 0)
            return jnp.where(hit, jnp.maximum(x, 0), x), jnp.where(hit, -p.restitution * v, v)

        self.run = jax.jit(lambda x, v: jax.lax.fori_loop(0, p.substeps, substep, (x, v)), donate_argnums=(0, 1))
        self.x, self.v = jnp.array(p.x), jnp.array(p.v)

    def frame(self) -> None:
        self.x, self.v = self.run(self.x, self.v)
        self.x.block_until_ready()

    def result(self) -> Array:
        return np.asarray(self.x)


CONTESTANTS = [Pointmass, PointmassDiscrete, Taichi, TaichiFused, Warp, WarpFused, JAX, NumPy, NumPyBlocks, C, CFused]
