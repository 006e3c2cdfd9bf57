"""Says at the start of a run, in a moment, that its step is too long for its springs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pointmass.element_motion import Element, ElementBlocks, element_blocks, element_forces
from pointmass.errors import InvalidInput
from pointmass.laws.force import Blocks
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.base import Array, Solver
from pointmass.solvers.control import control_of
from pointmass.solvers.stability import grows, largest_safe_steps

if TYPE_CHECKING:
    from pointmass.system import ParticleSystem

LARGE = 1_000_000  # numbers in the matrices of all elements, beyond which a part of the system is looked at
WORK = 10_000_000  # of them that may be multiplied by a vector
SHORTEST, LONGEST = 6, 40  # iterations
CLEARLY = 1.001  # times the limit: nearer than this the iterations do not tell
LAST = 1e-10  # of the first rest of the iterations, where they have found all


def too_long(system: ParticleSystem, solver: Solver, dt: float) -> str | None:
    """One sentence if steps of dt amplify the fastest motion of the springs as they are now, else None.

    A few Lanczos iterations find a motion that is nearly as fast as the fastest: so what is said is true, and a step
    within some percent of the limit may pass. `ParticleSystem.stability` takes its time and finds the limit itself. Of
    very large systems the first particles are looked at.

    Parameters
    ----------
    solver : explicit ones have a limit; those that choose their own steps keep to it.
    dt : [s].
    """
    if solver.implicit or control_of(solver) is not None or not any(element_forces(system)):
        return None
    try:
        with np.errstate(all="ignore"):
            part = _first(system)
            return _sentence(part, element_blocks(part), solver, dt)
    except InvalidInput:  # a parameter that is not allowed now: the run says so itself
        return None


def _sentence(system: ParticleSystem, blocks: Sequence[ElementBlocks], solver: Solver, dt: float) -> str | None:
    n = len(system.particles)
    numbers = sum(each.pull.size for each in blocks)
    if not all(np.isfinite(each.pull).all() and np.isfinite(each.drag).all() for each in blocks):
        return None
    kinds = [[each.pull for each in blocks], [each.drag for each in blocks]]
    acting = [kind for kind in kinds if any(matrices.any() for matrices in kind)]
    if not acting:
        return None
    steps = int(np.clip(WORK // numbers, SHORTEST, LONGEST))
    motions = [_fastest(_product(blocks, kind, n), 3 * n, steps) for kind in acting]
    modes = np.array([[_energy(blocks, kind, x).sum() for x in motions] for kind in kinds])
    if not grows(solver, modes[0], modes[1], dt / CLEARLY).any():
        return None
    modes += np.array([_others(system, x) for x in motions]).T  # air may damp what springs do not
    limits = largest_safe_steps(solver, modes[0], modes[1])
    worst = int(np.argmin(limits))
    limit = float(limits[worst])
    if not dt > CLEARLY * limit:
        return None
    carrier = _carrier(blocks, acting[worst], motions[worst])
    stiffness, damping = modes[:, worst]
    if limit == 0.0:
        return f"{solver.name} amplifies the motion of {carrier} at any dt: use symplectic_euler, rk4 or implicit_euler"
    root = 0.25 * damping * damping - stiffness
    speed = math.sqrt(stiffness) if root < 0.0 else 0.5 * damping + math.sqrt(root)
    return (
        f"dt = {dt:.3g} s is too long for {solver.name}: {carrier} takes part in a motion with "
        f"{'omega' if root < 0.0 else 'rate'} dt = {speed * dt:.3g}, and the limit is {speed * limit:.3g}; "
        f"the largest safe dt is about {limit:.3g} s: use a smaller dt, more substeps or implicit_euler"
    )


def _first(system: ParticleSystem) -> ParticleSystem:
    """As much of a system as can be looked at in a moment."""
    numbers = sum((3 * force.nodes) ** 2 * len(force.ids) for force in element_forces(system))
    if numbers <= LARGE:
        return system
    return system.part(np.arange(int(len(system.particles) * LARGE / numbers)))


def _product(blocks: Sequence[ElementBlocks], kind: Sequence[Array], n: int) -> Callable[[Array], Array]:
    """Multiplies a motion by the matrix of all elements."""
    parts = []
    for each, matrices in zip(blocks, kind, strict=True):
        e, k = each.root.shape
        entries = (3 * each.rows[:, :, None] + np.arange(3)).reshape(e, 3 * k)
        parts.append((each.scaled(matrices), entries))

    def times(x: Array) -> Array:
        result = np.zeros(3 * n)
        for scaled, entries in parts:
            pulled = np.einsum("eij,ej->ei", scaled, x[entries])
            result += np.bincount(entries.ravel(), pulled.ravel(), 3 * n)
        return result

    return times


def _fastest(times: Callable[[Array], Array], size: int, steps: int) -> Array:
    """Nearly the eigenvector of the largest eigenvalue of a symmetric matrix, by Lanczos's method (1950)."""
    basis = [_unit(np.cos(np.arange(size)))]
    diagonal: list[float] = []
    beside: list[float] = []
    for _ in range(min(steps, size)):
        x = times(basis[-1])
        if beside:
            x -= beside[-1] * basis[-2]
        diagonal.append(float((basis[-1] * x).sum()))
        x -= diagonal[-1] * basis[-1]
        rest = math.sqrt((x * x).sum())
        if not rest > LAST * max(map(abs, (*diagonal, *beside))):
            break
        beside.append(rest)
        basis.append(x / rest)
    count = len(diagonal)
    matrix = np.diag(diagonal) + np.diag(beside[: count - 1], 1) + np.diag(beside[: count - 1], -1)
    weights = np.linalg.eigh(matrix)[1][:, -1]
    return _unit(np.asarray(sum((w * q for w, q in zip(weights, basis, strict=False)), start=np.zeros(size))))


def _unit(x: Array) -> Array:
    return np.asarray(x / math.sqrt((x * x).sum()))


def _energy(blocks: Sequence[ElementBlocks], kind: Sequence[Array], x: Array) -> Array:
    """Of each element in a motion, those of all forces one after another."""
    return np.concatenate([each.energy(matrices, each.of(x)) for each, matrices in zip(blocks, kind, strict=True)])


def _others(system: ParticleSystem, x: Array) -> tuple[float, float]:
    """What forces on single particles add to the stiffness and to the damping of a motion."""
    p, blocks = system.particles, Blocks()
    for force in system.forces:
        if isinstance(force, UnaryForce) and force.enabled:
            force.add_jacobian(p, system.t, p.x, p.v, blocks)
    moved = x.reshape(-1, 3) * np.sqrt(np.where(p.pinned, 0.0, p.w))[:, None]
    both = np.zeros(2)
    for rows, dx, dv in blocks.own:
        both -= [np.einsum("ni,nij,nj", moved[rows], d, moved[rows]) for d in (dx, dv)]
    return float(both[0]), float(both[1])


def _carrier(blocks: Sequence[ElementBlocks], kind: Sequence[Array], x: Array) -> Element:
    """The element with most of the energy of a motion."""
    energy = _energy(blocks, kind, x)
    number = int(energy.argmax())
    for each in blocks:
        if number < len(each.rows):
            break
        number -= len(each.rows)
    return each.element(number, float(energy.max() / energy.sum()))
