"""The fast path of particles that are islands of their own: smoke, snow, sparks, dust.

Lane = particle. A tile of particles is loaded once into a small scratch, makes all steps of a span there, and is stored
once, so that memory is touched once a frame. Tiles are always padded to full width.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine import store
from pointmass.engine.binding import Binder, equal_columns
from pointmass.engine.contact import ClearLines
from pointmass.engine.island import NOT_FINITE, Outcome, Span, entry_text, marked
from pointmass.engine.motion import BEFORE, LANE, STATE, WAITS, Flight, Lanes, Motion, W
from pointmass.engine.phases import REACHED
from pointmass.engine.printing import function, indented
from pointmass.engine.reference import KILLED
from pointmass.engine.threads import LINE, spread
from pointmass.solvers.advance import Stats
from pointmass.solvers.base import Memory, Solver
from pointmass.system import ParticleSystem

Array = NDArray[np.floating[Any]]
Rows = NDArray[np.intp]
GRAIN = 4  # tiles that are worth a thread
BUNCH = 32  # lanes of which it is asked in one go whether somebody waits
UNROLLED = (8, 4, 2)  # steps that a lane makes in registers, if all of them are not longer than
LONG = 450  # statements
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
    if m == {W}:
        for j in range(0, {3 * W}, {LINE} // x.itemsize):
            streamed(kept, a + np.uintp(j), x)
    else:
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


WAITING = f"""@njit(**FLAGS)
def somebody_waits(s, first, count):
    bits = s.view(BITS)
    o = np.uintp({WAITS * W} + first)
    any_bit = BITS(0)
    for j in range(count):
        any_bit |= bits[o + np.uintp(j)]
    return any_bit != 0


