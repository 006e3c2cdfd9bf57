"""Prints `deriv`: the accelerations of an island (order 1: its velocities), the lecture's clear, calculate and gather.

Elements are evaluated once each, into a buffer; then every particle adds up what acts on it, force by force in listed
order and element by element: nothing is scattered, so the bits depend on no thread.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.binding import Binder, Table, Text
from pointmass.engine.contact import ContactText
from pointmass.engine.pairs import Pairs
from pointmass.engine.printing import indented, literal
from pointmass.engine.reference import surfaces_of
from pointmass.laws.elements import ElementForce
from pointmass.laws.pairs import PairForce
from pointmass.laws.unary import UnaryForce
from pointmass.system import ParticleSystem
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Program
from pointmass.tracing.trace import Traced, vector_names


@dataclass
class Elements:
    """A family of elements in the kernel.

    Attributes
    ----------
    number : of the family; the arrays of the kernel are named after it: E (nodes), D (columns), J and I (incidence), B
        (buffer of forces), and s, e (its range in the island).
    """

    force: ElementForce
    number: int
    table: Table

    @property
    def arguments(self) -> list[str]:
        """Arrays of the kernel."""
        j = self.number
        return [f"E{j}", f"D{j}", f"J{j}", f"I{j}"]

    @property
    def locals(self) -> list[str]:
        """What a call for one island takes besides: buffer and range."""
        j = self.number
        return [f"B{j}", f"s{j}", f"e{j}"]


class Deriv:
    """The text of `deriv` for a system.

    Attributes
    ----------
    text : the function.
    families : of elements, in the order of the forces.
    pairs : forces between all particles, or those within a cut-off.
    contact : what the colliders do to a particle, if there are any.
    flags, once : how functions are compiled, and those that are called at one place only.

    Parameters
    ----------
    parallel : whether its loops are those of all threads.
    lagged : whether resting contact is that of the start of a piece (implicit solvers).
    alone : whether it is for particles that are islands of their own, on which no element acts.
    binder : that another kernel uses too.
    """

    def __init__(
        self, system: ParticleSystem, parallel: bool, lagged: bool, alone: bool = False, binder: Binder | None = None
    ) -> None:
        self.system, self.alone = system, alone
        self.contact: ContactText | None = None
        if system.colliders:
            self.contact = ContactText(surfaces_of(system), system.order, lagged, str(system.particles.dtype))
        self.order = system.order
        self.binder = binder or Binder(system.particles, Table("C"))
        self.families: list[Elements] = []
        self.pairs: list[Pairs] = []
        self.loop = "prange" if parallel else "range"
        self.flags = "parallel=True, **OWNING" if parallel else "**FLAGS"
        self.once = self.flags if parallel else "forceinline=True, **FLAGS"  # each array is seven arguments of a call
        self._at_time: list[str] = []
        self.text = self._printed()

    @property
    def data(self) -> list[str]:
        """Names of the arrays of a kernel that are the same for all islands."""
        elements = [a for f in self.families for a in f.arguments]
        arrays = [*self.binder.arrays, *elements, *(a for p in self.pairs for a in p.arguments)]
        return arrays if self.contact is None else [*arrays, "F"]

    @property
    def call(self) -> str:
        """The arguments of a call that all islands' calls share, as text."""
        own = (
            [a for f in self.families for a in f.locals]
            + [a for p in self.pairs for a in p.locals]
            + ["K"] * (self.contact is not None)
        )
        return ", ".join(["base", "n", *self.data, *own])

    def _printed(self) -> str:
        elements, sums = [], []
        for k, force in enumerate(self.system.forces):
            if isinstance(force, UnaryForce):
                timed, lines = unary(self.binder, force, f"f{k}", UNARY, "g")
                self._at_time += timed
                sums += lines
            elif isinstance(force, ElementForce) and not self.alone:
                evaluate, gather = self._elements(force, f"f{k}")
                elements += evaluate
                sums += gather
            elif isinstance(force, PairForce) and not self.alone:
                evaluate, gather = self._pairs(force)
                elements += evaluate
                sums += gather
        w = self.binder.attribute("w", "g")
        last = [f"k[o{a}] = f_{a} * w if free else R(0)" for a in "xyz"]
        if self.order == 1:
            last = [f"k[o{a}] = f_{a} if free else R(0)" for a in "xyz"]
        particle = [
            "g = base + i",
            "o_x = np.uintp(3 * i)",
            "o_y = np.uintp(3 * i + 1)",
            "o_z = np.uintp(3 * i + 2)",
            *(f"f_{a} = R(0)" for a in "xyz"),
            *sums,
            *self._bear(),
            f"w = {w}",
            "free = w != 0",
            *(line.replace("[o", "[o_") for line in last),
        ]
        lines = [
            f"@njit({self.flags})",
            f"def deriv({self.call}, t, x, v, k):",
            *indented(self.binder.numbers.lines(), 1),
            "    status = 0",
            *indented(self._at_time, 1),
            *indented(elements, 1),
            f"    for i in {self.loop}(n):",
            *indented(particle, 2),
            "    return status",
            "",
        ]
        contact = "" if self.contact is None else self.contact.text
        pairs = "".join(f"{p.text}\n\n" for p in self.pairs)
        return contact + self.binder.functions + pairs + "\n".join(lines)

    def _pairs(self, force: PairForce) -> tuple[list[str], list[str]]:
        """Statements that evaluate all pairs, and those that add what they do to a particle."""
        pairs = Pairs(force, len(self.families) + len(self.pairs), self.binder, self.loop == "prange")
        self.pairs.append(pairs)
        j, switch = pairs.number, self.binder.switch(force)
        evaluate = [f"# {force.name}", f"if {switch} != 0 and e{j} > s{j}:", f"    status |= {pairs.call()}"]
        gather = [f"if {switch} != 0:", *(f"    f_{a} = f_{a} + F{j}[3 * g + {k}]" for k, a in enumerate("xyz"))]
        return evaluate, gather

    def _bear(self) -> list[str]:
        """Resting contact: a filter on the sum of all forces, between calculate and gather."""
        if self.contact is None:
            return []
        state = [f"np.float64({q}[o_{a}])" if q == "x" or self.order == 2 else "0.0" for q in "xv" for a in "xyz"]
        force = ", ".join(f"np.float64(f_{a})" for a in "xyz")
        mass = f"np.float64({self.binder.attribute('m', 'g')})"
        return [
            f"if K[{self.contact.record} * i] > 0:",
            f"    b_x, b_y, b_z = bear(F, K, {self.contact.record} * i, t, {', '.join(state)}, {mass}, {force})",
            "    f_x, f_y, f_z = R(b_x), R(b_y), R(b_z)",
        ]

    def _elements(self, force: ElementForce, tag: str) -> tuple[list[str], list[str]]:
        """Statements that evaluate elements into their buffer, and those that add them up on a particle."""
        j, nodes = len(self.families) + len(self.pairs), force.nodes
        table = Table(f"D{j}")
        self.families.append(Elements(force, j, table))
        state = {"t": "R(t)"}
        for a in range(nodes):
            for q in "xv":
                names = vector_names(f"{q}{a + 1}")
                state |= {name: f"{q}[n{a} + np.uintp({axis})]" for axis, name in enumerate(names)}
        law, terms = different(force.traced)
        opposite = nodes == 2 and all(_opposite(a, b) for a, b in zip(terms[:3], terms[3:], strict=True))
        text: Text = self.binder.law(law if opposite else force.traced, force, state, "u", table, tag)
        self._at_time += text.at_time
        switch = self.binder.switch(force)
        count = len(text.outputs)  # numbers of an element in the buffer
        evaluate = [
            f"# {force.name}",
            f"if {switch} != 0:",
            f"    for element in {self.loop}(s{j}, e{j}):",
            "        u = np.uintp(element)",
            *(
                f"        n{a} = np.uintp(3) * np.uintp(E{j}[np.uintp({nodes}) * u + np.uintp({a})])"
                for a in range(nodes)
            ),
            *indented(text.lines, 2),
            f"        b = np.uintp({count}) * (u - np.uintp(s{j}))",
            *(f"        B{j}[b + np.uintp({k})] = {out}" for k, out in enumerate(text.outputs)),
        ]
        gather = [
            f"# {force.name}",
            f"if {switch} != 0:",
            f"    for entry in range(J{j}[g], J{j}[g + 1]):",
            f"        u = np.uintp(I{j}[np.uintp(entry)])",
        ]
        if opposite:
            gather += [f"        b = np.uintp({count}) * (u >> np.uintp(1))"]
            gather += ["        second = (u & np.uintp(1)) != np.uintp(0)"]
            for axis, first, other in zip("xyz", terms[:3], terms[3:], strict=True):
                if first is not None and other is not None:
                    gather.append(f"        q = B{j}[b + np.uintp({first[0]})]")
                    ends = ("-q", "q") if first[1] == "-" else ("q", "-q")
                    gather.append(f"        f_{axis} = f_{axis} + select(second, {ends[1]}, {ends[0]})")
        else:
            gather.append("        b = np.uintp(3) * u")
            gather += [f"        f_{a} = f_{a} + B{j}[b + np.uintp({k})]" for k, a in enumerate("xyz")]
        return evaluate, gather


