"""What a user adds to a system by hand, and takes back: pins, springs and particles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.forces import Springs
from pointmass.laws.force import Force
from pointmass.simulation import Simulation
from pointmass.system import ParticleSystem
from pointmass.viewer.inputs import Cut, Drop, Input, Join, Pin, Remove
from pointmass.viewer.messages import Vector, vector
from pointmass.viewer.mouse import STIFFEST

FAMILY = "added"  # of the springs
RATE = 30.0  # of a spring with its two particles alone, sqrt(k_s / m) [1/s]
DAMPING_RATIO = 0.1


class _Spring(NamedTuple):
    """One that was added: its ends, stiffness [N/m], damping [N s/m] and rest length [m]."""

    ids: tuple[int, int]
    k_s: float
    k_d: float
    rest: float


def change(sim: Simulation, system: ParticleSystem, what: Input) -> None:
    """Do what an input says to the system of a simulation, or to a copy of it.

    Raises
    ------
    InvalidInput
        It is not allowed, and nothing has changed.
    """
    match what:
        case Pin(particle, on):
            if not on and any(particle in motion.ids for motion in sim.motions):
                raise InvalidInput(f"particle {particle} is led by a motion of the scene: it cannot be let go")
            pin(system, particle, on)
        case Join(first, second, rest):
            join(system, first, second, sim.dt, sim.solver.implicit, rest)
        case Cut(first, second):
            cut(system, first, second)
        case Drop(place, particle):
            drop(system, place, particle)
        case Remove(particle):
            system.remove([_row(system, particle)])


def undoing(system: ParticleSystem, what: Input) -> Input | None:
    """The input that takes back another one, which was not done yet; None if that changes nothing.

    Raises
    ------
    InvalidInput
        The input is not allowed.
    """
    match what:
        case Pin(particle, on):
            return Pin(particle, not on) if pinned(system, [particle]) != on else None
        case Join(first, second):
            return Cut(first, second)
        case Cut(first, second):
            springs = _added(system)
            return Join(first, second, springs[_newest(springs, first, second)].rest)
        case Drop(_, particle):
            return Remove(system.particles.next_id if particle is None else particle)
        case Remove(particle):
            return Drop(vector(system.particles.x[_row(system, particle)]), particle)
    return None


def pinned(system: ParticleSystem, particles: list[int]) -> bool:
    """Whether the first of some particles is pinned."""
    row = int(system.particles.rows(np.array(particles[:1], np.int64))[0]) if particles else -1
    return row >= 0 and bool(system.particles.pinned[row])


def pin(system: ParticleSystem, particle: int, on: bool) -> None:
    """Hold a particle where it is, or let it go.

    Raises
    ------
    InvalidInput
        There is no such particle any more.
    """
    row = _row(system, particle)
    if on:
        system.particles.pin([row])
    else:
        system.particles.unpin([row])


def join(system: ParticleSystem, first: int, second: int, h: float, implicit: bool, rest: float | None = None) -> None:
    """Put a spring between two particles, with a rest length [m]; None = as long as they are apart.

    It is as stiff as lets the two swing with RATE, or as a step of h [s] of an explicit solver demands.

    Raises
    ------
    InvalidInput
        One is no longer there, both are the same or pinned, or the system is a flow.
    """
    if system.order == 1:
        raise InvalidInput("a spring joins masses, and a flow has none")
    p, rows = system.particles, [_row(system, particle) for particle in (first, second)]
    if first == second:
        raise InvalidInput("a spring joins two particles: pick another one first")
    inverse = float(p.w[rows].sum())
    if inverse == 0:
        raise InvalidInput("a spring between two pinned particles moves nobody: let one go first")
    rate = RATE if implicit else min(RATE, STIFFEST / h)
    k_s, k_d = rate**2 / inverse, 2 * DAMPING_RATIO * rate / inverse
    if rest is None:
        rest = float(np.linalg.norm(p.x[rows[0]].astype(np.float64) - p.x[rows[1]]))
    _have(system, [*_added(system), _Spring((first, second), k_s, k_d, rest)])


def cut(system: ParticleSystem, first: int, second: int) -> None:
    """Take away the newest spring that was put between two particles.

    Raises
    ------
    InvalidInput
        There is none.
    """
    springs = _added(system)
    del springs[_newest(springs, first, second)]
    _have(system, springs)


def drop(system: ParticleSystem, place: Vector, particle: int | None = None) -> int:
    """Add a particle at rest, as heavy and as large as most; its id, which may be that of one who is gone.

    Raises
    ------
    InvalidInput
        A force has numbers for each particle, which a new one would lack.
    """
    p = system.particles
    m, radius = (float(np.median(a)) if len(p) else default for a, default in ((p.m, 1.0), (p.radius, 0.0)))
    return int(system.add([place], m=m, radius=radius, id=None if particle is None else [particle])[0])


def _force(system: ParticleSystem) -> Springs | None:
    return next((f for f in system.forces if isinstance(f, Springs) and f.family == FAMILY), None)


def _added(system: ParticleSystem) -> list[_Spring]:
    """The springs that were added, the newest last."""
    force = _force(system)
    if force is None:
        return []
    k_s, k_d, rest = (np.asarray(force.parameters[n].components[0].value).tolist() for n in ("k_s", "k_d", "rest"))
    return [_Spring((a, b), *numbers) for (a, b), *numbers in zip(force.ids.tolist(), k_s, k_d, rest, strict=True)]


def _newest(springs: list[_Spring], first: int, second: int) -> int:
    found = [k for k, spring in enumerate(springs) if spring.ids == (first, second)]
    if not found:
        raise InvalidInput(f"there is no spring any more between the particles {first} and {second}")
    return found[-1]


def _have(system: ParticleSystem, springs: list[_Spring]) -> None:
    """Have these in place of those that were added."""
    old = _force(system)
    place = len(system.forces) if old is None else system.forces.index(old)
    new: list[Force] = []
    if springs:
        ids, k_s, k_d, rest = (list(column) for column in zip(*springs, strict=True))
        new = [Springs(ids, k_s, k_d, rest, family=FAMILY)]
        new[0].bind(system.particles)
    system.forces[place : place + 1] = new
    system.particles.version += 1


def _row(system: ParticleSystem, particle: int) -> int:
    row = int(system.particles.rows(np.array([particle]))[0])
    if row < 0:
        raise InvalidInput(f"particle {particle} is no longer there: pick another one")
    return row
