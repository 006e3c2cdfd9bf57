"""The fast path of particles that are islands of their own: smoke, snow, sparks, dust.

Lane = particle. A tile of particles is loaded once into a small scratch, makes all steps of a span there, and is stored
once, so that memory is touched once a frame. Tiles are always padded to full width.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.binding import Binder, Table, equal_columns
from pointmass.engine.contact import ClearLines
from pointmass.engine.forces import unary
from pointmass.engine.island import NOT_FINITE, IslandKernel, Outcome, Span, entry_text
from pointmass.engine.phases import REACHED
from pointmass.engine.printing import function, indented, literal
from pointmass.engine.reference import KILLED
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
LANE = "i"  # index of a lane
STATE = 7  # rows of the scratch before the columns: x, v, and who waits
W = 256  # lanes of a tile
BUNCH = 32  # lanes of which it is asked in one go whether somebody waits
AXES = "xyz"
UNROLLED = (4, 1)  # steps that a lane makes in registers
LONG = 100  # statements of a step that are not unrolled
TRANSPOSED = f'''@njit(**FLAGS)
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
def copy(kept, x, lo, m):
    """Rows of x to where they are kept."""
    a = np.uintp(3 * lo)
    for j in range(3 * m):
        kept[a + np.uintp(j)] = x[a + np.uintp(j)]


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


WAITS = f"""@njit(**FLAGS)
def somebody_waits(s, first, count):
    bits = s.view(BITS)
    o = np.uintp({6 * W} + first)
    any_bit = BITS(0)
    for j in range(count):
        any_bit |= bits[o + np.uintp(j)]
    return any_bit != 0


