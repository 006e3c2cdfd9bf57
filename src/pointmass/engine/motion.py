"""Prints a step of a particle in locals: what all lanes of `singles` do at once, and what one does near surfaces."""

from __future__ import annotations

from collections.abc import Sequence

from pointmass.engine.binding import Binder, Table
from pointmass.engine.contact import ClearLines, ContactText
from pointmass.engine.forces import unary
from pointmass.engine.island import NO_STEP
from pointmass.engine.printing import function, indented, literal
from pointmass.engine.reference import KILLED, surfaces_of
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.advance import SET_BACKS
from pointmass.solvers.base import Solver
from pointmass.solvers.explicit import ExplicitRungeKutta
from pointmass.solvers.splitting import Splitting
from pointmass.system import ParticleSystem

LANE = "i"  # index of a lane
WAITS, BEFORE, STATE = 6, 7, 13  # rows of the scratch: x and v, who waits, x and v before the last steps, then columns
W = 256  # lanes of a tile
ONCE = "forceinline=True, **FLAGS"  # of what is called in one place: each array is seven arguments of a call
AXES = "xyz"


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
    lines : statements of a lane: from x_x, ..., v_z at t to x1_x, ..., v1_z at t + h, with hr for R(h).
    """

    def __init__(self, system: ParticleSystem, solver: Solver, binder: Binder) -> None:
        self.system, self.solver, self.binder = system, solver, binder
        self.forces = [force for force in system.forces if isinstance(force, UnaryForce)]
        self.dtype = binder.dtype
        self.at_time: list[str] = []
        self.lines: list[str] = [f"w = {self.binder.attribute('w', LANE)}"]
        self.pins = system.particles.has_pins
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

    @property
    def entries(self) -> dict[str, str]:
        """The state's locals, x_x, ..., v_z, and where they are in the scratch of the lanes."""
        return {name: f"s[{k * W} + {LANE}]" for k, name in enumerate(self.state("x", "v"))}

    def state(self, x: str, v: str) -> list[str]:
        """Locals of positions and velocities that begin with `x` and `v`; a flow has no velocities."""
        return [f"{q}_{a}" for q in (x, v)[: self.system.order] for a in AXES]

    def arrived(self) -> list[str]:
        """Statements that make the end of a step its beginning."""
        ends = [end if end[0] == "x" else self._free(end) for end in self.state("x1", "v1")]
        return [f"{name} = {end}" for name, end in zip(self.entries, ends, strict=True)]

    def path(self, end: int) -> list[str]:
        """Statements that give the state at the beginning or the end of a step the names of `ClearLines`."""
        values = self.state("x1", "v1") if end else self.state("x", "v")
        values += ["R(0)"] * (6 - len(values))
        return [f"{name}{end} = {value}" for name, value in zip("xyzuvw", values, strict=True)]

    def watched(self, clear: ClearLines) -> list[str]:
        """Statements that look whether a step comes near a surface."""
        return [*self.path(0), *self.path(1), *clear.lane]

    def third(self, length: str) -> str:
        """The statement that gives `ClearLines` the length of the longest step."""
        return f"third = {length} * {literal(1 / 3, self.dtype)}"

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
        passes = solver.passes if depends else 1
        fresh = True
        for k, ((opening, drift, closing), (before, after)) in enumerate(
            zip(solver.substeps, solver._times, strict=True)
        ):
            if not fresh:
                self._deriv(f"t + {before!r} * h", "x1", "v1", "a")
            elif k:
                self._standing(f"t + {before!r} * h", "x1", "v1", "a", [])
            for a in AXES:
                self.lines.append(f"v1_{a} = v1_{a} + {literal(opening, self.dtype)} * hr * a_{a}")
                self.lines.append(f"x1_{a} = x1_{a} + {literal(drift, self.dtype)} * hr * {self._free(f'v1_{a}')}")
            fresh = closing != 0.0 and not depends
            if closing != 0.0:
                self.lines += [f"b_{a} = v1_{a}" for a in AXES]
                time, kick = f"t + {after!r} * h", f"{literal(closing, self.dtype)} * hr"
                kicks = [f"v1_{a} = b_{a} + {kick} * a_{a}" for a in AXES]
                for _ in range(passes):
                    self._deriv(time, "x1", "v1", "a")
                    self.lines += kicks
                for _ in range(passes, solver.passes):
                    self._standing(time, "x1", "v1", "a", kicks)

    def _standing(self, time: str, x: str, v: str, result: str, lines: Sequence[str]) -> None:
        """Another evaluation of one that stands on a surface, whose force depends on its velocity; lanes are free."""


