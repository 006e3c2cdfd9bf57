"""The fast path of one large island whose elements are shifts of a stencil on a row-major grid: cloth.

A tile of the grid is loaded with a halo into a scratch, [row][component][column], makes a few steps there, and its
inner part is stored; tiles overlap by what the halo loses in these steps, and compute it twice. A step sweeps over the
rows: each stencil is evaluated once for a whole row, into a ring of the last rows; then the row above which nothing is
missing any more adds up its forces, in the order of the reference path, and moves on the spot. Rows have a constant,
padded length, so every loop is a vector without gathers, and the bits depend neither on the tiles nor on the threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.binding import Binder, Packed, Table
from pointmass.engine.forces import different, unary
from pointmass.engine.island import Array, Outcome, Rows, Span
from pointmass.engine.phases import REACHED, STATE, entries, phases, regions, simple
from pointmass.engine.pins import MAP, maps, put
from pointmass.engine.printing import indented
from pointmass.engine.threads import spread
from pointmass.laws import stencils
from pointmass.laws.elements import ElementForce
from pointmass.laws.stencils import SMALLEST, Grid
from pointmass.laws.unary import UnaryForce
from pointmass.motions import NO_MOTIONS, Motions
from pointmass.solvers.advance import Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.system import ParticleSystem
from pointmass.tracing.trace import vector_names

AXES = "xyz"
WIDTHS = (64, 128, 256)  # columns of a tile
HEIGHT = 64  # rows of a tile, at most
STEPS = 4  # steps in one pass, at most
TERMS = 48  # terms of a sum in one loop: LLVM compares no more than some 100 addresses before it gives up vectors
GRAIN = 32  # rows that are worth a thread
PAD = 8  # the halo has a multiple of so many columns


def grid(system: ParticleSystem, members: Rows) -> Grid | None:
    """The grid that an island is, if it is one; `members` are its particles, row by row."""
    forces = [force for force in system.forces if isinstance(force, ElementForce) and force.enabled]
    return stencils.grid(forces, system.particles, members)


@dataclass
class Row:
    """The components of a row of the scratch."""

    places: dict[str, int] = field(default_factory=dict)

    def component(self, name: str) -> int:
        """Number of a component; one with a new name is added."""
        return self.places.setdefault(name, len(self.places))


class Columns(Table):
    """Columns of the particles, or of a stencil's elements at their corners, as components of a row."""

    def __init__(self, name: str, row: Row) -> None:
        super().__init__(name)
        self.row = row

    def entry(self, column: int, index: str) -> str:
        return _entry(self.row.component(f"{self.name} {column}"))


def _entry(component: int, rows: int = 0, columns: int = 0) -> str:
    """A number of lane `i` in the row `q`, or of a lane at a distance."""
    far = f"{rows} * ROW + " * (rows > 0) + f"{component} * WIDTH" + f" + {columns}" * (columns > 0)
    return f"q[{far} + i]"


def _sum(terms: list[list[str]], fresh: bool) -> list[str]:
    """A loop that adds up forces on the particles of a row."""
    return [
        "for i in range(WIDTH):",
        *indented([f"f_{a} = {'R(0)' if fresh else f'f[{k} * WIDTH + i]'}" for k, a in enumerate(AXES)], 1),
        *indented([line for term in terms for line in term], 1),
        *indented([f"f[{k} * WIDTH + i] = f_{a}" for k, a in enumerate(AXES)], 1),
    ]


def _runs(places: Sequence[int], call: str) -> list[str]:
    """A call for each component c at its `place`, as loops over places in a row: what is printed once is compiled
    once."""
    lines, begin = [], 0
    for end in range(1, len(places) + 1):
        if end < len(places) and places[end] == places[end - 1] + 1:
            continue
        lines.append(f"for c in range({begin}, {end}):")
        lines.append("    " + call.format(place=f"({places[begin] - begin} + c)"))
        begin = end
    return lines


