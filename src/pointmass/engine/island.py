"""The kernel that takes islands from step to step: everything that a system can do, island by island.

It is printed in two forms from one text: threads take islands, each a whole one; or all threads work on a single large
island, loop by loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.adaptive import control_text
from pointmass.engine.blocks import Kind, Layout, layout, slices
from pointmass.engine.contact import ContactText
from pointmass.engine.dealt import Dealt
from pointmass.engine.forces import LANES, Deriv, Elements, Incidence, incidence, tiled
from pointmass.engine.impacts import WORK, ImpactText
from pointmass.engine.implicit import implicit_text
from pointmass.engine.pairs import FULL, PairArrays
from pointmass.engine.phases import REACHED
from pointmass.engine.pins import PIN_LISTS, lead_lines, maps, pin_lists
from pointmass.engine.printing import function, indented
from pointmass.engine.reference import KILLED
from pointmass.engine.relaxation import relaxation_text
from pointmass.engine.steps import StepText, each, step_text
from pointmass.engine.threads import spread
from pointmass.laws.colouring import colour_starts
from pointmass.laws.elements import ConstraintForce
from pointmass.laws.stencils import Grid
from pointmass.motions import NO_MOTIONS, Motions
from pointmass.solvers.advance import NEARLY, SET_BACKS, Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.solvers.control import control_of
from pointmass.solvers.implicit import Implicit
from pointmass.solvers.xpbd import XPBD
from pointmass.system import ParticleSystem

CHECKPOINT = 64  # steps after which nothing is remembered of earlier ones but the state, so that a run can go on there
GRAIN = 256  # particles that are worth a thread
NOT_FINITE, NO_STEP = 1, 4  # bits of the status of an island

MEMORY = {"warm": ("rise", 1), "x_before": ("y_before", 0), "v_before": ("y_before", 1)}  # in the solver's words
CONTROL = ("h_next", "error_old", "rejected")  # what the step control remembers of an island

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

    @property
    def times(self) -> list[float]:
        """The grid: begins of the steps, and the end of the last one [s]."""
        return [self.time(k) for k in range(self.count + 1)]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a kernel says of a group after a span.

    Attributes
    ----------
    good : whether nothing went wrong.
    reach : largest |x| [m] and |v| [m/s] of a component.
    again : whether it had too little room, and has enough for another try now.
    died : rows of the particles that a surface killed.
    hit : rows of those that may have hit a surface, all who did among them, if the kernel was to watch.
    """

    good: bool
    reach: Array
    stats: Stats
    again: bool = False
    died: Rows = field(default_factory=lambda: np.zeros(0, np.intp))
    hit: Rows = field(default_factory=lambda: np.zeros(0, np.intp))