class Pulled(Motion):
    """The same with the accelerations by calls of a function, `pull`, which also knows what the particle rests on.

    Attributes
    ----------
    contact : what the colliders do to the particle, if there are any.
    arrays : those that it reads: the scratch of the lanes holds the state and the columns.
    text : of `pull`.
    """

    def __init__(self, system: ParticleSystem, solver: Solver, binder: Binder) -> None:
        self.contact: ContactText | None = None
        if system.colliders:
            self.contact = ContactText(surfaces_of(system), system.order, False, binder.dtype, ONCE)
        super().__init__(system, solver, binder)
        self.text = self._pull()

    @property
    def arrays(self) -> list[str]:
        own = [] if self.contact is None else ["F", "K"]
        return ["s", *(name for name in self.binder.arrays if name != "C"), *own]

    @property
    def record(self) -> str:
        """Where the particle's contacts are in K: what it looks up, it remembers from step to step."""
        return f"{self.contact.record} * {LANE}" if self.contact is not None and self.contact.looks_up else "0"

    def double(self, x: str, v: str) -> str:
        """Six numbers in float64, those of v 0 in a flow."""
        return ", ".join([f"np.float64({name})" for name in self.state(x, v)] + ["0.0"] * (6 - 3 * self.system.order))

    def slope(self, time: str, x: str, v: str, result: str) -> list[str]:
        """Statements that ask for the accelerations."""
        given = ", ".join([LANE, *self.arrays, time, *self.state(x, v)])
        return [f"{', '.join(f'{result}_{a}' for a in AXES)}, bad = pull({given})", "status |= bad"]

    def _deriv(self, time: str, x: str, v: str, result: str) -> None:
        self.lines += self.slope(time, x, v, result)

    def _standing(self, time: str, x: str, v: str, result: str, lines: Sequence[str]) -> None:
        if self.contact is not None:
            self.lines += ["if K[o] > 0:", *indented([*self.slope(time, x, v, result), *lines], 1)]

    def _pull(self) -> str:
        lines = ["status = 0", *(f"f_{a} = R(0)" for a in AXES)]
        state = {name: name for name in self.state("x", "v")}
        for k, force in enumerate(self.forces):
            timed, own = unary(self.binder, force, f"f{k}", state, LANE)
            lines += [*timed, *own]
        if self.contact is not None:
            pull = ", ".join(f"np.float64(f_{a})" for a in AXES)
            mass = f"np.float64({self.binder.attribute('m', LANE)})"
            lines += [
                f"o = {self.record}",
                "if K[o] > 0:",
                f"    d_x, d_y, d_z = bear(F, K, o, t, {self.double('x', 'v')}, {mass}, {pull})",
                *(f"    f_{a} = R(d_{a})" for a in AXES),
            ]
        lines += [f"w = {self.binder.attribute('w', LANE)}", *["free = w != 0"] * self.pins]
        scale = " * w" if self.system.order == 2 else ""
        lines.append(f"return {', '.join(self._free(f'f_{a}{scale}') for a in AXES)}, status")
        doc = '"""Accelerations (order 1: velocities) at a time, and a status."""'
        given = ", ".join([LANE, *self.arrays, "t", *self.state("x", "v")])
        return function("pull", given, "**FLAGS", [doc, *self.binder.numbers.lines(), *lines])


