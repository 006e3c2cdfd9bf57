"""Fish: many equal ones, each of 23 masses, 79 springs, 12 muscles, 78 triangles that feel the water, and fins.

They beat their tails without a brain, so that peers can do the same. The scene `school`, with the brains of all, is
timed alone.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.track import Array, Contestant, Judge, Race, against
from benchmarks.workloads.peers import Ours, start_taichi

if TYPE_CHECKING:
    import pointmass as pm

TITLE = "Fish"
SCHOOL = "A school with brains, six frames and a look"
LENGTH = 0.3  # [m]
SUBSTEPS = 16
DT = 1 / 60 / SUBSTEPS
LOOK = 6 * SUBSTEPS  # steps from one look of the brains to the next
TOLERANCE = 1e-3  # of a fish
JUDGED = 4  # fish that the judge looks at
BEAT, FREQUENCY = 0.2, 2.0  # of the tail [1, 1/s]
PRODUCTS = 4170  # multiplications in the laws, for a fish and a step


def races(quick: bool) -> list[Race]:
    """Ten thousand that swim straight on; a school of one and of ten thousand."""
    count = 50 if quick else 10_000
    race = partial(Race, unit="fish-steps", slots=PRODUCTS)
    alone = race(
        TITLE,
        f"{count:,} fish",
        partial(shoal, count),
        CONTESTANTS,
        judge,
        work=float(SUBSTEPS * count),
        particles=23 * count,
        traffic=23 * 48 / SUBSTEPS,
    )
    schools = [
        race(
            SCHOOL,
            f"{n:,} fish",
            partial(int, n),
            [Brains],
            judge_school,
            work=float(LOOK * n),
            particles=23 * n,
            traffic=23 * 48 / LOOK,
        )
        for n in ((20,) if quick else (1000, 10_000))
    ]
    return [alone, *schools]


@dataclass(frozen=True)
class Shoal:
    """Fish side by side, in arrays; those of the first one are enough, as all are equal.

    Attributes
    ----------
    x : shape (fish, 23, 3) [m].
    mass : shape (23,) [kg].
    springs, k_s, k_d, rest : ends of all springs, muscles too, and their numbers, shape (91, ...).
    wave, phase : how much of its length each is longer and shorter, and when, shape (91,); 0 for those that are none.
    faces, drag : triangles in the water, shape (f, 3), and their drag [N s/m^3], shape (f,).
    section, fins, upright : nodes of the section with the fins, area times drag [N s/m], and what keeps it upright [N].
    """

    x: Array
    mass: Array
    springs: NDArray[np.int32]
    k_s: Array
    k_d: Array
    rest: Array
    wave: Array
    phase: Array
    faces: NDArray[np.int32]
    drag: Array
    section: NDArray[np.int32]
    fins: float
    upright: float


def bodies(count: int) -> "pm.Body":
    """The fish of pointmass, which beat their tails."""
    import pointmass as pm
    from pointmass.controllers.swimmers import LAG, SEGMENTS, SIDES, SWIMS

    side = math.ceil(math.sqrt(count))
    k = np.arange(count)
    places = LENGTH * np.stack([np.zeros(count), 0.5 * (k // side), 0.5 * (k % side)], axis=1)
    body = pm.fish(count, places, length=LENGTH)
    muscles = next(f for f in body.forces if isinstance(f, pm.Muscles))
    beat = {"amplitude": BEAT * SIDES * SWIMS, "frequency": np.full(12, FREQUENCY), "phase": -LAG * SEGMENTS}
    muscles.put(**{name: np.tile(value, count) for name, value in beat.items()})
    return body


def shoal(count: int) -> Shoal:
    """The same in arrays."""
    import pointmass as pm

    one, p = bodies(1), bodies(count).particles
    springs: list[Any] = [f for f in one.forces if isinstance(f, pm.Springs)]
    columns: dict[str, list[Array]] = {name: [] for name in ("k_s", "k_d", "rest", "amplitude", "phase")}
    for force in springs:
        force.bind(one.particles)
        numbers = force.settings(one.particles, 0.0, np.arange(len(force.ids)))
        for name, column in columns.items():
            column.append(np.broadcast_to(numbers.get(name, (0.0,))[0], len(force.ids)).astype(np.float64))
    k_s, k_d, rest, wave, phase = (np.concatenate(column) for column in columns.values())
    (water,) = (f for f in one.forces if isinstance(f, pm.Water))
    (fins,) = (f for f in one.forces if isinstance(f, pm.Fins))
    number = {n: float(np.ravel(v.components[0].value)[0]) for n, v in fins.parameters.items() if not v.vector}
    return Shoal(
        p.x.reshape(count, 23, 3).copy(),
        one.particles.m.copy(),
        np.concatenate([f.ids for f in springs]).astype(np.int32),
        k_s,
        k_d,
        rest,
        wave,
        phase,
        water.ids.astype(np.int32),
        np.broadcast_to(water.parameters["drag"].components[0].value, len(water.ids)).astype(np.float64),
        fins.ids[0].astype(np.int32),
        number["area"] * number["drag"],
        number["upright"],
    )


def judge(problem: Shoal, scheme: str) -> Judge:
    """By some fish on the reference path in float64; errors in lengths of a fish."""
    import pointmass as pm

    body = bodies(len(problem.x))
    rows = np.arange(23 * min(JUDGED, len(problem.x)))
    part = pm.ParticleSystem(body.particles, body.forces).part(rows)
    sim = pm.Simulation(part, "symplectic_euler", DT, compiled=False)
    sim.step(SUBSTEPS)
    return against(part.particles.x, LENGTH, TOLERANCE, rows)


def judge_school(count: int, scheme: str) -> Judge:
    """By the whole school on the reference path in float64."""
    import pointmass as pm

    sim = school(count, "float64").simulation()
    whole = sim.system
    alone = pm.Simulation(whole, sim.solver, sim.dt, controllers=sim.controllers, seed=sim.seed, compiled=False)
    alone.step(LOOK)
    return against(whole.particles.x, 0.2, TOLERANCE)


def school(count: int, dtype: str = "float32") -> "pm.Scene":
    """The shipped scene."""
    import pointmass as pm

    made = pm.SCENES["school"](fish=count).build()
    made.dtype = dtype
    return made


class Brains(Ours):
    """The scene as `pointmass run school` makes it, in float32."""

    def __init__(self, count: int) -> None:
        self.sim, self.steps = school(count).simulation(), LOOK


class Pointmass(Ours):
    """The public API, as a user writes it."""

    def __init__(self, problem: Shoal) -> None:
        import pointmass as pm

        body = bodies(len(problem.x))
        p = body.particles
        particles = pm.Particles(p.x, m=p.m, dtype=np.float32)
        self.sim = pm.Simulation(pm.ParticleSystem(particles, body.forces), "symplectic_euler", DT)
        self.steps = SUBSTEPS


class NumPy(Contestant):
    """All fish at once, nodes first; sums over elements by a product with a matrix of who belongs to whom."""

    name = "NumPy"

    def __init__(self, p: Shoal) -> None:
        super().__init__(p)
        self.x = np.ascontiguousarray(p.x.transpose(1, 2, 0).astype(np.float32))
        self.v = np.zeros_like(self.x)
        self.t = 0.0
        node = np.arange(23)[:, None]
        at, to = p.springs.T
        self.ends = ((node == at) * 1.0 - (node == to)).astype(np.float32)
        self.corners = sum((node == p.faces[:, k]) / 3.0 for k in range(3)).astype(np.float32)
        self.push = (DT / p.mass).astype(np.float32)[:, None, None]
        self.numbers = [values.astype(np.float32)[:, None] for values in (p.k_s, p.k_d, p.drag)]

    def frame(self) -> None:
        p = self.problem
        for _ in range(SUBSTEPS):
            rest = p.rest * (1 + p.wave * np.sin(2 * math.pi * FREQUENCY * self.t + p.phase))
            self.step(rest.astype(np.float32)[:, None])
            self.t += DT

    def step(self, rest: Array) -> None:
        p, x, v = self.problem, self.x, self.v
        k_s, k_d, drag = self.numbers
        (at, to), (a, b, c) = p.springs.T, p.faces.T
        d, dv = x[at] - x[to], v[at] - v[to]
        square, along = np.einsum("eka,eka->ea", d, d), np.einsum("eka,eka->ea", d, dv)
        d *= -(k_s * (1 - rest / np.sqrt(square)) + k_d * along / square)[:, None]
        f = np.tensordot(self.ends, d, 1)
        u, w = x[b] - x[a], x[c] - x[a]
        normal = 0.5 * np.cross(u, w, axis=1)
        out = np.maximum(np.einsum("eka,eka->ea", normal, (v[a] + v[b] + v[c]) / 3), 0)
        normal *= (-drag * out / np.sqrt(np.einsum("eka,eka->ea", normal, normal)))[:, None]
        f += np.tensordot(self.corners, normal, 1)
        ul, ur, lr, ll = p.section
        rise = x[ul] + x[ur] - x[ll] - x[lr]
        up = rise / np.sqrt((rise * rise).sum(axis=0))
        quarter = np.float32(-0.25 * p.fins) * ((v[p.section].sum(axis=0) / 4) * up).sum(axis=0) * up
        f[p.section] += quarter
        f[[ul, ur], 1] += np.float32(p.upright)
        f[[ll, lr], 1] -= np.float32(p.upright)
        v += self.push * f
        x += np.float32(DT) * v

    def result(self) -> Array:
        return self.x.transpose(2, 0, 1).reshape(-1, 3)


class TaichiScatter(Contestant):
    """Over all elements, with atomic additions; one kernel for each substep."""

    name = "Taichi, scatter"

    def __init__(self, p: Shoal) -> None:
        import taichi as ti

        start_taichi(ti)
        super().__init__(p)
        self.ti, self.count, self.t = ti, len(p.x), 0.0
        self.x, self.v, self.f = (ti.Vector.field(3, ti.f32, (self.count, 23)) for _ in range(3))
        self.x.from_numpy(p.x.astype(np.float32))
        self.kernel = self.build(p)

    def fields(self, p: Shoal) -> dict[str, Any]:
        """The numbers of one fish."""
        ti, made = self.ti, {}
        for name in ("k_s", "k_d", "rest", "wave", "phase", "drag"):
            values = getattr(p, name)
            made[name] = ti.field(ti.f32, len(values))
            made[name].from_numpy(values.astype(np.float32))
        made["w"] = ti.field(ti.f32, 23)
        made["w"].from_numpy((1 / p.mass).astype(np.float32))
        for name, wide in (("springs", 2), ("faces", 3)):
            made[name] = ti.Vector.field(wide, ti.i32, len(getattr(p, name)))
            made[name].from_numpy(getattr(p, name))
        return made

    def laws(self, p: Shoal) -> tuple[Any, Any, Any]:
        """The forces of a spring, of a triangle and of the fins, as functions of a fish, an element and the time."""
        ti, x, v, f, one = self.ti, self.x, self.v, self.f, self.fields(p)
        k_s, k_d, rest, wave, phase = (one[name] for name in ("k_s", "k_d", "rest", "wave", "phase"))
        ends, faces, drag = one["springs"], one["faces"], one["drag"]
        turn, fins, upright = 2 * math.pi * FREQUENCY, p.fins, p.upright
        ul, ur, lr, ll = (int(k) for k in p.section)

        @ti.func
        def spring(i, e, t):
            a, b = ends[e][0], ends[e][1]
            d, dv = x[i, a] - x[i, b], v[i, a] - v[i, b]
            inverse = 1 / d.norm()
            length = rest[e]
            if wave[e] != 0.0:
                length *= 1 + wave[e] * ti.sin(turn * t + phase[e])
            force = -(k_s[e] * (1 - length * inverse) + k_d[e] * d.dot(dv) * inverse * inverse) * d
            f[i, a] += force
            f[i, b] -= force

        @ti.func
        def water(i, e):
            a, b, c = faces[e][0], faces[e][1], faces[e][2]
            normal = 0.5 * (x[i, b] - x[i, a]).cross(x[i, c] - x[i, a])
            out = ti.max(normal.dot(v[i, a] + v[i, b] + v[i, c]) / 3, 0.0)
            third = -drag[e] * out / (3 * normal.norm()) * normal
            f[i, a] += third
            f[i, b] += third
            f[i, c] += third

        @ti.func
        def section(i):
            up = (x[i, ul] + x[i, ur] - x[i, ll] - x[i, lr]).normalized()
            quarter = -0.25 * fins * (0.25 * (v[i, ul] + v[i, ur] + v[i, lr] + v[i, ll])).dot(up) * up
            pull = ti.Vector([0.0, upright, 0.0])
            f[i, ul] += quarter + pull
            f[i, ur] += quarter + pull
            f[i, lr] += quarter - pull
            f[i, ll] += quarter - pull

        self.w = one["w"]
        return spring, water, section

    def build(self, p: Shoal) -> Any:
        ti, x, v, f, count, h = self.ti, self.x, self.v, self.f, self.count, DT
        (spring, water, section), w = self.laws(p), self.w
        springs, faces = len(p.springs), len(p.faces)

        @ti.kernel
        def advance(t: ti.f32):
            for i, k in f:
                f[i, k] = ti.Vector([0.0, 0.0, 0.0])
            for i, e in ti.ndrange(count, springs):
                spring(i, e, t)
            for i, e in ti.ndrange(count, faces):
                water(i, e)
            for i in range(count):
                section(i)
            for i, k in x:
                v[i, k] += h * w[k] * f[i, k]
                x[i, k] += h * v[i, k]

        return advance

    def frame(self) -> None:
        for _ in range(SUBSTEPS):
            self.kernel(self.t)
            self.t += DT
        self.ti.sync()

    def result(self) -> Array:
        return self.x.to_numpy().reshape(-1, 3)


class TaichiByFish(TaichiScatter):
    """A thread to a fish, the loop over substeps inside the kernel."""

    name = "Taichi, substeps fused by fish"

    def build(self, p: Shoal) -> Any:
        ti, x, v, f, count, h = self.ti, self.x, self.v, self.f, self.count, DT
        (spring, water, section), w = self.laws(p), self.w
        springs, faces = len(p.springs), len(p.faces)

        @ti.kernel
        def advance(begin: ti.f32):
            for i in range(count):
                for s in range(SUBSTEPS):
                    t = begin + s * h
                    for k in range(23):
                        f[i, k] = ti.Vector([0.0, 0.0, 0.0])
                    for e in range(springs):
                        spring(i, e, t)
                    for e in range(faces):
                        water(i, e)
                    section(i)
                    for k in range(23):
                        v[i, k] += h * w[k] * f[i, k]
                        x[i, k] += h * v[i, k]

        return advance

    def frame(self) -> None:
        self.kernel(self.t)
        self.t += SUBSTEPS * DT
        self.ti.sync()


CONTESTANTS = [Pointmass, TaichiScatter, TaichiByFish, NumPy]