"""


class Lanes(Table):
    """Columns of the particles of a tile, behind their state."""

    def entry(self, column: int, index: str) -> str:
        return super().entry(column, index) if index != LANE else f"s[{(STATE + column) * W} + {LANE}]"

    def beside(self, index: str) -> bool:
        return index == LANE


class Motion:
    """Prints one step of a solver for one lane, in locals.

    Attributes
    ----------
    at_time : statements of the step, outside the loop over lanes.
    lines : statements of a lane: from x_x, ..., v_z to x1_x, ..., v1_z.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, births: bool) -> None:
        self.system, self.solver = system, solver
        self.forces = [force for force in system.forces if isinstance(force, UnaryForce)]
        equal = frozenset() if births else equal_columns(system.particles)
        switches = not all(force.enabled for force in system.forces)
        self.binder = Binder(system.particles, Lanes("C"), switches, equal)
        self.dtype = self.binder.dtype
        self.at_time: list[str] = []
        self.lines: list[str] = [f"w = {self.binder.attribute('w', LANE)}"]
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
            self.timed = self.timed or not force.steady
            timed, lines = unary(self.binder, force, f"f{j}_{k}", state, LANE, f"s{k}")
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
    """Advances particles that nobody pulls on.

    Who comes near a surface, or is not born yet, waits while the others make a step, and then makes it by the text of
    an island.

    Parameters
    ----------
    births : whether some may not be born yet.
    watched : whether it tells who hits a surface.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, births: bool, watched: bool = False) -> None:
        self.system, self.solver, self.births = system, solver, births
        self.motion = Motion(system, solver, births)
        self.island: IslandKernel | None = None
        if births or system.colliders:
            self.island = IslandKernel(system, solver, False, alone=True, binder=self.motion.binder, watched=watched)
        self.state = [(q, a) for q in ("xv" if system.order == 2 else "x") for a in AXES]
        self.text = self._printed()

    def _printed(self) -> str:
        motion, island = self.motion, self.island
        clear = self._clear()
        step = [*motion.lines]
        if clear is not None:
            third = f"third = hr * {literal(1 / 3, motion.dtype)}"
            step = [*step, third, *self._place(0), *self._place(1), *clear.lane]
        step += [f"{q}_{a} = {q}1_{a}" for q, a in self.state if q == "x"]
        step += [f"{q}_{a} = {motion._free(f'{q}1_{a}')}" for q, a in self.state if q == "v"]
        timed = motion.timed or (clear is not None and bool(clear.step))
        long = timed or len(step) > LONG or bool(motion.binder.functions)  # functions are longer than they look
        unrolled = [u for u in UNROLLED if u == 1 or not long]
        lanes = [self._unrolled(u, step, clear) for u in unrolled if u > 1]
        first = motion.binder.functions if island is None else island.functions_text
        waits = "" if island is None else WAITS
        return "".join([REACHED, first, TRANSPOSED, *lanes, self._single(step, clear), waits, self._run(unrolled)])

    def _clear(self) -> ClearLines | None:
        contact = None if self.island is None else self.island.deriv.contact
        return None if contact is None else contact.clear_lines(self.motion.dtype, "F")

    def _place(self, end: int) -> list[str]:
        """The state of a lane at the beginning or the end of a step, by the names of `ClearLines`."""
        tail, lines = "1" if end else "", []
        for q, letters in (("x", "xyz"), ("v", "uvw")):
            for a, b in zip(AXES, letters, strict=True):
                lines.append(f"{b}{end} = {f'{q}{tail}_{a}' if (q, a) in self.state else 'R(0)'}")
        return lines

    def _unrolled(self, count: int, step: list[str], clear: ClearLines | None) -> str:
        """The function that makes a few steps of all lanes, with the state in registers in between."""
        arguments = ", ".join([*self.shared, *(f"t{j}" for j in range(count + 1))])
        loop = [f"for j in range({W}):", *indented([f"{LANE} = np.uintp(j)", *self._lane(count, step, clear)], 1)]
        lines = [*self._head(count, clear), *loop, "return status"]
        return function(f"lanes{count}", arguments, "**FLAGS", lines)

    def _single(self, step: list[str], clear: ClearLines | None) -> str:
        """The functions that make one step of all lanes, and of one lane; this says whether that was clear."""
        head, body = self._head(1, clear), self._lane(1, step, clear)
        common = ", ".join(_read([*self.shared, *_assigned(head)], body))
        last = "return not waits" if self.island is not None else "return True"
        step_of = function("step_of", f"{LANE}, {common}", "forceinline=True, **FLAGS", [*body, last])
        call = f"step_of({{}}, {common})"
        arguments = ", ".join([*self.shared, "t0", "t1"])
        all_lanes = [*head, f"for j in range({W}):", f"    {call.format('np.uintp(j)')}", "return status"]
        texts = [step_of, function("lanes1", arguments, "**FLAGS", all_lanes)]
        if self.island is not None:
            one = [*head, f"return {call.format(LANE)} and status == 0"]
            texts.append(function("lane", f"{LANE}, {arguments}", "**FLAGS", one))
        return "".join(texts)

    def _head(self, unrolled: int, clear: ClearLines | None) -> list[str]:
        """What all lanes have in common."""
        return [
            *self.motion.binder.numbers.lines(),
            *(f"h{j} = R(t{j + 1} - t{j})" for j in range(unrolled)),
            "t = t0",
            "h = t1 - t0",
            "status = 0",
            *self.motion.at_time,
            *([] if clear is None else [*clear.once, *clear.step]),
        ]

    def _lane(self, unrolled: int, step: list[str], clear: ClearLines | None) -> list[str]:
        """The steps of a lane; one that waits keeps its state."""
        motion = self.motion
        place = {f"{q}_{a}": f"s[{k * W} + {LANE}]" for k, (q, a) in enumerate(self.state)}
        waiting = f"s[{6 * W} + {LANE}]"
        keep = [f"{entry} = {name}" for name, entry in place.items()]
        first: list[str] = []
        last: list[str] = []
        if self.island is not None:
            last = [f"waits = {waiting} != R(0)"]
            if clear is not None:
                first = [f"radius = {motion.binder.attribute('radius', LANE)}", *self._place(0), *clear.begin]
                moves = f"({motion.binder.attribute('w', LANE)} != R(0)) & " if motion.pins else ""
                last += [*clear.end, f"waits = waits | ({moves}(not ({clear.result})))"]
            keep = [f"{entry} = {entry} if waits else {name}" for name, entry in place.items()]
            keep.append(f"{waiting} = R(1) if waits else R(0)")
        return [
            *(f"{name} = {entry}" for name, entry in place.items()),
            *first,
            *(line for j in range(unrolled) for line in (f"hr = h{j}", *step)),
            *last,
            *keep,
        ]

    def _catch_up(self, island: IslandKernel) -> list[str]:
        """Statements that take those who waited over the `stride` steps that the others have made."""
        call = island.call.replace("base, n,", "lo + i, 1,").replace(", x, v, ", ", xi, vi, ")
        waiting = f"s[{6 * W} + i]"
        state = [
            (f"{q}i[{k}]", f"s[{(3 * ('xv'.index(q)) + k) * W} + i]")
            for q in "xv"[: self.system.order]
            for k in range(3)
        ]
        contact = island.deriv.contact
        if contact is not None and contact.looks_up:  # each lane is near the same triangles from step to step
            call = call.replace(", K, ", f", K[{contact.record} * i:{contact.record} * (i + 1)], ")
        begin = ["clock = max(clock, birth[lo + i])"] if self.births else []
        mortal = island.deadly
        alive = " and died[lo + i] == 0" if mortal else ""
        death = [f"died[lo + i] = 1 if events[0] >= {KILLED} else 0"] if mortal else []
        death += ["if events[0] > 0:", "    hit[lo + i] = 1"] if island.watched else []
        # Most of the steps that somebody waited for are clear after all: only those that are not take the long way.
        easy = f"clock == t0 + j * dt and lane(np.uintp(i), {', '.join(self.shared)}, clock, end)"
        return [
            f"for bunch in range(0, {W}, {BUNCH}):",
            f"    if not somebody_waits(s, bunch, {BUNCH}):",
            "        continue",
            f"    for i in range(bunch, bunch + {BUNCH}):",
            f"        if {waiting} != 0 and i < m{alive}:",
            "            for j in range(k, k + stride):",
            "                clock = t0 + j * dt",
            "                end = t0 + (j + 1) * dt",
            *indented(begin, 4),
            f"                {waiting} = R(0)",
            f"                if clock < end and bad == 0{alive} and not ({easy}):",
            *indented([f"{local} = {entry}" for local, entry in state], 5),
            *["                    known[0] = 0"] * island.step.keeps,
            f"                    bad = advance({call})",
            *indented(death, 5),
            *indented([f"{entry} = {local}" for local, entry in state], 5),
            f"        {waiting} = {'R(1) if i < m and died[lo + i] != 0 else ' if mortal else ''}R(0)",
        ]

    def _run(self, unrolled: list[int]) -> str:
        """The kernel itself: tiles of particles over a span."""
        motion, island, order = self.motion, self.island, self.system.order
        columns = len(motion.binder.particle.getters)
        copies = [(q, 3 * W * k) for k, q in enumerate("xv"[:order])]
        shared = ", ".join(self.shared)
        prepared, began, hold, caught = [], [], [], []
        if island is not None:
            own = [
                "xi = np.zeros(3, R)",
                "vi = np.zeros(3, R)",
                "control = np.zeros(3)",
                "done = np.zeros(5, np.int64)",
                "h_before = np.full(1, np.inf)",
            ]
            prepared = [*island.scratch, *own]
            began = [f"for i in range({W}):", f"    s[{6 * W} + i] = R(0)"]
            caught = [f"if somebody_waits(s, 0, {W}):", *indented(self._catch_up(island), 1)]
        if self.births:
            began += ["late = -np.inf", "for i in range(m):", "    late = max(late, birth[lo + i])"]
            hold = ["if late > t0 + k * dt:", "    for i in range(m):"]
            dead = " or died[lo + i] != 0" if self.deadly else ""
            hold += [f"        s[{6 * W} + i] = R(1) if birth[lo + i] > t0 + k * dt{dead} else R(0)"]
        steps = [*hold, "stride = 1"]
        for u in unrolled:
            times = ", ".join(f"t0 + (k + {j}) * dt" for j in range(u + 1))
            few = f"k + {u} <= k0 + count" if u > 1 else "stride == 1"
            steps += [f"if {few}:", f"    bad |= lanes{u}({shared}, {times})", *[f"    stride = {u}"] * (u > 1)]
        steps = ["while k < k0 + count:", *indented([*steps, *caught, "k += stride"], 1)]
        arrays = [*motion.binder.arrays, *(["F"] if self.system.colliders else [])]
        given = f"first, last, x, v, x_kept, v_kept, {', '.join(arrays)}, birth, t0, dt, k0, count, status, reach"
        given += ", died" * self.deadly + ", hit" * self.watched
        made = [f"s = np.ones({(STATE + columns) * W}, R)", *prepared]
        own = [f"    s[{(STATE + c) * W} + i] = C[{c}, lo + i]" for c in range(columns)]
        tile = [
            f"lo = tile * {W}",
            f"m = min({W}, len(x) // 3 - lo)",
            "if len(x_kept) > 0:",
            *(f"    copy({q}_kept, {q}, lo, m)" for q in "xv"),
            *(f"load(s, {offset}, {q}, lo, m)" for q, offset in copies),
            *(["for i in range(m):", *own] if own else []),
            *began,
            "bad = 0",
            "k = k0",
            *steps,
            *(f"reach[tile, {k}] = reached(s, {offset}, {offset} + m, 3, {W})" for k, (_, offset) in enumerate(copies)),
            "far = max(reach[tile, 0], reach[tile, 1])",
            f"status[tile] = bad if far < np.inf else {NOT_FINITE}",
            *(f"keep(s, {offset}, {q}, lo, m)" for q, offset in copies),
        ]
        return entry_text(made, given, ["for tile in range(first, last):", *indented(tile, 1)])

    @property
    def deadly(self) -> bool:
        """Whether a surface kills."""
        return self.island is not None and self.island.deadly

    @property
    def watched(self) -> bool:
        """Whether it tells who hits a surface."""
        return self.island is not None and self.island.watched

    @property
    def remembers(self) -> bool:
        """Whether a lane keeps what it looked up in the data of a surface."""
        contact = None if self.island is None else self.island.deriv.contact
        return contact is not None and contact.looks_up

    @property
    def shared(self) -> list[str]:
        """Arrays that the lanes read: the scratch holds the columns."""
        more = ["F"] if self.system.colliders else []
        return ["s", *(name for name in self.motion.binder.arrays if name != "C"), *more]

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


def _assigned(lines: list[str]) -> list[str]:
    """Names of the locals that statements assign, but those of blocks."""
    targets = (line.split(" = ")[0].split(", ") for line in lines if " = " in line and not line.startswith(" "))
    return list(dict.fromkeys(name for names in targets for name in names))


def _read(names: list[str], lines: list[str]) -> list[str]:
    """Those of the names that statements read."""
    words = set(re.findall(r"[A-Za-z_]\w*", " ".join(lines)))
    return [name for name in names if name in words]


@dataclass(eq=False)
class SingleMembers:
    """Particles that are islands of their own.

    Attributes
    ----------
    rows : of the particles.
    before : where the next span is to leave the positions and velocities that it begins with, shape (rows, 3).
    """

    kernel: SinglesKernel
    rows: Rows
    before: tuple[Array, ...] = ()

    def run(self, x: Array, v: Array, births: Array | None, span: Span, memory: Memory) -> Outcome:
        """Advance positions and velocities, shape (3 * rows,), in place."""
        motion, island, count = self.kernel.motion, self.kernel.island, len(self.rows)
        particles = self.kernel.system.particles
        order = None if count == len(particles) else self.rows
        data = motion.binder.data(count, order)
        if island is not None and island.deriv.contact is not None:
            data.append(island.deriv.contact.table())
        data.append(np.zeros(0) if births is None else births)
        kept, self.before = [array.reshape(-1) for array in self.before] or [x[:0], v[:0]], ()
        tiles = -(-count // W)
        status, reach = np.zeros(tiles, np.int64), np.zeros((tiles, 2), x.dtype)
        grid = (span.t0, span.dt, span.first, span.count)
        kernel, scratch = self.kernel.functions["run"], self.kernel.functions["scratch"]
        died, hit = np.zeros((2, count), np.uint8)
        marks = [*[died] * self.kernel.deadly, *[hit] * self.kernel.watched]
        arrays = (x, v, *kept, *data, *grid, status, reach, *marks)
        spread(lambda lo, hi: kernel(lo, hi, *arrays, *scratch([W if self.kernel.remembers else 1])), tiles, GRAIN)
        work = Stats(span.count, 0, span.count * motion.evaluations)
        far = reach.max(axis=0).astype(np.float64)
        touched = self.rows[:0] if island is None else self.rows[island.marked(hit)]
        return Outcome(not status.any(), far, work, died=self.rows[died > 0], hit=touched)
