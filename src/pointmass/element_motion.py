"""Motions of elements: how fast each spring, joint or hinge swings by itself, and how much of a motion it carries."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.solvers.base import Array, Solver
from pointmass.solvers.stability import largest_safe_steps

if TYPE_CHECKING:
    from pointmass.system import ParticleSystem

SHIFT = 4.0  # times the root of the precision: how far a joint is bent, in edges


@dataclass(frozen=True)
class Element:
    """One element of a force and what it carries of a motion; as text its name, such as "spring 17 of family shear
    (particles 3-12)".

    Attributes
    ----------
    force : its name, such as "springs".
    family : such as "shear"; the name of the force where it has no families.
    number : of the element within its force.
    particles : ids of its particles.
    part : of the energy of the motion, from 0 to 1.
    """

    force: str
    family: str
    number: int
    particles: tuple[int, ...]
    part: float

    def __str__(self) -> str:
        family = f" of family {self.family}" if self.family != self.force else ""
        ids = "-".join(str(i) for i in self.particles)
        return f"{self.force.removesuffix('s')} {self.number}{family} (particles {ids})"


@dataclass(frozen=True, eq=False)
class ElementMotions:
    """The fastest motion of each element of a force as if nothing else were there; arrays have shape (e,).

    Attributes
    ----------
    force : its name, such as "springs".
    family : such as "shear"; the name of the force where it has no families.
    ids : particles of the elements, shape (e, nodes).
    frequency : root of the largest eigenvalue of M^-1/2 K M^-1/2, K being the element's stiffness [rad/s]: of a spring
        sqrt(k_s (1/m1 + 1/m2)).
    damping_ratio : of that motion, 1 = critical; infinite for what has no stiffness.
    largest_safe_dt : of the element alone [s].
    largest_safe_dt_together : where its neighbours are [s]: sums over the elements at each particle bound what can
        move there, nodes(e) sum_e K_ii / m_i, and are scaled so that the least of all is that of the system.
    part : of the energy of the motion of the system that limits the step; with those of other forces they sum to 1.
    """

    force: str
    family: str
    ids: NDArray[np.int64]
    frequency: Array
    damping_ratio: Array
    largest_safe_dt: Array
    largest_safe_dt_together: Array
    part: Array

    def share(self, dt: float) -> Array:
        """Of the solver's limit that each element takes by itself: 1 = at the edge, above 1 it is unstable alone."""
        return _share(dt, self.largest_safe_dt)

    def share_together(self, dt: float) -> Array:
        """Likewise with its neighbours: the largest of all is dt over the largest safe step of the system."""
        return _share(dt, self.largest_safe_dt_together)

    def element(self, number: int) -> Element:
        """One of them by its number."""
        particles = tuple(int(i) for i in self.ids[number])
        return Element(self.force, self.family, number, particles, float(self.part[number]))


class ElementBlocks(NamedTuple):
    """Stiffness and damping of the elements of one force.

    Attributes
    ----------
    force : whose they are.
    rows : of the particles of the elements, shape (e, nodes).
    root : of 1/m of these particles, 0 where they are pinned, shape (e, nodes).
    pull, drag : symmetric parts of -df/dx and -df/dv, shape (e, nodes, 3, nodes, 3).
    """

    force: ElementForce
    rows: NDArray[np.intp]
    root: Array
    pull: Array
    drag: Array

    def scaled(self, blocks: Array) -> Array:
        """M^-1/2 B M^-1/2 of `pull` or `drag`, shape (e, 3 nodes, 3 nodes)."""
        e, k = self.root.shape
        weighed = blocks * self.root[:, :, None, None, None] * self.root[:, None, None, :, None]
        return weighed.reshape(e, 3 * k, 3 * k)

    def element(self, number: int, part: float) -> Element:
        """One of them, which carries a part of a motion."""
        particles = tuple(int(i) for i in self.force.ids[number])
        return Element(self.force.name, self.force.family, number, particles, part)

    def of(self, vector: Array) -> Array:
        """What each element sees of a motion of all particles, shape (e, nodes, 3)."""
        return vector.reshape(-1, 3)[self.rows]

    def energy(self, blocks: Array, moved: Array) -> Array:
        """u^T M^-1/2 B M^-1/2 u of `pull` or `drag` for motions u, shape (e, nodes, 3) -> (e,)."""
        u = moved * self.root[:, :, None]
        return np.asarray((blocks * u[:, :, :, None, None] * u[:, None, None]).sum(axis=(1, 2, 3, 4)))