class IslandKernel:
    """Advances a group of islands.

    Parameters
    ----------
    parallel : one large island by all threads, instead of many by one thread each.
    watched : whether it tells who hits a surface.
    motions : of pinned particles.
    found : the grid that the island is, if the solver relaxes it by rows.
    """

    def __init__(
        self,
        system: ParticleSystem,
        solver: Solver,
        parallel: bool,
        watched: bool = False,
        motions: Motions = NO_MOTIONS,
        found: Grid | None = None,
    ) -> None:
        self.system, self.solver = system, solver
        self._watched, self.motions = watched, motions
        self.dtype = str(system.particles.dtype)
        self.deriv = Deriv(system, parallel, solver.implicit, isinstance(solver, XPBD), found is not None)
        self.dealt: Dealt | None = None
        if found is not None:
            assert isinstance(solver, XPBD)
            self.dealt = Dealt(found, self.dtype, bool(system.colliders), solver.iterations > 1, bool(motions))
        self.impacts = self._impacts()
        self.step = self._step_text()
        self.text = REACHED + self.functions_text + self._run()

    def _impacts(self) -> ImpactText | None:
        deriv = self.deriv
        if deriv.contact is None:
            return None
        w, m, radius = (deriv.binder.attribute(name, "g") for name in ("w", "m", "radius"))
        flags, braking = deriv.flags, self.solver.braking
        return ImpactText(deriv.contact, self.system.order, deriv.loop, flags, deriv.call, w, m, radius, braking)

    def _step_text(self) -> StepText:
        if isinstance(self.solver, Implicit):
            return implicit_text(self.deriv, self.solver)
        if isinstance(self.solver, XPBD):
            return relaxation_text(self.deriv, self.solver, self.dealt)
        depends = self.system.velocity_dependent
        order, loop = self.system.order, self.deriv.loop
        steady = all(force.steady for force in self.system.forces) and not self.motions
        return step_text(self.solver, order, self.dtype, loop, self._w, depends, steady, self.impacts is not None)

    @property
    def _w(self) -> str:
        """Inverse mass of particle i."""
        return self.deriv.binder.attribute("w", "np.uintp(base + i)")

    @property
    def deadly(self) -> bool:
        """Whether a surface kills."""
        return self.deriv.contact is not None and self.deriv.contact.kills

    @property
    def watched(self) -> bool:
        """Whether it tells who hits a surface."""
        return self._watched and self.impacts is not None

    @property
    def work(self) -> list[str]:
        """Arrays that an island needs while it is advanced, each of length 3n."""
        more = [] if self.impacts is None else [*WORK, "av"]
        return [*self.step.work, *([] if self.step.in_place else ["x1", "v1"]), *more]

    @property
    def memory(self) -> list[str]:
        """Arrays of 3 numbers for each particle that the solver keeps between steps."""
        return self.step.memory

    @property
    def call(self) -> str:
        """The arguments of `advance`, as text."""
        more = ["known"] * self.step.keeps + ([] if self.impacts is None else ["events", "paid", "when"])
        layouts = [*self.step.arrays, *["slices"] * bool(self.step.kinds)]
        arrays = [*layouts, *self.work, *self.step.scratch, *self.memory, *more]
        return ", ".join([self.deriv.call, "clock, end, x, v", *arrays, "h_before, control, done"])

    @property
    def scratch(self) -> list[str]:
        """Statements that make what a thread needs for an island; M has the largest counts of particles, of elements,
        of what the blocks of a matrix take, and last that of tiles."""
        contact = self.deriv.contact
        families = enumerate(self.deriv.families)
        lines = [f"B{f.number} = np.empty({3 * f.force.nodes} * M[{k + 1}], R)" for k, f in families if f.implicit]
        lines += [f"{name} = {make}" for name, make in self.deriv.scratch.items()]
        lines += [f"{name} = np.empty(3 * M[0], R)" for name in self.work]
        lines += ["known = np.zeros(1, np.int64)"] * self.step.keeps
        lines += [f"{name} = {make}" for name, make in self.step.scratch.items()]
        if contact is not None:
            lines.append(f"K = np.zeros({contact.record} * M[0])")
            lines += [f"{name} = np.zeros(M[0], np.int64)" for name in ("events", "paid")]
            lines.append("when = np.zeros(1)")
        return lines

    @property
    def functions_text(self) -> str:
        """The functions down to `advance`."""
        deriv, control = self.deriv, control_of(self.solver)
        parts = [deriv.text, self._slope(), self.step.functions]
        if self.impacts is not None:
            parts.append(self.impacts.text)
        if control is not None:
            parts.append(control_text(control, self.system.order, self.dtype, deriv.call))
        return "".join([*parts, self._advance()])

    def _slope(self) -> str:
        """dy/dt, in two arrays: of x and of v (order 1: of x alone)."""
        deriv = self.deriv
        lines = [f"return deriv({deriv.call}, t, x, x, kx)"]
        if self.system.order == 2:
            lines = [
                f"status = deriv({deriv.call}, t, x, v, kv)",
                *each(deriv.loop, self._w, ["kx[q] = v[q] if free else R(0)"]),
                "return status",
            ]
        return function("slope", f"{deriv.call}, t, x, v, kx, kv", deriv.flags, lines)

    def _advance(self) -> str:
        """An island from its clock to the end of a step."""
        deriv, second, step = self.deriv, self.system.order == 2, self.step
        calls = {"SLOPE(": f"slope({deriv.call}, ", "DERIV(": f"deriv({deriv.call}, "}
        trial = step.lines
        for name, call in calls.items():
            trial = [line.replace(name, call) for line in trial]
        keep = ["x[q] = x1[q]"] + ["v[q] = v1[q] if free else R(0)"] * second
        wanted, judged = ["h = left", "last = True"], []
        if step.error:
            wanted = [
                "if not control[0] > 0.0:",
                f"    control[0] = first_step({deriv.call}, clock, left, x, v, kx0, kv0, tx, tv, kx1, kv1, ex, ev)",
                "    done[1] += 2",
                "wanted = control[0]",
                f"last = wanted * {NEARLY!r} >= left",
                "h = left if last else wanted",
            ]
            judged = [
                *(line.replace("SLOPE(", f"slope({deriv.call}, ") for line in step.error),
                "verdict = judge(rms(n, ex, ev), h, wanted, clock, end, control)",
                "if verdict != 0:",
                "    done[2] += 1",
                f"    status |= {NO_STEP} if verdict == 2 else 0",
                "    continue",
            ]
        before, after, beyond = [], [], ["clock = end if last else clock + h"]
        if self.impacts is not None:
            before = [f"standing, bad = prepare({deriv.call}, clock, h, x, v, av)", "status |= bad"]
            after = [
                f"for q in {deriv.loop}(3 * n):",
                *indented([f"{q}0[q] = {q}[q]" for q in "xv"[: self.system.order]], 1),
            ]
            arrays = ", ".join(WORK)
            beyond = [
                f"now, hits = collide({deriv.call}, n == 1, clock, h, x, v, events, paid, when, began, {arrays})",
                "if hits > 0:",
                *indented(self._anew(), 1),
                "if now < clock + h:",
                "    backs += 1",
                f"    status |= {NO_STEP} if backs > {SET_BACKS} else 0",
                "    clock = now",
                "else:",
                "    clock = end if last else clock + h",
            ]
        lines = [
            "status = 0",
            "backs = 0",
            *self._begin(),
            "while clock < end and status == 0:",
            "    left = end - clock",
            *indented(wanted, 1),
            *indented(before, 1),
            "    hr = R(h)",
            "    t = clock",
            *indented(trial, 1),
            "    done[0] += 1",
            f"    done[1] += {step.evaluations}",
            *indented(judged, 1),
            *indented(after, 1),
            *indented([] if step.in_place else each(deriv.loop, self._w, keep), 1),
            *indented(beyond, 1),
            "return status",
        ]
        return function("advance", self.call, deriv.once, lines)

    def _begin(self) -> list[str]:
        """At the beginning of a step: nobody has hit anything, and everybody is where the step began."""
        if self.impacts is None:
            return []
        return [
            "began = clock",
            f"for i in {self.deriv.loop}(n):",
            "    events[i] = 0",
            f"for q in {self.deriv.loop}(3 * n):",
            "    bx[q] = x[q]",
        ]

    def _anew(self) -> list[str]:
        """What the solver remembers is of no use after an impact."""
        control = control_of(self.solver)
        if self.solver.implicit:
            loop = [f"for q in {self.deriv.loop}(3 * n):", *(f"    {name}[q] = R(0)" for name in self.memory)]
            return ["h_before[0] = np.inf", *(loop if self.memory else [])]
        if control is None:
            return ["pass"]
        return [f"control[{k}] = {value!r}" for k, value in enumerate((0.0, control.floor, 0.0))]

    def _run(self) -> str:
        """The kernel itself: the islands of a group over a span."""
        deriv = self.deriv
        elements = [f.number for f in deriv.families]
        numbers = elements * deriv.implicit + [p.number for p in deriv.pairs]
        ranges = [line for j in numbers for line in (f"s{j} = S{j}[island]", f"e{j} = S{j}[island + 1]")]
        kinds = self.step.kinds
        ranges += ["slices = first_slice[island]"] if kinds else []
        tiles = {f"T{j}": f"tiles{j}" for j in elements} | ({"cuts": "tiling"} if elements else {})
        ranges += [f"{name} = {all_}" + "[island:island + 2]" * (not deriv.parallel) for name, all_ in tiles.items()]
        lists = [f"K{p.number}[0] = 0" for p in deriv.pairs if p.near]
        lists += ["known[0] = 0"] * (self.step.keeps and bool(lists))
        lists += ["warm_[:] = R(0)"] if "warm" in self.memory else []
        anew = [f"if (k0 + s) % {CHECKPOINT} == 0:", *indented(lists, 1)] if lists else []
        call = self.call.replace(", x, v, ", ", xi, vi, ")
        for name in self.memory:
            call = call.replace(f", {name},", f", {name}_,")
        around = [line.replace(", x, v", ", xi, vi") for line in self.step.around]
        alive, dead, deaths = "", [], []
        if self.deadly:  # an island of more than one particle makes single steps where somebody may die
            alive, dead = " and alive", ["alive = True"]
            deaths = ["for i in range(n):", f"    if events[i] >= {KILLED}:", "        died[base + i] = 1"]
            deaths.append("        alive = False")
        hits = ["for i in range(n):", "    if events[i] > 0:", "        hit[base + i] = 1"] if self.watched else []
        island = [
            "base = first[island]",
            "n = first[island + 1] - base",
            *ranges,
            "xi = x[3 * base:3 * (base + n)]",
            "vi = v[3 * base:3 * (base + n)]",
            *(f"{name}_ = {name}[3 * base:3 * (base + n)]" for name in self.memory),
            "h_before = lengths[island:island + 1]",
            "control = controls[island]",
            "done = work[island]",
            *["known[0] = 0"] * self.step.keeps,
            *["elastic = True"] * deriv.relaxed,
            "bad = 0",
            *dead,
            *around[:1],
            "for s in range(count):",
            *indented(self._lead(), 1),
            "    clock = max(t0 + (k0 + s) * dt, birth[island])",
            "    end = t0 + (k0 + s + 1) * dt",
            *indented(anew, 1),
            f"    if clock < end and bad == 0{alive}:",
            f"        bad = advance({call})",
            *indented([*deaths, *hits], 2),
            *around[1:],
            "far, fast = reached(xi, 0, 3 * n), reached(vi, 0, 3 * n)",
            f"status[island] = bad if far < np.inf and fast < np.inf else {NOT_FINITE}",
            "reach[island, 0] = far",
            "reach[island, 1] = fast",
        ]
        layouts = [*self.step.arrays, "first_slice"] if kinds else []
        pins = [*PIN_LISTS, "pin_maps"] if self.motions else []
        data = ", ".join([*pins, *deriv.data, *(f"S{j}" for j in numbers), *layouts, *tiles.values()])
        mortal = ["died"] * self.deadly + ["hit"] * self.watched
        grid = ", ".join([*self.memory, "birth, t0, dt, k0, count, lengths, controls, work, status, reach", *mortal])
        given = f"lo, hi, first, x, v, {data}, {grid}"
        return entry_text(self.scratch, given, ["for island in range(lo, hi):", *indented(island, 1)])

    def _lead(self) -> list[str]:
        """Put pins that move where the solver sees them in step `s`; as far as it knows they have always been there."""
        if not self.motions:
            return []
        history = [("x_before_", "v_before_")] if "x_before" in self.memory else []
        return lead_lines(len(self.motions.motions), [("xi", "vi"), *history])

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


