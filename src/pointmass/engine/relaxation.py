"""Prints the step of a solver that relaxes elements one by one: what `laws.relaxation` does, element by element.

The elements of a family lie in the order of their colours. One thread goes through those of an island in this order.
All threads on one island share the elements of a colour, which have no particle in common: chunk by chunk, what they
need is gathered into columns, of which vectors are made, and put back.
"""

from __future__ import annotations

from collections.abc import Callable

from pointmass.engine.forces import FREE, LANES, Deriv, Elements
from pointmass.engine.printing import function, indented
from pointmass.engine.steps import StepText, each
from pointmass.laws.elements import ConstraintForce
from pointmass.solvers.xpbd import XPBD
from pointmass.tracing.trace import vector_names

AXES = range(3)
Entry = Callable[[int], str]  # a column of the scratch, for one lane


def relaxation_text(deriv: Deriv, solver: XPBD) -> StepText:
    """The step for a system and a solver."""
    families = [_Family(deriv, f, k) for k, f in enumerate(deriv.families) if isinstance(f.force, ConstraintForce)]
    scratch = {f"noted{f.number}": f"np.empty(M[{f.place + 1}], R)" for f in families}
    if deriv.contact is not None:
        scratch |= FREE
    if deriv.parallel and families:
        scratch["chunk"] = f"np.zeros((M[-1], {LANES * max(f.columns for f in families)}), R)"
    w = deriv.binder.attribute("w", "np.uintp(base + i)")
    lines = ["elastic = False", "status |= DERIV(t, x, v, kv)", "elastic = True", *deriv.projections]
    way = "way[q] = hr * (v1[q] if free else R(0))"
    lines += each(deriv.loop, w, ["v1[q] = v[q] + hr * kv[q]", way, "rise[q] = way[q]"])
    for f in families:
        lines += [f"for q in {deriv.loop}(e{f.number} - s{f.number}):", f"    noted{f.number}[q] = R(0)"]
    sweep = [f"status |= relax{f.number}({f.given.replace('t, h,', 't + h, hr,')})" for f in families]
    lines += [f"for _ in range({solver.iterations}):", *indented(sweep or ["pass"], 1)]
    lines += each(deriv.loop, w, ["x1[q] = x[q] + rise[q]", "v1[q] = v1[q] + (rise[q] - way[q]) / hr"])
    return StepText(["kv", "way", "rise"], lines, 1, functions="".join(f.text() for f in families), scratch=scratch)


