"""Prints the kernels of forces between pairs of particles: all pairs, or those of a list of neighbours.

Every particle adds up by itself what the others do to it, in an order that depends on no thread.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass.engine.binding import Binder
from pointmass.engine.printing import indented, statements
from pointmass.laws.pairs import PairForce
from pointmass.particles import Particles
from pointmass.tracing.columns import expanded
from pointmass.tracing.trace import trace, vector_names

TILES = {True: 256, False: 16}  # particles of all pairs whose sums grow side by side: parallel or not
BLOCK = 256  # partners whose sum is taken in the kernel's precision, before it is added in float64
UNROLL = 4  # partners for each pass over a tile
LANES = {"float32": 16, "float64": 8}  # sums of a particle that grow side by side
SKIN = 0.15  # of the cut-off: how much farther the list of neighbours looks
PIECE = 256  # neighbours whose numbers are brought together at a time
CHUNK = 64  # particles that one thread takes at a time
HEAD = 8  # numbers about the list, before the flags of the chunks
FINE = (4, 1, 1)  # cells to a cut-off and skin along each axis: a row of cells along x is one stretch of the list
SMALLEST = 1e-9  # cut-off [m], for balls without a radius
FULL = 16  # status: the list has too little room

Rows = NDArray[np.intp]


class Pairs:
    """A pair force in a kernel.

    Attributes
    ----------
    text : its functions; the one to call is `pairs{number}`.
    arguments : arrays of the kernel that belong to it (`PairArrays.arrays`): H (rows), W (work), F (forces of all rows,
        shape (3 n,)); within a cut-off also K (head), L (cells), N (neighbours), X (positions when these were found).
    locals : what a call for one island takes besides, its range s, e in H.
    """

    def __init__(self, force: PairForce, number: int, binder: Binder, parallel: bool) -> None:
        self.force, self.number, self.binder = force, number, binder
        self.loop = "prange" if parallel else "range"
        self.flags = "parallel=True, **FLAGS" if parallel else "**FLAGS"
        self.tile = TILES[parallel]
        self.near = force.reach(binder.particles) is not None
        self.arguments = [f"{a}{number}" for a in ("HWFKLNX" if self.near else "HWF")]
        self.locals = [f"s{number}", f"e{number}"]
        self._law = _Law(force, f"f{number}", binder, self.near)
        self.quantities = len(self._law.quantities)
        self.text = self._near() if self.near else self._all()

    def call(self, t: str = "t", x: str = "x", v: str = "v") -> str:
        """The call that fills F for an island, whose value is a status; it stands where base, P and C are known."""
        arguments = ["base", *self.locals, "P", self.binder.particle.name, *self.arguments, t, x, v]
        return f"pairs{self.number}({', '.join(arguments)})"

    def _head(self) -> list[str]:
        j, law = self.number, self._law
        names = ["base", "s", "e", "P", self.binder.particle.name, *(a[0] for a in self.arguments), "t", "x", "v"]
        return [
            f"@njit({self.flags})",
            f"def pairs{j}({', '.join(names)}):",
            *indented([*self.binder.numbers.lines(), "status = 0", *law.at_time, "m = e - s"], 1),
        ]

    def _all(self) -> str:
        """All threads share one large island and take each pair once; one thread gets islands that are often small."""
        size, loop = self.tile, self.loop
        body = [
            f"n = (m + {size - 1}) // {size} * {size}",
            f"for i in {loop}(n):",
            "    g = H[s + min(np.int64(i), m - 1)]",
            *indented(self._law.copies("n", "i"), 1),
            *(self._tiles_of_two() if loop == "prange" else self._tile_by_tile()),
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
            *(f"    b_{k} = W[{law.row(q)} * n + j]" for k, q in enumerate(law.second)),
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
            *(f"    b{u}_{k} = W[{law.row(q)} * n + j + {u}]" for u in range(UNROLL) for k, q in enumerate(law.second)),
            f"    for l in range({size}):",
            *indented([line for lines, _ in many for line in lines], 2),
            *(f"        z[{a} + l] = {text}" for a, text in zip(sums, added, strict=True)),
        ]
        tile = [
            f"lo = np.int64(tile) * {size}",
            f"z = np.empty({(len(law.first) + law.sums) * size}, R)",
            f"total = np.zeros({law.sums * size})",
            f"for l in range({size}):",
            *(f"    {lanes[q]} = W[{law.row(q)} * n + lo + l]" for q in law.first),
            f"for block in range(0, m, {BLOCK}):",
            f"    end = min(block + {BLOCK}, m)",
            f"    for l in range({law.sums * size}):",
            f"        z[{sums[0]} + l] = R(0)",
            f"    if (block < lo + {size} and lo < end) or end - block < {BLOCK}:",
            *indented(self._careful("block", "end", sums), 2),
            "    else:",
            *indented(plain, 2),
            f"    for l in range({law.sums * size}):",
            f"        total[l] = total[l] + z[{sums[0]} + l]",
            f"for l in range(min({size}, m - lo)):",
            *(f"    sum{k} = R(total[{k * size} + l])" for k in range(law.sums)),
            *indented(law.result("H[s + lo + l]", "lo + l", "n"), 1),
        ]
        return [f"for tile in range(n // {size}):", *indented(tile, 1)]

    def _tiles_of_two(self) -> list[str]:
        """Every pair once, for both: tiles meet as in a tournament, so that no two threads add to the same tile.

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
            *(f"    z[{k * size} + l] = W[{law.row(q)} * n + lo + l]" for k, q in enumerate(law.first)),
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
            *(f"    {lanes[q]} = W[{law.row(q)} * n + hi + l]" for q in both),
            f"for i in range(lo, lo + {size}, {UNROLL}):",
            *(f"    b{u}_{k} = W[{law.row(q)} * n + i + {u}]" for u in range(UNROLL) for k, q in enumerate(both)),
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
            "teams = tiles + tiles % 2",
            "for turn in range(teams - 1):",
            "    for table in prange(teams // 2):",
            "        a = (turn + np.int64(table)) % (teams - 1)",
            "        b = (turn - np.int64(table)) % (teams - 1) if table > 0 else teams - 1",
            "        if max(a, b) < tiles:",
            *indented(meet, 3),
            "for k in prange(m):",
            *(f"    sum{k} = R(total[{k} * n + k])" for k in range(law.sums)),
            *indented(law.result("H[s + k]", "k", "n"), 1),
        ]

    def _near(self) -> str:
        j, law, loop = self.number, self._law, self.loop
        force, particles = self.force, self.binder.particles
        reach = self.binder.numbers.number(f"reach {id(force)}", lambda: _reach(force, particles))
        sides = (
            [self.binder.numbers.number(f"side {id(force)} {a}", _side(force, a)) for a in range(3)]
            if force.box is not None
            else []
        )
        lanes = LANES[self.binder.dtype]
        inputs = {q: f"z[{k * PIECE} + q]" for k, q in enumerate(law.second)}
        sums = [len(law.second) * PIECE + k * (PIECE + lanes) for k in range(law.sums)]
        width = len(law.second) * PIECE + law.sums * (PIECE + lanes)
        own = {q: f"a{k}" for k, q in enumerate(law.first)}
        lines, outputs = law.pair(own, inputs, "q_")
        place = vector_names("x")
        images = [
            f"{inputs[q]} = {inputs[q]} + {side} * np.floor(({own[q]} - {inputs[q]}) * i{side} + R(0.5))"
            for q, side in zip(place, sides, strict=False)
        ]
        particle = [
            *(f"{own[q]} = W[{law.row(q)} * m + k]" for q in law.first),
            "count = np.int64(L[m + k])",
            "at = k * room",
            f"for l in range({lanes}):",
            *(f"    z[{a} + l] = R(0)" for a in sums),
            f"for piece in range(0, count, {PIECE}):",
            f"    many = min({PIECE}, count - piece)",
            f"    full = (many + {lanes - 1}) // {lanes} * {lanes}",
            "    for q in range(many):",
            "        b = np.uintp(N[np.uintp(at + piece + q)])",
            *(f"        {inputs[q]} = W[np.uintp({law.row(q)} * m) + b]" for q in law.second),
            "    for q in range(many, full):",
            *(f"        {inputs[q]} = {'R(np.inf)' if q in place else 'R(0)'}" for q in law.second),
            *indented(["if L[2 * m + k] != 0:", "    for q in range(full):", *indented(images, 2)] if sides else [], 1),
            "    for q in range(full):",
            *indented(lines, 2),
            *(f"        d{a} = {own[q]} - {inputs[q]}" for a, q in enumerate(place)),
            "        near = d0 * d0 + d1 * d1 + d2 * d2 < cut2",
            *(
                f"        z[{a + lanes} + q] = z[{a} + q] + ({o} if near else R(0))"
                for a, o in zip(sums, outputs, strict=True)
            ),
            f"    for l in range({lanes}):",
            *(f"        z[{a} + l] = z[{a} + full + l]" for a in sums),
            *_halves(sums, lanes),
            *(f"sum{k} = z[{a}]" for k, a in enumerate(sums)),
            *law.result("H[s + L[k]]", "k", "m"),
        ]
        copy = [
            "moved = 0",
            f"for k in range(np.int64(chunk) * {CHUNK}, min(m, (np.int64(chunk) + 1) * {CHUNK})):",
            "    g = H[np.uintp(s + L[k])]",
            *indented(law.copies("m", "k"), 1),
            *(f"    r{a} = np.uintp({a} * m + k)" for a in range(3)),
            *(f"    W[r{a}] = W[r{a}] - X[np.uintp(3 * m) + r{a}]" for a in range(3) if sides),
            *(f"    d{a} = W[r{a}] - X[r{a}]" for a in range(3)),
            "    if not d0 * d0 + d1 * d1 + d2 * d2 <= slack2:",
            "        moved = 1",
            f"K[{HEAD} + chunk] = moved",
        ]
        build = f"build{j}({', '.join(['base', 's', 'e', reach, *sides, 'H', 'W', 'K', 'L', 'N', 'X', 'x'])})"
        body = [
            f"cut2 = {reach} * {reach}",
            f"slack2 = R({0.5 * SKIN} * {0.5 * SKIN}) * cut2",
            *(f"i{side} = R(1) / {side}" for side in sides),
            "room = K[1]",
            f"chunks = (m + {CHUNK - 1}) // {CHUNK}",
            "for turn in range(2):",
            "    if K[0] == 0:",
            f"        problem = {build}",
            "        if problem == 1:",
            "            for k in range(3 * m):",
            "                F[3 * H[s + k // 3] + k % 3] = R(np.nan)",
            "        if problem != 0:",
            "            return problem if problem != 1 else status",
            f"    for chunk in {loop}(chunks):",
            *indented(copy, 2),
            "    for chunk in range(chunks):",
            f"        if K[{HEAD} + chunk] != 0:",
            "            K[0] = 0",
            "    if K[0] != 0:",
            "        break",
            f"for chunk in {loop}(chunks):",
            f"    z = np.empty({width}, R)",
            f"    for k in range(np.int64(chunk) * {CHUNK}, min(m, (np.int64(chunk) + 1) * {CHUNK})):",
            *indented(particle, 2),
            "return status",
        ]
        return "\n".join([*self._build(bool(sides)), "", "", *self._head(), *indented(body, 1), ""])

    def _build(self, periodic: bool) -> list[str]:
        """The function that sorts the particles into cells and lists the neighbours of each."""
        sides = ["side0", "side1", "side2"] if periodic else []
        names = ["base", "s", "e", "reach", *sides, "H", "W", "K", "L", "N", "X", "x"]
        axes = []
        for a in range(3):
            if periodic:
                axes += [
                    f"side = side{a}",
                    f"n{a} = np.int64(max(1.0, min(np.floor(side / (far / {FINE[a]})), 1048576.0)))",
                    "for i in range(m):",
                    f"    X[{3 + a} * m + i] = side * np.floor(x[3 * (H[s + i] - base) + {a}] / side)",
                ]
            else:
                axes += [
                    f"low{a} = np.inf",
                    "high = -np.inf",
                    "for i in range(m):",
                    f"    u = np.float64(x[3 * (H[s + i] - base) + {a}])",
                    f"    low{a} = min(low{a}, u)",
                    "    high = max(high, u)",
                    f"most = min(max((high - low{a}) / (far / {FINE[a]}) + 1.0, {2 * FINE[a] + 1}.0), 1048576.0)",
                    f"n{a} = np.int64(most)",
                ]
        place = []
        for a in range(3):
            value = f"x[3 * (H[s + i] - base) + {a}]"
            if periodic:
                place.append(f"u = np.float64({value} - X[{3 + a} * m + i]) / (np.float64(side{a}) / n{a})")
            else:
                place.append(f"u = np.floor((np.float64({value}) - low{a}) / (far / {FINE[a]}))")
                place.append(f"u = u - n{a} * np.floor(u / n{a})")
            place.append(f"c{a} = max(0, min(n{a} - 1, np.int64(u)))")
        candidate = [f"e{a} = abs(p{a} - W[w{a} + np.uintp(q)])" for a in range(3)]
        candidate += [f"e{a} = min(e{a}, side{a} - e{a})" for a in range(3) if periodic]
        search = [
            f"z = np.empty({PIECE}, R)",
            f"for k in range(np.int64(chunk) * {CHUNK}, min(m, (np.int64(chunk) + 1) * {CHUNK})):",
            "    c = np.int64(L[3 * m + L[k]])",
            "    c0 = c % n0",
            "    c1 = c // n0 % n1",
            "    c2 = c // (n0 * n1)",
            *(f"    p{a} = W[{a} * m + k]" for a in range(3)),
            "    at = k * room",
            "    found = 0",
            "    for row in range(h1 * h2):",
            "        r1 = (c1 + row % h1 - g1) % n1",
            "        r2 = (c2 + row // h1 - g2) % n2",
            "        first = 4 * m + (r2 * n1 + r1) * n0",
            "        for part in range(2):",
            f"            a = max(c0 - {FINE[0]}, 0)",
            f"            b = min(c0 + {FINE[0] + 1}, n0)",
            f"            if n0 < {2 * FINE[0] + 1}:",
            "                a = 0",
            "                b = n0 if part == 0 else 0",
            "            elif part == 1:",
            f"                a = n0 + c0 - {FINE[0]} if c0 < {FINE[0]} else 0",
            f"                b = n0 if c0 < {FINE[0]} else max(0, c0 + {FINE[0] + 1} - n0)",
            "            stop = np.int64(L[first + b])",
            f"            for piece in range(np.int64(L[first + a]), stop, {PIECE}):",
            f"                many = min({PIECE}, stop - piece)",
            *(f"                w{a} = np.uintp({a} * m + piece)" for a in range(3)),
            "                for q in range(many):",
            *indented(candidate, 5),
            "                    z[q] = e0 * e0 + e1 * e1 + e2 * e2",
            "                if piece <= k < piece + many:",
            "                    z[k - piece] = R(np.inf)",
            "                start = np.uintp(at + min(found, room))",
            "                c = start",
            "                for q in range(many):",
            "                    N[c] = piece + q",
            "                    c += np.uintp(z[q] <= far2)",
            "                found += np.int64(c - start)",
            "    L[m + k] = found",
        ]
        if periodic:
            edge = [f"p{a} < far or p{a} + far > side{a}" for a in range(3)]
            search.append(f"    L[2 * m + k] = 1 if {' or '.join(edge)} else 0")
        body = [
            "m = e - s",
            "room = K[1]",
            f"far = np.float64(reach) * {1 + SKIN}",
            "far2 = R(far * far)",
            "K[3] += 1",
            "for k in range(3 * m):",
            "    if not abs(x[3 * (H[s + k // 3] - base) + k % 3]) < np.inf:",
            "        return 1",
            *axes,
            "while n0 * n1 * n2 > 4 * m + 27:",
            "    if n0 >= n1 and n0 >= n2:",
            "        n0 = (n0 + 1) // 2",
            "    elif n1 >= n2:",
            "        n1 = (n1 + 1) // 2",
            "    else:",
            "        n2 = (n2 + 1) // 2",
            "cells = n0 * n1 * n2",
            "for c in range(cells + 1):",
            "    L[4 * m + c] = 0",
            "for i in range(m):",
            *indented(place, 1),
            "    c = (c2 * n1 + c1) * n0 + c0",
            "    L[3 * m + i] = c",
            "    L[4 * m + c] += 1",
            "before = 0",
            "for c in range(cells + 1):",
            "    here = L[4 * m + c]",
            "    L[4 * m + c] = before",
            "    before += here",
            "for i in range(m):",
            "    c = L[3 * m + i]",
            "    L[L[4 * m + c]] = i",
            "    L[4 * m + c] += 1",
            "for c in range(cells, 0, -1):",
            "    L[4 * m + c] = L[4 * m + c - 1]",
            "L[4 * m] = 0",
            *(
                ["for a in range(3):", "    for k in range(m):", "        X[a * m + k] = X[(3 + a) * m + L[k]]"]
                * periodic
            ),
            *(["for k in range(3 * m):", "    X[3 * m + k] = X[k]"] * periodic),
            "for k in range(m):",
            "    o = 3 * (H[s + L[k]] - base)",
            "    for a in range(3):",
            f"        W[a * m + k] = x[o + a]{' - X[(3 + a) * m + k]' * periodic}",
            "        X[a * m + k] = W[a * m + k]",
            "h1 = min(n1, 3)",
            "h2 = min(n2, 3)",
            "g1 = 1 if n1 > 2 else 0",
            "g2 = 1 if n2 > 2 else 0",
            f"for chunk in {self.loop}((m + {CHUNK - 1}) // {CHUNK}):",
            *indented(search, 1),
            "most = 0",
            "for k in range(m):",
            "    most = max(most, L[m + k])",
            "K[2] = most",
            "if most >= room:",
            f"    return {FULL}",
            "K[0] = 1",
            "return 0",
        ]
        return [f"@njit({self.flags})", f"def build{self.number}({', '.join(names)}):", *indented(body, 1)]


