"""Springs relaxed one by one (XPBD): the same constraints, substeps and iterations for everybody.

Everybody sorts the springs into colours and relaxes one colour after the other. What comes out depends on that order,
so the judge takes that of pointmass for pointmass, and for the others the one in which each spring takes the lowest
colour that is free: they all do that.
"""

from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.track import Array, Contestant, Judge, Race, against
from benchmarks.workloads.cloth import cloth, irregular
from benchmarks.workloads.peers import Ours, start_taichi
from benchmarks.workloads.springs import Springs

TITLE = "XPBD"
FRAME = 1 / 60  # [s]
SUBSTEPS = {1: 20, 5: 4}  # iterations -> substeps of a frame: small steps (Macklin 2019), and as of old
STIFFNESS = 2.0  # k_s dt^2 / m with 20 substeps: many times what an explicit step could bear
SHRUNK = 0.99  # rest lengths over lengths at the start
TOLERANCE = 1e-3  # of the shortest spring
# 6 sums for places, 3 differences, length 3, root 1, direction 4, along it 6, the masses 2, the impulse 4, moves 6
SLOTS = 35


@dataclass(frozen=True)
class Relaxed(Springs):
    """Springs, and how often each is relaxed in a substep."""

    iterations: int = 1

    @cached_property
    def colours(self) -> list[NDArray[np.intp]]:
        """Springs in groups in which no two share a particle: each takes the lowest that is free at both ends."""
        taken = [0] * len(self.x)
        mine = np.empty(len(self.pairs), np.intp)
        for e, (a, b) in enumerate(self.pairs.tolist()):
            lowest = ~(taken[a] | taken[b]) & ((taken[a] | taken[b]) + 1)
            taken[a] |= lowest
            taken[b] |= lowest
            mine[e] = lowest.bit_length() - 1
        return [np.flatnonzero(mine == colour) for colour in range(mine.max() + 1)]


def races(quick: bool) -> list[Race]:
    """A lattice and an irregular mesh of 128 x 128 particles, in small steps of one iteration and in steps of five."""
    side = 20 if quick else 128
    result = []
    for name, make in (("lattice", cloth), ("irregular mesh", irregular)):
        for iterations in SUBSTEPS:
            build = partial(taut, make, side, iterations)
            p = build()
            work = float(p.substeps * iterations * len(p.pairs))
            case = f"{name} of {side * side:,} particles, {p.substeps} substeps, {iterations} iteration(s)"
            traffic = 48 * len(p.x) / work  # the state once a frame
            relaxations = "relaxations"
            result.append(Race(TITLE, case, build, CONTESTANTS, judge, relaxations, work, len(p.x), SLOTS, traffic))
    return result


def taut(make: Any, side: int, iterations: int) -> Relaxed:
    """A cloth hung up at two corners, whose springs are all a little too short at first."""
    p = make(side)
    substeps = SUBSTEPS[iterations]
    rest = [SHRUNK * np.linalg.norm(p.x[a[:, 0]] - p.x[a[:, 1]], axis=1) for a in p.families]
    given = {f.name: getattr(p, f.name) for f in fields(p)}
    given |= {"rest": tuple(r.astype(np.float32) for r in rest), "k_d": 0.0, "substeps": substeps}
    given |= {"dt": FRAME / substeps, "k_s": STIFFNESS * p.mass / (FRAME / SUBSTEPS[1]) ** 2}
    return Relaxed(**given, iterations=iterations)


def judge(p: Relaxed, scheme: str) -> Judge:
    """By the same in float64; errors in shortest springs."""
    order = p.colours if scheme == "" else own_colours(p)
    x, _ = numpy_frame(p, order, p.x.astype(np.float64), np.zeros(p.x.shape))
    return against(x, float(p.lengths.min()), TOLERANCE)


def own_colours(p: Relaxed) -> list[NDArray[np.intp]]:
    """The springs in the order of pointmass: family by family, and each by its colours."""
    result, first = [], 0
    for mine in Pointmass(p).sim.system.colours.values():
        result += [first + np.flatnonzero(mine == colour) for colour in range(mine.max() + 1)]
        first += len(mine)
    return result


def numpy_frame(p: Relaxed, order: list[NDArray[np.intp]], x: Array, v: Array) -> tuple[Array, Array]:
    """A frame, colour by colour, in the type of x."""
    rest, w = p.lengths.astype(x.dtype), p.w.astype(x.dtype)
    h, softness = x.dtype.type(p.dt), x.dtype.type(1 / (p.k_s * p.dt**2))
    groups = [(*p.pairs[own].T, own) for own in order]
    for _ in range(p.substeps):
        v[:, 1] += h * x.dtype.type(p.g) * (w > 0)
        y = x + h * v
        noted = np.zeros_like(rest)
        for _ in range(p.iterations):
            for a, b, own in groups:
                d = y[a] - y[b]
                length = np.sqrt(np.einsum("ij,ij->i", d, d))
                more = -(length - rest[own] + softness * noted[own]) / (w[a] + w[b] + softness)
                noted[own] += more
                d *= (more / length)[:, None]
                y[a] += w[a, None] * d
                y[b] -= w[b, None] * d
        x, v = y, (y - x) / h
    return x, v


