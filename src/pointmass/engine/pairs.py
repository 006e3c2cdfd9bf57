"""Prints the kernels of forces between pairs of particles: all pairs, or those of a list of neighbours.

What the others do to a particle is added up in an order that depends on no thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.binding import Binder
from pointmass.engine.printing import indented, statements
from pointmass.laws.pairs import PairForce
from pointmass.particles import Particles
from pointmass.system import ParticleSystem
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Program
from pointmass.tracing.trace import trace, vector_names

TILES = {True: 256, False: 16}  # particles of all pairs whose sums grow side by side: parallel or not
TEAMS = 32  # of tiles, at most: threads wait for each other after each of as many rounds, and half as many can work
BLOCK = 256  # partners whose sum is taken in the kernel's precision, before it is added in float64
UNROLL = 4  # partners for each pass over a tile
LANES = {"float32": 16, "float64": 8}  # sums of a particle that grow side by side
SKIN = 0.15  # of the cut-off: how much farther the list of neighbours looks
PIECE = 256  # neighbours whose numbers are brought together at a time
CHUNK = 64  # particles that one thread takes at a time
HEAD = 8  # numbers about the list (known, room, most, how often found, records, room for records), then flags of chunks
NEAR_LANES = 8  # neighbours of a particle are a multiple of these: sums that grow side by side
FINE = (3, 1, 1)  # cells to a cut-off and skin along each axis: a row of cells along x is one stretch of the list
SMALLEST = 1e-9  # cut-off [m], for balls without a radius
SLOPES = 21  # numbers of a row for implicit solvers: df/dx and df/dv by its own state, and a sum of products
FULL = 16  # status: the list has too little room

Rows = NDArray[np.intp]
Slopes = NDArray[np.object_]  # expressions of slopes: axis of the force, 0: x, 1: v, axis


class Pairs:
    """A pair force in a kernel.

    Attributes
    ----------
    text : its functions; those to call are `pairs{number}` and, for implicit solvers, `slopes{number}`.
    arguments : arrays of the kernel that belong to it (`PairArrays.arrays`): H (rows), W (work), F (forces of all rows,
        shape (3 n,)); within a cut-off also K (head), L (cells), N (neighbours), X (positions when these were found);
        where not all act on all A: H begins with those that are acted on, A[1] of them, and ends with those that act,
        from A[0] on; for implicit solvers those of its part of the matrix (`blocks`) and D, for each row df/dx, df/dv
        by its own state and what `slopes` adds up.
    blocks : of the matrix, beside its diagonal: I (for each row the first of its blocks, and how many), O (column of
        each), Y (its 9 numbers).
    locals : what a call for one island takes besides, its range s, e in H.

    Parameters
    ----------
    searches : functions that search for neighbours and are printed already, text -> name; new ones are added.
    implicit : whether its slopes are wanted; there are some where `has_slopes`.
    """

    def __init__(
        self,
        force: PairForce,
        number: int,
        binder: Binder,
        parallel: bool,
        searches: dict[str, str] | None = None,
        implicit: bool = False,
    ) -> None:
        self.force, self.number, self.binder = force, number, binder
        self._searches: dict[str, str] = {} if searches is None else searches
        self.loop = "prange" if parallel else "range"
        self.flags = "parallel=True, **OWNING" if parallel else "forceinline=False, **OWNING"  # long, and called often
        self.tile = TILES[parallel]
        self.near = force.reach(binder.particles) is not None
        self.one_way = force.by is not None
        self.implicit = implicit
        self.blocks = [f"{a}{number}" for a in "IOY" * implicit]
        self.arguments = [f"{a}{number}" for a in "HWF" + "KLNX" * self.near + "A" * self.one_way]
        self.arguments += [*self.blocks, *[f"D{number}"] * implicit]
        self.begin, self.acted = ("A[0]", "A[1]") if self.one_way else ("0", "m")
        self.locals = [f"s{number}", f"e{number}"]
        self._law = _Law(force, f"f{number}", binder, self.near)
        self.quantities = len(self._law.quantities)
        self.text = self._near() if self.near else self._all()

    def call(self, t: str = "t", x: str = "x", v: str = "v") -> str:
        """The call that fills F for an island, whose value is a status; it stands where base, P and C are known."""
        return self._called("pairs", t, x, v)

    def slopes_call(self, gap: str) -> str:
        """The call that fills the blocks with gamma df/dv + gamma^2 df/dx, made symmetric, and D, whose sums are the
        products of df/dx, without its diagonal, and a vector; it stands where g, x and v are known, too."""
        return self._called("slopes", "g", gap, "t", "x", "v")

    def slope(self, k: int) -> str:
        """Number k of what `slopes` finds for particle g_, as an expression."""
        return f"D{self.number}[np.uintp({SLOPES} * g_ + {k})]"

    def off(self) -> list[str]:
        """Statements that empty the blocks of an island."""
        return [f"for i in {self.loop}(n):", f"    I{self.number}[2 * (base + i) + 1] = 0"]

    def _called(self, function: str, *more: str) -> str:
        arguments = ["base", *self.locals, "P", self.binder.particle.name, *self.arguments, *more]
        return f"{function}{self.number}({', '.join(arguments)})"

    def _head(self, function: str = "pairs", *more: str) -> list[str]:
        names = ["base", "s", "e", "P", self.binder.particle.name, *(a[0] for a in self.arguments), *more]
        return [
            f"@njit({self.flags})",
            f"def {function}{self.number}({', '.join([*names, 't', 'x', 'v'])}):",
            *indented([*self.binder.numbers.lines(), "status = 0", *self._law.at_time, "m = e - s"], 1),
        ]

    def _all(self) -> str:
        """All threads share one large island and take each pair once; one thread gets islands that are often small."""
        size, loop = self.tile, self.loop
        body = [
            f"n = (m + {size - 1}) // {size} * {size}",
            f"for i in {loop}(n):",
            "    g = H[s + min(np.int64(i), m - 1)]",
            *indented(self._law.copies("i"), 1),
            *(self._tiles_of_two() if loop == "prange" and not self.one_way else self._tile_by_tile()),
            "return status",
        ]
        return "\n".join([*self._head(), *indented(body, 1), ""])

    def _careful(self, first: str, end: str, sums: list[int]) -> list[str]:
        """Statements that add some partners to the sums of a tile, none to itself."""
        law, size = self._law, self.tile
        lanes = {q: f"z[{k * size} + l]" for k, q in enumerate(law.first)}
        lines, outputs = law.pair(lanes, {q: f"b_{k}" for k, q in enumerate(law.second)}, "c_")
        return [
            f"for j in range({first}, {end}):",
            *(f"    b_{k} = {law.entry(q, 'j')}" for k, q in enumerate(law.second)),
            f"    for l in range({size}):",
            *indented(lines, 2),
            "        other = lo + l != j",
            *(
                f"        z[{a} + l] = z[{a} + l] + ({o} if other else R(0))"
                for a, o in zip(sums, outputs, strict=True)
            ),
        ]

    def _tile_by_tile(self) -> list[str]:
        """Every particle of a tile with all others, block by block."""
        law, size = self._law, self.tile
        lanes = {q: f"z[{k * size} + l]" for k, q in enumerate(law.first)}
        sums = [(len(law.first) + k) * size for k in range(law.sums)]

        many = [law.pair(lanes, {q: f"b{u}_{k}" for k, q in enumerate(law.second)}, f"q{u}_") for u in range(UNROLL)]
        added = [" + ".join([f"z[{a} + l]", *(outputs[k] for _, outputs in many)]) for k, a in enumerate(sums)]
        plain = [
            f"for j in range(block, end, {UNROLL}):",
            *(f"    b{u}_{k} = {law.entry(q, f'j + {u}')}" for u in range(UNROLL) for k, q in enumerate(law.second)),
            f"    for l in range({size}):",
            *indented([line for lines, _ in many for line in lines], 2),
            *(f"        z[{a} + l] = {text}" for a, text in zip(sums, added, strict=True)),
        ]
        tile = [
            f"lo = np.int64(tile) * {size}",
            f"z = np.empty({(len(law.first) + law.sums) * size}, R)",
            f"total = np.zeros({law.sums * size})",
            f"for l in range({size}):",
            *(f"    {lanes[q]} = {law.entry(q, 'lo + l')}" for q in law.first),
            f"for block in range({self.begin}, m, {BLOCK}):",
            f"    end = min(block + {BLOCK}, m)",
            f"    for l in range({law.sums * size}):",
            f"        z[{sums[0]} + l] = R(0)",
            f"    if (block < lo + {size} and lo < end) or end - block < {BLOCK}:",
            *indented(self._careful("block", "end", sums), 2),
            "    else:",
            *indented(plain, 2),
            f"    for l in range({law.sums * size}):",
            f"        total[l] = total[l] + z[{sums[0]} + l]",
            f"for l in range(min({size}, {self.acted} - lo)):",
            *(f"    sum{k} = R(total[{k * size} + l])" for k in range(law.sums)),
            *indented(law.result("H[s + lo + l]", "lo + l"), 1),
        ]
        return [f"for tile in {self.loop}(({self.acted} + {size - 1}) // {size}):", *indented(tile, 1)]

    def _tiles_of_two(self) -> list[str]:
        """Every pair once, for both: teams of tiles meet as in a tournament, so that no two threads add to one tile.

        A few particles of tile a at a time meet all of tile b, a vector lane each. What lane l of b adds to one of a
        goes to where lane l + `lanes` goes on; so a loop without dependence leaves as many sums as there are lanes.
        """
        law, size = self._law, self.tile
        both = [q for q in law.quantities if q in law.first or q in law.second]
        lanes = {q: f"y[{k * size} + l]" for k, q in enumerate(both)}
        sums = [(len(both) + k) * size for k in range(law.sums)]  # of the tile of the lanes
        width, step = LANES[self.binder.dtype], size + LANES[self.binder.dtype]
        own = [[sums[-1] + size + (u * law.sums + k) * step for k in range(law.sums)] for u in range(UNROLL)]
        every = [a for each in own for a in each]

        many = [law.mirrored({q: f"b{u}_{k}" for k, q in enumerate(both)}, lanes, f"q{u}_") for u in range(UNROLL)]
        alone = [
            f"lo = np.int64(tile) * {size}",
            f"z = np.zeros({sums[-1] + size}, R)",
            f"for l in range({size}):",
            *(f"    z[{k * size} + l] = {law.entry(q, 'lo + l')}" for k, q in enumerate(law.first)),
            *self._careful("lo", f"min(lo + {size}, m)", sums),
            f"for l in range({size}):",
            *(f"    total[{k} * n + lo + l] = z[{a} + l]" for k, a in enumerate(sums)),
        ]
        meet = [
            f"lo = min(a, b) * {size}",
            f"hi = max(a, b) * {size}",
            f"many = min({size}, m - hi)",
            f"z = np.zeros({every[-1] + step}, R)",
            f"y = z[{size} - many:]",
            "for l in range(many):",
            *(f"    {lanes[q]} = {law.entry(q, 'hi + l')}" for q in both),
            f"for i in range(lo, lo + {size}, {UNROLL}):",
            *(f"    b{u}_{k} = {law.entry(q, f'i + {u}')}" for u in range(UNROLL) for k, q in enumerate(both)),
            f"    for l in range({width}):",
            *(f"        y[{a} + l] = R(0)" for a in every),
            "    for l in range(many):",
            *indented([line for lines, _, _ in many for line in lines], 2),
            *(
                f"        y[{a + width} + l] = y[{a} + l] + {o}"
                for each, (_, outputs, _) in zip(own, many, strict=True)
                for a, o in zip(each, outputs, strict=True)
            ),
            *(
                f"        y[{a} + l] = {' + '.join([f'y[{a} + l]', *(others[k] for _, _, others in many)])}"
                for k, a in enumerate(sums)
            ),
            *indented(_halves([a + size for a in every], width), 1),
            *(
                f"    total[{k} * n + i + {u}] += z[{a + size}]"
                for u, each in enumerate(own)
                for k, a in enumerate(each)
            ),
            "for l in range(many):",
            *(f"    total[{k} * n + hi + l] += y[{a} + l]" for k, a in enumerate(sums)),
        ]
        return [
            f"tiles = n // {size}",
            f"total = np.empty({law.sums} * n)",
            "for tile in prange(tiles):",
            *indented(alone, 1),
            f"group = (tiles + {TEAMS - 1}) // {TEAMS}",
            "teams = (tiles + group - 1) // group",
            "teams += teams % 2",
            "for turn in range(teams):",
            "    tables = teams // 2 if turn > 0 else teams",  # a choice within prange() would leave it to one thread
            "    for table in prange(tables):",
            "        first = np.int64(table)",
            "        second = first",
            "        if turn > 0:",
            "            first = (turn + np.int64(table)) % (teams - 1)",
            "            second = (turn - np.int64(table)) % (teams - 1) if table > 0 else teams - 1",
            "        for a in range(first * group, min((first + 1) * group, tiles)):",
            "            for b in range(second * group, min((second + 1) * group, tiles)):",
            "                if first != second or a < b:",
            *indented(meet, 5),
            "for k in prange(m):",
            *(f"    sum{k} = R(total[{k} * n + k])" for k in range(law.sums)),
            *indented(law.result("H[s + k]", "k"), 1),
        ]

    def _near(self) -> str:
        law = self._law
        inputs = {q: f"y[4 * q + {a}]" for a, q in enumerate(law.packed)}
        more = [q for q in law.second if q not in law.packed]
        inputs |= {q: f"y[{(4 + k) * PIECE} + q]" for k, q in enumerate(more)}
        step = PIECE + NEAR_LANES
        sums = [k * step for k in range(law.sums)]
        own = {q: f"a{k}" for k, q in enumerate(law.first)}
        lines, outputs = law.pair(own, inputs, "q_")
        particle = [
            "k = np.int64(L[2 * top + r])",
            *(f"{own[q]} = {law.entry(q, 'k')}" for q in law.first),
            *(f"sum{k} = R(0)" for k in range(law.sums)),
            f"for piece in range(r * room, r * room + np.int64(L[top + r]), {PIECE}):",
            f"    many = min({PIECE}, r * room + np.int64(L[top + r]) - piece)",
            "    for q in range(many):",
            "        b = np.uintp(N[np.uintp(piece + q)])",
            # all four before one is written: then they move as one vector
            *(f"        b{a} = W[np.uintp(4) * b + np.uintp({a})]" for a in range(4)),
            *(f"        y[np.uintp(4 * q + {a})] = b{a}" for a in range(4)),
            *(f"        {inputs[q]} = {law.entry(q, 'b')}" for q in more),
            f"    u = z[{PIECE} - many:]",
            f"    for l in range({NEAR_LANES}):",
            *(f"        u[{a} + l] = R(0)" for a in sums),
            "    for q in range(many):",
            *indented(lines, 2),
            *(f"        d{a} = {own[q]} - {inputs[q]}" for a, q in enumerate(vector_names("x"))),
            f"        near = d0 * d0 + d1 * d1 + d2 * d2 < {'cut2' if len(law.packed) == 4 else 'y[4 * q + 3]'}",
            *(
                f"        u[{a + NEAR_LANES} + q] = u[{a} + q] + ({o} if near else R(0))"
                for a, o in zip(sums, outputs, strict=True)
            ),
            *indented(_halves([a + PIECE for a in sums], NEAR_LANES), 1),
            *(f"    sum{k} = sum{k} + z[{a + PIECE}]" for k, a in enumerate(sums)),
            *law.result("H[s + L[k]]", "k"),
        ]
        scratch = [f"y = np.empty({(4 + len(more)) * PIECE}, R)", f"z = np.empty({law.sums * step}, R)"]
        name, build = self._build()
        listed = self._listed(name)
        parts = [*build, *self._head(), *indented([*listed, *self._each(scratch, particle), "return status"], 1)]
        if self.implicit:
            parts += ["", "", *self._head("slopes", "gamma", "gap")]
            parts += indented([*listed, "gg = gamma * gamma", *self._each([], self._slopes()), "return status"], 1)
        return "\n".join([*parts, ""])

    def _each(self, scratch: list[str], particle: list[str]) -> list[str]:
        """A loop over the particles that are acted on, the sorted ones r."""
        return [
            f"for chunk in {self.loop}(({self.acted} + {CHUNK - 1}) // {CHUNK}):",
            *indented(scratch, 1),
            f"    for r in range(np.int64(chunk) * {CHUNK}, min({self.acted}, (np.int64(chunk) + 1) * {CHUNK})):",
            *indented(particle, 2),
        ]

    def _slopes(self) -> list[str]:
        """Statements that find the blocks of the row of a particle."""
        law = self._law
        own, other = ({q: law.entry(q, place) for q in law.quantities} for place in ("k", "b"))
        lines, first, second, turned = law.slopes(own, other, "j_")
        axes = range(3)
        places = [(i, c) for i in axes for c in axes]
        sums = [*(f"{q}{i}{c}" for q in "ab" for i, c in places), "l0", "l1", "l2"]
        block = []
        for i, c in places:
            slope, back = (f"R(0.5) * ({second[i, q, c]} + {turned[c, q, i]})" for q in (0, 1))
            block.append(f"Y[np.uintp(9) * o + np.uintp({3 * i + c})] = gamma * ({back}) + gg * ({slope})")
        pulls = [" + ".join(f"{second[i, 0, c]} * gap[g2 + np.uintp({c})]" for c in axes) for i in axes]
        near = [
            *lines,
            "there = np.int64(H[s + L[b]]) - base",
            "g2 = np.uintp(3 * there)",
            "o = np.uintp(found)",
            "O[o] = there",
            *block,
            *(f"{q}{i}{c} = {q}{i}{c} + {first[i, k, c]}" for k, q in enumerate("ab") for i, c in places),
            *(f"l{i} = l{i} + ({pull})" for i, pull in enumerate(pulls)),
            "found += 1",
        ]
        return [
            "k = np.int64(L[2 * top + r])",
            *(f"{name} = R(0)" for name in sums),
            "found = r * room",
            "for q in range(r * room, r * room + np.int64(L[top + r])):",
            "    b = np.int64(N[np.uintp(q)])",
            *(f"    d{a} = {own[q]} - {other[q]}" for a, q in enumerate(vector_names("x"))),
            f"    if d0 * d0 + d1 * d1 + d2 * d2 < {'cut2' if len(law.packed) == 4 else 'W[4 * b + 3]'}:",
            *indented(near, 2),
            "g1 = np.int64(H[s + L[k]])",
            "I[2 * g1] = r * room",
            "I[2 * g1 + 1] = found - r * room",
            *(f"D[np.uintp({SLOPES} * g1 + {a})] = {name}" for a, name in enumerate(sums)),
        ]

    @property
    def _reaches(self) -> tuple[str, list[str]]:
        """The cut-off, and the sides of a periodic box."""
        force, particles, numbers = self.force, self.binder.particles, self.binder.numbers
        reach = numbers.number(f"reach {id(force)}", lambda: _reach(force, particles))
        axes = range(3 * (force.box is not None))
        return reach, [numbers.number(f"side {id(force)} {a}", _side(force, a)) for a in axes]

    def _build(self) -> tuple[str, list[str]]:
        """The name of the function that lists neighbours, and its text unless there is one of the same text."""
        search = self._search(self.force.box is not None)
        mine = f"build{self.number}"
        name = self._searches.setdefault("\n".join(search), mine)
        text = [f"@njit({self.flags})", f"def {mine}{search[0]}", *search[1:], "", ""]
        return name, text if name == mine else []

    def _listed(self, build: str) -> list[str]:
        """Statements that copy what the law reads, and find the neighbours anew where somebody has moved too far."""
        law, loop = self._law, self.loop
        reach, sides = self._reaches
        copy = [
            "moved = 0",
            f"for k in range(np.int64(chunk) * {CHUNK}, min(total, (np.int64(chunk) + 1) * {CHUNK})):",
            "    g = H[np.uintp(s + L[k])]",
            *indented(law.copies("k", [f" - X[np.uintp({3 + a} * top + k)]" if sides else "" for a in range(3)]), 1),
            *(f"    d{a} = {law.entry(q, 'k')} - X[np.uintp({a} * top + k)]" for a, q in enumerate(vector_names("x"))),
            "    if not d0 * d0 + d1 * d1 + d2 * d2 <= slack2:",
            "        moved = 1",
            f"K[{HEAD} + chunk] = moved",
        ]
        given = ["base", "s", "e", reach, *sides, *"HWKLNX", *"A" * self.one_way, "x"]
        return [
            f"cut2 = {reach} * {reach}",
            f"slack2 = R({0.5 * SKIN} * {0.5 * SKIN}) * cut2",
            "room = K[1]",
            "top = K[5]",
            "n = top + 1",
            "for turn in range(2):",
            "    if K[0] == 0:",
            f"        problem = {build}({', '.join(given)})",
            "        if problem == 1:",
            "            for k in range(3 * m):",
            "                F[3 * H[s + k // 3] + k % 3] = R(np.nan)",
            "        if problem != 0:",
            "            return problem if problem != 1 else status",
            "    total = K[4]",
            f"    chunks = (total + {CHUNK - 1}) // {CHUNK}",
            f"    for chunk in {loop}(chunks):",
            *indented(copy, 2),
            "    for chunk in range(chunks):",
            f"        if K[{HEAD} + chunk] != 0:",
            "            K[0] = 0",
            "    if K[0] != 0:",
            "        break",
        ]

    def _search(self, periodic: bool) -> list[str]:
        """The function that sorts the particles into cells and lists the neighbours of each, from its arguments on.

        In a periodic box the images near its faces are sorted too, so that nobody needs to look across a face: a
        record is a particle or an image of one, sorted; `top` is how many there is room for. Stretches of L, each of
        this length: particle of a record, neighbours of a particle (by its place among the sorted ones), its record,
        cell of a record not yet sorted, the order, particle of a record not yet sorted (less m: an image); then the
        begins of the cells; who does not act is in another cell, where nobody looks. X has positions when the list was
        made, and by how much images were moved, in both orders.
        """
        law, loop = self._law, self.loop
        sides = ["side0", "side1", "side2"] if periodic else []
        names = ["base", "s", "e", "reach", *sides, *"HWKLNX", *"A" * self.one_way, "x"]
        found = [
            *(f"low{a} = min(low{a}, np.float64(u{a}))" for a in range(3)),
            *(f"high{a} = max(high{a}, np.float64(u{a}))" for a in range(3)),
        ]
        if periodic:
            images = [
                *(
                    f"{end}{a} = {sign}1 if x[o + {a}] - h{a} {test} else 0"
                    for a in range(3)
                    for end, sign, test in (("a", "-", f">= side{a} - far"), ("b", "", "<= far"))
                ),
                "for i2 in range(a2, b2 + 1):",
                "    for i1 in range(a1, b1 + 1):",
                "        for i0 in range(a0, b0 + 1):",
                "            itself = i0 == 0 and i1 == 0 and i2 == 0",
                "            L[5 * top + total] = i if itself else i - m",
                *(f"            X[{6 + a} * top + total] = h{a} - i{a} * side{a}" for a in range(3)),
                *(f"            u{a} = x[o + {a}] - X[{6 + a} * top + total]" for a in range(3)),
                *indented(found, 3),
                "            total += 1",
            ]
        else:
            images = [
                *(f"u{a} = x[o + {a}]" for a in range(3)),
                *found,
                "L[5 * top + i] = i",
                "total += 1",
            ]
        finite = [f"abs(x[o + {a}]{f' - h{a}' * periodic}) < np.inf" for a in range(3)]
        counts = []
        for a in range(3):
            most = f"max((high{a} - low{a}) / (far / {FINE[a]}) + 1.0, {2 * FINE[a] + 1}.0)"
            counts.append(f"n{a} = np.int64(min({most}, 1048576.0))")
        place = ["i = np.int64(L[5 * top + q])", "o = 3 * (H[s + (i if i >= 0 else i + m)] - base)"]
        for a in range(3):
            where = f"np.float64(x[o + {a}]{f' - X[{6 + a} * top + q]' * periodic})"
            place += [
                f"u = np.floor(({where} - low{a}) / (far / {FINE[a]}))",
                f"c{a} = max(0, min(n{a} - 1, np.int64(u - n{a} * np.floor(u / n{a}))))",
            ]
        place.append("L[3 * top + q] = (c2 * n1 + c1) * n0 + c0")
        if self.one_way:
            place.append("L[3 * top + q] += cells if (i if i >= 0 else i + m) < A[0] else 0")
        stretch = [
            "for row in range(h1 * h2):",
            "    r1 = (c1 + row % h1 - g1) % n1",
            "    r2 = (c2 + row // h1 - g2) % n2",
            "    first = 6 * top + (r2 * n1 + r1) * n0",
            "    for part in range(2):",
            f"        a = max(c0 - {FINE[0]}, 0)",
            f"        b = min(c0 + {FINE[0] + 1}, n0)",
            f"        if n0 < {2 * FINE[0] + 1}:",
            "            a = 0",
            "            b = n0 if part == 0 else 0",
            "        elif part == 1:",
            f"            a = n0 + c0 - {FINE[0]} if c0 < {FINE[0]} else 0",
            f"            b = n0 if c0 < {FINE[0]} else max(0, c0 + {FINE[0] + 1} - n0)",
            "        a = np.int64(L[first + a])",
            "        b = np.int64(L[first + b])",
        ]
        each = [
            "known = np.int64(-1)",
            f"for r in range(np.int64(chunk) * {CHUNK}, min({self.acted}, (np.int64(chunk) + 1) * {CHUNK})):",
            "    k = np.int64(L[2 * top + r])",
            f"    c = np.int64(L[3 * top + L[4 * top + k]]){' % cells' * self.one_way}",
            "    if c != known:",
            "        known = c",
            "        c0 = c % n0",
            "        c1 = c // n0 % n1",
            "        c2 = c // (n0 * n1)",
            "        many = np.int64(0)",
            *indented(stretch, 2),
        ]
        search = [
            "wide = np.int64(0)",
            *each,
            "                many += max(b - a, 0)",
            "        wide = max(wide, many)",
            "z = np.empty(3 * wide, R)",
            "I = np.empty(wide, np.int32)",
            "B = np.empty(wide, np.int32)",
            "many = np.int64(0)",
            *each,
            "                for q in range(b - a):",
            *(
                f"                    z[np.uintp({a} * wide + many + q)] = X[np.uintp({a} * top + a + q)]"
                for a in range(3)
            ),
            "                    I[np.uintp(many + q)] = a + q",
            "                many += max(b - a, 0)",
            *(f"    p{a} = X[{a} * top + k]" for a in range(3)),
            "    for q in range(many):",
            *(f"        d{a} = p{a} - z[np.uintp({a} * wide) + np.uintp(q)]" for a in range(3)),
            "        B[q] = 1 if d0 * d0 + d1 * d1 + d2 * d2 <= far2 and I[q] != k else 0",
            "    found = 0",
            f"    for piece in range(0, many, {PIECE}):",
            "        start = np.uintp(r * room + min(found, room))",
            "        c = start",
            f"        for q in range(min({PIECE}, many - piece)):",
            "            N[c] = I[np.uintp(piece + q)]",
            "            c += np.uintp(B[np.uintp(piece + q)])",
            "        found += np.int64(c - start)",
            f"    full = (found + {NEAR_LANES - 1}) // {NEAR_LANES} * {NEAR_LANES}",
            "    for q in range(min(found, room), min(full, room)):",
            "        N[r * room + q] = top",
            "    L[top + r] = full",
        ]
        body = [
            "m = e - s",
            "room = K[1]",
            "top = K[5]",
            "n = top + 1",
            f"far = np.float64(reach) * {1 + SKIN}",
            "far2 = R(far * far)",
            "K[3] += 1",
            *(f"low{a} = np.inf" for a in range(3)),
            *(f"high{a} = -np.inf" for a in range(3)),
            "total = 0",
            "for i in range(m):",
            "    o = 3 * (H[s + i] - base)",
            *(f"    h{a} = side{a} * np.floor(x[o + {a}] / side{a})" for a in range(3) if periodic),
            f"    if not ({' and '.join(finite)}):",
            "        return 1",
            *indented(images, 1),
            "K[4] = total",
            *counts,
            f"while n0 * n1 * n2 > {2 if self.one_way else 4} * total + {13 if self.one_way else 27}:",
            "    if n0 >= n1 and n0 >= n2:",
            "        n0 = (n0 + 1) // 2",
            "    elif n1 >= n2:",
            "        n1 = (n1 + 1) // 2",
            "    else:",
            "        n2 = (n2 + 1) // 2",
            "cells = n0 * n1 * n2",
            f"for q in {loop}(total):",
            *indented(place, 1),
            *["cells *= 2"] * self.one_way,
            "for c in range(cells + 1):",
            "    L[6 * top + c] = 0",
            "for q in range(total):",
            "    L[6 * top + L[3 * top + q]] += 1",
            "before = 0",
            "for c in range(cells + 1):",
            "    here = L[6 * top + c]",
            "    L[6 * top + c] = before",
            "    before += here",
            "for q in range(total):",
            "    c = L[3 * top + q]",
            "    L[4 * top + L[6 * top + c]] = q",
            "    L[6 * top + c] += 1",
            "for c in range(cells, 0, -1):",
            "    L[6 * top + c] = L[6 * top + c - 1]",
            "L[6 * top] = 0",
            *["cells = n0 * n1 * n2"] * self.one_way,
            "r = 0",
            "for k in range(total):",
            f"    if {'A[1] > ' * self.one_way}L[5 * top + L[4 * top + k]] >= 0:",
            "        L[2 * top + r] = k",
            "        r += 1",
            f"for k in {loop}(total):",
            "    q = np.int64(L[4 * top + k])",
            "    i = np.int64(L[5 * top + q])",
            "    L[k] = i if i >= 0 else i + m",
            "    o = 3 * (H[s + L[k]] - base)",
            "    for a in range(3):",
            *["        X[(3 + a) * top + k] = X[(6 + a) * top + q]"] * periodic,
            f"        X[a * top + k] = x[o + a]{' - X[(3 + a) * top + k]' * periodic}",
            "    W[4 * k + 3] = reach * reach",
            *(f"{law.entry(q, 'top')} = {'R(np.inf)' if q in vector_names('x') else 'R(0)'}" for q in law.quantities),
            "h1 = min(n1, 3)",
            "h2 = min(n2, 3)",
            "g1 = 1 if n1 > 2 else 0",
            "g2 = 1 if n2 > 2 else 0",
            f"for chunk in {loop}(({self.acted} + {CHUNK - 1}) // {CHUNK}):",
            *indented(search, 1),
            "most = 0",
            f"for r in range({self.acted}):",
            "    most = max(most, L[top + r])",
            "K[2] = most",
            "if most >= room:",
            f"    return {FULL}",
            "K[0] = 1",
            "return 0",
        ]
        return [f"({', '.join(names)}):", *indented(body, 1)]


def _halves(sums: list[int], lanes: int) -> list[str]:
    """Statements that add up the lanes of some sums in z, in pairs."""
    return [
        line
        for half in (lanes >> k for k in range(1, lanes.bit_length()))
        for line in (f"for l in range({half}):", *(f"    z[{a} + l] = z[{a} + l] + z[{a + half} + l]" for a in sums))
    ]


class _Law:
    """A pair law with its inputs found: numbers that all share, and quantities of each particle, which lie in W.

    Attributes
    ----------
    packed : quantities that lie side by side, four numbers for each particle, since neighbours are anywhere; where
        these are the position only, the fourth is the square of the cut-off. Others have a row each.
    """

    def __init__(self, force: PairForce, tag: str, binder: Binder, near: bool) -> None:
        self.force, self.tag, self.binder = force, tag, binder
        self.program = expanded(force.traced.program)
        self.sums = len(self.program.outputs)
        finish = force.traced_finish
        self.finish = None if finish is None else expanded(finish.program)
        needed = self.program.arguments()
        later = set() if self.finish is None else self.finish.arguments()
        common = [p for p in force.parameters if p not in force.per_particle and p in needed | later]
        own = [p for p in force.parameters if p in force.per_particle]
        self.inputs = {
            f"{q[0]}{node}_{q[2]}" if q[1:2] == "_" else f"{q}{node}": (node, q)
            for node in "12"
            for q in (*vector_names("x"), *vector_names("v"), "m", *own)
        }
        place = vector_names("x") if near else ()
        wanted = {node: {q for name, (n, q) in self.inputs.items() if n == node and name in needed} for node in "12"}
        order = [q for node, q in self.inputs.values() if node == "1"]
        self.first, self.second = ([q for q in order if q in wanted[node] or q in place] for node in "12")
        self.quantities = [q for q in order if q in self.first or q in self.second or q in later & set(own)]
        self.packed = [*place, *[q for q in self.second if q not in place][:1]] if near else []
        shared = self._values(common, "")
        owned = self._values([p for p in own if p in self.quantities], "g")
        self.at_time = shared.at_time + owned.at_time
        self.common = dict(zip(common, shared.outputs, strict=True)) | {"t": "R(t)"}
        self._lines = owned.lines
        self._owned = dict(zip([p for p in own if p in self.quantities], owned.outputs, strict=True))

    def entry(self, quantity: str, index: str) -> str:
        """A quantity of a particle in W, as an expression: n is how many particles a row has room for."""
        if quantity in self.packed:
            return f"W[np.uintp(4) * np.uintp({index}) + np.uintp({self.packed.index(quantity)})]"
        row = [q for q in self.quantities if q not in self.packed].index(quantity)
        return f"W[np.uintp({row + 4 * bool(self.packed)} * n) + np.uintp({index})]"

    def copies(self, index: str, moved: Sequence[str] = ("", "", "")) -> list[str]:
        """Statements that write the quantities of the row g to a place in W, positions with something added."""
        expressions = {"m": self.binder.attribute("m", "g")} if "m" in self.quantities else {}
        expressions |= self._owned
        expressions |= {n: f"v[o + np.uintp({a})]" for a, n in enumerate(vector_names("v"))}
        expressions |= {n: f"x[o + np.uintp({a})]{moved[a]}" for a, n in enumerate(vector_names("x"))}
        writes = [f"{self.entry(q, index)} = {expressions[q]}" for q in self.quantities]
        return ["o = np.uintp(3 * (g - base))", *self._lines, *writes]

    def pair(self, first: dict[str, str], second: dict[str, str], prefix: str) -> tuple[list[str], list[str]]:
        """Statements and outputs for one pair, from expressions of the quantities of both."""
        dtype, call = self.binder.dtype, self.binder.caller(self.program)
        return statements(self.program, self._names(first, second), f"{self.tag}{prefix}", dtype, call)

    def mirrored(
        self, first: dict[str, str], second: dict[str, str], prefix: str
    ) -> tuple[list[str], list[str], list[str]]:
        """Statements for one pair, and the outputs for its first and for its second particle."""
        return self._both(self.program, self.program, first, second, prefix)

    def slopes(
        self, own: dict[str, str], other: dict[str, str], prefix: str
    ) -> tuple[list[str], Slopes, Slopes, Slopes]:
        """Statements for one pair, and the slopes of the force on its first particle by the state of the first, by that
        of the second, and of the force on the second by the state of the first."""
        program = self.force.traced_slopes.program
        shape = (self.sums, 2, 2, 3)  # sum, node, x|v, axis
        by_second = np.reshape(program.outputs, shape)[:, 1].ravel().tolist()
        lines, mine, turned = self._both(program, replace(program, outputs=by_second), own, other, prefix)
        slopes = np.reshape(np.array(mine, object), shape)
        return lines, slopes[:, 0], slopes[:, 1], np.reshape(np.array(turned, object), (self.sums, 2, 3))

    def _both(
        self, program: Program, turned: Program, first: dict[str, str], second: dict[str, str], prefix: str
    ) -> tuple[list[str], list[str], list[str]]:
        """Statements of a program for a pair, and of another one for the same pair turned round; outputs of each."""
        both = expanded(program)
        count = len(both.outputs)
        both.outputs += expanded(turned, both, self._turned).outputs
        dtype, call = self.binder.dtype, self.binder.caller(both)
        lines, outputs = statements(both, self._names(first, second), f"{self.tag}{prefix}", dtype, call)
        return lines, outputs[:count], outputs[count:]

    @property
    def _turned(self) -> dict[str, str]:
        """The input of the other particle, for each input of one."""
        places = {place: name for name, place in self.inputs.items()}
        return {name: places["21"["12".index(node)], q] for name, (node, q) in self.inputs.items()}

    def _names(self, first: dict[str, str], second: dict[str, str]) -> dict[str, str]:
        """Expressions of the law's inputs."""
        sides = {"1": first, "2": second}
        return {name: sides[node][q] for name, (node, q) in self.inputs.items() if q in sides[node]} | self.common

    def result(self, row: str, index: str) -> list[str]:
        """Statements that write the force on the particle of a row, whose sums are sum0, sum1, ..."""
        outputs = [f"sum{k}" for k in range(self.sums)]
        lines: list[str] = []
        if self.finish is not None:
            names = {f"sum{k}": f"sum{k}" for k in range(self.sums)} | self.common
            names |= {n: f"{q}[3 * (g - base) + {a}]" for q in "xv" for a, n in enumerate(vector_names(q))}
            names |= {q: self.entry(q, index) for q in self._owned}
            names |= {"m": self.binder.attribute("m", "g")}
            dtype, call = self.binder.dtype, self.binder.caller(self.finish)
            lines, outputs = statements(self.finish, names, f"{self.tag}e_", dtype, call)
        return [f"g = {row}", *lines, *(f"F[3 * g + {a}] = {o}" for a, o in enumerate(outputs))]

    def _values(self, parameters: list[str], index: str) -> Any:
        """How the kernel finds parameters, as outputs."""
        itself = trace(lambda *values: values, dict.fromkeys(parameters, "scalar"), len(parameters), self.force.name)
        return self.binder.law(itself, self.force, {}, index, self.binder.particle, self.tag)