def element_forces(system: ParticleSystem) -> Iterator[ElementForce]:
    """The forces on elements that act now."""
    for force in system.forces:
        if isinstance(force, ElementForce) and force.enabled and len(force.ids):
            yield force


def element_blocks(system: ParticleSystem) -> list[ElementBlocks]:
    """Of all forces on elements that act now."""
    p = system.particles
    x, v = bent(system).astype(np.float64), p.v.astype(np.float64)
    weight = np.sqrt(np.where(p.pinned, 0.0, p.w.astype(np.float64)))
    result = []
    for force in element_forces(system):
        rows = force.rows(p)
        dx, dv = (_symmetric(-d) for d in force.element_jacobians(p, system.t, x, v))
        result.append(ElementBlocks(force, rows, weight[rows], dx, dv))
    return result


def element_sums(system: ParticleSystem) -> Array:
    """Sums over the elements at each particle of |M^-1/2 B M^-1/2|, B being df/dx and df/dv, shape (2, n)."""
    p = system.particles
    x, v = bent(system).astype(np.float64), p.v.astype(np.float64)
    weight = np.sqrt(np.where(p.pinned, 0.0, p.w.astype(np.float64)))
    sums = np.zeros((2, len(p)))
    for force in element_forces(system):
        rows = force.rows(p)
        for k, matrices in enumerate(force.element_jacobians(p, system.t, x, v)):
            squares = np.zeros(len(rows))
            for a, b in np.ndindex(force.nodes, force.nodes):
                block = (matrices[:, a, i, b, j] for i, j in np.ndindex(3, 3))  # columns that lie together in memory
                squares += (weight[rows[:, a]] * weight[rows[:, b]]) ** 2 * sum(column * column for column in block)
            sums[k] += np.bincount(rows.ravel(), np.repeat(np.sqrt(squares), force.nodes), len(p))
    return sums


def bent(system: ParticleSystem) -> Array:
    """Positions now, those in elements of three and more particles shifted by next to nothing, shape (n, 3).

    A joint that is exactly straight has no direction of bending and no force, but the least motion gives it its whole
    stiffness: that is what limits a step.
    """
    p = system.particles
    size = np.full(len(p), np.inf)
    for force in element_forces(system):
        if force.nodes > 2:
            rows = force.rows(p)
            edges = np.linalg.norm(np.diff(p.x[rows].astype(np.float64), axis=1), axis=2)
            np.minimum.at(size, rows.ravel(), np.repeat(edges.min(axis=1), force.nodes))
    moved = np.isfinite(size)
    x = p.x.copy()
    if moved.any():
        length = SHIFT * np.sqrt(np.finfo(p.dtype).eps) * size[moved, None]
        x[moved] += (length * random.direction(0, "stability", p.id[moved], "bend")).astype(p.dtype)
    return x