"""


class SinglesKernel:
    """Advances particles that nobody pulls on.

    Who comes near a surface, or is not born yet, waits while the others make a step, and then makes it alone.

    Parameters
    ----------
    births : whether some may not be born yet.
    watched : whether it tells who hits a surface, if there are any.

    Attributes
    ----------
    deadly : whether a surface kills.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, births: bool, watched: bool = False) -> None:
        self.system, self.solver, self.births = system, solver, births
        equal = frozenset() if births else equal_columns(system.particles)
        switches = not all(force.enabled for force in system.forces)
        binder = Binder(system.particles, Lanes("C"), switches, equal)
        self.motion = Motion(system, solver, binder)
        self.flight = Flight(self.motion) if births or system.colliders else None
        self.contact = None if self.flight is None else self.flight.contact
        self.deadly = self.contact is not None and self.contact.kills
        self.watched = watched and self.contact is not None
        self.text = self._printed()

    def _printed(self) -> str:
        motion, flight = self.motion, self.flight
        clear = None if self.contact is None else self.contact.clear_lines(motion.dtype, "F")
        step = [*motion.lines]
        if clear is not None:
            step += motion.watched(clear)
        timed = motion.timed or (clear is not None and bool(clear.step))
        size = len(step) + (0 if clear is None else len(clear.inner))
        several = not (timed or motion.binder.functions)  # functions are longer than they look
        unrolled = [*[u for u in UNROLLED if several and u * size <= LONG][:1], 1]
        lanes = [self._unrolled(u, step, clear) for u in unrolled]
        alone = "" if flight is None else flight.text + WAITING
        return "".join([REACHED, motion.binder.functions, alone, TRANSPOSED, *lanes, self._run(unrolled, clear)])

    def _unrolled(self, count: int, step: list[str], clear: ClearLines | None) -> str:
        """The function that makes a few steps of all lanes, with the state in registers in between."""
        arguments = ", ".join([*self.shared, *(f"t{j}" for j in range(count + 1))])
        looks = [] if clear is None else self._looks(clear)
        lines = [*self._head(count, clear), *looks, *_lanes(self._lane(count, step, clear)), "return status, waiting"]
        return function(f"lanes{count}", arguments, "**FLAGS", lines)

    def _head(self, unrolled: int, clear: ClearLines | None) -> list[str]:
        """What all lanes have in common."""
        longest = "h0" if unrolled == 1 else f"max({', '.join(f'h{j}' for j in range(unrolled))})"
        return [
            *self.motion.binder.numbers.lines(),
            *(f"h{j} = R(t{j + 1} - t{j})" for j in range(unrolled)),
            "t = t0",
            "h = t1 - t0",
            "status = 0",
            "waiting = False",
            *self.motion.at_time,
            *([] if clear is None else [*clear.once, *clear.step, self.motion.third(longest)]),
        ]

    def _looks(self, clear: ClearLines) -> list[str]:
        """The searches of all lanes in the data of surfaces, before their step, which is then one of vectors."""
        lines = []
        place = [f"{name}0 = {entry}" for name, entry in zip("xyz", self.motion.entries.values(), strict=False)]
        for k, (apart, bound) in enumerate(clear.looked.values()):
            found = self._found(k)
            lines += _lanes([*place, f"{found} = {apart}"])
            lines += _lanes([f"if not {found} > R(0):", *indented([*place, f"{found} = {bound}"], 1)])
        return lines

    def _found(self, k: int) -> str:
        """Where a lane keeps what it has found in a search: behind the columns."""
        return f"s[{(STATE + len(self.motion.binder.particle.getters) + k) * W} + {LANE}]"

    def _lane(self, unrolled: int, step: list[str], clear: ClearLines | None) -> list[str]:
        """The steps of a lane, and its state before them: one that waits goes back to it.

        To write it only where a lane does not wait would be a store with a mask, which takes ten times as long without
        AVX-512.
        """
        motion = self.motion
        place = motion.entries
        waiting = f"s[{WAITS * W} + {LANE}]"
        keep = [f"{entry} = {name}" for name, entry in place.items()]
        first: list[str] = []
        between = motion.arrived()
        last: list[str] = []
        if self.flight is not None:
            last = [f"waits = {waiting} != R(0)"]
            if clear is not None:
                first = [f"radius = {motion.binder.attribute('radius', LANE)}", *motion.path(0), *clear.begin]
                first += [f"{name} = {self._found(k)}" for k, name in enumerate(clear.looked)]
                between = [*clear.inner, *between]
                moves = f"({motion.binder.attribute('w', LANE)} != R(0)) & " if motion.pins else ""
                last += [*clear.end, f"waits = waits | ({moves}(not ({clear.result})))"]
            keep = [f"s[{(BEFORE + k) * W} + {LANE}] = {entry}" for k, entry in enumerate(place.values())] + keep
            keep.append(f"{waiting} = R(1) if waits else R(0)")
            keep.append("waiting |= waits")
        return [
            *(f"{name} = {entry}" for name, entry in place.items()),
            *first,
            *(line for j in range(unrolled - 1) for line in (f"hr = h{j}", *step, *between)),
            *(f"hr = h{unrolled - 1}", *step, *motion.arrived()),
            *last,
            *keep,
        ]

    def _catch_up(self, flight: Flight) -> list[str]:
        """Statements that take those who waited over the `stride` steps that the others have made."""
        waiting = f"s[{WAITS * W} + i]"
        alive = " and died[lo + i] == 0" if self.deadly else ""
        marks = [f"died[lo + i] = 1 if events >= {KILLED} else 0"] if self.deadly else []
        marks += ["if events > 0:", "    hit[lo + i] = 1"] if self.watched else []
        birth = "birth[lo + i]" if self.births else "-np.inf"
        given = f"np.uintp(i), {', '.join(flight.arrays)}, t0, dt, k, k + stride, {birth}"
        return [
            f"for bunch in range(0, {W}, {BUNCH}):",
            f"    if not somebody_waits(s, bunch, {BUNCH}):",
            "        continue",
            f"    for i in range(bunch, bunch + {BUNCH}):",
            f"        if {waiting} != 0:",
            *(f"            s[{k * W} + i] = s[{(BEFORE + k) * W} + i]" for k in range(len(self.motion.entries))),
            f"            if i < m and bad == 0{alive}:",
            f"                bad, events = fly({given})",
            *indented(marks, 4),
            f"        {waiting} = {'R(1) if i < m and died[lo + i] != 0 else ' if self.deadly else ''}R(0)",
        ]

    def _run(self, unrolled: list[int], clear: ClearLines | None) -> str:
        """The kernel itself: tiles of particles over a span."""
        motion, flight, order = self.motion, self.flight, self.system.order
        columns = len(motion.binder.particle.getters)
        copies = [(q, 3 * W * k) for k, q in enumerate("xv"[:order])]
        shared = ", ".join(self.shared)
        prepared: list[str] = []
        began, hold, caught = [], [], []
        if flight is not None:
            prepared = flight.scratch
            began = [f"for i in range({W}):", f"    s[{WAITS * W} + i] = R(0)"]
            caught = ["if waiting:", *indented(self._catch_up(flight), 1)]
        if self.births:
            began += ["late = -np.inf", "for i in range(m):", "    late = max(late, birth[lo + i])"]
            hold = ["if late > t0 + k * dt:", "    for i in range(m):"]
            dead = " or died[lo + i] != 0" if self.deadly else ""
            hold += [f"        s[{WAITS * W} + i] = R(1) if birth[lo + i] > t0 + k * dt{dead} else R(0)"]
        steps = [*hold, "stride = 1"]
        for u in unrolled:
            times = ", ".join(f"t0 + (k + {j}) * dt" for j in range(u + 1))
            few = f"k + {u} <= k0 + count" if u > 1 else "stride == 1"
            steps += [f"if {few}:", f"    went, waiting = lanes{u}({shared}, {times})", "    bad |= went"]
            steps += [f"    stride = {u}"] * (u > 1)
        steps = ["while k < k0 + count:", *indented([*steps, *caught, "k += stride"], 1)]
        arrays = [*motion.binder.arrays, *(["F"] if self.system.colliders else [])]
        given = f"first, last, x, v, x_kept, v_kept, {', '.join(arrays)}, birth, t0, dt, k0, count, status, reach"
        given += ", died" * self.deadly + ", hit" * self.watched
        searches = 0 if clear is None else len(clear.looked)
        made = [f"s = np.ones({(STATE + columns + searches) * W}, R)", *prepared]
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
    def remembers(self) -> bool:
        """Whether a lane keeps what it looked up in the data of a surface."""
        return self.contact is not None and self.contact.looks_up

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


