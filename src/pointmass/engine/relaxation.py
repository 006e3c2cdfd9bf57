"""Prints the step of a solver that relaxes elements one by one: what `laws.relaxation` does, element by element.

The elements of a family lie in the order of their colours. One thread goes through those of an island in this order.
All threads on one island share the elements of a colour, which have no particle in common: chunk by chunk, records of
the particles are turned into columns, of which vectors are made, and back. A grid needs no such turns (see `fronts`).
"""

from __future__ import annotations

from pointmass.engine.constraint import AXES, places, solved, state
from pointmass.engine.dealt import Dealt
from pointmass.engine.forces import FREE, LANES, RECORD, Deriv, Elements
from pointmass.engine.fronts import Fronts
from pointmass.engine.printing import function, indented
from pointmass.engine.steps import StepText, each
from pointmass.laws.elements import ConstraintForce
from pointmass.solvers.xpbd import XPBD

MASS, PLACE = 3, 4  # numbers of a particle's record, behind how far it comes
FEWEST = 4  # chunks of a colour that are worth all threads


def relaxation_text(deriv: Deriv, solver: XPBD, dealt: Dealt | None) -> StepText:
    """The step for a system and a solver; `dealt` is the grid that its only island is, if it is one."""
    scratch = FREE if deriv.contact is not None else {}
    others = ["elastic = False", "status |= DERIV(t, x, v, kv)", "elastic = True", *deriv.projections]
    if dealt is not None:
        fronts = Fronts(deriv, dealt)
        swept, call = fronts.swept.replace(", t, h", ", {}, hr"), fronts.call.replace(", t, h,", ", t, hr,")
        lines = [f"for _ in range({solver.iterations}):", f"    status |= sweep({swept.format('t + h')})"]
        if not fronts.whole:
            lines = [*others, f"begin({call})", *lines, f"finish({call})"]
            return StepText(["kv"], lines, 1, functions=fronts.text, scratch=scratch)
        lines = [f"status |= kicked({swept.format('t')})", *lines, f"status |= moved({swept.format('t + h')})"]
        around = f"begin({call})", f"finish({call})"
        return StepText([], lines, 1, functions=fronts.text, in_place=True, around=around)
    elastic = [(k, f) for k, f in enumerate(deriv.families) if isinstance(f.force, ConstraintForce)]
    noting = solver.iterations > 1
    families = [_Family(deriv, f, k, noting) for k, f in elastic]
    if noting:
        scratch = {f"noted{f.number}": f"np.empty(M[{f.place + 1}], R)" for f in families} | scratch
    rise = "rise[q]"
    begin = ["v1[q] = v[q] + hr * kv[q]", "way[q] = hr * (v1[q] if free else R(0))"]
    w = deriv.binder.attribute("w", "np.uintp(base + i)")
    if deriv.parallel and families:
        scratch["chunk"] = f"np.zeros((M[-1], {LANES * max(f.columns for f in families)}), R)"
        scratch["moves"] = f"np.zeros({RECORD} * M[0], R)"
        rise = f"moves[{RECORD} * i + axis]"
        begin += [f"moves[{RECORD} * i + {MASS}] = {w}", f"moves[{RECORD} * i + {PLACE} + axis] = x[q]"]
    lines = [*others, *each(deriv.loop, w, [*begin, f"{rise} = way[q]"])]
    for f in families if noting else []:
        lines += [f"for q in {deriv.loop}(e{f.number} - s{f.number}):", f"    noted{f.number}[q] = R(0)"]
    sweep = [f"status |= relax{f.number}({f.given.replace('t, h,', 't + h, hr,')})" for f in families]
    lines += [f"for _ in range({solver.iterations}):", *indented(sweep or ["pass"], 1)]
    lines += each(deriv.loop, w, [f"x1[q] = x[q] + {rise}", f"v1[q] = v1[q] + ({rise} - way[q]) / hr"])
    return StepText(["kv", "way", "rise"], lines, 1, functions="".join(f.text() for f in families), scratch=scratch)


