"""Prints how elements are relaxed that are shifts of stencils on a grid: colour by colour as vectors without gathers.

No colour waits for all of the one before it: a front of rows runs over the grid, and each colour follows where those
before it are done, so rows are in the first caches while all colours go over them.

Threads take bands of rows. Near its ends a band leaves out what needs rows of others, more with every colour; what is
left between two bands is done when both are through. So every element finds what it would find colour by colour, and
the bits depend on no thread.
"""

from __future__ import annotations

from pointmass.engine.constraint import AXES, places, solved, state
from pointmass.engine.dealt import FREE, MASS, PLACE, RISE, Dealt, number
from pointmass.engine.forces import ZERO, Deriv, unary
from pointmass.engine.printing import function, indented
from pointmass.laws.elements import ConstraintForce
from pointmass.laws.unary import UnaryForce
from pointmass.tracing.trace import vector_names


class Fronts:
    """The text of sweeps over a grid.

    Attributes
    ----------
    text : functions.
    whole : whether all of a step is done by rows, and `begin` and `finish` are called before and after many: nothing
        acts but the elements of the grid and forces on single particles.
    call : arguments of `begin` and `finish`.
    swept : arguments of `sweep`, `kicked` and `moved`.
    """

    def __init__(self, deriv: Deriv, dealt: Dealt) -> None:
        self.deriv, self.dealt = deriv, dealt
        self.projected = deriv.contact is not None
        self.shared = ", ".join(["G", *deriv.binder.arrays])
        self.colours = dealt.colours()
        stages = [self._stage(k) for k in range(len(dealt.grid.stencils))]
        known = (UnaryForce, ConstraintForce)
        still = not self.projected and not dealt.led
        self.whole = still and all(isinstance(force, known) for force in deriv.system.forces)
        self.swept = f"{deriv.call}, t, h"
        self.call = f"{deriv.call}, x, v"
        if not self.whole:
            self.call = f"{self.swept}, x, v, kv, x1, v1{', Q' * self.projected}"
        own = self._steps() + self._ends() if self.whole else self._exchange()
        self.text = "".join([dealt.constants, *stages, self._band(), self._sweep(), own])

    def _stage(self, k: int) -> str:
        """The function that relaxes the elements with their corner in a row."""
        dealt, deriv = self.dealt, self.deriv
        stencil = dealt.grid.stencils[k]
        force, nodes = stencil.force, stencil.force.nodes
        assert isinstance(force, ConstraintForce)
        at_time: list[str] = []
        loops: list[str] = []
        for turn in dealt.pieces(stencil):
            for piece in turn:
                own = f"{piece.first} * DECK"
                law = force.traced_constraint
                text = deriv.binder.law(law, force, state(nodes), own, dealt.tables[k], f"c{k}")
                at_time = text.at_time
                mine = [self._entries(a, stencil.shifts[a][0], piece.at[a]) for a in range(nodes)]
                taken = {name: entry for node in mine for name, entry in node.items()}
                moved = [f"r{a}{c}" for a in range(nodes) for c in AXES]
                noted = number(dealt.noted[k], own) if dealt.noted else ""
                loops += [
                    f"for i in range({piece.count} * DECK):",
                    *(f"    {name} = {entry}" for name, entry in taken.items()),
                    *(f"    o{name} = {name}" for name in moved),
                    f"    had = {noted or 'R(0)'}",
                    *indented([*places(nodes), *text.lines, *solved(nodes, text.outputs, self.projected)], 1),
                    *[f"    {noted} = had + more"] * bool(noted),
                    f"    inside = {number(dealt.masks[stencil.box[1]], own)} != R(0)",
                    *(f"    {taken[name]} = select(inside, {name}, o{name})" for name in moved),
                ]
        rows = f"q = G[r * ROW:(r + {stencil.box[0] + 1}) * ROW]"
        lines = [*deriv.binder.numbers.lines(), "status = 0", *at_time, rows, *loops, "return status"]
        return function(f"stage{k}", f"r, {self.shared}, t, h", "**FLAGS", lines)

    def _entries(self, a: int, row: int, at: tuple[int, int]) -> dict[str, str]:
        """What an element needs of node `a`, so many rows below its corner."""
        place = f"{at[0]} * DECK + {at[1]}"
        found = {f"r{a}{c}": number(RISE + c, place, row) for c in AXES}
        found |= {f"x{a}{c}": number(PLACE + c, place, row) for c in AXES}
        found[f"w{a}"] = number(MASS, place, row)
        return found | {f"f{a}{m}": number(FREE + m, place, row) for m in range(9 * self.projected)}

    def _band(self) -> str:
        """The function that lets a front run over a band of rows.

        It is either a band, from row `lo` to row `hi`, in which colour after colour leaves out more rows where others
        are beyond the end (`opens`, `closes`: 1 where they are, else 0); or (`late`) what has been left out around
        lo = hi.
        """
        lines = ["status = 0", f"for front in range(lo, hi + {2 * self._depth}):"]
        for colour in self.colours:
            before, rows = colour.before, colour.rows
            lines += [
                f"    r = front - {before + rows}",
                f"    first = lo + opens * {before} - late * {rows}",
                f"    last = hi - closes * {before} - (1 - late) * {rows}",
                f"    if r >= first and r < last and r // {colour.step} % {colour.count} == {colour.turn}:",
                f"        status |= stage{colour.stencil}(r, {self.shared}, t, h)",
            ]
        arguments = f"{self.shared}, t, h, lo, hi, opens, closes, late"
        return function("band", arguments, "**FLAGS", [*lines, "return status"])

    @property
    def _depth(self) -> int:
        """Rows that a band leaves out at an end, at most."""
        return sum(colour.rows for colour in self.colours)

    def _sweep(self) -> str:
        """The function that relaxes all elements once."""
        band = f"band({self.shared}, t, h, {{}})"
        ends = "m * part // bands, m * (part + 1) // bands, 1 if part > 0 else 0, 1 if part < bands - 1 else 0, 0"
        lines = [
            "m = n // wide[0]",
            f"bands = max(1, min(len(cuts) - 1, m // {2 * self._depth + 1}))",
            "worst = 0",
            f"for part in {self.deriv.loop}(bands):",
            f"    worst = max(worst, {band.format(ends)})",
            "between = 0",
            f"for part in {self.deriv.loop}(1, bands):",
            f"    between = max(between, {band.format('m * part // bands, m * part // bands, -1, -1, 1')})",
            "return worst | between",
        ]
        return function("sweep", self.swept, self.deriv.flags, lines)

    def _steps(self) -> str:
        """The functions that kick all rows by the other forces, and that move them on."""
        deriv, dealt, binder = self.deriv, self.dealt, self.deriv.binder
        places, speeds = ([number(c, "0") for c in own] for own in (range(PLACE, PLACE + 3), dealt.speed))
        inputs = dict(zip(vector_names("x"), places, strict=True)) | dict(zip(vector_names("v"), speeds, strict=True))
        at_time: list[str] = []
        forces: list[str] = []
        columns, binder.particle = binder.particle, dealt.particle
        for k, force in enumerate(deriv.system.forces):
            if isinstance(force, UnaryForce):
                timed, lines = unary(binder, force, f"f{k}", inputs, "0")
                at_time += timed
                forces += lines
        binder.particle = columns
        row = ["q = G[r * ROW:(r + 1) * ROW]"]
        free = [f"w = {number(MASS, '0')}", "free = w != R(0)"]
        loop = "for i in range(DECKS * DECK):"
        kick, move = [*ZERO, *forces, *free], [*free]
        for c, axis in enumerate("xyz"):
            rise = number(RISE + c, "0")
            kick += [f"u = {speeds[c]} + h * select(free, f_{axis} * w, R(0))", f"{speeds[c]} = u"]
            kick.append(f"{rise} = h * select(free, u, R(0))")
            move += [f"rise = {rise}", f"u = {speeds[c]}", "way = h * select(free, u, R(0))"]
            move += [f"{places[c]} = {places[c]} + rise", f"{speeds[c]} = select(free, u + (rise - way) / h, R(0))"]
        forget = [line for k in dealt.noted for line in ("for i in range(WIDTH):", f"    {number(k, '0')} = R(0)")]
        start = [*binder.numbers.lines(), "status = 0", *at_time]
        given = f"r, {self.shared}, t, h"
        parts = []
        for name, lines in (
            ("kick", [*start, *row, loop, *indented(kick, 1), *forget, "return status"]),
            ("move", [*row, loop, *indented(move, 1), "return 0"]),
        ):
            parts.append(function(name, given, "**FLAGS", lines))
            each = [
                "worst = 0",
                f"for r in {deriv.loop}(n // wide[0]):",
                f"    worst = max(worst, {name}({given}))",
                "return worst",
            ]
            parts.append(function({"kick": "kicked", "move": "moved"}[name], self.swept, deriv.flags, each))
        return "".join(parts)

    def _ends(self) -> str:
        """The functions that deal out places and velocities before many steps, and take them in after these."""
        there, back = [], []
        for array, components in (("x", range(PLACE, PLACE + 3)), ("v", self.dealt.speed)):
            for axis, c in enumerate(components):
                mine, dealt = f"{array}[np.uintp(3 * i + {axis})]", f"G[o + np.uintp({c} * WIDTH)]"
                there.append(f"{dealt} = {mine}")
                back.append(f"{mine} = {dealt}")
        return self._exchanged("begin", [], there) + self._exchanged("finish", [], back)

    def _exchange(self) -> str:
        """The functions that deal out how far particles come by the other forces, and take in how far they have."""
        there, back = [], []
        for c in AXES:
            q, rise = f"np.uintp(3 * i + {c})", f"G[o + np.uintp({RISE + c} * WIDTH)]"
            go = [f"u = v[{q}] + h * kv[{q}]", "way = h * (u if free else R(0))"]
            there += [*go, f"{rise} = way", f"G[o + np.uintp({PLACE + c} * WIDTH)] = x[{q}]"]
            back += [*go, f"x1[{q}] = x[{q}] + {rise}", f"u = u + ({rise} - way) / h", f"v1[{q}] = u"]
        there += [f"G[o + np.uintp({FREE + k} * WIDTH)] = Q[np.uintp(9 * i + {k})]" for k in range(9 * self.projected)]
        noted = [f"    G[r * ROW + {k} * WIDTH:r * ROW + {k + 1} * WIDTH] = R(0)" for k in self.dealt.noted]
        return self._exchanged("begin", noted, there) + self._exchanged("finish", [], back)

    def _exchanged(self, name: str, rows: list[str], lines: list[str]) -> str:
        """A function that goes through rows, and through particle i, which is at o and may be `free`."""
        w = self.deriv.binder.attribute("w", "np.uintp(base + i)")
        lines = [
            "columns = wide[0]",
            f"for r in {self.deriv.loop}(n // columns):",
            *rows,
            "    for c in range(columns):",
            "        i = r * columns + c",
            "        deck, lane = np.uintp(c) % np.uintp(DECKS), np.uintp(c) // np.uintp(DECKS)",
            "        o = np.uintp(r * ROW) + deck * np.uintp(DECK) + lane",
            f"        free = {w} != R(0)",
            *indented(lines, 2),
        ]
        return function(name, self.call, self.deriv.flags, lines)
