"""Births and deaths: a million particles of smoke in curl noise around a solid; a fifth of them is new every second."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from benchmarks.track import Array, Contestant, Judge, Race
from benchmarks.workloads.peers import Ours, start_taichi
from benchmarks.workloads.solids import Ball, Stone

SAMPLE = 4000  # particles that the judge looks at
NEARBY = 1000  # and so many of them begin near the collider
LIFETIME = 5.0  # [s]: with N / 5 births a second, N are alive
BLOCK = 4096  # particles whose noise fits the cache, for the NumPy that works in blocks
TOLERANCE = 5e-5  # of positions [m]
MARGIN = 2e-5  # [m]: who comes so near to the edge of the contact test is nobody's witness: it may go either way
SLOW = 0.05  # [m/s]: likewise who touches so slowly, which pointmass may let rest
BISECTIONS = 60

# The noise of pm.CurlNoise, written a second time: Perlin's, with gradients from a hash (Wellons's lowbias32).
PRIMES, PRIME_OF_COMPONENT = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D), 0x165667B1
FADE = Polynomial([0, 0, 0, 10, -15, 6])
LEVELS = 1024  # values of each of the three numbers of a gradient
CELLS = 2**24 - 1  # mask of a lattice index
BALL, STONE = Ball(), Stone()

Flow = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Problem:
    """Particles of mass 1 in a room around a collider; SI units. Row i dies at (i + 0.5) / rate, and one is born."""

    n: int
    substeps: int = 4
    k: float = 4.0
    length: float = 0.7
    speed: float = 1.5
    seed: int = 3
    restitution: float = 0.5
    eps: float = 1e-5
    side: float = 5.0
    cone: float = 20.0
    collider: Ball | Stone = BALL
    x: Array = field(init=False)
    v: Array = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(1)
        x = ((rng.random((self.n, 3)) - 0.5) * self.side).astype(np.float32)
        object.__setattr__(self, "x", self.collider.emptied(x))
        object.__setattr__(self, "v", rng.standard_normal((self.n, 3), dtype=np.float32))

    @property
    def dt(self) -> float:
        """Step [s]."""
        return 1 / 60 / self.substeps

    @property
    def rate(self) -> float:
        """Births in a second, as many as deaths."""
        return self.n / LIFETIME

    @property
    def age(self) -> Array:
        """Of the rows at the start [s]."""
        return LIFETIME - (np.arange(self.n) + 0.5) / self.rate

    @property
    def newest(self) -> float:
        """Who is younger after the first frame was born in it [s]."""
        return 1 / 60 + 0.25 / self.rate

    def born(self, step: int) -> range:
        """Rows that die in a step, whose place the newborn take."""
        return range(*(int(self.rate * self.dt * k) for k in (step, step + 1)))

    @property
    def strength(self) -> float:
        """Factor on the curl of the noise in cells, so that its root mean square is `speed`, by closed integrals."""
        ends = (1 - FADE, FADE)
        dots = ((1 - FADE) * Polynomial([0, 1]), FADE * Polynomial([-1, 1]))

        def square(parts: tuple[Polynomial, Polynomial]) -> float:
            return float(sum((p * p).integ()(1.0) for p in parts))

        value, slope = square(ends), square(tuple(p.deriv() for p in ends))
        dot, dot_slope = square(dots), square(tuple(p.deriv() for p in dots))
        # Of a derivative along x: the gradient's own part along x, or one of the two others.
        total = dot_slope * value * value + 2 * slope * dot * value
        return self.speed / math.sqrt(6 * (LEVELS**2 - 1) / 12 * total)

    @cached_property
    def witnesses(self) -> Any:
        """Rows that the judge looks at: they live on, and some are near the collider."""
        alive = np.arange(2 * self.born(self.substeps - 1).stop, self.n)
        near = alive[np.argsort(np.abs(self.collider.distance(self.x[alive])[0]))[: min(NEARBY, len(alive) // 4)]]
        return np.union1d(near, alive[:: max(1, len(alive) // (SAMPLE - NEARBY))])


def races(quick: bool) -> list[Race]:
    """A million particles, 200,000 births and deaths a second."""
    n = 20_000 if quick else 1_000_000
    # Noise: of each corner 3 dots (3 each), the weight and its 3 slopes (6), the cross product (6) and what is left of
    # the curl (6), and for each axis the fade (5) and its slope (4); drag and step 9; the ball: distance 6, root 4,
    # tests 2. The hash is made of whole numbers.
    slots = 8 * (9 + 6 + 6 + 6) + 3 * 9 + 9 + 12
    case = f"{n:,} particles, {n / LIFETIME:,.0f} births a second"
    substeps = Problem.substeps
    work = float(n * substeps)
    return [
        Race(title, case, make, CONTESTANTS, judge, "particle-steps", work, n, slots, 48 / substeps)
        for title, make in (
            ("Births", partial(Problem, n)),
            ("Births around a mesh", partial(Problem, n, collider=STONE)),
        )
    ]


# ---------------------------------------------------------------------------------------------------- the reference


def judge(p: Problem, scheme: str) -> Judge:
    """By the float64 motion of witnesses, and by how many are alive and new; errors in metres."""
    x, v = (a[p.witnesses].astype(np.float64) for a in (p.x, p.v))
    sure = np.ones(len(x), bool)
    for _ in range(p.substeps):
        x, v, clear = _swept(p, x, v) if scheme == "swept" else _discrete(p, x, v)
        sure &= clear

    def error(result: Array) -> float:
        places, (alive, new, _) = result[:-1], result[-1]
        expected = p.rate / 60
        if abs(alive - p.n) > 2 or abs(new - expected) > 2:
            return math.inf
        return float(np.linalg.norm(places - x, axis=1)[sure].max())

    return Judge(None, error, TOLERANCE)


def flow(p: Problem, x: Array) -> Array:
    """Velocity of the air [m/s], shape (n, 3): the curl of three noises, in the precision of x."""
    real = x.dtype.type
    q = x * real(1 / p.length)
    whole = np.floor(q)
    part = q - whole
    cell = whole.astype(np.int32).astype(np.uint32)
    fade = [part[:, a] ** 3 * (part[:, a] * (part[:, a] * real(6) - real(15)) + real(10)) for a in range(3)]
    slope = [real(30) * (part[:, a] * (part[:, a] - real(1))) ** 2 for a in range(3)]
    base = _mixed(np.uint32(p.seed + PRIME_OF_COMPONENT))
    ends = [[((cell[:, a] + np.uint32(e)) & np.uint32(CELLS)) * np.uint32(PRIMES[a]) for e in (0, 1)] for a in range(3)]
    weights = [[real(1) - fade[a], fade[a]] for a in range(3)]
    slopes = [[-slope[a], slope[a]] for a in range(3)]
    total = np.zeros_like(x)
    for i, j, k in product((0, 1), repeat=3):
        h = _mixed(ends[0][i] + ends[1][j] + ends[2][k] + base) + base
        dx, dy, dz = part[:, 0] - real(i), part[:, 1] - real(j), part[:, 2] - real(k)
        g = [_gradient(h, c, real) for c in range(3)]
        s = [a * dx + b * dy + c * dz for a, b, c in g]
        wx, wy, wz = weights[0][i], weights[1][j], weights[2][k]
        yz = wy * wz
        w, w_x, w_y, w_z = wx * yz, slopes[0][i] * yz, wx * slopes[1][j] * wz, wx * wy * slopes[2][k]
        total[:, 0] += w_y * s[2] - w_z * s[1] + w * (g[2][1] - g[1][2])
        total[:, 1] += w_z * s[0] - w_x * s[2] + w * (g[0][2] - g[2][0])
        total[:, 2] += w_x * s[1] - w_y * s[0] + w * (g[1][0] - g[0][1])
    total *= real(p.strength)
    return total


def _mixed(h: Any) -> Any:
    with np.errstate(over="ignore"):
        h = h ^ (h >> np.uint32(16))
        h = h * np.uint32(0x21F0AAAD)
        h = h ^ (h >> np.uint32(15))
        h = h * np.uint32(0x735A2D97)
        return h ^ (h >> np.uint32(15))


def _gradient(h: Any, component: int, real: Any) -> list[Array]:
    h = _mixed(h + np.uint32(PRIME_OF_COMPONENT * (component + 1) % 2**32))
    return [((h >> np.uint32(10 * b)) & np.uint32(LEVELS - 1)).astype(real) - real((LEVELS - 1) / 2) for b in range(3)]


def step(p: Problem, x: Array, v: Array, h: Any) -> tuple[Array, Array]:
    """A step without a collider; h is a number or of shape (n, 1)."""
    v = v + h * x.dtype.type(p.k) * (flow(p, x) - v)
    return x + h * v, v


def bounced(p: Problem, v: Array, normal: Array) -> Array:
    """Velocities after an impact."""
    return v - (1 + p.restitution) * (v * normal).sum(axis=1)[:, None] * normal


def _discrete(p: Problem, x: Array, v: Array) -> tuple[Array, Array, Any]:
    x, v = step(p, x, v, p.dt)
    gap, normal = p.collider.distance(x)
    toward = (v * normal).sum(axis=1)
    hit = (gap < p.eps) & (toward < 0)
    clear = (np.abs(gap - p.eps) > MARGIN) & (~hit | (toward < -SLOW))
    v = np.where(hit[:, None], bounced(p, v, normal), v)
    x = x - np.where(hit, np.minimum(gap, 0), 0)[:, None] * normal
    return x, v, clear


def _swept(p: Problem, x: Array, v: Array) -> tuple[Array, Array, Any]:
    """A step, and where it would end inside: to the impact on its cubic, the bounce, the rest of the step."""
    x1, v1 = step(p, x, v, p.dt)
    gap = p.collider.distance(x1)[0]
    clear = np.abs(gap) > MARGIN
    for row in np.flatnonzero(gap < 0):
        y, u, left = x[row : row + 1], v[row : row + 1], p.dt
        for _ in range(8):
            end, speed = step(p, y, u, left)
            if p.collider.distance(end)[0][0] >= 0:
                break
            low, high = 0.0, 1.0
            for _ in range(BISECTIONS):
                middle = (low + high) / 2
                outside = p.collider.distance(_cubic(y, u, end, speed, left, middle)[0])[0][0] > 0
                low, high = (middle, high) if outside else (low, middle)
            y, u = _cubic(y, u, end, speed, left, low)
            normal = p.collider.distance(y)[1]
            clear[row] &= (u * normal).sum() < -SLOW
            u = bounced(p, u, normal)
            left *= 1 - low
        x1[row], v1[row] = end[0], speed[0]
    return x1, v1, clear


def _cubic(x0: Array, v0: Array, x1: Array, v1: Array, h: float, s: float) -> tuple[Array, Array]:
    """Position and velocity at the fraction s of a step, from both ends."""
    r, chord = 1 - s, (x1 - x0) / h
    x = x0 * (r * r * (1 + 2 * s)) + x1 * (s * s * (3 - 2 * s)) + h * (v0 * (s * r * r) - v1 * (s * s * r))
    return x, chord * (6 * s * r) + v0 * (r * (1 - 3 * s)) + v1 * (s * (3 * s - 2))


def report(places: Array, alive: int, new: int) -> Array:
    """What the judge wants: the witnesses' places, and in the last row how many live and were born."""
    return np.concatenate([np.asarray(places, np.float64), [[alive, new, 0.0]]])