class _Family:
    """The functions that look at all elements of a family once.

    Attributes
    ----------
    number, place : of the family, among all and among those of elements.
    columns : numbers that an element needs of its particles.
    noting : whether it notes what it does for another sweep.
    given : arguments of the function.
    """

    def __init__(self, deriv: Deriv, elements: Elements, place: int, noting: bool) -> None:
        self.noting = noting
        self.deriv, self.elements, self.number, self.place = deriv, elements, elements.number, place
        self.nodes = range(elements.force.nodes)
        self.projected = deriv.contact is not None
        self.own = RECORD + 9 * self.projected  # of a node: its record, and where it is free
        self.columns = self.own * len(self.nodes)
        arrays, more = ["moves", "chunk"] if deriv.parallel else ["x", "rise"], [f"noted{self.number}"] * noting
        self.given = f"{deriv.call}, t, h, {', '.join([*arrays, *more, *['Q'] * self.projected])}"

    def text(self) -> str:
        """Everything."""
        deriv, force = self.deriv, self.elements.force
        assert isinstance(force, ConstraintForce)
        table, inputs = self.elements.table, state(force.nodes)
        text = deriv.binder.law(force.traced_constraint, force, inputs, "u_", table, f"c{self.number}")
        switch = deriv.binder.switch(force)
        body = [*text.lines, *solved(force.nodes, text.outputs, self.projected)]
        start = [*deriv.binder.numbers.lines(), "status = 0", *text.at_time]
        if deriv.parallel:
            chunks = [*start, *self._chunks(body), "return status"]
            before = function(f"chunks{self.number}", f"first, last, end, s, {self.given}", "**FLAGS", chunks)
            lines = [*deriv.binder.numbers.lines(), "status = 0", f"if {switch} != 0:", *indented(self._colours(), 1)]
        else:
            before, lines = "", [*start, f"if {switch} != 0:", *indented(self._in_turn(body), 1)]
        return before + function(f"relax{self.number}", self.given, deriv.flags, [*lines, "return status"])

    def _node(self, a: int) -> str:
        return f"n{a} = np.uintp(E{self.number}[{len(self.nodes)} * u_ + {a}])"

    def _free(self, a: int) -> dict[str, str]:
        """Where node a is free."""
        return {f"f{a}{m}": f"Q[np.uintp(9) * n{a} + np.uintp({m})]" for m in range(9 * self.projected)}

    def _in_turn(self, body: list[str]) -> list[str]:
        """Element by element."""
        j = self.number
        taken: dict[str, str] = {}
        for a in self.nodes:
            taken |= {f"r{a}{c}": f"rise[np.uintp(3) * n{a} + np.uintp({c})]" for c in AXES}
            taken |= {f"x{a}{c}": f"x[np.uintp(3) * n{a} + np.uintp({c})]" for c in AXES}
            taken[f"w{a}"] = self.deriv.binder.attribute("w", f"(np.uintp(base) + n{a})")
            taken |= self._free(a)
        noted = f"noted{j}[u_ - s{j}]" if self.noting else ""
        one = [
            *(self._node(a) for a in self.nodes),
            *(f"{name} = {entry}" for name, entry in taken.items()),
            f"had = {noted or 'R(0)'}",
            *places(len(self.nodes)),
            *body,
            *[f"{noted} = had + more"] * self.noting,
            *(f"{taken[f'r{a}{c}']} = r{a}{c}" for a in self.nodes for c in AXES),
        ]
        return [f"for u_ in range(s{j}, e{j}):", *indented(one, 1)]

    def _colours(self) -> list[str]:
        """Colour by colour: which elements are a chunk does not depend on the number of threads."""
        j = self.number
        call = f"chunks{j}(begin + {LANES} * ({{}}), begin + {LANES} * ({{}}), end, {{}}, {self.given})"
        return [
            "parts = len(cuts) - 1",
            f"for colour in range(len(Z{j}) - 1):",
            f"    begin = Z{j}[colour]",
            f"    end = Z{j}[colour + 1]",
            f"    many = (end - begin + {LANES - 1}) // {LANES}",
            f"    if many < {FEWEST}:",
            f"        status |= {call.format('0', 'many', 'chunk[0]')}",
            "    else:",
            "        worst = 0",
            "        for part in prange(parts):",
            f"            bad = {call.format('many * part // parts', 'many * (part + 1) // parts', 'chunk[part]')}",
            "            worst = max(worst, bad)",
            "        status |= worst",
        ]

    def _chunks(self, body: list[str]) -> list[str]:
        """The elements from `first` to `last`, or to the end of their colour, chunk by chunk."""
        j, count = self.number, len(self.nodes)
        at: dict[str, str] = {}
        for a in self.nodes:
            record = {MASS: f"w{a}", **{c: f"r{a}{c}" for c in AXES}, **{PLACE + c: f"x{a}{c}" for c in AXES}}
            own = record | {RECORD + m: name for m, name in enumerate(self._free(a))}
            at |= {name: f"s[i + np.uintp({LANES * (self.own * a + k)})]" for k, name in own.items()}
        noted = f"noted{j}[np.uintp(start - s{j}) + i]" if self.noting else ""
        element = ["i = np.uintp(lane)", "u_ = start + lane"]
        item = ["i = np.uintp(lane)", f"e = np.uintp({count}) * (np.uintp(start) + i)"]
        block = [f"i + np.uintp({LANES * self.own * a}), {LANES}" for a in self.nodes]
        row = f"E{j}, e + np.uintp({{}}), {count}"
        turn = [f"more_columns(s, {block[a]}, moves, {row.format(a)})" for a in self.nodes]
        back = [f"put_back(moves, {row.format(a)}, s, {block[a]})" for a in self.nodes]
        one = "s[i + np.uintp({0})] = moves[np.uintp({1}) * n{2} + np.uintp({3})]"
        single, put = [], []
        for a in self.nodes:
            single += [one.format(LANES * (self.own * a + k), RECORD, a, k) for k in range(PLACE + 3)]
            put += [f"moves[np.uintp({RECORD}) * n{a} + np.uintp({c})] = {at[f'r{a}{c}']}" for c in AXES]
        nodes = [self._node(a) for a in self.nodes]
        free = [f"{at[name]} = {entry}" for a in self.nodes for name, entry in self._free(a).items()]
        chunk = [
            f"count = min({LANES}, end - start)",
            "for lane in range(0, count - 7, 8):",
            *indented([*item, *turn], 1),
            "for lane in range(count - count % 8, count):",
            *indented([*element, *nodes, *single], 1),
            *(["for lane in range(count):", *indented([*element, *nodes, *free], 1)] if free else []),
            "for lane in range(count):",
            *indented([*element, *(f"{n} = {e}" for n, e in at.items()), f"had = {noted or 'R(0)'}"], 1),
            *indented([*places(count), *body, *[f"{noted} = had + more"] * self.noting], 1),
            *(f"    {at[f'r{a}{c}']} = r{a}{c}" for a in self.nodes for c in AXES),
            "for lane in range(0, count - 7, 8):",
            *indented([*item, *back], 1),
            "for lane in range(count - count % 8, count):",
            *indented([*element, *nodes, *put], 1),
        ]
        return [f"for start in range(first, min(last, end), {LANES}):", *indented(chunk, 1)]
