"""Numbers of the particles of a frame, by name: what lenses colour by and expressions are made of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.frame import Frame
from pointmass.particles import BUILT_IN, Array
from pointmass.simulation import Simulation
from pointmass.system import ParticleSystem
from pointmass.viewer.contacts import contacts
from pointmass.viewer.residual import residual, solves

Numbers = NDArray[np.floating[Any]]
MEASURED = ("x", "y", "z", "vx", "vy", "vz", "speed", "id", "t")  # of any frame
VECTORS = {f"{'' if q == 'x' else q}{a}": (q, k) for q in "xvf" for k, a in enumerate("xyz")}
FORCES = ("fx", "fy", "fz", "force")  # and where there are masses
RESIDUAL = "residual"  # and where the solver has equations to solve


class Columns:
    """The columns of a frame; each is computed when it is first asked for.

    Parameters
    ----------
    sims : whose particles the rows of the frame are, one simulation after another; none for a cache.

    Notes
    -----
    `force` is the length of (fx, fy, fz) [N], all forces at the place and velocity of the frame, without what pins and
    surfaces bear. `residual` is what the solver's next step leaves unsolved, see `residual.py`.
    """

    def __init__(self, frame: Frame, sims: Sequence[Simulation] = ()) -> None:
        self.frame = frame
        self._sims = sims
        self._known: dict[str, Any] = {"t": frame.time}
        self._forces: Numbers | None = None

    @property
    def forces(self) -> Numbers:
        """All forces on each particle [N], shape (n, 3)."""
        if self._forces is None:
            parts = []
            for system, x, v, t in self._states():
                system.clear_forces()
                with np.errstate(all="ignore"):
                    system.calculate_forces(t, x, v)
                parts.append(system.particles.f.astype(np.float64))
            self._forces = np.concatenate(parts) if parts else np.zeros((0, 3))
        return self._forces

    @property
    def contacts(self) -> tuple[NDArray[np.intp], Numbers]:
        """Rows of particles that touch surfaces, and the normals of these, as `contacts` says."""
        rows, normals, begin = [np.zeros(0, np.intp)], [np.zeros((0, 3))], 0
        for system, x, _, t in self._states():
            touching, normal = contacts(system, x, t)
            rows.append(touching + begin)
            normals.append(normal)
            begin += len(x)
        return np.concatenate(rows), np.concatenate(normals)

    def _states(self) -> Iterator[tuple[ParticleSystem, Array, Array, float]]:
        """Each system, places and velocities of its particles, and the time.

        They are those of the frame, which may lie between two steps. Where several systems are shown, beside each
        other, places in the frame are not their own: they are those of the last step.
        """
        for sim in self._sims:
            p = sim.system.particles
            if len(self._sims) > 1:
                yield sim.system, p.x.copy(), p.v.copy(), sim.t
            else:
                x, v = (a.astype(p.dtype) for a in (self.frame.positions, self.frame.velocities))
                yield sim.system, x, v, self.frame.time

    def names(self) -> list[str]:
        """All that there are."""
        return names(self._sims)

    def __getitem__(self, name: str) -> Any:
        if name not in self._known:
            self._known[name] = self._found(name)
        return self._known[name]

    def _found(self, name: str) -> Numbers:
        frame = self.frame
        if name in ("speed", "force"):
            return length(frame.velocities if name == "speed" else self.forces)
        if name == "id":
            return frame.ids.astype(np.float64)
        if name in VECTORS:
            whose, axis = VECTORS[name]
            vectors = self.forces if whose == "f" else frame.positions if whose == "x" else frame.velocities
            return vectors[:, axis].astype(np.float64)
        if name == RESIDUAL:
            return np.concatenate([residual(sim) for sim in self._sims])
        columns = [sim.system.particles.column(name) for sim in self._sims]
        return np.concatenate(columns).astype(np.float64) if columns else np.zeros(0)


def names(sims: Sequence[Simulation]) -> list[str]:
    """The names of all columns."""
    known = list(MEASURED)
    if sims:
        known += [
            *(FORCES if sims[0].system.order == 2 else ()),
            *([RESIDUAL] if solves(sims) else []),
            *BUILT_IN,
            *sims[0].system.particles.attributes,
        ]
    return list(dict.fromkeys(known))


def length(vectors: Numbers) -> Numbers:
    """Of each row."""
    wide = vectors.astype(np.float64)
    with np.errstate(over="ignore"):
        result: Numbers = np.sqrt(np.einsum("ij,ij->i", wide, wide))
    return result
