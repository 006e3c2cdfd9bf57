"""The fast path of particles that are islands of their own: smoke, snow, sparks, dust.

Lane = particle. A tile of particles is loaded once into a small scratch, makes all steps of a span there, and is stored
once, so that memory is touched once a frame. Tiles are always padded to full width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.binding import Binder, Table
from pointmass.engine.forces import unary
from pointmass.engine.island import NOT_FINITE, Outcome, Span
from pointmass.engine.printing import indented, literal
from pointmass.engine.threads import spread
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.advance import Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.solvers.explicit import ExplicitRungeKutta
from pointmass.solvers.splitting import Splitting
from pointmass.system import ParticleSystem

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]
GRAIN = 4  # tiles that are worth a thread
W = 256  # lanes of a tile
AXES = "xyz"
UNROLLED = (4, 1)  # steps that a lane makes in registers
LONG = 60  # statements of a step that are not unrolled
TRANSPOSED = f'''BITS = np.int32 if R is np.float32 else np.int64
SIZE = BITS(np.iinfo(BITS).max)  # all bits but the sign


@njit(**FLAGS)
def reached(s, offset, m):
    """Largest size of three runs of lanes. As whole numbers, the bits of a size are in the order of the sizes, and NaN
    is above all: so the loop is one of vectors."""
    bits = s.view(BITS)
    most = BITS(0)
    for c in range(3):
        o = np.uintp(offset + {W} * c)
        for j in range(m):
            most = max(most, bits[o + np.uintp(j)] & SIZE)
    found = np.empty(1, BITS)
    found[0] = most
    return found.view(R)[0]


@njit(**FLAGS)
def load(s, offset, x, lo, m):
    """Rows of x, (x, y, z) each, to three runs of lanes."""
    o = np.uintp(offset)
    a = np.uintp(3 * lo)
    if m == {W}:
        for j in range({W}):
            i = np.uintp(j)
            s[o + i] = x[a + np.uintp(3) * i]
            s[o + np.uintp({W}) + i] = x[a + np.uintp(3) * i + np.uintp(1)]
            s[o + np.uintp({2 * W}) + i] = x[a + np.uintp(3) * i + np.uintp(2)]
    else:
        for i in range(m):
            for c in range(3):
                s[offset + {W} * c + i] = x[3 * (lo + i) + c]


@njit(**FLAGS)
def keep(s, offset, x, lo, m):
    """The way back."""
    o = np.uintp(offset)
    a = np.uintp(3 * lo)
    if m == {W}:
        for j in range({W}):
            i = np.uintp(j)
            x[a + np.uintp(3) * i] = s[o + i]
            x[a + np.uintp(3) * i + np.uintp(1)] = s[o + np.uintp({W}) + i]
            x[a + np.uintp(3) * i + np.uintp(2)] = s[o + np.uintp({2 * W}) + i]
    else:
        for i in range(m):
            for c in range(3):
                x[3 * (lo + i) + c] = s[offset + {W} * c + i]


'''


class Lanes(Table):
    """Columns of the particles of a tile, behind their state."""

    def entry(self, column: int, index: str) -> str:
        return f"s[{(6 + column) * W} + i]"


class Motion:
    """Prints one step of a solver for one lane, in locals.

    Attributes
    ----------
    at_time : statements of the step, outside the loop over lanes.
    lines : statements of a lane: from x_x, ..., v_z to x1_x, ..., v1_z.
    """

    def __init__(self, system: ParticleSystem, solver: Solver) -> None:
        self.system, self.solver = system, solver
        self.forces = [force for force in system.forces if isinstance(force, UnaryForce)]
        self.binder = Binder(system.particles, Lanes("C"), switches=not all(f.enabled for f in system.forces))
        self.dtype = self.binder.dtype
        self.at_time: list[str] = []
        self.lines: list[str] = [f"w = {self.binder.attribute('w', 'i')}"]
        self.pins = bool(system.particles.pinned.any())
        if self.pins:
            self.lines.append("free = w != 0")
        self.timed = False  # whether the laws depend on time
        self.evaluations = 0
        if isinstance(solver, ExplicitRungeKutta):
            self._explicit(solver)
        else:
            assert isinstance(solver, Splitting)
            self._splitting(solver)

    def _deriv(self, time: str, x: str, v: str, result: str) -> None:
        """Accelerations (order 1: velocities) at a stage, whose locals begin with `x` and `v`."""
        k = self.evaluations
        self.evaluations += 1
        self.at_time.append(f"s{k} = {time}")
        self.lines += [f"f_{a} = R(0)" for a in AXES]
        state = {f"{q}_{a}": f"{name}_{a}" for q, name in (("x", x), ("v", v)) for a in AXES}
        for j, force in enumerate(self.forces):
            self.timed = (
                self.timed or "t" in force.traced.depends_on or not all(p.steady for p in force.parameters.values())
            )
            timed, lines = unary(self.binder, force, f"f{j}_{k}", state, "i", f"s{k}")
            self.at_time += timed
            self.lines += lines
        scale = " * w" if self.system.order == 2 else ""
        self.lines += [f"{result}_{a} = {self._free(f'f_{a}{scale}')}" for a in AXES]

    def _free(self, value: str) -> str:
        """A value that is 0 for pinned particles."""
        return f"({value} if free else R(0))" if self.pins else value

    def _explicit(self, solver: ExplicitRungeKutta) -> None:
        second = self.system.order == 2
        slopes = [f"a{i}" for i in range(len(solver._stages))]
        rises = [f"r{i}" for i in range(len(solver._stages))] if second else slopes
        for i, (c, a) in enumerate(solver._stages):
            x, v = ("x", "v") if i == 0 else (f"x{i}s", f"v{i}s")
            if i:
                self._combine(x, "x", a, rises)
                if second:
                    self._combine(v, "v", a, slopes)
            self._deriv(f"t + {c!r} * h", x, v, slopes[i])
            if second:
                self.lines += [f"{rises[i]}_{b} = {self._free(f'{v}_{b}')}" for b in AXES]
        self._combine("x1", "x", solver._weights, rises)
        if second:
            self._combine("v1", "v", solver._weights, slopes)

    def _combine(self, result: str, base: str, weights: Sequence[float], slopes: Sequence[str]) -> None:
        for a in AXES:
            terms = " + ".join(
                f"{literal(w, self.dtype)} * {k}_{a}" for w, k in zip(weights, slopes, strict=False) if w
            )
            self.lines.append(f"{result}_{a} = {base}_{a} + hr * ({terms})")

    def _splitting(self, solver: Splitting) -> None:
        depends = self.system.velocity_dependent
        self.lines += [f"{q}1_{a} = {q}_{a}" for q in "xv" for a in AXES]
        self._deriv("t", "x", "v", "a")
        fresh = True
        for (opening, drift, closing), (before, after) in zip(solver.substeps, solver._times, strict=True):
            if not fresh:
                self._deriv(f"t + {before!r} * h", "x1", "v1", "a")
            for a in AXES:
                self.lines.append(f"v1_{a} = v1_{a} + {literal(opening, self.dtype)} * hr * a_{a}")
                self.lines.append(f"x1_{a} = x1_{a} + {literal(drift, self.dtype)} * hr * {self._free(f'v1_{a}')}")
            fresh = closing != 0.0 and not depends
            if closing != 0.0:
                self.lines += [f"b_{a} = v1_{a}" for a in AXES]
                for _ in range(solver.passes if depends else 1):
                    self._deriv(f"t + {after!r} * h", "x1", "v1", "a")
                    self.lines += [f"v1_{a} = b_{a} + {literal(closing, self.dtype)} * hr * a_{a}" for a in AXES]


class SinglesKernel:
    """Advances particles that nobody pulls on."""

    def __init__(self, system: ParticleSystem, solver: Solver) -> None:
        self.system, self.solver = system, solver
        self.motion = Motion(system, solver)
        self.text = self._printed()

    def _printed(self) -> str:
        motion, state = self.motion, self.state
        columns = len(motion.binder.particle.getters)
        long = len(motion.lines) > LONG or motion.timed
        unrolled = [u for u in UNROLLED if u == 1 or not long]
        moves = [f"{q}_{a} = {q}1_{a}" for q, a in state if q == "x"]
        moves += [f"{q}_{a} = {motion._free(f'{q}1_{a}')}" for q, a in state if q == "v"]
        parts = [self._lanes(u, [*motion.lines, *moves]) for u in unrolled]
        load = [f"s[{(6 + c) * W} + i] = C[{c}, lo + i]" for c in range(columns)]
        copies = [(f"{q}", 3 * W * k) for k, q in enumerate("xv" if self.system.order == 2 else "x")]
        steps, shared = [], ", ".join(self.shared)
        for u in unrolled:
            times = ", ".join(f"t0 + (k + {j}) * dt" for j in range(u + 1))
            steps += [f"while k + {u} <= k0 + count:", f"    bad |= lanes{u}({shared}, {times})", f"    k += {u}"]
        run = [
            "@njit(**FLAGS)",
            f"def run(first, last, x, v, {', '.join(motion.binder.arrays)}, t0, dt, k0, count, status, reach):",
            "    n = len(x) // 3",
            f"    s = np.ones({(6 + columns) * W}, R)",
            "    for tile in range(first, last):",
            f"        lo = tile * {W}",
            f"        m = min({W}, n - lo)",
            *(f"        load(s, {offset}, {q}, lo, m)" for q, offset in copies),
            "        for i in range(m):",
            *indented(load, 3),
            "        bad = 0",
            "        k = k0",
            *indented(steps, 2),
            *(f"        reach[tile, {k}] = reached(s, {offset}, m)" for k, (_, offset) in enumerate(copies)),
            "        far = max(reach[tile, 0], reach[tile, 1])",
            f"        status[tile] = bad if far < np.inf else {NOT_FINITE}",
            *(f"        keep(s, {offset}, {q}, lo, m)" for q, offset in copies),
            "",
        ]
        return motion.binder.functions + "\n".join([TRANSPOSED, *(line for part in parts for line in part), *run])

    def _lanes(self, unrolled: int, step: list[str]) -> list[str]:
        """The function that makes a few steps of all lanes, with the state in registers in between."""
        motion = self.motion
        place = {f"{q}_{a}": f"s[{k * W} + i]" for k, (q, a) in enumerate(self.state)}
        times = [f"t{j}" for j in range(unrolled + 1)]
        steps = [line for j in range(unrolled) for line in (f"hr = h{j}", *step)]
        return [
            "@njit(**FLAGS)",
            f"def lanes{unrolled}({', '.join([*self.shared, *times])}):",
            *indented(motion.binder.numbers.lines(), 1),
            *(f"    h{j} = R(t{j + 1} - t{j})" for j in range(unrolled)),
            "    t = t0",
            "    h = t1 - t0",
            "    status = 0",
            *indented(motion.at_time, 1),
            f"    for j in range({W}):",
            "        i = np.uintp(j)",
            *indented([f"{name} = {entry}" for name, entry in place.items()], 2),
            *indented(steps, 2),
            *indented([f"{entry} = {name}" for name, entry in place.items()], 2),
            "    return status",
            "",
            "",
        ]

    @property
    def shared(self) -> list[str]:
        """Arrays that the lanes read: the scratch holds the columns."""
        return ["s", *(name for name in self.motion.binder.arrays if name != "C")]

    @property
    def state(self) -> list[tuple[str, str]]:
        """(quantity, axis) of each component of the state."""
        return [(q, a) for q in ("xv" if self.system.order == 2 else "x") for a in AXES]

    @property
    def title(self) -> str:
        """What the kernel is, in a line."""
        forces = ", ".join(f.name for f in self.motion.forces) or "no force"
        return f"single particles: {self.solver.name} under {forces}, order {self.system.order}"

    @cached_property
    def functions(self) -> dict[str, Any]:
        """By name; each is compiled when it is first called."""
        return vars(store.load(self.title, self.text, self.motion.dtype))

    def members(self, rows: Rows, labels: Rows) -> SingleMembers:
        """Particles to be advanced: see `SingleMembers`."""
        return SingleMembers(self, rows)


@dataclass(frozen=True, eq=False)
class SingleMembers:
    """Particles that are islands of their own.

    Attributes
    ----------
    rows : of the particles.
    """

    kernel: SinglesKernel
    rows: Rows

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        motion, count = self.kernel.motion, len(self.rows)
        particles = self.kernel.system.particles
        order = None if count == len(particles) else self.rows
        data = motion.binder.data(count, order)
        tiles = -(-count // W)
        status, reach = np.zeros(tiles, np.int64), np.zeros((tiles, 2), x.dtype)
        grid = (span.t0, span.dt, span.first, span.count)
        kernel = self.kernel.functions["run"]
        spread(lambda lo, hi: kernel(lo, hi, x, v, *data, *grid, status, reach), tiles, GRAIN)
        work = Stats(span.count, 0, span.count * motion.evaluations)
        return Outcome(not status.any(), reach.max(axis=0).astype(np.float64), work)