class _Family:
    """The function that looks at all elements of a family once.

    Attributes
    ----------
    number, place : of the family, among all and among those of elements.
    columns : numbers that an element needs of its particles, and what it has noted.
    given : arguments of the function.
    """

    def __init__(self, deriv: Deriv, elements: Elements, place: int) -> None:
        self.deriv, self.elements, self.number, self.place = deriv, elements, elements.number, place
        self.nodes = range(elements.force.nodes)
        self.projected = deriv.contact is not None
        self.own = 16 if self.projected else 7  # of a node: how far it comes, place, inverse mass, and where it is free
        self.columns = self.own * len(self.nodes) + 1
        arrays = ["x", "rise", f"noted{self.number}", *["Q"] * self.projected, *["chunk"] * deriv.parallel]
        self.given = f"{deriv.call}, t, h, {', '.join(arrays)}"

    def text(self) -> str:
        """Everything."""
        deriv, force = self.deriv, self.elements.force
        assert isinstance(force, ConstraintForce)
        state = {"t": "R(t)"}
        for a in self.nodes:
            state |= {name: f"q{a}{c}" for c, name in enumerate(vector_names(f"x{a + 1}"))}
        text = deriv.binder.law(force.traced_constraint, force, state, "u_", self.elements.table, f"c{self.number}")
        body = [*text.lines, *self._solved(text.outputs)]
        lines = [
            *deriv.binder.numbers.lines(),
            "status = 0",
            *text.at_time,
            f"if {deriv.binder.switch(force)} != 0:",
            *indented(self._by_chunks(body) if deriv.parallel else self._in_turn(body), 1),
            "return status",
        ]
        return function(f"relax{self.number}", self.given, deriv.flags, lines)

    def _gathered(self, a: int) -> list[tuple[str, str]]:
        """(local, expression) of what an element needs of node a in row `n{a}`."""
        found = [(f"r{a}{c}", f"rise[np.uintp(3) * n{a} + np.uintp({c})]") for c in AXES]
        found += [(f"x{a}{c}", f"x[np.uintp(3) * n{a} + np.uintp({c})]") for c in AXES]
        found.append((f"w{a}", self.deriv.binder.attribute("w", f"(np.uintp(base) + n{a})")))
        free = [(f"f{a}{m}", f"Q[np.uintp(9) * n{a} + np.uintp({m})]") for m in range(9)]
        return found + free * self.projected

    def _node(self, a: int) -> str:
        return f"n{a} = np.uintp(E{self.number}[{len(self.nodes)} * u_ + {a}])"

    def _solved(self, outputs: list[str]) -> list[str]:
        """Statements from the constraint and its slopes to how far the particles come."""
        gap, k, d, *slopes = outputs
        lines = [f"k = {k} * h * h", f"d = {d} * h"]
        lines += [f"g{a}{c} = {slopes[3 * a + c]}" for a in self.nodes for c in AXES]
        for a in self.nodes:
            free = [[f"f{a}{3 * c + m} * g{a}{m}" for m in AXES] for c in AXES]
            lines += [f"y{a}{c} = {' + '.join(free[c]) if self.projected else f'g{a}{c}'}" for c in AXES]
        lines += ["soft = R(0)", "went = R(0)"]
        for a in self.nodes:
            lines.append(f"soft = soft + w{a} * ({' + '.join(f'g{a}{c} * y{a}{c}' for c in AXES)})")
            lines.append(f"went = went + ({' + '.join(f'g{a}{c} * r{a}{c}' for c in AXES)})")
        lines.append(f"more = -(k * ({gap}) + had + d * went) / (R(1) + (k + d) * soft)")
        return [*lines, *(f"r{a}{c} = r{a}{c} + (w{a} * more) * y{a}{c}" for a in self.nodes for c in AXES)]

    def _places(self) -> list[str]:
        return [f"q{a}{c} = x{a}{c} + r{a}{c}" for a in self.nodes for c in AXES]

    def _in_turn(self, body: list[str]) -> list[str]:
        """Element by element."""
        j = self.number
        back = [f"rise[np.uintp(3) * n{a} + np.uintp({c})] = r{a}{c}" for a in self.nodes for c in AXES]
        one = [
            *(self._node(a) for a in self.nodes),
            *(f"{name} = {entry}" for a in self.nodes for name, entry in self._gathered(a)),
            f"had = noted{j}[u_ - s{j}]",
            *self._places(),
            *body,
            f"noted{j}[u_ - s{j}] = had + more",
            *back,
        ]
        return [f"for u_ in range(s{j}, e{j}):", *indented(one, 1)]

    def _by_chunks(self, body: list[str]) -> list[str]:
        """Colour by colour, and chunk by chunk: which elements are a chunk does not depend on the number of threads."""
        j = self.number
        names = [(name, entry) for a in self.nodes for name, entry in self._gathered(a)]
        at = {name: f"s[i + np.uintp({LANES * k})]" for k, (name, _) in enumerate(names)}
        had = f"s[i + np.uintp({LANES * len(names)})]"
        element = ["i = np.uintp(lane)", "u_ = first + lane"]
        rows = [self._node(a) for a in self.nodes]
        moved = [f"r{a}{c}" for a in self.nodes for c in AXES]
        back = [f"rise[np.uintp(3) * n{r[1]} + np.uintp({r[2]})] = {at[r]}" for r in moved]
        chunk = [
            f"first = Z{j}[colour] + {LANES} * number",
            f"count = min({LANES}, Z{j}[colour + 1] - first)",
            "for lane in range(count):",
            *indented([*element, *rows, *(f"{at[n]} = {e}" for n, e in names), f"{had} = noted{j}[u_ - s{j}]"], 1),
            "for lane in range(count):",
            *indented([*element, *(f"{n} = {e}" for n, e in at.items()), f"had = {had}", *self._places(), *body], 1),
            *indented([f"{had} = had + more", *(f"{at[r]} = {r}" for r in moved)], 1),
            "for lane in range(count):",
            *indented([*element, *rows, *back, f"noted{j}[u_ - s{j}] = {had}"], 1),
        ]
        return [
            "parts = len(cuts) - 1",
            f"for colour in range(len(Z{j}) - 1):",
            f"    chunks = (Z{j}[colour + 1] - Z{j}[colour] + {LANES - 1}) // {LANES}",
            "    for part in prange(parts):",
            "        s = chunk[part]",
            "        for number in range(chunks * part // parts, chunks * (part + 1) // parts):",
            *indented(chunk, 3),
        ]
