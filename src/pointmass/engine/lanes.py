"""The fast path of many islands of one topology: hair, snakes, fish, ensembles.

Lane = island. A tile of islands is loaded once into a scratch, [component][node][lane], makes all steps of a span
there, and is stored once. The loop over the elements is outside and the loop over the islands inside, so nothing is
gathered: the operations of the island text in the same order, and the same bits. Tiles are always padded to full width.

Elements whose nodes follow each other at even distances are one loop with constant offsets. A topology without order is
a loop over a list of nodes, with a small stage for the forces of one element, so that the loop over lanes stays a
vector.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.binding import Binder, Packed, Table
from pointmass.engine.forces import tiled, unary
from pointmass.engine.island import NOT_FINITE, Array, Outcome, Rows, Span
from pointmass.engine.phases import REACHED, STATE, entries, phases, regions, simple
from pointmass.engine.pins import MAP, maps, put
from pointmass.engine.printing import indented
from pointmass.engine.threads import spread
from pointmass.laws.elements import ElementForce
from pointmass.laws.unary import UnaryForce
from pointmass.motions import NO_MOTIONS, Motions
from pointmass.solvers.advance import Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.system import ParticleSystem
from pointmass.tracing.trace import vector_names

AXES = "xyz"
FEWEST = 8  # islands that are worth a tile
GRAIN = 2  # tiles that are worth a thread
UNROLLED = 1500  # statements of elements that are printed one by one
WIDTHS = (64, 32, 16)  # lanes of a tile
ROOM = 28_000  # bytes of a scratch that fits into the first cache


def _inputs(quantity: str, node: int | None = None) -> tuple[str, str, str]:
    """The inputs of a law for a part of the state: x_x, ... or x1_x, ..."""
    return vector_names(f"{quantity.lower()}{node or ''}")


@dataclass
class Scratch:
    """Where the rows of a scratch are; a row has a number for each lane."""

    rows: int = 0
    places: dict[str, int] = field(default_factory=dict)

    def block(self, name: str, rows: int) -> int:
        """The first row of a block; a block with a new name is added."""
        if name not in self.places:
            self.places[name] = self.rows
            self.rows += rows | 1
        return self.places[name]


class Columns(Table):
    """Columns of nodes or of elements, as blocks of the scratch."""

    def __init__(self, name: str, length: int, scratch: Scratch) -> None:
        super().__init__(name)
        self.length, self.scratch = length, scratch

    def place(self, column: int) -> int:
        """First row of a column."""
        return self.scratch.block(f"{self.name} {column}", self.length)

    def entry(self, column: int, index: str) -> str:
        """The number of lane `i` in a row of the column; "" is the first one."""
        return f"s[({self.place(column)} + {index or 0}) * L + i]"


@dataclass
class Family:
    """The elements of a force, the same in every island.

    Attributes
    ----------
    nodes : of each element, by their numbers within the island, shape (e, k).
    own : numbers of the elements in the force, shape (islands, e).
    """

    force: ElementForce
    nodes: NDArray[np.int32]
    own: Rows


@dataclass(frozen=True)
class Run:
    """Elements that follow each other at even distances: element e has the nodes `nodes + e strides`."""

    begin: int
    count: int
    nodes: tuple[int, ...]
    strides: tuple[int, ...]


def runs(nodes: NDArray[np.int32]) -> list[Run]:
    """The elements, shape (e, k), in order, as few runs."""
    result = []
    begin = 0
    while begin < len(nodes):
        strides = nodes[begin + 1] - nodes[begin] if begin + 1 < len(nodes) else 0 * nodes[begin]
        count = 1
        while (strides >= 0).all() and begin + count < len(nodes):
            if (nodes[begin + count] != nodes[begin] + count * strides).any():
                break
            count += 1
        result.append(Run(begin, count, tuple(nodes[begin].tolist()), tuple(strides.tolist())))
        begin += count
    return result


@dataclass(frozen=True, eq=False)
class Topology:
    """Islands that are made alike.

    Attributes
    ----------
    rows : particles, shape (islands, nodes); a node is the same in every island.
    families : elements of each force that is on.
    """

    rows: Rows
    families: list[Family]


def topologies(system: ParticleSystem, rows: Rows, labels: Rows) -> list[Topology]:
    """Islands by what they are made of; those of which there are few are left out.

    Parameters
    ----------
    rows : particles of each island, one island after the other.
    labels : island of each, shape (rows,).
    """
    first = np.append(np.flatnonzero(np.diff(labels, prepend=-1)), len(rows)).astype(np.int64)
    place = np.full(len(system.particles), -1, np.intp)
    place[rows] = np.arange(len(rows))
    found = []
    for force in system.forces:
        if isinstance(force, ElementForce) and force.enabled:
            nodes = force.rows(system.particles)
            mine = np.flatnonzero(place[nodes[:, 0]] >= 0)
            sorted_ = tiled(place[nodes[mine]], first, first[:-1])
            found.append((force, mine[sorted_.order], sorted_.nodes.reshape(-1, force.nodes), sorted_.start))
    alike: dict[Any, list[int]] = {}
    for island in range(len(first) - 1):
        parts = [nodes[start[island] : start[island + 1]].tobytes() for _, _, nodes, start in found]
        alike.setdefault((int(first[island + 1] - first[island]), *parts), []).append(island)
    result = []
    for (size, *_), islands in alike.items():
        if len(islands) >= FEWEST and size > 1:
            families = []
            for force, own, local, start in found:
                begin, end = int(start[islands[0]]), int(start[islands[0] + 1])
                each = own[start[islands][:, None] + np.arange(end - begin)]
                families.append(Family(force, np.asarray(local[begin:end], np.int32), each))
            result.append(Topology(rows[first[islands][:, None] + np.arange(size)], families))
    return result


class LanesKernel:
    """Advances islands of one topology.

    Forces on elements that are switched off are left out, so another kernel is needed when they are switched on.
    """

    def __init__(
        self, system: ParticleSystem, solver: Solver, topology: Topology, motions: Motions = NO_MOTIONS
    ) -> None:
        self.system, self.solver, self.families, self.motions = system, solver, topology.families, motions
        self.dtype = str(system.particles.dtype)
        self.nodes = topology.rows.shape[1]
        self.apart = self.nodes | 1  # rows between components: multiples of 4096 bytes would collide in the cache
        self.phases = phases(solver, self.dtype, system.velocity_dependent)
        self.scratch = Scratch()
        for name in [*regions(self.phases), "F"]:
            self.scratch.block(name, 3 * self.apart)
        self.binder = Binder(system.particles, Columns("C", self.nodes, self.scratch))
        self.tables = [Columns(f"D{j}", len(f.nodes), self.scratch) for j, f in enumerate(self.families)]
        self.led = np.flatnonzero(np.isin(topology.rows, motions.led(system.particles).rows).any(axis=0))
        self.arms = Columns("M", len(self.led), self.scratch)
        self.staged: set[int] = set()  # numbers of the families that are a loop
        self._at_time: list[str] = []
        deriv, lead = self._deriv(), self._lead()
        width = [w for w in WIDTHS if self.scratch.rows * w * system.particles.dtype.itemsize <= ROOM]
        self.width = WIDTHS[0] if self.staged else width[0] if width else WIDTHS[-1]
        constants = [f"L = {self.width}", f"N = {self.nodes}", f"A = {self.apart}", "", "", ""]
        parts = ["\n".join(constants), self.binder.functions, REACHED, *MOVED]
        self.text = "".join([*parts, "\n".join([*deriv, *lead, *self._step(), *self._run()])])

    @staticmethod
    def fits(system: ParticleSystem, solver: Solver) -> bool:
        """Whether islands of one topology can be advanced like this: undisturbed, by fixed steps. All must be born."""
        return simple(system, solver)

    @property
    def title(self) -> str:
        """What the kernel is, in a line."""
        forces = ", ".join(f.name for f in self.system.forces) or "no force"
        return f"islands of {self.nodes} particles side by side: {self.solver.name} under {forces}"

    @cached_property
    def functions(self) -> dict[str, Any]:
        """By name; each is compiled when it is first called."""
        return vars(store.load(self.title, self.text, self.dtype))

    def members(self, topology: Topology) -> LanesMembers:
        """Islands to be advanced, in the order of `topology.rows`."""
        return LanesMembers(self, topology)

    def columns(self) -> list[Columns]:
        """Tables of all columns in the scratch."""
        particle = self.binder.particle
        assert isinstance(particle, Columns)
        return [particle, *self.tables, self.arms]

    # ---------------------------------------------------------------------------------------- text

    def _place(self, name: str, axis: int) -> int:
        """First row of a component."""
        return int(self.scratch.places[name] + axis * self.apart)

    def _deriv(self) -> list[str]:
        """The function that adds up the forces, in listed order and element by element."""
        lines: list[str] = []
        group: list[str] = []  # forces on one particle that follow each other
        fresh, j = True, 0
        for k, force in enumerate(self.system.forces):
            if isinstance(force, UnaryForce):
                state = {n: f"s[{self._place(q, a)} * L + i]" for q in STATE for a, n in enumerate(_inputs(q))}
                timed, adds = unary(self.binder, force, f"f{k}", state, "")
                self._at_time += timed
                group += adds
            elif any(force is f.force for f in self.families):
                lines += [*self._unary(group, fresh), *self._elements(j, f"f{k}")]
                group, fresh, j = [], False, j + 1
        lines += self._unary(group, fresh)
        stage = max((3 * self.families[j].force.nodes for j in self.staged), default=0)
        return [
            f"STAGE = {stage}",
            "",
            "",
            "@njit(**FLAGS)",
            f"def deriv(s, g, {self._shared()}, t):",
            *indented(self.binder.numbers.lines(), 1),
            "    status = 0",
            *indented(self._at_time, 1),
            *indented(lines, 1),
            "    return status",
            "",
            "",
        ]

    def _shared(self) -> str:
        """Arrays that all islands share: numbers, grids, and the nodes of elements that are a loop."""
        arrays = [name for name in self.binder.arrays if name != self.binder.particle.name]
        return ", ".join([*arrays, *(f"E{j}" for j in sorted(self.staged))])

    def _unary(self, group: list[str], fresh: bool) -> list[str]:
        """The loop over all particles that adds forces; the first one clears."""
        if not group and not fresh:
            return []
        forces = [(a, f"s[{self._place('F', k)} * L + i]") for k, a in enumerate(AXES)]
        return [
            f"for i in range({self.nodes} * L):",
            *indented([f"f_{a} = {'R(0)' if fresh else entry}" for a, entry in forces], 1),
            *indented(group, 1),
            *indented([f"{entry} = f_{a}" for a, entry in forces], 1),
        ]

    def _elements(self, j: int, tag: str) -> list[str]:
        """The elements of a family, one after the other."""
        family = self.families[j]
        if len(family.nodes) == 0:
            return []
        found = runs(family.nodes)
        once, timed = self._law(j, tag, found[0])
        self._at_time += timed
        if len(found) * len(once) > UNROLLED:
            self.staged.add(j)
            return self._loop(j, tag)
        lines = [f"# {family.force.name}"]
        for run in found:
            lines += [f"for e in range({run.count}):", "    for i in range(L):"]
            lines += indented(self._law(j, tag, run)[0], 2)
        return lines

    def _law(self, j: int, tag: str, run: Run) -> tuple[list[str], list[str]]:
        """Statements of one lane for element `e` of a run, and those of the time."""
        force = self.families[j].force
        state, targets = {"t": "R(t)"}, []
        for b, (node, stride) in enumerate(zip(run.nodes, run.strides, strict=True)):
            for q in STATE:
                for a, name in enumerate(_inputs(q, b + 1)):
                    state[name] = f"s[({self._place(q, a) + node} + {stride} * e) * L + i]"
            targets += [f"s[({self._place('F', a) + node} + {stride} * e) * L + i]" for a in range(3)]
        text = self.binder.law(force.traced, force, state, f"{run.begin} + e", self.tables[j], tag)
        adds = [f"{target} = {target} + {out}" for target, out in zip(targets, text.outputs, strict=True)]
        return [*text.lines, *adds], text.at_time

    def _loop(self, j: int, tag: str) -> list[str]:
        """The elements of a family as a loop: forces to the stage, which nothing else shares, and then to the nodes."""
        force = self.families[j].force
        state, take = {"t": "R(t)"}, []
        stage = [f"g[{row} * L + i]" for row in range(3 * force.nodes)]
        for b in range(force.nodes):
            at = f" * L + i) + n{b}]"
            for q in STATE:
                state |= {n: f"s[np.uintp({self._place(q, a)}{at}" for a, n in enumerate(_inputs(q, b + 1))}
            take.append("for i in range(L):")
            take += [f"    s[np.uintp({self._place('F', a)}{at} += {stage[3 * b + a]}" for a in range(3)]
        text = self.binder.law(force.traced, force, state, "e", self.tables[j], tag)
        return [
            f"# {force.name}",
            f"for e in range({len(self.families[j].nodes)}):",
            *(f"    n{b} = np.uintp(E{j}[{force.nodes} * e + {b}]) * np.uintp(L)" for b in range(force.nodes)),
            "    for i in range(L):",
            *indented(text.lines, 2),
            *indented([f"{entry} = {out}" for entry, out in zip(stage, text.outputs, strict=True)], 2),
            *indented(take, 1),
        ]

    def _lead(self) -> list[str]:
        """The function that puts pins that move where the solver sees them in a step, whose maps begin at `o`."""
        if not len(self.led):
            return []
        lines = []
        for run in runs(np.asarray(self.led[:, None], np.int32)):
            places = {
                f"{name} {axis}": f"s[({self._place(name, a) + run.nodes[0]} + {run.strides[0]} * e) * L + i]"
                for name in self.scratch.places
                if name in ("X", "V", "X0", "V0")
                for a, axis in enumerate(AXES)
            }
            lines += [f"for e in range({run.count}):", "    for i in range(L):"]
            lines += indented(put(self.motions, self.system.particles, self.arms, f"{run.begin} + e", places), 2)
        return ["@njit(**FLAGS)", "def lead(s, pin_maps, o):", *indented(lines, 1), "", ""]

    def _step(self) -> list[str]:
        """The functions of the phases, and the one that calls them in turn."""
        functions, calls = [], []
        different = list(dict.fromkeys(tuple(p.lines) for p in self.phases))
        for phase in self.phases:
            calls += [
                f"status |= deriv(s, g, {self._shared()}, {phase.time})",
                f"phase{different.index(tuple(phase.lines))}(s, hr)",
            ]
        for number, lines in enumerate(different):
            functions += ["@njit(**FLAGS)", f"def phase{number}(s, hr):", f"    for i in range({self.nodes} * L):"]
            functions += [f"        w = {self.binder.attribute('w', '')}", "        free = w != R(0)"]
            for k in range(3):
                places = {r: f"s[{self._place(r, k)} * L + i]" for r in regions(self.phases)}
                functions.append(f"        a = s[{self._place('F', k)} * L + i]")
                functions.append("        a = select(free, a * w, R(0))")
                functions += indented(entries(lines, places), 2)
            functions += ["", ""]
        step = ["@njit(**FLAGS)", f"def step(s, g, {self._shared()}, t, h):", "    status = 0", "    hr = R(h)"]
        return [*functions, *step, *indented([*calls, "return status"], 1), "", ""]

    def _run(self) -> list[str]:
        """The kernel itself: some tiles over a span."""
        copies = []
        if "X0" in self.scratch.places:
            starts = [f"s[{self._place(f'{q}0', 0)} * L + i] = s[{self._place(q, 0)} * L + i]" for q in STATE]
            copies = [f"        for i in range({3 * self.apart} * L):", *indented(starts, 3)]
        blocks = [(table.place(c), table.length) for table in self.columns() for c in range(len(table.getters))]
        fill = []
        for b, (row, length) in enumerate(blocks):
            fill += [
                f"        o = O[{2 * b}] + tile * O[{2 * b + 1}]",
                f"        for i in range({length} * L):",
                f"            s[{row} * L + i] = K[o + i]",
            ]
        given, lead = self._shared(), []
        if len(self.led):
            given, lead = (
                f"{given}, pin_maps",
                [f"            lead(s, pin_maps, (k - k0) * {MAP * len(self.motions.motions)})"],
            )
        return [
            "@njit(**OWNING_ENTRY)",
            f"def run(first, last, islands, x, v, {given}, K, O, t0, dt, k0, count, status, reach):",
            f"    s = np.zeros({self.scratch.rows} * L, R)",
            "    g = np.empty(STAGE * L, R)",
            "    for tile in range(first, last):",
            "        load(s, 0, x, tile * L, islands)",
            "        load(s, 3 * A * L, v, tile * L, islands)",
            *copies,
            *fill,
            "        bad = 0",
            "        for k in range(k0, k0 + count):",
            *lead,
            "            t = t0 + k * dt",
            f"            bad |= step(s, g, {self._shared()}, t, t0 + (k + 1) * dt - t)",
            "        far, fast = reached(s, 0, 3 * A * L), reached(s, 3 * A * L, 6 * A * L)",
            f"        status[tile] = bad if far < np.inf and fast < np.inf else {NOT_FINITE}",
            "        reach[tile, 0] = far",
            "        reach[tile, 1] = fast",
            "        keep(s, 0, x, tile * L, islands)",
            "        keep(s, 3 * A * L, v, tile * L, islands)",
            "",
        ]


MOVED = '''@njit(**FLAGS)
def load(s, offset, x, lo, islands):
    """The islands from `lo` on, (x, y, z) of each node; the last one again where there are no more."""
    for lane in range(L):
        b = np.uintp(3 * N * min(lo + lane, islands - 1))
        o = np.uintp(offset + lane)
        for q in range(N):
            s[o] = x[b]
            s[o + np.uintp(A * L)] = x[b + np.uintp(1)]
            s[o + np.uintp(2 * A * L)] = x[b + np.uintp(2)]
            b += np.uintp(3)
            o += np.uintp(L)


@njit(**FLAGS)
def keep(s, offset, x, lo, islands):
    """The way back."""
    for lane in range(min(L, islands - lo)):
        b = np.uintp(3 * N * (lo + lane))
        o = np.uintp(offset + lane)
        for q in range(N):
            x[b] = s[o]
            x[b + np.uintp(1)] = s[o + np.uintp(A * L)]
            x[b + np.uintp(2)] = s[o + np.uintp(2 * A * L)]
            b += np.uintp(3)
            o += np.uintp(L)


'''


class LanesMembers:
    """Islands of one topology, in the order of the kernel's lanes."""

    def __init__(self, kernel: LanesKernel, topology: Topology) -> None:
        self.kernel, self.islands = kernel, len(topology.rows)
        orders = [topology.rows, *(f.own for f in topology.families), topology.rows[:, kernel.led]]
        self._columns = Packed(kernel.columns(), orders, kernel.dtype, self._tiles)

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        kernel = self.kernel
        elements = [np.ascontiguousarray(kernel.families[j].nodes).ravel() for j in sorted(kernel.staged)]
        places = [maps(kernel.motions, span.times, kernel.dtype)] if len(kernel.led) else []
        data = (*kernel.binder.common(), *elements, *places, *self._columns.arrays())
        tiles = -(-self.islands // kernel.width)
        status, reach = np.zeros(tiles, np.int64), np.zeros((tiles, 2), x.dtype)
        grid = (span.t0, span.dt, span.first, span.count)
        run = kernel.functions["run"]
        spread(lambda lo, hi: run(lo, hi, self.islands, x, v, *data, *grid, status, reach), tiles, GRAIN)
        work = Stats(span.count, 0, span.count * len(kernel.phases))
        return Outcome(not status.any(), reach.max(axis=0).astype(np.float64), work)

    def _tiles(self, values: Array) -> tuple[Array, int]:
        """A column, shape (islands, length), by tile, and how far the next tile is."""
        width = self.kernel.width
        tiles = -(-self.islands // width)
        lanes = np.minimum(np.arange(tiles * width), self.islands - 1).reshape(tiles, width)
        common = bool((values == values[0]).all())
        part = values[lanes[:1] if common else lanes].transpose(0, 2, 1).ravel()
        return part, 0 if common else values.shape[1] * width