class LatticeKernel:
    """Advances an island that is a grid.

    Forces on elements that are switched off are left out, so another kernel is needed when they are switched on. The
    number of rows is data; columns count in steps of `WIDTHS`.

    Attributes
    ----------
    most : steps in one pass.
    pad : columns of the halo on either side.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, found: Grid, motions: Motions = NO_MOTIONS) -> None:
        self.system, self.solver, self.grid, self.motions = system, solver, found, motions
        self.leads = bool(np.isin(found.members, motions.led(system.particles).rows).any())
        self.dtype = str(system.particles.dtype)
        self.phases = phases(solver, self.dtype, system.velocity_dependent)
        boxes = [s.box for s in found.stencils]
        self.reach = max(r for r, _ in boxes)
        lost = max(1, max(c for _, c in boxes) * len(self.phases))  # columns that a step takes from the halo
        self.most = max(1, min(STEPS, PAD // lost))
        self.pad = -(-lost * self.most // PAD) * PAD
        self.width = min(WIDTHS, key=lambda w: (-(-found.n // w) * (w + 2 * self.pad), w))
        self.masks = sorted({c for _, c in boxes})
        self.row = Row()
        self.state = [self.row.component(f"{name} {a}") for name in STATE for a in AXES]
        for name in regions(self.phases):
            for a in AXES:
                self.row.component(f"{name} {a}")
        self.binder = Binder(system.particles, Columns("C", self.row))
        self.tables = [Columns(f"D{k}", self.row) for k in range(len(found.stencils))]
        self.slots = 0  # numbers of all stencils at one corner
        row = [*self._row(), *self._lead()]
        parts = ["\n".join(self._constants()), self.binder.functions, REACHED]
        self.text = "".join([*parts, "\n".join([*row, *self._phases(), *self._tile(), *self._run()])])

    @staticmethod
    def fits(system: ParticleSystem, solver: Solver) -> bool:
        """Whether a grid can be advanced like this: undisturbed, by fixed steps. All must be born."""
        return simple(system, solver)

    @property
    def title(self) -> str:
        """What the kernel is, in a line."""
        forces = ", ".join(f.name for f in self.system.forces) or "no force"
        return f"grid of particles: {self.solver.name} under {forces}"

    @cached_property
    def functions(self) -> dict[str, Any]:
        """By name; each is compiled when it is first called."""
        return vars(store.load(self.title, self.text, self.dtype))

    def members(self, found: Grid) -> LatticeMembers:
        """A grid to be advanced."""
        return LatticeMembers(self, found)

    def columns(self) -> list[Columns]:
        """Tables of all columns: of the particles, and of the elements of each stencil."""
        particle = self.binder.particle
        assert isinstance(particle, Columns)
        return [particle, *self.tables]

    def scratch(self, rows: int) -> int:
        """How many numbers the scratch of a tile needs."""
        width = self.width + 2 * self.pad
        head = 3 + len(self.masks) + (self.reach + 1) * (self.slots + 1)
        return width * (head + (rows + self.reach + 1) * len(self.row.places))

    # ---------------------------------------------------------------------------------------- text

    def _constants(self) -> list[str]:
        return [
            f"WIDTH = {self.width + 2 * self.pad}",
            f"PAD = {self.pad}",
            f"INNER = {self.width}",
            f"ROW = {len(self.row.places)} * WIDTH",
            "MASKS = 3 * WIDTH",  # behind the forces on a row
            f"RING = MASKS + {len(self.masks)} * WIDTH",
            f"SLOT = {self.slots + 1} * WIDTH",
            f"HEAD = RING + {self.reach + 1} * SLOT",
            "",
            "",
        ]

    def _row(self) -> list[str]:
        """The function that evaluates all elements whose corner is in a row, and adds up the forces on that row."""
        elements: list[str] = []
        sums: list[list[str]] = []
        timed: list[str] = []
        k = 0
        for number, force in enumerate(self.system.forces):
            if isinstance(force, UnaryForce):
                state = {n: self._state(q, a) for q in STATE for a, n in enumerate(vector_names(q.lower()))}
                at_time, lines = unary(self.binder, force, f"f{number}", state, "")
                timed += at_time
                sums.append(lines)
            elif k < len(self.grid.stencils) and self.grid.stencils[k].force is force:
                mine = [s for s in self.grid.stencils if s.force is force]
                terms: list[tuple[int, str]] = []
                for _ in mine:
                    lines, at_time, own = self._stencil(k, f"f{number}")
                    elements += lines
                    timed += [line for line in at_time if line not in timed]
                    terms += own
                    k += 1
                sums += [[line] for _, line in sorted(terms, key=lambda term: term[0])]
        return [
            "@njit(**FLAGS)",
            f"def row(q, masks, {self._rings()}, f, {self._shared()}, t, r, m, whole):",
            *indented(self.binder.numbers.lines(), 1),
            "    status = 0",
            *indented([*timed, *elements], 1),
            "    if whole:",
            *indented(
                [line for k in range(0, max(1, len(sums)), TERMS) for line in _sum(sums[k : k + TERMS], k == 0)], 2
            ),
            "    return status",
            "",
            "",
        ]

    def _shared(self) -> str:
        """Arrays that all particles share: numbers and grids."""
        return ", ".join(name for name in self.binder.arrays if name != self.binder.particle.name)

    def _given(self) -> str:
        """The same, and what tells where pins that move are: rows that have any, maps of the steps from `k0` on."""
        return self._shared() + ", led, pin_maps, k0" * self.leads

    def _rings(self) -> str:
        """Names of the forces of the elements with their corner in this row, in the one before, ..."""
        return ", ".join(f"z{d}" for d in range(self.reach + 1))

    def _state(self, region: str, axis: int, shift: tuple[int, int] = (0, 0)) -> str:
        return _entry(self.row.component(f"{region} {AXES[axis]}"), *shift)

    def _stencil(self, k: int, tag: str) -> tuple[list[str], list[str], list[tuple[int, str]]]:
        """A stencil for a row of corners.

        Returns
        -------
        lines, at_time : statements of the row, and of the time.
        terms : what it adds to the forces on a particle, each with the number of its element in the order of the force.
        """
        stencil, slot = self.grid.stencils[k], self.slots
        force = stencil.force
        law, outputs = different(force.traced)
        self.slots += len(law.program.outputs)
        state = {"t": "R(t)"}
        for b, shift in enumerate(stencil.shifts):
            for q in STATE:
                names = vector_names(f"{q.lower()}{b + 1}")
                state |= {n: self._state(q, a, shift) for a, n in enumerate(names)}
        text = self.binder.law(law, force, state, "", self.tables[k], tag)
        rows, columns = stencil.box
        ring = [f"z0[{slot + o} * WIDTH + PAD + i]" for o in range(len(text.outputs))]
        inside = f"inside = masks[{self.masks.index(columns)} * WIDTH + i] != R(0)"
        lines = [
            f"if r < m - {rows}:",
            "    for i in range(WIDTH):",
            *indented([inside, *text.lines], 2),
            *(f"        {e} = select(inside, {o}, R(0))" for e, o in zip(ring, text.outputs, strict=True)),
            "else:",
            "    for i in range(WIDTH):",
            *(f"        {e} = R(0)" for e in ring),
        ]
        terms = []
        for b, (dr, dc) in enumerate(stencil.shifts):
            middle = stencil.own[(stencil.own.shape[0] + rows) // 2 - dr, (stencil.own.shape[1] + columns) // 2 - dc]
            for a, term in zip(AXES, outputs[3 * b : 3 * b + 3], strict=True):
                if term is not None:
                    entry = f"z{dr}[{slot + term[0]} * WIDTH + PAD - {dc} + i]"
                    terms.append((int(middle), f"f_{a} = f_{a} {term[1]} {entry}"))
        return lines, text.at_time, terms

    def _lead(self) -> list[str]:
        """The function that puts pins that move where the solver sees them in a step, for a row; maps from `o` on."""
        if not self.leads:
            return []
        regions = [name for name in ("X", "V", "X0", "V0") if f"{name} x" in self.row.places]
        places = {f"{name} {axis}": self._state(name, a) for name in regions for a, axis in enumerate(AXES)}
        lines = put(self.motions, self.system.particles, self.binder.particle, "", places)
        return [
            "@njit(**FLAGS)",
            "def lead(q, pin_maps, o):",
            "    for i in range(WIDTH):",
            *indented(lines, 2),
            "",
            "",
        ]

    def _phases(self) -> list[str]:
        """The functions of the phases for a row."""
        different = list(dict.fromkeys(tuple(p.lines) for p in self.phases))
        lines = []
        for number, phase in enumerate(different):
            lines += ["@njit(**FLAGS)", f"def phase{number}(q, f, hr):", "    for i in range(WIDTH):"]
            lines += [f"        w = {self.binder.attribute('w', '')}", "        free = w != R(0)"]
            for a in range(3):
                places = {r: self._state(r, a) for r in regions(self.phases)}
                lines.append(f"        a = select(free, f[{a} * WIDTH + i] * w, R(0))")
                lines += indented(entries(phase, places), 2)
            lines += ["", ""]
        return lines

    def _sweeps(self) -> list[str]:
        """Statements of a step: a sweep over the rows for each phase."""
        different = list(dict.fromkeys(tuple(p.lines) for p in self.phases))
        depth = self.reach + 1
        lines = []
        for phase in self.phases:
            lines += [
                "for i in range(RING, HEAD):",
                "    s[i] = R(0)",
                f"begin = lo + {self.reach} if lo > 0 else 0",
                f"end = hi - {self.reach} if hi < m else m",
                "for r in range(lo, end):",
                f"    q = s[HEAD + (r - top) * ROW : HEAD + (r - top + {self.reach + 1}) * ROW + WIDTH]",
                *(f"    z{d} = s[RING + (r + {depth - d}) % {depth} * SLOT :][:SLOT]" for d in range(depth)),
                f"    status |= row(q, masks, {self._rings()}, f, {self._shared()}, {phase.time}, r, m, r >= begin)",
                "    if r >= begin:",
                f"        phase{different.index(tuple(phase.lines))}(q, f, hr)",
                "lo = begin",
                "hi = end",
            ]
        return lines

    def _tile(self) -> list[str]:
        """The function that takes the particles of one tile through a few steps."""
        halo = self.reach * len(self.phases)
        load = _runs(self.state, "bring(s, o + {place} * WIDTH, Y, (c * m + r) * n, left, n)")
        if "X0 x" in self.row.places:
            places = [self.row.component(f"{q}0 {a}") for q in STATE for a in AXES]
            load += _runs(places, "bring(s, o + {place} * WIDTH, Y, (c * m + r) * n, left, n)")
        places = [self.row.component(f"{t.name} {column}") for t in self.columns() for column in range(len(t.getters))]
        fill = _runs(places, "bring(s, o + {place} * WIDTH, K, O[2 * c] + r * O[2 * c + 1], left, n)")
        masks = []
        for k, columns in enumerate(self.masks):
            masks.append(f"masks[{k} * WIDTH + i] = R(1) if left + i >= 0 and left + i < n - {columns} else R(0)")
        count = "min(INNER, n - left - PAD)"
        keep = _runs(self.state, f"keep(s, o + {{place}} * WIDTH + PAD, Z, (c * m + r) * n + left + PAD, {count})")
        lead = []
        if self.leads:
            lead = [
                "for r in range(lo, hi):",
                "    if led[r] != 0:",
                "        q = s[HEAD + (r - top) * ROW : HEAD + (r - top + 1) * ROW]",
                f"        lead(q, pin_maps, (now - k0) * {MAP * len(self.motions.motions)})",
            ]
        return [
            "@njit(**FLAGS)",
            "def bring(s, offset, Y, row, left, n):",
            "    begin = max(0, -left)",
            "    end = min(WIDTH, n - left)",
            "    for i in range(begin):",
            "        s[offset + i] = R(0)",
            "    o = np.uintp(offset + begin)",
            "    y = np.uintp(row + left + begin)",
            "    for i in range(end - begin):",
            "        s[o + np.uintp(i)] = Y[y + np.uintp(i)]",
            "    for i in range(end, WIDTH):",
            "        s[offset + i] = R(0)",
            "",
            "",
            "@njit(**FLAGS)",
            "def keep(s, offset, Z, row, count):",
            "    o = np.uintp(offset)",
            "    z = np.uintp(row)",
            "    for i in range(count):",
            "        Z[z + np.uintp(i)] = s[o + np.uintp(i)]",
            "",
            "",
            "@njit(**FLAGS)",
            f"def tile(s, Y, Z, {self._given()}, K, O, upper, lower, column, m, n, t0, dt, k, steps):",
            "    left = column * INNER - PAD",
            f"    top = max(0, upper - {halo} * steps)",
            f"    bottom = min(m, lower + {halo} * steps)",
            "    f = s[:MASKS]",
            "    masks = s[MASKS:RING]",
            "    for i in range(WIDTH):",
            *indented(masks, 2),
            "    for r in range(top, bottom):",
            "        o = HEAD + (r - top) * ROW",
            *indented([*load, *fill], 2),
            "    lo = top",
            "    hi = bottom",
            "    status = 0",
            "    for now in range(k, k + steps):",
            "        t = t0 + now * dt",
            "        h = t0 + (now + 1) * dt - t",
            "        hr = R(h)",
            *indented(lead, 2),
            *indented(self._sweeps(), 2),
            "    for r in range(upper, lower):",
            "        o = HEAD + (r - top) * ROW",
            *indented(keep, 2),
            "    return status",
            "",
            "",
        ]

    def _run(self) -> list[str]:
        shared = self._given()
        return f'''@njit(parallel=True, **OWNING_ENTRY)
def sweep(Y, Z, work, {shared}, K, O, height, m, n, t0, dt, k, steps, status):
    wide = (n + INNER - 1) // INNER
    tiles = (m + height - 1) // height * wide
    for chunk in prange(len(work)):
        bad = 0
        for q in range(chunk * tiles // len(work), (chunk + 1) * tiles // len(work)):
            upper = q // wide * height
            lower = min(m, upper + height)
            bad |= tile(work[chunk], Y, Z, {shared}, K, O, upper, lower, q % wide, m, n, t0, dt, k, steps)
        status[chunk] |= bad


@njit(**OWNING_ENTRY)
def apart(lo, hi, x, v, Y, m, n):
    """(x, y, z) of each particle to a row of each component."""
    for r in range(lo, hi):
        for c in range(n):
            for a in range(3):
                Y[(a * m + r) * n + c] = x[3 * (r * n + c) + a]
                Y[((3 + a) * m + r) * n + c] = v[3 * (r * n + c) + a]


@njit(**OWNING_ENTRY)
def together(lo, hi, x, v, Y, m, n, reach):
    """The way back, and the largest size of a component in each row."""
    for r in range(lo, hi):
        for c in range(n):
            for a in range(3):
                x[3 * (r * n + c) + a] = Y[(a * m + r) * n + c]
                v[3 * (r * n + c) + a] = Y[((3 + a) * m + r) * n + c]
        reach[r, 0] = reached(x, 3 * r * n, 3 * (r + 1) * n)
        reach[r, 1] = reached(v, 3 * r * n, 3 * (r + 1) * n)
'''.split("\n")


class LatticeMembers:
    """An island that is a grid."""

    def __init__(self, kernel: LatticeKernel, found: Grid) -> None:
        self.kernel, self.grid = kernel, found
        orders = [found.members.reshape(found.m, found.n), *(s.own for s in found.stencils)]
        self._columns = Packed(kernel.columns(), orders, kernel.dtype, self._rows)
        size = 6 * found.m * found.n
        self._state = np.empty(size, kernel.dtype), np.empty(size, kernel.dtype)
        self._work: NDArray[Any] | None = None
        self._led: list[NDArray[Any]] = []
        if kernel.leads:
            rows = np.flatnonzero(np.isin(found.members, kernel.motions.led(kernel.system.particles).rows)) // found.n
            self._led = [np.isin(np.arange(found.m), rows).astype(np.int64)]

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        kernel, m, n = self.kernel, self.grid.m, self.grid.n
        apart, sweep, together = (kernel.functions[name] for name in ("apart", "sweep", "together"))
        height, work = self._tiles()
        status, reach = np.zeros(len(work), np.int64), np.zeros((m, 2), x.dtype)
        here, there = self._state
        pins: tuple[Any, ...] = ()
        if kernel.leads:
            pins = (*self._led, maps(kernel.motions, span.times, kernel.dtype), span.first)
        data = (work, *kernel.binder.common(), *pins, *self._columns.arrays(), height, m, n, span.t0, span.dt)
        spread(lambda lo, hi: apart(lo, hi, x, v, here, m, n), m, GRAIN)
        for k in range(span.first, span.first + span.count, kernel.most):
            sweep(here, there, *data, k, min(kernel.most, span.first + span.count - k), status)
            here, there = there, here
        spread(lambda lo, hi: together(lo, hi, x, v, here, m, n, reach), m, GRAIN)
        far = reach.max(axis=0).astype(np.float64)
        stats = Stats(span.count, 0, span.count * len(kernel.phases))
        return Outcome(not status.any() and bool((far < np.inf).all()), far, stats)

    def _tiles(self) -> tuple[int, NDArray[Any]]:
        """Rows of a tile, so that all threads have as many, and the scratch of each. Bits do not depend on them."""
        import numba

        kernel, threads = self.kernel, numba.get_num_threads()
        wide = -(-self.grid.n // kernel.width)
        bands = -(-self.grid.m // HEIGHT)
        while bands * wide % threads and bands < self.grid.m // SMALLEST:
            bands += 1
        height = -(-self.grid.m // bands)
        size = kernel.scratch(height + 2 * kernel.reach * len(kernel.phases) * kernel.most)
        if self._work is None or self._work.shape != (threads, size):
            self._work = np.zeros((threads, size), kernel.dtype)
        return height, self._work

    def _rows(self, values: Array) -> tuple[Array, int]:
        """A column of the corners by rows of the grid, and how far the next row is."""
        m, n = self.grid.m, self.grid.n
        common = bool((values == values[0, 0]).all())
        full = np.full((1 if common else m, n), values[0, 0], values.dtype)
        if not common:
            full[: values.shape[0], : values.shape[1]] = values
        return full.ravel(), 0 if common else n