# ---------------------------------------------------------------------------------------------------- contestants


class Pointmass(Ours):
    """The public API, as a user writes it."""

    name = "pointmass, swept contact"
    scheme = "swept"

    def __init__(self, p: Problem) -> None:
        import pointmass as pm

        super().__init__(p)
        particles = pm.Particles(p.x, p.v, lifetime=LIFETIME, dtype=np.float32)
        particles.age[:] = p.age
        air = pm.CurlNoise(p.length, p.speed, rate=0.0, octaves=1, seed=p.seed)
        solid = p.collider.ours(restitution=p.restitution, friction=0.0, eps=p.eps, contact=self.scheme)
        source = pm.BoxEmitter(
            (0.0, -0.5 * p.side, 0.0),
            sides=(p.side, 0.0, p.side),
            rate=p.rate,
            speed=1.0,
            cone=p.cone,
            lifetime=LIFETIME,
            mass=1.0,
        )
        system = pm.ParticleSystem(particles, [pm.Wind(air, p.k)], solid)
        self.sim = pm.Simulation(system, pm.SymplecticEuler(), p.dt, emitters=[source])
        self.steps = p.substeps

    def result(self) -> Array:
        p = self.sim.system.particles
        order = np.argsort(p.id)
        rows = order[np.searchsorted(p.id, self.problem.witnesses, sorter=order)]
        return report(p.x[rows], len(p), int((p.age < self.problem.newest).sum()))