class Flight:
    """Prints `fly`: steps of one particle that may be born in them and may meet surfaces, from impact to impact.

    It does what `ReferenceEngine` does to an island of one particle.

    Attributes
    ----------
    contact : what the colliders do to the particle, if there are any.
    arrays : those that it reads.
    text : the functions. fly(i, *arrays, t0, dt, first, last, birth) takes lane i over some steps; a status, and the
        most impacts that it had in one of them.
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.pulled = Pulled(motion.system, motion.solver, motion.binder)
        self.contact, self.arrays = self.pulled.contact, self.pulled.arrays
        contact = "" if self.contact is None else self.contact.text
        self.text = contact + self.pulled.text + self._fly()

    @property
    def scratch(self) -> list[str]:
        """Statements that make what a thread needs; M[0] is how many particles remember what they looked up."""
        return [] if self.contact is None else [f"K = np.zeros({self.contact.record} * M[0])"]

    def _fly(self) -> str:
        """The function itself. Most steps are clear after all: only those that are not take the long way."""
        motion, binder = self.motion, self.motion.binder
        once: list[str] = []
        trial = ["t = began", "h = end - began", "hr = R(h)", *motion.at_time, *motion.lines]
        if self.contact is None:
            step = [*trial, *motion.arrived()]
        else:
            clear = self.contact.clear_lines(motion.dtype, "F")
            once = [f"o = {self.pulled.record}", f"radius = {binder.attribute('radius', LANE)}", *clear.once]
            pinned = "(not free) or " if motion.pins else ""
            step = [
                *["t0 = began"] * bool(clear.step),
                *trial,
                *clear.step,
                motion.third("hr"),
                *motion.path(0),
                *clear.begin,
                *clear.looks,
                *motion.watched(clear),
                *clear.end,
                f"if {pinned}({clear.result}):",
                *indented(motion.arrived(), 1),
                "else:",
                *indented(self._pieces(), 1),
            ]
        lines = [
            *(f"{name} = {entry}" for name, entry in motion.entries.items()),
            "status = 0",
            "most = 0",
            *once,
            "for step in range(first, last):",
            "    began = max(start + step * dt, birth)",
            "    end = start + (step + 1) * dt",
            f"    if began < end and status == 0 and most < {KILLED}:",
            *indented(step, 2),
            *(f"{entry} = {name}" for name, entry in motion.entries.items()),
            "return status, most",
        ]
        doc = '"""Some steps, from impact to impact; a status, and the most impacts that there were in one of them."""'
        given = ", ".join([LANE, *self.arrays, "start, dt, first, last, birth"])
        return function("fly", given, ONCE, [doc, *binder.numbers.lines(), *lines])

    def _pieces(self) -> list[str]:
        """A step that is not clear: `_prepare` of ReferenceEngine, the solver's trial and `_collide`, in turns."""
        assert self.contact is not None
        pulled = self.pulled
        state, begin = pulled.double("x", "v"), ", ".join(f"np.float64(start_{a})" for a in AXES)
        slope = ", ".join(f"np.float64(n_{a})" for a in AXES)
        mass = f"np.float64({pulled.binder.attribute('m', LANE)})"
        found = [
            *pulled.slope("t", "x", "v", "n"),
            f"u_x, u_y, u_z = find(F, K, o, t, {state}, {mass}, {slope}, r, 0.0)",
            *[f"v_{a} = R(u_{a})" for a in AXES] * (pulled.system.order == 2),
        ]
        moved = "d_x, d_y, d_z, u_x, u_y, u_z"
        keep = [f"{name} = R({value})" for name, value in zip(pulled.state("x", "v"), moved.split(", "), strict=False)]
        piece = [
            "t = clock",
            "h = end - clock",
            "hr = R(h)",
            "now = t + h",
            "K[o] = 0.0",
            f"if near(F, K, o, t, {', '.join(f'np.float64(x_{a})' for a in AXES)}, r):",
            *indented(found, 1),
            *pulled.lines,
            f"{moved} = {pulled.double('x1', 'v1')}",
            "if K[o] > 0:",
            f"    {moved} = settle(F, K, o, t + h, h, {moved}, r)",
            *[f"{moved}, struck = bounce(F, K, o, t + h, {moved}, r)"] * self.contact.discrete,
            f"{moved}, now, events, g_x, g_y, g_z = strike(F, K, o, True, events, {state}, {moved}, t, h, r)",
            *[f"events += {KILLED} if struck == {KILLED} and not now < t + h else 0"]
            * (self.contact.discrete and self.contact.kills),
            *keep,
            f"{moved} = evict(F, K, o, now, {state}, r, {begin}, began)",
            *keep,
            "if now < t + h:",
            "    backs += 1",
            f"    status |= {NO_STEP} if backs > {SET_BACKS} else 0",
            "    clock = now",
            "else:",
            "    clock = end",
        ]
        return [
            "events = 0",
            "backs = 0",
            "clock = began",
            "r = np.float64(radius)",
            *(f"start_{a} = x_{a}" for a in AXES),
            "while clock < end and status == 0:",
            *indented(piece, 1),
            "most = max(most, events)",
        ]