def unary(
    binder: Binder, force: UnaryForce, tag: str, state: Mapping[str, str], index: str, time: str = "t"
) -> tuple[list[str], list[str]]:
    """Statements of the time, and those that add a force on one particle to f_x, f_y, f_z.

    Parameters
    ----------
    tag : keeps its locals apart.
    state : expressions of x_x, ..., v_z.
    """
    mass = {"m": binder.attribute("m", index)} if "m" in force.traced.depends_on else {}
    names = {**state, **mass, "t": f"R({time})"}
    text = binder.law(force.traced, force, names, index, binder.particle, tag, time)
    acts = binder.selected(force, index)
    adds = [
        f"f_{a} = f_{a} + {out if acts is None else f'({out} if {acts} else R(0))'}"
        for a, out in zip("xyz", text.outputs, strict=True)
        if out != literal(0.0, binder.dtype)
    ]
    return text.at_time, [f"# {force.name}", *text.lines, *adds]


def _opposite(a: tuple[int, str] | None, b: tuple[int, str] | None) -> bool:
    """Whether two outputs of a law (see `different`) are each other's negative."""
    return a == b if a is None or b is None else a[0] == b[0] and a[1] != b[1]


def different(traced: Traced) -> tuple[Traced, list[tuple[int, str] | None]]:
    """A law without the outputs that are another one with the other sign.

    Returns
    -------
    law : its outputs are the forces that are different.
    terms : number and sign of the one that each output of the law is; None for 0.
    """
    program = expanded(traced.program)
    found: dict[int, int] = {}
    terms: list[tuple[int, str] | None] = []
    for node in program.outputs:
        op, *rest = program.nodes[node]
        if op == "const" and rest[0] == 0:
            terms.append(None)
        else:
            base = rest[0] if op == "neg" else node
            terms.append((found.setdefault(base, len(found)), "-" if op == "neg" else "+"))
    return Traced(traced.name, traced.inputs, Program(program.nodes, list(found))), terms


