"""Forces between all pairs of particles, summed directly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.laws.force import Array, Blocks, Force, Rows, clock, inputs_for, matrix
from pointmass.particles import Particles
from pointmass.tracing.trace import Traced, trace, vector_names

PAIRS_AT_ONCE = 2**18  # a block of columns of this many pairs stays in the cache
LARGEST_JACOBIAN = 1500  # particles; a dense Jacobian has 18 n^2 numbers


class PairForce(Force):
    """A law between every two particles of a selection.

    Attributes
    ----------
    law : (x1, v1, m1, x2, v2, m2, t, *parameters) -> what particle 2 does to particle 1, three numbers.
    potential : the energy of a pair, of the same arguments, where there is one.
    per_particle : parameters that each particle has its own of; the law gets them as pairs (p1, p2).
    """

    internal: ClassVar[bool] = True
    law: ClassVar[Callable[..., Any]]
    potential: ClassVar[Callable[..., Any] | None] = None
    per_particle: ClassVar[tuple[str, ...]] = ()

    @cached_property
    def traced(self) -> Traced:
        """The law as a program."""
        return trace(self._paired(self.law), self._signature(), 3, self.name)

    @cached_property
    def traced_potential(self) -> Traced | None:
        """The potential energy of a pair as a program."""
        if self.potential is None:
            return None
        return trace(self._paired(self.potential), self._signature(), 1, f"{self.name} potential")

    @property
    def velocity_dependent(self) -> bool:
        return bool({"v1", "v2"} & self.traced.depends_on)

    def bind(self, particles: Particles) -> None:
        super().bind(particles)
        for p in self.parameters.values():
            p.check(particles, len(particles), "particles")
            if p.vector or (p.name not in self.per_particle and not p.common):
                raise InvalidInput(f"{p.name} of {self.name} must be one number or a function of t")
        _ = self.traced

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows = particles.select(self.on)
        for first in self._blocks(rows):
            parts = self._on_block(self.traced, particles, t, x, v, first, rows)
            for axis, part in enumerate(parts):
                f[first, axis] += part.sum(axis=1)

    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        rows = particles.select(self.on)
        if len(rows) > LARGEST_JACOBIAN:
            raise InvalidInput(
                f"{self.name} couples {len(rows)} particles, and implicit solvers take at most {LARGEST_JACOBIAN}: "
                "use leapfrog or dopri5"
            )
        n = len(rows)
        parts = self._on_block(self._jacobian, particles, t, x, v, rows, rows)
        values = matrix([p.ravel() for p in parts], n * n, x.dtype).reshape(n * n, 3, 2, 2, 3)  # axis, node, x|v, axis
        i, j = np.repeat(rows, n), np.tile(rows, n)
        blocks.add(i, i, values[:, :, 0, 0], values[:, :, 0, 1])
        blocks.add(i, j, values[:, :, 1, 0], values[:, :, 1, 1])

    def energy(self, particles: Particles, t: float, x: Array, v: Array) -> float | None:
        if self.traced_potential is None:
            return None
        rows = particles.select(self.on)
        total = 0.0
        for first in self._blocks(rows):
            (part,) = self._on_block(self.traced_potential, particles, t, x, v, first, rows)
            total += float(part.sum(dtype=np.float64))
        return 0.5 * total

    def links(self, particles: Particles) -> Rows:
        rows = particles.select(self.on)
        return np.stack([rows[:-1], rows[1:]], axis=1)

    def partners(self, particles: Particles, row: int) -> list[int]:
        x = particles.x
        same = (x[particles.select(self.on)] == x[row]).all(axis=1)
        return [int(r) for r in particles.select(self.on)[same] if r != row]

    def keep(self, particles: Particles, mask: Any) -> None:
        super().keep(particles, mask)
        for p in self.parameters.values():
            p.keep(mask)

    def grow(self, particles: Particles, count: int) -> None:
        super().grow(particles, count)
        self.bind(particles)

    @cached_property
    def _jacobian(self) -> Traced:
        return self.traced.jacobian(*(n for a in "12" for q in "xv" for n in vector_names(f"{q}{a}")))

    def _inputs_of(self, name: str) -> tuple[str, ...]:
        return (f"{name}1", f"{name}2") if name in self.per_particle else (name,)

    def _signature(self) -> dict[str, str]:
        state = {f"{q}{a}": kind for a in "12" for q, kind in (("x", "vector"), ("v", "vector"), ("m", "scalar"))}
        return state | {"t": "scalar"} | {n: "scalar" for p in self.parameters for n in self._inputs_of(p)}

    def _paired(self, law: Callable[..., Any]) -> Callable[..., Any]:
        """The law, called with one number for each input: those of each particle are put together as (p1, p2)."""

        def call(*arguments: Any) -> Any:
            rest = iter(arguments[7:])
            own = [tuple(next(rest) for _ in self._inputs_of(p)) for p in self.parameters]
            return law(*arguments[:7], *(v if len(v) == 2 else v[0] for v in own))

        return call

    def _blocks(self, rows: Rows) -> Iterator[Rows]:
        size = max(1, PAIRS_AT_ONCE // max(1, len(rows)))
        for start in range(0, len(rows), size):
            yield rows[start : start + size]

    def _on_block(
        self, law: Traced, particles: Particles, t: Any, x: Array, v: Array, first: Rows, second: Rows
    ) -> list[Array]:
        """Outputs of a law for all pairs (i, j), each of shape (len(first), len(second)), 0 where i = j."""
        shape = (len(first), len(second))
        columns: dict[str, Any] = {}
        for node, rows, place in (("2", second, np.s_[None, :]), ("1", first, np.s_[:, None])):
            now = clock(t, rows)
            own = {"t": now, f"m{node}": particles.m[rows]}  # t, and parameters that all share, are those of particle 1
            for name, (value,) in self.settings(particles, now, rows).items():
                own[f"{name}{node}" if name in self.per_particle else name] = value
            for q, array in (("x", x), ("v", v)):
                own |= zip(vector_names(f"{q}{node}"), array[rows].T, strict=True)
            columns |= {n: c[place] if np.ndim(c) else c for n, c in own.items()}
        outputs = law.columns(*inputs_for(law, {}, columns, {}))
        itself = first[:, None] == second[None, :]
        return [np.where(itself, x.dtype.type(0), np.broadcast_to(o, shape)) for o in outputs]
