"""Hair: many equal strands, each a chain of masses with springs to the next mass and to the next but one.

And the hair of the scene `hair`, with all that it has: strands that resist stretch, bending and torsion, wind in gusts,
a soft layer on the head, and roots that turn with it. No peer has that, so it is timed alone, at several shapes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.track import Array, Judge, Race, against
from benchmarks.workloads import springs
from benchmarks.workloads.peers import Ours
from benchmarks.workloads.springs import Springs

if TYPE_CHECKING:
    import pointmass as pm

TITLE = "Hair"
MASSES = 16  # of a strand
LINK = 0.01  # [m]
STIFFNESS = 0.1  # k_s dt^2 / m
DAMPING = 0.01  # k_d dt / m
SUBSTEPS = 16
HEAD = "Hair on a head that turns"
JUDGED = 8  # strands that the judge looks at
PRODUCTS = {"straight": 181, "wavy": 235, "curly": 235}  # multiplications in the laws, for a particle and its elements


def races(quick: bool) -> list[Race]:
    """Ten thousand strands of springs; a hundred thousand masses on a head."""
    strands = 100 if quick else 10_000
    make = partial(hair, strands)
    work = float(SUBSTEPS * strands * (2 * MASSES - 3))
    particles = strands * MASSES
    traffic = 48 * particles / work
    case = f"{strands:,} strands of {MASSES} masses"
    plain = Race(TITLE, case, make, CONTESTANTS, springs.judge, "spring-steps", work, particles, springs.SLOTS, traffic)
    shapes = [Head(6250, 16), Head(5000, 20), Head(4167, 24, "wavy", 0.26), Head(4167, 24, "curly", 0.2)]
    return [plain, *(on_a_head(Head(40, 16) if quick else shape) for shape in shapes[: 1 if quick else None])]


@dataclass(frozen=True)
class Head:
    """The scene `hair` in float32, with its own number of steps."""

    strands: int
    points: int
    style: str = "straight"
    length: float = 0.24

    def scene(self, dtype: str = "float32") -> pm.Scene:
        """The scene itself."""
        import pointmass as pm

        kind = pm.SCENES["hair"]
        made = kind(strands=self.strands, points=self.points, style=self.style, length=self.length).build()
        made.dtype = dtype
        return made

    @property
    def substeps(self) -> int:
        """Steps of a sixtieth of a second; they depend on a strand, not on how many there are."""
        return round(1 / 60 / Head(3, self.points, self.style, self.length).scene().dt)

    @property
    def judged(self) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Rows of some strands."""
        which = np.linspace(0, self.strands - 1, min(JUDGED, self.strands)).astype(np.intp)
        return (which[:, None] * self.points + np.arange(self.points)).ravel()


def on_a_head(head: Head) -> Race:
    """pointmass alone."""
    particles, steps = head.strands * head.points, head.substeps
    style = "" if head.style == "straight" else f" {head.style}"
    case = f"{head.strands:,}{style} strands of {head.points} masses, {steps} steps a frame"
    unit, work = "particle-steps", float(steps * particles)
    return Race(
        HEAD, case, partial(_same, head), [OnAHead], judge_head, unit, work, particles, PRODUCTS[head.style], 48 / steps
    )


def _same(head: Head) -> Head:
    """What workers can be given."""
    return head


def judge_head(head: Head, scheme: str) -> Judge:
    """By some strands alone on the reference path in float64; errors in links."""
    import pointmass as pm

    whole = head.scene("float64").simulation()
    part = whole.system.part(head.judged)
    alone = pm.Simulation(part, whole.solver, whole.dt, motions=whole.motions, compiled=False)
    alone.step(head.substeps)
    return against(part.particles.x, head.length / (head.points - 1), springs.TOLERANCE, head.judged)


class OnAHead(Ours):
    """The scene as `pointmass run hair` makes it, in float32."""

    def __init__(self, head: Head) -> None:
        self.sim, self.steps = head.scene().simulation(), head.substeps


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
