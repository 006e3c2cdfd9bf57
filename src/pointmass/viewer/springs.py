"""The springs of simulations: who is joined, how far they are stretched, and how near their solver's limit they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import NamedTuple

import numpy as np

from pointmass.element_motion import ElementMotions, element_blocks, element_forces, element_motions
from pointmass.frame import Frame, Ints
from pointmass.laws.elements import ConstraintForce
from pointmass.simulation import Simulation
from pointmass.viewer.columns import Numbers

REST = 10.0  # times as long as limits took to compute, until they are computed again


class Values(NamedTuple):
    """A number for each spring between two rows of a frame, shapes (k, 2) and (k,)."""

    pairs: Ints
    value: Numbers


def sections(sims: Sequence[Simulation]) -> Iterator[tuple[Simulation, int]]:
    """Simulations, and the row of a frame at which the particles of each begin."""
    begin = 0
    for sim in sims:
        yield sim, begin
        begin += len(sim.system.particles)


def section_of(sims: Sequence[Simulation], row: int) -> int:
    """The number of the simulation whose particle is in a row of a frame; 0 for a cache."""
    return max(0, sum(begin <= row for _, begin in sections(sims)) - 1)


def any_springs(sims: Sequence[Simulation]) -> bool:
    """Whether there are any."""
    return any(force.nodes == 2 for sim in sims for force in element_forces(sim.system))


def ending_at(sim: Simulation, row: int) -> Ints:
    """The springs of a particle, as rows of its simulation, shape (k, 2)."""
    found = [np.zeros((0, 2), np.intp)]
    for force in element_forces(sim.system):
        if force.nodes == 2:
            rows = force.rows(sim.system.particles)
            found.append(rows[(rows == row).any(axis=1)])
    return np.concatenate(found)


def stretches(frame: Frame, sims: Sequence[Simulation]) -> Values:
    """|l - l0| / l0 of each spring in a frame; the largest is `ParticleSystem.stretch`."""
    pairs: list[Ints] = [np.zeros((0, 2), np.intp)]
    values: list[Numbers] = [np.zeros(0)]
    for sim, begin in sections(sims):
        p = sim.system.particles
        x = frame.positions[begin : begin + len(p)].astype(p.dtype)
        for force in element_forces(sim.system):
            if isinstance(force, ConstraintForce) and force.nodes == 2:
                rest = np.asarray(force.rests(p, frame.time), np.float64)
                with np.errstate(all="ignore"):
                    relative = np.abs(force.values(p, x) - rest) / rest
                pairs.append(force.rows(p) + begin)
                values.append(np.where(rest > 0, relative, 0.0))
    return Values(np.concatenate(pairs), np.concatenate(values))


@dataclass
class _Known:
    """What was found of a simulation, and when it may be looked at again on the clock [s]."""

    sim: Simulation
    version: int
    dt: float
    tables: tuple[ElementMotions, ...]
    until: float


class Limits:
    """How near each spring is to the limit of its solver: 1 and less is stable.

    It is the share of the limit that a spring takes together with its neighbours, `ElementMotions.share_together`,
    by the bound that needs no eigenvalues of the whole system: never below it. It costs more than a frame, so it is
    found again from time to time only.
    """

    def __init__(self) -> None:
        self._known: list[_Known] = []

    def of(self, sims: Sequence[Simulation]) -> Values:
        """A number for each spring."""
        pairs: list[Ints] = [np.zeros((0, 2), np.intp)]
        values: list[Numbers] = [np.zeros(0)]
        for (sim, begin), table in self._tables(sims):
            if table.ids.shape[1] == 2:
                rows = sim.system.particles.rows(table.ids)
                there = (rows >= 0).all(axis=1)
                pairs.append(rows[there] + begin)
                values.append(table.share_together(sim.dt)[there])
        return Values(np.concatenate(pairs), np.concatenate(values))

    def _tables(self, sims: Sequence[Simulation]) -> Iterator[tuple[tuple[Simulation, int], ElementMotions]]:
        if len(self._known) != len(sims):
            self._known = []
        for k, section in enumerate(sections(sims)):
            known = self._known[k] if k < len(self._known) else None
            if known is None or self._stale(known, section[0]):
                known = _found(section[0])
                self._known[k : k + 1] = [known]
            yield from ((section, table) for table in known.tables)

    def _stale(self, known: _Known, sim: Simulation) -> bool:
        same = (known.sim, known.version, known.dt) == (sim, sim.system.particles.version, sim.dt)
        return not same or perf_counter() > known.until


def _found(sim: Simulation) -> _Known:
    begun, system = perf_counter(), sim.system
    n = len(system.particles)
    blocks = element_blocks(system)
    with np.errstate(all="ignore"):
        tables = element_motions(blocks, n, sim.solver, 0.0, np.zeros(3 * n), False) if blocks else ()
    now = perf_counter()
    return _Known(sim, system.particles.version, sim.dt, tables, now + REST * (now - begun))
