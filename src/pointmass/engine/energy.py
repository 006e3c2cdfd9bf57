"""The potential energy of all pairs by a kernel: the loops of the forces, with the potential as the law."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from pointmass.engine import store
from pointmass.engine.binding import Binder, Table
from pointmass.engine.pairs import FULL, PairArrays, Pairs
from pointmass.laws.pairs import PairForce
from pointmass.particles import Particles


class PairEnergy:
    """The energy of a pair force that has a potential."""

    def __init__(self, force: PairForce, particles: Particles) -> None:
        assert force.traced_potential is not None
        law: Any = SimpleNamespace(
            name=f"{force.name} potential",
            traced=force.traced_potential,
            traced_finish=None,
            parameters=force.parameters,
            per_particle=force.per_particle,
            reach=force.reach,
            box=force.box,
            by=force.by,
            ends=force.ends,
        )
        self._particles = particles
        self._binder = Binder(particles, Table("C"))
        self._pairs = Pairs(law, 0, self._binder, parallel=True)
        head, tail = f"**OWNING)\ndef pairs{self._pairs.number}(", f"**OWNING_ENTRY)\ndef pairs{self._pairs.number}("
        text = self._binder.functions + self._pairs.text.replace(head, tail)
        module = store.load(law.name, text, str(particles.dtype))
        self._run = vars(module)["pairs0"]
        self._arrays = PairArrays(self._pairs, particles, np.arange(len(particles)))

    def __call__(self, t: float) -> float:
        """The energy now [J]."""
        p = self._particles
        status = FULL
        while status == FULL:
            arrays = self._arrays.arrays()
            data = self._binder.data(len(p), None)
            status = self._run(0, 0, len(self._arrays.rows), *data, *arrays, t, p.x.reshape(-1), p.v.reshape(-1))
            if status == FULL:
                self._arrays.enlarge()
        return 0.5 * float(arrays[2][::3].sum(dtype=np.float64))
