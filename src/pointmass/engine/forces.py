"""Prints `deriv`: the accelerations of an island (order 1: its velocities), the lecture's clear, calculate and gather.

The particles of an island fall into tiles, a thread each, or into one. A tile goes through all elements that touch it,
in their order, and adds what they do to its own particles: an element between two tiles is evaluated by both, so no
two threads write to one place, every particle adds up its forces in the order of the forces and of their elements, and
the bits depend on no thread.

An element reads its nodes from all over memory, and that is what takes the time, so a node is read at once: the state
of a particle is a record, and the records of some elements are turned into columns, on which the law is a loop of
vectors; what comes out are records again, each added to a particle in one go.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.binding import Binder, Table, Text
from pointmass.engine.contact import ContactText
from pointmass.engine.pairs import Pairs
from pointmass.engine.printing import function, indented, literal
from pointmass.engine.reference import surfaces_of
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.laws.pairs import PairForce
from pointmass.laws.unary import UnaryForce
from pointmass.system import ParticleSystem
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Program
from pointmass.tracing.trace import Traced, vector_names

LANES = 64  # elements that a law is evaluated for in one go
RECORD = 8  # numbers of a particle's state, 6 of them used: one load, and one line of the cache
FREE = {"Q": "np.empty(9 * M[0], R)", "Qw": "np.empty(18 * M[0], R)"}  # what `projections` need
TOTAL = 4  # numbers of a particle's force, 3 of them used
APART = 16  # rows between what two threads write all the time
ZERO = [f"f_{a} = R(0)" for a in "xyz"]
PARTICLE = ["g = base + i", *(f"o_{a} = np.uintp(3 * i + {k})" for k, a in enumerate("xyz"))]

Terms = list[tuple[int, str] | None]


@dataclass
class Elements:
    """A family of elements in the kernel.

    Attributes
    ----------
    number : of the family; the arrays of the kernel are named after it: N (nodes), L (columns) and T (ranges), tile by
        tile; for implicit solvers also E (nodes) and D (columns), element by element, J and I (incidence), B (buffer of
        forces), and s, e (its range in the island); Z (colours) of elements that all threads relax.
    tiled, table : columns tile by tile, and element by element.
    """

    force: ElementForce
    number: int
    tiled: Table
    table: Table
    implicit: bool
    coloured: bool

    @property
    def arguments(self) -> list[str]:
        """Arrays of the kernel."""
        return [f"{name}{self.number}" for name in ("NLEDJI" if self.implicit else "NL") + "Z" * self.coloured]

    @property
    def locals(self) -> list[str]:
        """What a call for one island takes besides: buffer and ranges."""
        return [f"{name}{self.number}" for name in ("TBse" if self.implicit else "T")]


class Deriv:
    """The text of `deriv` for a system.

    Attributes
    ----------
    text : the function.
    solved : whether a matrix of slopes is solved for.
    families : of elements, in the order of the forces.
    pairs : forces between all particles, or those within a cut-off.
    contact : what the colliders do to a particle, if there are any.
    flags, once : how functions are compiled, and those that are called at one place only.

    Parameters
    ----------
    parallel : whether its loops are those of all threads.
    implicit : whether resting contact is that of the start of a piece, and elements have blocks of a Jacobian.
    relaxed : whether springs and the like act only where the local `elastic` says so: else the solver relaxes them.
    dealt : whether the solver relaxes those of a grid, whose state by rows is in G, with so many columns (`wide`).
    """

    def __init__(
        self, system: ParticleSystem, parallel: bool, implicit: bool, relaxed: bool = False, dealt: bool = False
    ) -> None:
        self.system, self.parallel, self.implicit, self.relaxed = system, parallel, implicit, relaxed
        self.dealt = dealt
        self.contact: ContactText | None = None
        if system.colliders:
            self.contact = ContactText(surfaces_of(system), system.order, implicit, str(system.particles.dtype))
        self.order = system.order
        self.binder = Binder(system.particles, Table("C"))
        self.families: list[Elements] = []
        self.pairs: list[Pairs] = []
        self._searches: dict[str, str] = {}  # for neighbours, by their text
        self.loop = "prange" if parallel else "range"
        self.solved = implicit and not relaxed
        # Where it is, functions are called in several places, and would be as many copies.
        self.flags = "parallel=True, **OWNING" if parallel else "**APART" if self.solved else "**FLAGS"
        self.once = self.flags if parallel else "forceinline=True, **FLAGS"  # each array is seven arguments of a call
        self._at_time: list[str] = []
        self.text = self._printed()

    @property
    def data(self) -> list[str]:
        """Names of the arrays of a kernel that are the same for all islands."""
        elements = [a for f in self.families for a in f.arguments]
        arrays = [*self.binder.arrays, *elements, *(a for p in self.pairs for a in p.arguments)]
        return [*arrays, *["F"] * (self.contact is not None), *["G", "wide"] * self.dealt]

    @property
    def call(self) -> str:
        """The arguments of a call that all islands' calls share, as text."""
        own = (
            [a for f in self.families for a in f.locals]
            + [a for p in self.pairs for a in p.locals]
            + ["K"] * (self.contact is not None)
            + ["cuts", *self.scratch] * bool(self.families)
            + ["elastic"] * self.relaxed
        )
        return ", ".join(["base", "n", *self.data, *own])

    @property
    def scratch(self) -> dict[str, str]:
        """What elements need besides -> how it is made.

        M[0] is the largest number of particles of an island, M[-1] the number of tiles at work.
        """
        if not self.families:
            return {}
        nodes = max(f.force.nodes for f in self.families)
        return {
            "records": f"np.empty({RECORD} * M[0], R)",
            "totals": f"np.empty({TOTAL} * (M[0] + {APART} * M[-1]), R)",
            "lanes": f"np.zeros((M[-1], {6 * nodes * LANES}), R)",
            "acts": f"np.empty((M[-1], {TOTAL * nodes * LANES}), R)",
        }

    def _printed(self) -> str:
        before: list[str] = []  # what all particles wait for
        stages: list[list[str]] = [[]]  # forces on a particle, and between them elements in loops of their own
        for k, force in enumerate(self.system.forces):
            if isinstance(force, UnaryForce):
                timed, lines = unary(self.binder, force, f"f{k}", UNARY, "g")
                self._at_time += timed
                stages[-1] += lines
            elif isinstance(force, ElementForce):
                lines = self._elements(force, f"f{k}")
                stages += [lines, []] if lines else []
            elif isinstance(force, PairForce):
                evaluate, lines = self._pairs(force)
                before += evaluate
                stages[-1] += lines
        last = stages.pop()
        w = self.binder.attribute("w", "g")
        rate = "f_{0} * w" if self.order == 2 else "f_{0}"
        last += [*self._bear(), f"w = {w}", "free = w != 0"]
        last += [f"k[o_{a}] = {rate.format(a)} if free else R(0)" for a in "xyz"]
        numbers = self.binder.numbers.lines()
        contact = "" if self.contact is None else self.contact.text
        parts = [contact, self.binder.functions, *(f"{p.text}\n\n" for p in self.pairs)]
        if not stages:
            loop = [f"for i in {self.loop}(n):", *indented([*PARTICLE, *ZERO, *last], 1)]
            body = [*self._at_time, *before, *loop]
        else:
            tile = [*self._at_time, *self._tile(stages, last)]
            body = [
                *before,
                f"for i in {self.loop}(n):",
                *(f"    records[{RECORD} * i + {c}] = {q}[3 * i + {c % 3}]" for c, q in enumerate("xxxvvv")),
            ]
            if self.parallel:
                tile = [*numbers, "status = 0", *tile, "return status"]
                parts.append(function("tile_of", f"tile, {self.call}, t, x, v, k", "**FLAGS", tile))
                body += [
                    "worst = 0",
                    "for tile in prange(len(cuts) - 1):",
                    f"    worst = max(worst, tile_of(tile, {self.call}, t, x, v, k))",
                    "status |= worst",
                ]
            else:
                body += ["tile = 0", *tile]
        body = [*numbers, "status = 0", *body, "return status"]
        return "".join([*parts, function("deriv", f"{self.call}, t, x, v, k", self.flags, body)])

    def _tile(self, stages: list[list[str]], last: list[str]) -> list[str]:
        """Statements that go through the forces on the particles of a tile."""
        lines = [
            "lo = cuts[tile] - base",
            "hi = cuts[tile + 1] - base",
            "begin = np.uintp(lo)",
            "own = np.uintp(hi - lo)",
            f"spare = np.uintp(n + {APART} * tile)  # where goes what acts on the particles of others",
            "s = lanes[tile]",
            "z = acts[tile]",
        ]
        known = ZERO
        for k, stage in enumerate([*stages, last]):
            if k % 2:
                lines += stage
            elif stage or not k:
                keep = [f"totals[{TOTAL} * i + {c}] = {f}" for c, f in enumerate(("f_x", "f_y", "f_z", "R(0)"))]
                keep *= k < len(stages)
                lines += ["for i in range(lo, hi):", *indented([*PARTICLE, *known, *stage, *keep], 1)]
                known = [f"f_{a} = totals[{TOTAL} * i + {c}]" for c, a in enumerate("xyz")]
        return lines

    def _pairs(self, force: PairForce) -> tuple[list[str], list[str]]:
        """Statements that evaluate all pairs, and those that add what they do to a particle."""
        j = len(self.families) + len(self.pairs)
        pairs = Pairs(force, j, self.binder, self.parallel, self._searches, self.solved)
        self.pairs.append(pairs)
        evaluate = [f"# {force.name}", f"if {self.acting(pairs)}:", f"    status |= {pairs.call()}"]
        gather = [
            f"if {self.binder.switch(force)} != 0:",
            *(f"    f_{a} = f_{a} + F{j}[3 * g + {k}]" for k, a in enumerate("xyz")),
        ]
        return evaluate, gather

    def acting(self, pairs: Pairs) -> str:
        """Whether pairs act in an island, as an expression."""
        j = pairs.number
        return f"{self.binder.switch(pairs.force)} != 0 and e{j} > s{j}"

    @property
    def projections(self) -> list[str]:
        """Statements that find the directions in which contacts leave each particle free: 9 numbers of each in Q."""
        if self.contact is None:
            return []
        project = f"project(F, K, i * {self.contact.record}, Q[9 * i:9 * i + 9], Qw[18 * i:18 * i + 18])"
        return [f"for i in {self.loop}(n):", f"    {project}"]

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

    def _elements(self, force: ElementForce, tag: str) -> list[str]:
        """Statements that go through the elements of a tile and add what they do to its particles, if they ever do."""
        j, nodes = len(self.families) + len(self.pairs), force.nodes
        table = Table(f"L{j}")
        elastic = self.relaxed and isinstance(force, ConstraintForce)
        coloured = elastic and self.parallel and not self.dealt
        self.families.append(Elements(force, j, table, Table(f"D{j}"), self.implicit, coloured))
        if elastic and self.contact is None:  # only impacts ask for what is relaxed
            return []
        state = {"t": "R(t)"}
        for node in range(nodes):
            for k, q in enumerate("xv"):
                for axis, name in enumerate(vector_names(f"{q}{node + 1}")):
                    state[name] = f"s[i + np.uintp({(6 * node + 3 * k + axis) * LANES})]"
        law, terms = different(force.traced)
        text: Text = self.binder.law(law, force, state, "u", table, tag)
        self._at_time += text.at_time
        zero = literal(0.0, self.binder.dtype)
        values = [zero if term is None else f"{term[1].strip('+')}{text.outputs[term[0]]}" for term in terms]
        kept: list[Terms] = []  # what acts on a node, if it is neither that on one before it nor its negative
        write, add = [], []
        for node in range(nodes):
            mine, place, way = terms[3 * node : 3 * node + 3], len(kept), "added"
            if mine in kept:
                place = kept.index(mine)
            elif _negative(mine) in kept:
                place, way = kept.index(_negative(mine)), "subtracted"
            else:
                kept.append(mine)
                for c, value in enumerate([*values[3 * node : 3 * node + 3], zero]):
                    write.append(f"z[b + np.uintp({TOTAL * LANES * place + c})] = {value}")
            add += [
                f"row = np.uintp(N{j}[e + np.uintp({node})])",
                "row = row if row - begin < own else spare",
                f"{way}(totals, np.uintp({TOTAL}) * row, z, b + np.uintp({TOTAL * LANES * place}))",
            ]
        # Vectors round another way than single numbers: which elements are left over must not depend on the tiles.
        lanes = str(LANES) if self.parallel else "count"
        item = ["i = np.uintp(lane)", f"e = np.uintp({nodes}) * (np.uintp(first) + i)"]
        turn = [
            f"columns(s, i + np.uintp({6 * LANES * node}), {LANES}, records, N{j}, e + np.uintp({node}), {nodes})"
            for node in range(nodes)
        ]
        return [
            f"# {force.name}",
            f"if {'elastic and ' * elastic}{self.binder.switch(force)} != 0:",
            f"    for first in range(T{j}[tile], T{j}[tile + 1], {LANES}):",
            f"        count = min({LANES}, T{j}[tile + 1] - first)",
            "        for lane in range(0, count - 7, 8):",
            *indented([*item, *turn], 3),
            "        for lane in range(count - count % 8, count):",
            *indented(item, 3),
            f"            for node in range({nodes}):",
            f"                row = np.uintp({RECORD}) * np.uintp(N{j}[e + np.uintp(node)])",
            "                for c in range(6):",
            f"                    s[i + np.uintp({6 * LANES} * node + {LANES} * c)] = records[row + np.uintp(c)]",
            f"        for lane in range({lanes}):",
            "            i = np.uintp(lane)",
            "            u = np.uintp(first) + i",
            f"            b = np.uintp({TOTAL}) * i",
            *indented([*text.lines, *write], 3),
            "        for lane in range(count):",
            *indented([*item, f"b = np.uintp({TOTAL}) * i", *add], 3),
        ]


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