class PointmassDiscrete(Pointmass):
    """With the test at the end of each step that everybody else makes."""

    name = "pointmass, discrete contact"
    scheme = "discrete"


class NumPy(Contestant):
    """Whole arrays, one pass after another; who is born takes the row of who dies."""

    name = "NumPy"
    block: ClassVar[int] = 0

    def __init__(self, p: Problem) -> None:
        super().__init__(p)
        self.x, self.v, self.age = p.x.copy(), p.v.copy(), p.age.astype(np.float32)
        self.steps = 0
        self.rng = np.random.default_rng(2)

    def frame(self) -> None:
        p, h = self.problem, np.float32(self.problem.dt)
        width = self.block or p.n
        for _ in range(p.substeps):
            self.bear(np.array(p.born(self.steps)) % p.n)
            for first in range(0, p.n, width):
                part = slice(first, first + width)
                x, v = step(p, self.x[part], self.v[part], h)
                gap, normal = p.collider.distance(x)
                hit = np.flatnonzero((gap < p.eps) & ((v * normal).sum(axis=1) < 0))
                v[hit] = bounced(p, v[hit], normal[hit])
                x[hit] -= np.minimum(gap[hit], 0)[:, None] * normal[hit]
                self.x[part], self.v[part] = x, v
            self.age += h
            self.steps += 1

    def bear(self, rows: Any) -> None:
        """Newborn on the floor, upwards in a cone."""
        p, u = self.problem, self.rng.random((4, len(rows)), dtype=np.float32)
        self.x[rows] = np.stack([p.side * (u[0] - 0.5), np.full(len(rows), -p.side / 2), p.side * (u[1] - 0.5)], axis=1)
        up, turn = 1 - u[2] * np.float32(1 - math.cos(math.radians(p.cone))), np.float32(2 * np.pi) * u[3]
        across = np.sqrt(1 - up * up)
        self.v[rows] = np.stack([across * np.cos(turn), up, across * np.sin(turn)], axis=1)
        self.age[rows] = 0

    def result(self) -> Array:
        new = int((self.age < self.problem.newest).sum())
        return report(self.x[self.problem.witnesses], len(self.x), new)