def element_motions(
    blocks: Sequence[ElementBlocks], count: int, solver: Solver, limit: float, vector: Array, by_drag: bool
) -> tuple[ElementMotions, ...]:
    """The table of each force.

    Parameters
    ----------
    count : particles of the system.
    limit : its largest safe step [s].
    vector : its motion that limits the step, for x times the root of the mass, scaled so that its energy is 1.
    by_drag : whether it does so by its damping and not by its stiffness.
    """
    alone = [_alone(each) for each in blocks]
    pull, drag = (_sums(blocks, count, name) for name in ("pull", "drag"))
    modes = [mode for found in alone for mode in found]
    modes += [(pull[each.rows].max(axis=1), drag[each.rows].max(axis=1)) for each in blocks]
    sizes = np.cumsum([len(stiffness) for stiffness, _ in modes])[:-1]
    steps = np.split(largest_safe_steps(solver, *(np.concatenate(each) for each in zip(*modes, strict=True))), sizes)
    if solver.relaxes:
        elastic = [isinstance(each.force, ConstraintForce) for each in blocks]
        owners = [elastic[k // 2] for k in range(2 * len(blocks))] + elastic
        steps = [np.full(len(step), np.inf) if free else step for step, free in zip(steps, owners, strict=True)]
    together = steps[2 * len(blocks) :]
    least = min((float(step.min(initial=np.inf)) for step in together), default=np.inf)
    scale = max(1.0, limit / least) if 0.0 < least < np.inf else 1.0
    return tuple(_tables(blocks, alone, steps, [scale * step for step in together], vector, by_drag))


Mode = tuple[Array, Array]  # stiffness and damping of one motion of each element


def _tables(
    blocks: Sequence[ElementBlocks],
    alone: Sequence[tuple[Mode, Mode]],
    steps: Sequence[Array],
    together: Sequence[Array],
    vector: Array,
    by_drag: bool,
) -> Iterator[ElementMotions]:
    for k, each in enumerate(blocks):
        (stiffness, damping), (_, most) = alone[k]
        damping = np.where(stiffness > 0.0, damping, most)
        speed = np.sqrt(np.maximum(stiffness, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(damping > 0.0, 0.5 * damping / speed, 0.0)
        name = each.force.name
        yield ElementMotions(
            force=name,
            family=each.force.family,
            ids=each.force.ids.copy(),
            frequency=speed,
            damping_ratio=ratio,
            largest_safe_dt=np.minimum(steps[2 * k], steps[2 * k + 1]),
            largest_safe_dt_together=together[k],
            part=each.energy(each.drag if by_drag else each.pull, each.of(vector)),
        )


def _alone(blocks: ElementBlocks) -> tuple[Mode, Mode]:
    """Each element's stiffest motion, and the one that is damped most."""
    found = []
    for strong, other in ((blocks.pull, blocks.drag), (blocks.drag, blocks.pull)):
        value, vector = _strongest(blocks, strong)
        found.append((value, blocks.energy(other, vector)))
    (stiffness, damping), (most, its) = found
    return (stiffness, damping), (its, most)


def _strongest(blocks: ElementBlocks, matrices: Array) -> tuple[Array, Array]:
    """Largest eigenvalue of M^-1/2 B M^-1/2 of each element and its vector, shapes (e,) and (e, nodes, 3)."""
    e, k = blocks.root.shape
    if not matrices.any():
        return np.zeros(e), np.zeros((e, k, 3))
    first = matrices[:, 0, :, 0]
    if k == 2 and all((matrices[:, a, :, b] == (first if a == b else -first)).all() for a in (0, 1) for b in (0, 1)):
        values, vectors = np.linalg.eigh(np.ascontiguousarray(first))  # only the difference counts: a third of the work
        both = np.stack([blocks.root[:, 0], -blocks.root[:, 1]], axis=1)
        weight = (both * both).sum(axis=1)
        both = both / np.sqrt(np.where(weight > 0.0, weight, 1.0))[:, None]
        return values[:, -1] * weight, both[:, :, None] * vectors[:, None, :, -1]
    values, vectors = np.linalg.eigh(blocks.scaled(matrices))
    return values[:, -1], vectors[:, :, -1].reshape(e, k, 3)


def _sums(blocks: Sequence[ElementBlocks], count: int, name: str) -> Array:
    """Bound of what elements do at each particle, from sum_e nodes(e) B_ii / m_i, shape (count,).

    For k parts |a1 + ... + ak|^2 <= k (|a1|^2 + ... + |ak|^2): no motion of all has more energy than these sums have.
    """
    total = np.zeros((count, 3, 3))
    for each in blocks:
        matrices = getattr(each, name)
        for a in range(each.force.nodes):
            weight = each.force.nodes * each.root[:, a] ** 2
            for i in range(3):
                for j in range(i + 1):
                    total[:, i, j] += np.bincount(each.rows[:, a], weight * matrices[:, a, i, a, j], count)
    largest: Array = np.linalg.eigvalsh(total)[:, -1]  # of lower triangles
    return largest


def _symmetric(blocks: Array) -> Array:
    return 0.5 * (blocks + blocks.transpose(0, 3, 4, 1, 2))


def _share(dt: float, limit: Array) -> Array:
    with np.errstate(divide="ignore"):
        share: Array = np.where(np.isinf(limit), 0.0, dt / limit)
    return share