def _halves(sums: list[int], lanes: int) -> list[str]:
    """Statements that add up the lanes of some sums in z, in pairs."""
    return [
        line
        for half in (lanes >> k for k in range(1, lanes.bit_length()))
        for line in (f"for l in range({half}):", *(f"    z[{a} + l] = z[{a} + l] + z[{a + half} + l]" for a in sums))
    ]


class _Law:
    """A pair law with its inputs found: numbers that all share, and quantities of each particle, rows of W."""

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
        shared = self._values(common, "")
        owned = self._values([p for p in own if p in self.quantities], "g")
        self.at_time = shared.at_time + owned.at_time
        self.common = dict(zip(common, shared.outputs, strict=True)) | {"t": "R(t)"}
        self._lines = owned.lines
        self._owned = dict(zip([p for p in own if p in self.quantities], owned.outputs, strict=True))

    def row(self, quantity: str) -> int:
        """Row of W."""
        return self.quantities.index(quantity)

    def copies(self, stride: str, index: str) -> list[str]:
        """Statements that write the quantities of the row g to a place in W."""
        expressions = {"m": self.binder.attribute("m", "g")} if "m" in self.quantities else {}
        expressions |= self._owned
        expressions |= {n: f"{q}[o + np.uintp({a})]" for q in "xv" for a, n in enumerate(vector_names(q))}
        writes = [f"W[np.uintp({k} * {stride} + {index})] = {expressions[q]}" for k, q in enumerate(self.quantities)]
        return ["o = np.uintp(3 * (g - base))", *self._lines, *writes]

    def pair(self, first: dict[str, str], second: dict[str, str], prefix: str) -> tuple[list[str], list[str]]:
        """Statements and outputs for one pair, from expressions of the quantities of both."""
        sides = {"1": first, "2": second}
        names = {name: sides[node][q] for name, (node, q) in self.inputs.items() if q in sides[node]} | self.common
        return statements(self.program, names, f"{self.tag}{prefix}", self.binder.dtype)

    def mirrored(
        self, first: dict[str, str], second: dict[str, str], prefix: str
    ) -> tuple[list[str], list[str], list[str]]:
        """Statements for one pair, and the outputs for its first and for its second particle."""
        sides = {"1": first, "2": second}
        names = {name: sides[node][q] for name, (node, q) in self.inputs.items() if q in sides[node]} | self.common
        places = {place: name for name, place in self.inputs.items()}
        other = {name: places["21"["12".index(node)], q] for name, (node, q) in self.inputs.items()}
        both = expanded(self.program)
        both.outputs += expanded(self.program, both, other).outputs
        lines, outputs = statements(both, names, f"{self.tag}{prefix}", self.binder.dtype)
        return lines, outputs[: self.sums], outputs[self.sums :]

    def result(self, row: str, index: str, stride: str) -> list[str]:
        """Statements that write the force on the particle of a row, whose sums are sum0, sum1, ..."""
        outputs = [f"sum{k}" for k in range(self.sums)]
        lines: list[str] = []
        if self.finish is not None:
            names = {f"sum{k}": f"sum{k}" for k in range(self.sums)} | self.common
            names |= {n: f"{q}[3 * (g - base) + {a}]" for q in "xv" for a, n in enumerate(vector_names(q))}
            names |= {q: f"W[{self.row(q)} * {stride} + {index}]" for q in self._owned}
            names |= {"m": self.binder.attribute("m", "g")}
            lines, outputs = statements(self.finish, names, f"{self.tag}e_", self.binder.dtype)
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
        rows = place[particles.select(pairs.force.on)]
        self.rows = rows[rows >= 0].astype(np.int64)
        count, dtype = len(self.rows), particles.dtype
        padded = count if pairs.near else -(-count // pairs.tile) * pairs.tile
        self._work = np.empty(pairs.quantities * padded, dtype)
        self._forces = np.zeros(3 * (int(place.max(initial=-1)) + 1), dtype)
        self._head = np.zeros(HEAD + -(-count // CHUNK), np.int64)
        self._cells = np.zeros(8 * count + 28, np.int32)
        self._origin = np.zeros(6 * count, dtype)
        self._neighbours = np.zeros(0, np.int32)
        self._known: Any = None
        self._reserve(32)

    def arrays(self) -> list[Any]:
        """The kernel's arguments, in the order of `Pairs.arguments`; another cut-off makes it find neighbours anew."""
        if not self.pairs.near:
            return [self.rows, self._work, self._forces]
        now = self.pairs.force.reach(self.particles), self.pairs.force.box
        if now != self._known:
            self._known = now
            self.forget()
        if 5 * self._head[2] > 4 * self._head[1]:  # before it is full: a run that begins again finds all anew
            self._reserve(int(self._head[2]))
        return [
            self.rows, self._work, self._forces, self._head, self._cells, self._neighbours, self._origin,
        ]  # fmt: skip

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
        count = len(self.rows) if self.pairs.near else 0
        grown = np.zeros(room * count + PIECE, np.int32)
        if old:
            each = min(old, room)
            grown[: room * count].reshape(count, room)[:, :each] = self._neighbours[: old * count].reshape(count, old)[
                :, :each
            ]
        self._head[1], self._neighbours = room, grown


def _reach(force: PairForce, particles: Particles) -> float:
    return max(force.reach(particles) or 0.0, SMALLEST)


def _side(force: PairForce, axis: int) -> Callable[[], float]:
    return lambda: force.box[axis]  # type: ignore[index]