class NumPyBlocks(NumPy):
    """A block of particles at a time, while its noise is in the cache."""

    name = "NumPy in blocks"
    block = BLOCK


class Taichi(Contestant):
    """A kernel for the births of each substep, and one for its motion."""

    name = "Taichi"

    def __init__(self, p: Problem) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti = ti
        self.x = ti.Vector.field(3, ti.f32, p.n)
        self.v = ti.Vector.field(3, ti.f32, p.n)
        self.age = ti.field(ti.f32, p.n)
        self.x.from_numpy(p.x)
        self.v.from_numpy(p.v)
        self.age.from_numpy(p.age.astype(np.float32))
        self.steps = 0
        self.advance, self.bear = self.build(p)

    def build(self, p: Problem) -> tuple[Any, Any]:
        import taichi as ti

        x, v, age = self.x, self.v, self.age
        h, k, restitution, eps, n = p.dt, p.k, p.restitution, p.eps, p.n
        side, slant, strength, fine = p.side, 1 - math.cos(math.radians(p.cone)), p.strength, 1 / p.length
        base = int(_mixed(np.uint32(p.seed + PRIME_OF_COMPONENT)))
        distance = p.collider.taichi()

        @ti.func
        def mixed(a):
            a ^= a >> ti.u32(16)
            a *= ti.u32(0x21F0AAAD)
            a ^= a >> ti.u32(15)
            a *= ti.u32(0x735A2D97)
            a ^= a >> ti.u32(15)
            return a

        @ti.func
        def gradient(corner, component: ti.template()):
            a = mixed(corner + ti.u32(PRIME_OF_COMPONENT * (component + 1) % 2**32))
            last, middle = ti.u32(LEVELS - 1), (LEVELS - 1) / 2
            return ti.Vector(
                [ti.cast((a >> ti.u32(10 * b)) & last, ti.i32) - middle for b in ti.static(range(3))], ti.f32
            )

        @ti.func
        def flow(place):
            q = place * fine
            whole = ti.floor(q)
            u = q - whole
            cell = ti.cast(ti.cast(whole, ti.i32), ti.u32)
            fade = u * u * u * (u * (u * 6.0 - 15.0) + 10.0)
            slope = 30.0 * (u * (u - 1.0)) ** 2
            total = ti.Vector([0.0, 0.0, 0.0])
            for i, j, m in ti.static(ti.ndrange(2, 2, 2)):
                corner = ((cell[0] + ti.u32(i)) & ti.u32(CELLS)) * ti.u32(PRIMES[0])
                corner += ((cell[1] + ti.u32(j)) & ti.u32(CELLS)) * ti.u32(PRIMES[1])
                corner += ((cell[2] + ti.u32(m)) & ti.u32(CELLS)) * ti.u32(PRIMES[2])
                corner = mixed(corner + ti.u32(base)) + ti.u32(base)
                d = u - ti.Vector([float(i), float(j), float(m)])
                a, b, c = gradient(corner, 0), gradient(corner, 1), gradient(corner, 2)
                s = ti.Vector([a.dot(d), b.dot(d), c.dot(d)])
                wx = fade[0] if ti.static(i == 1) else 1.0 - fade[0]
                wy = fade[1] if ti.static(j == 1) else 1.0 - fade[1]
                wz = fade[2] if ti.static(m == 1) else 1.0 - fade[2]
                grown = ti.Vector(
                    [
                        (2 * i - 1) * slope[0] * wy * wz,
                        (2 * j - 1) * slope[1] * wx * wz,
                        (2 * m - 1) * slope[2] * wx * wy,
                    ]
                )
                total += grown.cross(s) + wx * wy * wz * ti.Vector([c[1] - b[2], a[2] - c[0], b[0] - a[1]])
            return strength * total

        @ti.kernel
        def advance():
            for i in x:
                xi, vi = x[i], v[i]
                vi += h * k * (flow(xi) - vi)
                xi += h * vi
                near = distance(xi)
                normal = ti.Vector([near[0], near[1], near[2]])
                toward = vi.dot(normal)
                if near[3] < eps and toward < 0:
                    vi -= (1 + restitution) * toward * normal
                    xi -= ti.min(near[3], 0.0) * normal
                x[i], v[i] = xi, vi
                age[i] += h

        @ti.kernel
        def bear(first: int, last: int):
            for born in range(first, last):
                i = born % n
                x[i] = ti.Vector([side * (ti.random() - 0.5), -side / 2, side * (ti.random() - 0.5)])
                up = 1 - ti.random() * slant
                turn, across = 2 * math.pi * ti.random(), ti.sqrt(1 - up * up)
                v[i] = ti.Vector([across * ti.cos(turn), up, across * ti.sin(turn)])
                age[i] = 0.0

        return advance, bear

    def frame(self) -> None:
        for _ in range(self.problem.substeps):
            rows = self.problem.born(self.steps)
            self.bear(rows.start, rows.stop)
            self.advance()
            self.steps += 1
        self.ti.sync()

    def result(self) -> Array:
        new = int((self.age.to_numpy() < self.problem.newest).sum())
        return report(self.x.to_numpy()[self.problem.witnesses], self.problem.n, new)


CONTESTANTS = [Pointmass, PointmassDiscrete, Taichi, NumPy, NumPyBlocks]