class PairArrays:
    """The arrays of a pair force in a kernel, kept from call to call.

    Parameters
    ----------
    place : row in the kernel of each particle of the system, -1 for those that it does not have, shape (n,).
    """

    def __init__(self, pairs: Pairs, particles: Particles, place: Rows) -> None:
        self.pairs, self.particles = pairs, particles
        self.rows, self._split = _rows(pairs.force, particles, place)
        count, dtype = len(self.rows), particles.dtype
        self._forces = np.zeros(3 * (int(place.max(initial=-1)) + 1), dtype)
        self._work = np.empty(pairs.quantities * -(-count // pairs.tile) * pairs.tile * (not pairs.near), dtype)
        self._head = np.zeros(HEAD, np.int64)
        self._neighbours = np.zeros(0, np.int32)
        self._known: Any = None
        self._blocks: list[Any] = []  # for implicit solvers; what is never used of them costs nothing
        if pairs.implicit:
            kernel = len(self._forces) // 3
            slopes = np.zeros(SLOPES * kernel, dtype)
            self._blocks = [np.zeros(2 * kernel, np.int64), np.zeros(0, np.int32), np.zeros(0, dtype), slopes]

    def arrays(self) -> list[Any]:
        """The kernel's arguments, in the order of `Pairs.arguments`; another cut-off makes it find neighbours anew."""
        split = [self._split] * self.pairs.one_way
        if not self.pairs.near:
            return [self.rows, self._work, self._forces, *split]
        now = self.pairs.force.reach(self.particles), self.pairs.force.box
        if now != self._known:
            self._known = now
            self._begin()
        if 5 * self._head[2] > 4 * self._head[1]:  # before it is full: a run that begins again finds all anew
            self._reserve(int(self._head[2]))
        return [
            self.rows, self._work, self._forces, self._head, self._cells, self._neighbours, self._origin, *split,
            *self._blocks,
        ]  # fmt: skip

    def _begin(self) -> None:
        """Memory for another cut-off; what is never used of it costs nothing."""
        count, dtype, box = len(self.rows), self.particles.dtype, self.pairs.force.box
        far = _reach(self.pairs.force, self.particles) * (1 + SKIN)
        top = count * int(np.prod([2 if 2.01 * far < side else 3 for side in box])) if box else count
        self._work = np.zeros((self.pairs.quantities + 1) * (top + 1), dtype)
        self._cells = np.zeros(10 * top + 28, np.int32)
        self._origin = np.zeros(9 * top if box else 3 * top, dtype)
        self._head = np.zeros(HEAD + -(-top // CHUNK), np.int64)
        self._head[5] = top
        self._reserve(32)

    def forget(self) -> None:
        """Find the neighbours anew at the next call, whatever moved: on the grid of steps from which runs go on."""
        self._head[0] = 0

    def enlarge(self) -> None:
        """Make room after the status FULL; the span is then to be run again from its start."""
        if self._head[2] >= self._head[1]:
            self._reserve(int(self._head[2]))
            self.forget()

    def _reserve(self, most: int) -> None:
        """Room for half as many neighbours again; those that are known stay, so that growing changes no bit."""
        room, old = most * 3 // 2 + 16, int(self._head[1])
        count = int(self._split[1])
        grown = np.zeros(room * count + PIECE, np.int32)
        if old:
            each = min(old, room)
            grown[: room * count].reshape(count, room)[:, :each] = self._neighbours[: old * count].reshape(count, old)[
                :, :each
            ]
        self._head[1], self._neighbours = room, grown
        if self._blocks:
            self._blocks[1:3] = np.empty(room * count, np.int32), np.empty(9 * room * count, self.particles.dtype)


def has_slopes(force: PairForce, system: ParticleSystem) -> bool:
    """Whether implicit solvers have a kernel of a force."""
    near = system.order == 2 and force.reach(system.particles) is not None
    return near and force.finish is None and force.by is None


def _rows(force: PairForce, particles: Particles, place: Rows) -> tuple[Rows, Rows]:
    """The rows of a kernel that are acted on or act, and where in them these begin and those end."""
    on, by = (place[rows][place[rows] >= 0].astype(np.int64) for rows in force.ends(particles))
    both = np.isin(on, by)
    rows = np.concatenate([on[~both], on[both], by[~np.isin(by, on)]])
    return rows, np.array([len(on) - both.sum(), len(on)], np.int64)


def _reach(force: PairForce, particles: Particles) -> float:
    return max(force.reach(particles) or 0.0, SMALLEST)


def _side(force: PairForce, axis: int) -> Callable[[], float]:
    return lambda: force.box[axis]  # type: ignore[index]