def _negative(terms: Terms) -> Terms:
    """Terms with the other sign (see `different`)."""
    return [None if term is None else (term[0], "+" if term[1] == "-" else "-") for term in terms]


def different(traced: Traced) -> tuple[Traced, Terms]:
    """A law without the outputs that are another one with the other sign.

    Returns
    -------
    law : its outputs are the forces that are different.
    terms : number and sign of the one that each output of the law is; None for 0.
    """
    program = expanded(traced.program)
    found: dict[int, int] = {}
    terms: Terms = []
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
class Tiled:
    """The elements of a family tile by tile; one between several tiles is there for each.

    Attributes
    ----------
    order : of the elements: tile by tile, and within one by their number, shape (e,).
    nodes : row of each node within its island, shape (e * k,).
    start : first element of each tile, shape (tiles + 1,).
    """

    order: NDArray[np.intp]
    nodes: NDArray[np.int32]
    start: NDArray[np.int64]


def tiled(places: NDArray[np.intp], cuts: NDArray[np.int64], first: NDArray[np.int64]) -> Tiled:
    """Sort elements into tiles.

    Parameters
    ----------
    places : rows of each element, shape (e, k).
    cuts : first row of each tile, shape (tiles + 1,).
    first : first row of the island of each tile, shape (tiles,).
    """
    tile = np.searchsorted(cuts, places, side="right") - 1
    anew = np.ones(tile.shape, bool)
    for node in range(1, tile.shape[1]):
        anew[:, node] = (tile[:, :node] != tile[:, node : node + 1]).all(axis=1)
    element, which = np.nonzero(anew)
    tile = tile[element, which]
    by_tile = np.argsort(tile, kind="stable")
    order, tile = element[by_tile], tile[by_tile]
    start = np.searchsorted(tile, np.arange(len(cuts)), side="left").astype(np.int64)
    local = places[order] - first[tile][:, None]
    return Tiled(order, local.astype(np.int32).ravel(), start)


@dataclass(frozen=True, eq=False)
class Incidence(Tiled):
    """The elements of a family island by island, and those of each row.

    Attributes
    ----------
    ends : start of each row's entries in `entries`, shape (rows + 1,).
    entries : element within its island times k plus node, for each row by element, shape (e * k,).
    """

    ends: NDArray[np.int64]
    entries: NDArray[np.int32]


def incidence(places: NDArray[np.intp], first: NDArray[np.int64]) -> Incidence:
    """Sort the elements of a group of islands.

    Parameters
    ----------
    places : rows of each element, shape (e, k), all of the group.
    first : first row of each island, shape (islands + 1,).
    """
    islands, k = tiled(places, first, first[:-1]), places.shape[1]
    rows = places[islands.order].ravel()
    own = np.arange(len(rows)) - k * np.repeat(islands.start[:-1], k * np.diff(islands.start))
    by_row = np.argsort(rows, kind="stable")
    ends = np.searchsorted(rows[by_row], np.arange(first[-1] + 1), side="left").astype(np.int64)
    return Incidence(islands.order, islands.nodes, islands.start, ends, own[by_row].astype(np.int32))
