"""The kernel that takes islands from step to step: everything that a system can do, island by island.

It is printed twice from one text: in `many` a parallel loop takes islands, each by one thread; in `one` a single large
island is worked on by all threads, loop by loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.forces import Deriv, Incidence, incidence
from pointmass.engine.printing import indented
from pointmass.engine.steps import step_text
from pointmass.solvers.base import Solver
from pointmass.system import ParticleSystem

CHUNKS = 256  # tasks that the islands are cut into, whatever the number of threads
NOT_FINITE = 1  # status of an island

REACHED = '''@njit(**FLAGS)
def reached(x, n):
    """Largest size of the first 3n numbers; infinite where one is not finite."""
    most = 0.0
    for q in range(3 * n):
        size = abs(x[q])
        if not size <= most:
            most = size if size < np.inf else np.inf
    return most


'''

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]


@dataclass(frozen=True)
class Span:
    """Steps on the grid of time: from t0 + first dt, `count` of them."""

    t0: float
    dt: float
    first: int
    count: int

    def time(self, k: int) -> float:
        """When step k of the span begins [s]; never accumulated."""
        return self.t0 + (self.first + k) * self.dt

    @property
    def start(self) -> float:
        """Begin of the first step [s]."""
        return self.time(0)

    @property
    def end(self) -> float:
        """End of the last step [s]."""
        return self.time(self.count)


class IslandKernel:
    """Advances a group of islands.

    Parameters
    ----------
    parallel : one large island by all threads, instead of many by one thread each.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, parallel: bool) -> None:
        self.system, self.solver = system, solver
        self.dtype = str(system.particles.dtype)
        self.deriv = Deriv(system, parallel)
        self.text = self._printed(parallel)

    def _printed(self, parallel: bool) -> str:
        deriv, order = self.deriv, self.system.order
        step = step_text(self.solver, order, self.dtype, deriv.loop, self.system.velocity_dependent)
        work = [*step.work, "x1", "v1"]
        call = f"deriv({deriv.call}, "
        lines = [line.replace("DERIV(", call) for line in step.lines]
        keep = ["x[q] = x1[q]"] + ["v[q] = v1[q] if C[0, base + q // 3] != 0 else R(0)"] * (order == 2)
        advance = [
            f"@njit({deriv.flags})",
            f"def advance({deriv.call}, t, h, x, v, {', '.join(work)}):",
            "    status = 0",
            "    hr = R(h)",
            *indented(lines, 1),
            f"    for q in {deriv.loop}(3 * n):",
            *indented(keep, 2),
            "    return status",
            "",
            "",
        ]
        ranges = [f"s{f.number} = S{f.number}[island]" for f in deriv.families]
        ranges += [f"e{f.number} = S{f.number}[island + 1]" for f in deriv.families]
        buffers = [f"B{f.number} = np.empty({3 * f.force.nodes} * M[{f.number + 1}], R)" for f in deriv.families]
        scratch = [f"{name} = np.empty(3 * M[0], R)" for name in work]
        starts = [f"S{f.number}" for f in deriv.families]
        island = [
            "base = first[island]",
            "n = first[island + 1] - base",
            *ranges,
            "xi = x[3 * base:3 * (base + n)]",
            "vi = v[3 * base:3 * (base + n)]",
            "bad = 0",
            "for s in range(count):",
            "    ta = t0 + (k0 + s) * dt",
            "    tb = t0 + (k0 + s + 1) * dt",
            "    if birth[island] >= tb or bad != 0:",
            "        continue",
            "    ta = max(ta, birth[island])",
            f"    bad |= advance({deriv.call}, ta, tb - ta, xi, vi, {', '.join(work)})",
            "far, fast = reached(xi, n), reached(vi, n)",
            f"status[island] = bad if far < np.inf and fast < np.inf else {NOT_FINITE}",
            "reach[island, 0] = far",
            "reach[island, 1] = fast",
        ]
        name = f"def run(first, x, v, {', '.join([*deriv.data, *starts])}, M, birth, t0, dt, k0, count, status, reach):"
        if parallel:
            body = ["island = 0", *buffers, *scratch, *island]
            run = ["@njit(**FLAGS)", name, *indented(body, 1)]
        else:
            body = [
                f"lo = chunk * islands // {CHUNKS}",
                f"hi = (chunk + 1) * islands // {CHUNKS}",
                "if lo < hi:",
                *indented([*buffers, *scratch], 1),
                "    for island in range(lo, hi):",
                *indented(island, 2),
            ]
            run = ["@njit(parallel=True, **FLAGS)", name, "    islands = len(first) - 1"]
            run += [f"    for chunk in prange({CHUNKS}):", *indented(body, 2)]
        return f"{REACHED}{deriv.text}\n\n" + "\n".join([*advance, *run, ""])

    @property
    def title(self) -> str:
        """What the kernel is, in a line."""
        forces = ", ".join(f.name for f in self.system.forces) or "no force"
        return f"{self.solver.name} under {forces}, order {self.system.order}"

    @cached_property
    def functions(self) -> dict[str, Any]:
        """By name; each is compiled when it is first called."""
        return vars(store.load(self.title, self.text, self.dtype))

    def members(self, rows: Rows, labels: Rows) -> IslandMembers:
        """Particles to be advanced: see `IslandMembers`."""
        return IslandMembers(self, rows, labels)


class IslandMembers:
    """The islands of a group in the order of the kernel's rows.

    Parameters
    ----------
    rows : particles of each island, one after the other.
    labels : island of each, shape (rows,).
    """

    def __init__(self, kernel: IslandKernel, rows: Rows, labels: Rows) -> None:
        self.kernel, self.rows = kernel, rows
        self.first = np.append(np.flatnonzero(np.diff(labels, prepend=-1)), len(rows)).astype(np.int64)
        self.place = np.full(len(kernel.system.particles), -1, np.intp)
        self.place[rows] = np.arange(len(rows))
        everybody = len(rows) == len(self.place) and bool((np.diff(rows) == 1).all())
        self.order = None if everybody else rows
        self.families = [self._family(f.force) for f in kernel.deriv.families]

    def _family(self, force: Any) -> tuple[Rows, Incidence]:
        """Elements of a force in the order of the kernel, and where they are."""
        nodes = force.rows(self.kernel.system.particles)
        mine = np.flatnonzero(self.place[nodes[:, 0]] >= 0)
        found = incidence(nodes[mine], self.place, self.first)
        return mine[found.order], found

    def run(self, x: Array, v: Array, births: Array | None, span: Span) -> tuple[bool, Array]:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        deriv, count = self.kernel.deriv, len(self.rows)
        dtype = self.kernel.system.particles.dtype
        data = deriv.binder.data(count, self.order)
        starts, most = [], [int(np.diff(self.first).max(initial=0))]
        for family, (elements, found) in zip(deriv.families, self.families, strict=True):
            data += [found.nodes, family.table.array(len(elements), dtype, elements), found.ends, found.entries]
            starts.append(found.start)
            most.append(int(np.diff(found.start).max(initial=0)))
        islands = len(self.first) - 1
        begin = np.full(islands, -np.inf) if births is None else np.maximum.reduceat(births, self.first[:-1])
        status, reach = np.zeros(islands, np.int64), np.zeros((islands, 2))
        grid = (span.t0, span.dt, span.first, span.count)
        self.kernel.functions["run"](self.first, x, v, *data, *starts, np.array(most), begin, *grid, status, reach)
        return not status.any(), reach.max(axis=0)