def _lanes(statements: list[str]) -> list[str]:
    """A loop over all lanes of a tile."""
    return [f"for j in range({W}):", *indented([f"{LANE} = np.uintp(j)", *statements], 1)]


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
        motion, contact, count = self.kernel.motion, self.kernel.contact, len(self.rows)
        particles = self.kernel.system.particles
        order = None if count == len(particles) else self.rows
        data = motion.binder.data(count, order)
        if contact is not None:
            data.append(contact.table())
        data.append(np.zeros(0) if births is None else births)
        kept, self.before = [array.reshape(-1) for array in self.before] or [x[:0], v[:0]], ()
        tiles = -(-count // W)
        status, reach = np.zeros(tiles, np.int64), np.zeros((tiles, 2), x.dtype)
        grid = (span.t0, span.dt, span.first, span.count)
        kernel, scratch = self.kernel.functions["run"], self.kernel.functions["scratch"]
        died, hit = (np.zeros(count * told, np.uint8) for told in (self.kernel.deadly, self.kernel.watched))
        marks = [*[died] * self.kernel.deadly, *[hit] * self.kernel.watched]
        arrays = (x, v, *kept, *data, *grid, status, reach, *marks)
        spread(lambda lo, hi: kernel(lo, hi, *arrays, *scratch([W if self.kernel.remembers else 1])), tiles, GRAIN)
        work = Stats(span.count, 0, span.count * motion.evaluations)
        far = reach.max(axis=0).astype(np.float64)
        told = self.rows[np.flatnonzero(died)], self.rows[marked(contact, hit)]
        return Outcome(not status.any(), far, work, False, *told)