UNARY = {name: f"{q}[o_{axis}]" for q in "xv" for axis, name in zip("xyz", vector_names(q), strict=True)}


@dataclass(frozen=True, eq=False)
class Incidence:
    """The elements of a family in the order of the kernel's rows.

    Attributes
    ----------
    order : of the elements: island by island, and within one by their number, shape (e,).
    nodes : row of each node within its island, shape (e * k,).
    start : first element of each island, shape (islands + 1,).
    ends : start of each row's entries in `entries`, shape (rows + 1,).
    entries : element within its island times k plus node, for each row by element, shape (e * k,).
    """

    order: NDArray[np.intp]
    nodes: NDArray[np.int32]
    start: NDArray[np.int64]
    ends: NDArray[np.int64]
    entries: NDArray[np.int32]


def incidence(rows: NDArray[np.intp], place: NDArray[np.intp], first: NDArray[np.int64]) -> Incidence:
    """Sort the elements of a group of islands.

    Parameters
    ----------
    rows : particles of each element, shape (e, k), all of the group.
    place : row in the kernel of each particle of the system, shape (n,).
    first : first row of each island, shape (islands + 1,).
    """
    places = place[rows]
    island = np.searchsorted(first, places[:, 0], side="right") - 1
    order = np.argsort(island, kind="stable")
    places, island = places[order], island[order]
    start = np.searchsorted(island, np.arange(len(first)), side="left").astype(np.int64)
    k = rows.shape[1]
    own = (np.arange(len(rows)) - start[island])[:, None] * k + np.arange(k)
    by_row = np.argsort(places.ravel(), kind="stable")
    ends = np.searchsorted(places.ravel()[by_row], np.arange(first[-1] + 1), side="left").astype(np.int64)
    local = places - first[island][:, None]
    return Incidence(order, local.astype(np.int32).ravel(), start, ends, own.ravel()[by_row].astype(np.int32))