def entry_text(scratch: Sequence[str], given: str, lines: Sequence[str]) -> str:
    """The kernel `run`, and `scratch` of plain Python, whose arrays it takes besides what is given: a call for each
    thread, with the sizes M."""
    made = ", ".join(line.split(" = ")[0] for line in scratch)
    head = ["def scratch(M):", *indented([*scratch, f"return {made},"], 1), "", "", ""]
    return "\n".join(head) + function("run", f"{given}, {made}", "**ENTRY", lines).removesuffix("\n\n")


def marked(contact: ContactText | None, hit: NDArray[np.uint8]) -> Rows:
    """Who has hit a surface by its mark, or may have: the lecture's test at the end of a step leaves none."""
    return np.arange(len(hit)) if contact is not None and contact.discrete else np.flatnonzero(hit)


def everybody(rows: Rows, count: int) -> bool:
    """Whether rows are those of all of `count` particles, in order."""
    return len(rows) == count and bool((np.diff(rows) == 1).all())


class IslandMembers:
    """The islands of a group in the order of the kernel's rows.

    Parameters
    ----------
    rows : particles of each island, one after the other.
    labels : island of each, shape (rows,).
    """

    def __init__(self, kernel: IslandKernel, rows: Rows, labels: Rows) -> None:
        self.kernel, self.rows = kernel, rows
        self.islands = labels[np.flatnonzero(np.diff(labels, prepend=-1))]
        self.first = np.append(np.flatnonzero(np.diff(labels, prepend=-1)), len(rows)).astype(np.int64)
        self.place = np.full(len(kernel.system.particles), -1, np.intp)
        self.place[rows] = np.arange(len(rows))
        self.order = None if everybody(rows, len(self.place)) else rows
        self.pairs = [PairArrays(p, kernel.system.particles, self.place) for p in kernel.deriv.pairs]
        elements = [self._elements(f.force) for f in kernel.deriv.families]
        self.families = []
        if kernel.deriv.implicit:
            self.families = [self._family(f, *e) for f, e in zip(kernel.deriv.families, elements, strict=True)]
        ordered = zip(kernel.deriv.families, self.families, strict=bool(self.families))
        self.colours = [
            colour_starts(self._colours(f, mine) if f.coloured else self.rows[:0]) for f, (mine, _) in ordered
        ]
        places = [self.place[nodes] for _, nodes in elements]
        self.tiling = self._tiling(places) if kernel.deriv.parallel else self.first
        first = 0 * self.tiling[:-1] if kernel.deriv.parallel else self.first[:-1]
        self.tiles = [tiled(rows, self.tiling, first) for rows in places]
        # A law is evaluated for so many elements at once, also for the last ones.
        self.tiled = [
            np.append(mine[t.order], np.repeat(mine[t.order[-1:]], LANES - 1))
            for (mine, _), t in zip(elements, self.tiles, strict=True)
        ]
        self.layouts = [self._layout(kind) for kind in kernel.step.kinds]
        self.pins = pin_lists(kernel.motions, kernel.system.particles, self.place, self.first) if kernel.motions else []

    def _elements(self, force: Any) -> tuple[Rows, Rows]:
        """Numbers and particles of the elements of a force that are in the group."""
        nodes = force.rows(self.kernel.system.particles)
        mine = np.flatnonzero(self.place[nodes[:, 0]] >= 0)
        return mine, nodes[mine]

    def _family(self, family: Elements, mine: Rows, nodes: Rows) -> tuple[Rows, Incidence]:
        """Elements in the order of the kernel, and where they are.

        Those that are relaxed are ordered by colour, and then by place: a thread meets the same particles again.
        """
        if self.kernel.deriv.relaxed and isinstance(family.force, ConstraintForce):
            by_place = self.place[nodes].min(axis=1, initial=len(self.rows))
            by_colour = np.lexsort((by_place, self._colours(family, mine)))
            mine, nodes = mine[by_colour], nodes[by_colour]
        found = incidence(self.place[nodes], self.first)
        return mine[found.order], found

    def _colours(self, family: Elements, elements: Rows) -> Rows:
        """Colours of some elements, by their numbers."""
        return self.kernel.system.colours[family.force][elements]

    def _layout(self, kind: Kind) -> Layout:
        """Where the blocks of a matrix are."""
        families = [(self.families[k][1], self.kernel.deriv.families[k].force.nodes) for k in kind.families]
        return layout(self.first, families, kind.relative)

    def _tiling(self, places: list[Rows]) -> NDArray[np.int64]:
        """First rows of the tiles of an island, one for each thread, so that all have as much to do.

        They are multiples of `LANES`, so that the same particles are left over at the end of loops of vectors.
        """
        import numba

        work = np.ones(len(self.rows))
        for rows in places:
            work += np.bincount(rows.ravel(), minlength=len(work))
        done = np.cumsum(work)
        tiles = numba.get_num_threads()
        inner = np.searchsorted(done, done[-1] * np.arange(1, tiles) / tiles)
        return np.unique(np.concatenate([[0], inner // LANES * LANES, [len(work)]])).astype(np.int64)

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        deriv, count, islands = self.kernel.deriv, len(self.rows), len(self.islands)
        dtype = self.kernel.system.particles.dtype
        data = deriv.binder.data(count, self.order)
        died, hit = np.zeros(count, np.uint8), np.zeros(count * self.kernel.watched, np.uint8)
        starts, most = [], [int(np.diff(self.first).max(initial=0))]
        for k, family in enumerate(deriv.families):
            data += [self.tiles[k].nodes, family.tiled.array(len(self.tiled[k]), dtype, self.tiled[k])]
            if deriv.implicit:
                elements, found = self.families[k]
                data += [found.nodes, family.table.array(len(elements), dtype, elements), found.ends, found.entries]
                data += [self.colours[k]] if family.coloured else []
                starts.append(found.start)
                most.append(int(np.diff(found.start).max(initial=0)))
        for pairs in self.pairs:
            data += pairs.arrays()
            home = np.searchsorted(self.first, pairs.rows[0], side="right") - 1 if len(pairs.rows) else islands
            starts.append(np.where(np.arange(islands + 1) > home, len(pairs.rows), 0))
        most += [found.most for found in self.layouts]
        layouts = [array for found in self.layouts for array in found.arrays]
        layouts += [slices(self.first)] if layouts else []
        most.append(len(self.tiling) - 1 if deriv.parallel else 1)
        begin = np.full(islands, -np.inf) if births is None else np.maximum.reduceat(births, self.first[:-1])
        control, work = np.zeros((islands, len(CONTROL))), np.zeros((islands, 5), np.int64)
        if CONTROL[0] in memory:
            control[:] = np.stack([memory[name][self.islands] for name in CONTROL], axis=1)
        status, reach = np.zeros(islands, np.int64), np.zeros((islands, 2))
        views = [self._view(memory, *MEMORY[name]) for name in self.kernel.memory]
        kept = [view[self.rows].astype(dtype).reshape(-1) for view in views]
        lengths = begin.copy()
        if "h_before" in memory:
            lengths = self._view(memory, "h_before", 0)[self.rows[self.first[:-1]], 0]
        grid = (span.t0, span.dt, span.first, span.count, lengths)
        arrays = (
            self.first,
            x,
            v,
            *self.pins,
            *([maps(self.kernel.motions, span.times, dtype)] if self.pins else []),
            *data,
            *self._more(),
            *starts,
            *layouts,
            *(t.start for t in self.tiles),
            *[self.tiling] * bool(self.tiles),
            *kept,
            begin,
            *grid,
            control,
            work,
            status,
            reach,
            *[died] * self.kernel.deadly,
            *[hit] * self.kernel.watched,
        )
        kernel = self.kernel.functions["run"]
        scratch = self.kernel.functions["scratch"]
        spread(lambda lo, hi: kernel(lo, hi, *arrays, *scratch(most)), islands, max(1, GRAIN * islands // count))
        for name, column in zip(CONTROL, control.T, strict=True):
            if name in memory:
                memory[name][self.islands] = column
        for view, array in zip(views, kept, strict=True):
            view[self.rows] = array.reshape(-1, 3)
        if "h_before" in memory:
            for part in range(self.kernel.system.order):
                self._view(memory, "h_before", part)[self.rows] = np.repeat(lengths, np.diff(self.first))[:, None]
        steps, evaluations = (int(w) for w in work[:, :2].max(axis=0))
        stats = Stats(steps, *(int(w) for w in (work[:, 2].sum(), evaluations, *work[:, 3:].sum(axis=0))))
        if (status & FULL).any():
            for pairs in self.pairs:
                pairs.enlarge()
        again = bool((status == FULL).any())
        told = self.rows[died > 0], self.rows[marked(self.kernel.deriv.contact, hit)]
        return Outcome(not status.any(), reach.max(axis=0), stats, again, *told)

    def _more(self) -> list[Any]:
        """Colliders now, and the rows of a grid."""
        contact, dealt = self.kernel.deriv.contact, self.kernel.dealt
        surfaces: list[Any] = [] if contact is None else [contact.table()]
        return surfaces + ([] if dealt is None else dealt.arrays(self.kernel.system.particles.w))

    def _view(self, memory: Memory, name: str, part: int) -> Array:
        """The part of a memory entry that belongs to x or to v, shape (n, 3)."""
        view: Array = memory[name].reshape(self.kernel.system.order, -1, 3)[part]
        return view
