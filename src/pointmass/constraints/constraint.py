"""What must hold at the end of each step, whatever the forces have done in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pointmass.description import Described
from pointmass.particles import Array, Particles
from pointmass.system import ParticleSystem


@dataclass(frozen=True, eq=False)
class Step:
    """A step that the solver has just made.

    Attributes
    ----------
    t0, t1 : its start and end [s].
    ids : of the particles that made it, shape (n,).
    x, v : positions [m] and velocities [m/s] at its start, shape (n, 3); those at its end are the particles' own.
    """

    t0: float
    t1: float
    ids: NDArray[np.int64]
    x: Array
    v: Array

    @property
    def dt(self) -> float:
        """Its length [s]."""
        return self.t1 - self.t0

    def begun(self, particles: Particles) -> tuple[Array, Array]:
        """Positions and velocities at its start of those who are there now; who was not is where it is."""
        if np.array_equal(self.ids, particles.id):
            return self.x, self.v
        x, v = particles.x.copy(), particles.v.copy()
        _, old, new = np.intersect1d(self.ids, particles.id, return_indices=True)
        x[new], v[new] = self.x[old], self.v[old]
        return x, v


class Constraint(Described):
    """What must hold at the end of each step.

    A run enforces its constraints in their order after each step of dt, before anybody dies or is born. What is put
    right is so for the next step and in every frame; the solver does not know of it.

    Attributes
    ----------
    breaks_up : whether it changes who is joined to whom.
    """

    breaks_up: ClassVar[bool] = False

    def bind(self, system: ParticleSystem) -> None:
        """Look at the start of a run, once.

        Raises
        ------
        InvalidInput
            The system has nothing that this can be about.
        """
        raise NotImplementedError

    def forget(self) -> None:
        """Remember nothing of earlier steps: called on a fixed grid of steps, so that a run can go on from there."""

    def state(self) -> dict[str, NDArray[Any]]:
        """What it still remembers of earlier steps, as arrays by name: see `Simulation.state`."""
        return {}

    def put_state(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Remember what a `state` says."""

    def enforce(self, system: ParticleSystem, step: Step) -> None:
        """Move the particles of `system` from where a step left them to where they may be, in place.

        Pinned particles keep their bits. The same bits come out on any number of threads.

        Raises
        ------
        Diverged
            It cannot be made to hold.
        """
        raise NotImplementedError


def between(step: Step, particles: Particles, t: float) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] of the present particles at a time within a step, on straight lines.

    What is not through anything at both ends of a step, on paths that were checked as straight, is not so in between.
    Who was not there at the start stands where it is.
    """
    share = np.asarray((t - step.t0) / step.dt, particles.dtype)
    x, v = step.begun(particles)
    return x + share * (particles.x - x), v + share * (particles.v - v)


def carried_over(particles: Particles, before: Array, dt: float) -> None:
    """Put into the velocities how far particles were moved from where they were `before`, over dt [s]."""
    moved = (particles.x != before).any(axis=1)
    particles.v[moved] += (particles.x[moved] - before[moved]) / np.asarray(dt, particles.dtype)
