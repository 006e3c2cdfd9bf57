"""What the next step of an implicit solver leaves unsolved at each particle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.island import Span
from pointmass.errors import Diverged
from pointmass.simulation import Simulation
from pointmass.viewer.contacts import contacts


def solves(sims: Sequence[Simulation]) -> bool:
    """Whether there are masses, and solvers with equations to solve."""
    return bool(sims) and all(sim.solver.implicit and sim.system.order == 2 for sim in sims)


def residual(sim: Simulation) -> NDArray[np.floating[Any]]:
    """What the next step leaves of each particle's equation, relative as `Solver.residual` is: its length, shape (n,).

    The step is made by an engine of its own and taken back, so that the run does not know of it. NaN: the particle
    touches a surface, which has a say in its velocity, too; the step fails; the solver has no equations.
    """
    system, p = sim.system, sim.system.particles
    engine = sim.engine.of(system, sim.solver)
    engine.reference.leave(sim.engine.reference.left())
    t, y, memory = sim.t, system.get_state(), engine.reference.recall()
    try:
        with engine.rehearsal(), np.errstate(all="ignore"):
            if not engine.compiled:
                engine.reference.step(t, t + sim.dt)
            elif not engine.run(Span(t, sim.dt, 0, 1), None, look_inside=False):
                return np.full(len(p), np.nan)
            y1, touching = system.get_state(), contacts(system, p.x, t + sim.dt)[0]
    except Diverged:
        return np.full(len(p), np.nan)
    with np.errstate(all="ignore"):
        found = sim.solver.residual(system, t, y, sim.dt, memory, y1)
    if found is None:
        return np.full(len(p), np.nan)
    length: NDArray[np.floating[Any]] = np.linalg.norm(found.reshape(-1, 3).astype(np.float64), axis=1)
    length[p.pinned] = 0.0
    length[touching] = np.nan
    return length