class Pointmass(Ours):
    """The public API, as a user writes it."""

    name = "pointmass, float32"
    scheme = "pointmass"
    dtype: ClassVar[type[np.floating[Any]]] = np.float32

    def __init__(self, p: Relaxed) -> None:
        import pointmass as pm

        particles = pm.Particles(p.x, m=p.mass, dtype=self.dtype)
        particles.pin(p.pinned)
        forces: list[Any] = [pm.Gravity((0, p.g, 0))]
        forces += [pm.Springs(a, p.k_s, 0.0, r) for a, r in zip(p.families, p.rest, strict=True)]
        self.sim = pm.Simulation(pm.ParticleSystem(particles, forces), pm.XPBD(p.iterations), p.dt)
        self.steps = p.substeps


class Pointmass64(Pointmass):
    """In float64, as pypbd."""

    name = "pointmass, float64"
    dtype = np.float64


class PyPBD(Contestant):
    """PositionBasedDynamics by its authors: C++ and OpenMP, float64."""

    name = "pypbd"

    def __init__(self, p: Relaxed) -> None:
        import pypbd as pbd

        super().__init__(p)
        simulation = pbd.Simulation.getCurrent()
        simulation.initDefault()
        self.model, self.step = simulation.getModel(), simulation.getTimeStep()
        self.particles = self.model.getParticles()
        for i, x in enumerate(p.x.astype(np.float64)):
            self.particles.addVertex(x)
            self.particles.setPosition0(i, SHRUNK * x)  # where springs have their lengths from
        for i, w in enumerate(p.w):
            self.particles.setMass(i, p.mass if w > 0 else 0.0)
        for a, b in p.pairs.tolist():
            self.model.addDistanceConstraint_XPBD(a, b, p.k_s)
        pbd.TimeManager.getCurrent().setTimeStepSize(p.dt * p.substeps)
        self.step.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, p.substeps)
        self.step.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, p.iterations)

    def frame(self) -> None:
        self.step.step(self.model)

    def result(self) -> Array:
        return np.array(self.particles.getVertices())


class NumPy(Contestant):
    """Colour by colour."""

    name = "NumPy, colours"

    def __init__(self, p: Relaxed) -> None:
        super().__init__(p)
        self.state = p.x.astype(np.float32), np.zeros(p.x.shape, np.float32)
        _ = p.colours

    def frame(self) -> None:
        self.state = numpy_frame(self.problem, self.problem.colours, *self.state)

    def result(self) -> Array:
        return self.state[0]


class Taichi(Contestant):
    """A kernel for each colour; springs sorted by colour."""

    name = "Taichi, colours"

    def __init__(self, p: Relaxed) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti = ti
        order = np.concatenate(p.colours)
        self.ends = np.cumsum([0, *map(len, p.colours)]).tolist()
        n, e = len(p.x), len(order)
        self.x = x = ti.Vector.field(3, ti.f32, n)
        y, v = ti.Vector.field(3, ti.f32, n), ti.Vector.field(3, ti.f32, n)
        w, rest, noted, pairs = (
            ti.field(ti.f32, n),
            ti.field(ti.f32, e),
            ti.field(ti.f32, e),
            ti.Vector.field(2, ti.i32, e),
        )
        x.from_numpy(p.x.astype(np.float32))
        w.from_numpy(p.w.astype(np.float32))
        rest.from_numpy(p.lengths[order].astype(np.float32))
        pairs.from_numpy(p.pairs[order])
        h, g, softness = p.dt, ti.Vector([0.0, p.g, 0.0]), 1 / (p.k_s * p.dt**2)

        @ti.kernel
        def begin():
            for i in x:
                if w[i] > 0:
                    v[i] += h * g
                y[i] = x[i] + h * v[i]
            for e in noted:
                noted[e] = 0.0

        @ti.kernel
        def relax(first: ti.i32, last: ti.i32):
            for e in range(first, last):
                a, b = pairs[e][0], pairs[e][1]
                d = y[a] - y[b]
                length = d.norm()
                more = -(length - rest[e] + softness * noted[e]) / (w[a] + w[b] + softness)
                noted[e] += more
                d *= more / length
                y[a] += w[a] * d
                y[b] -= w[b] * d

        @ti.kernel
        def finish():
            for i in x:
                v[i] = (y[i] - x[i]) / h
                x[i] = y[i]

        self.kernels = begin, relax, finish

    def frame(self) -> None:
        begin, relax, finish = self.kernels
        for _ in range(self.problem.substeps):
            begin()
            for _ in range(self.problem.iterations):
                for first, last in zip(self.ends[:-1], self.ends[1:], strict=True):
                    relax(first, last)
            finish()
        self.ti.sync()

    def result(self) -> Array:
        return self.x.to_numpy()


CONTESTANTS = [Pointmass, Pointmass64, PyPBD, Taichi, NumPy]
