"""Prints conjugate gradients for one island: what `solvers.linear.ConjugateGradients` does, in vector lanes.

All that belongs to a block of particles, residual, image and preconditioner, lies side by side in a tile of `V`, whose
rows have a number for each particle: the compiler sees that nothing overlaps. Only the direction p is an array of its
own, x after y after z, since products read it everywhere; it has a margin, for runs may begin or end outside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pointmass.engine.blocks import LANES, Kind
from pointmass.engine.forces import Deriv
from pointmass.engine.printing import function, indented, statements
from pointmass.solvers.implicit import Implicit
from pointmass.solvers.linear import ConjugateGradients, traced_block_inverse
from pointmass.tracing.columns import expanded

BLOCK = 256  # particles whose numbers are added up in one go: sums have the same shape on any number of threads
APART = BLOCK + 16  # numbers between the rows of a tile: powers of two fall into the same few lines of a cache
UPPER = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]  # entries that are kept of a symmetric 3x3 block
AXES = range(3)
SQUARE = [(i, j) for i in AXES for j in AXES]
PLACE = dict(zip("xyz", ("o", "o + apart", "o + twice"), strict=True))  # of a vector like p
NEAR = Kind("near", False, ())  # blocks of pairs, which are found anew each time
FOLD = """while count > 1:
    half = (count + 1) // 2
    for k in range(count - half):
        a[np.uintp(lo + k)] = a[np.uintp(lo + k)] + a[np.uintp(lo + half + k)]
    count = half
return a[lo]"""  # by halves, in vectors


class Gradients:
    """The functions of conjugate gradients.

    Attributes
    ----------
    scratch : arrays that they need -> the expressions that make them, but for those of the blocks.
    matrix : arguments that say what the matrix is.
    calls : of `condense`, and of `gradients`, which returns the number of iterations, or -1 minus that if it ended in a
        direction in which the matrix curves downwards.

    Parameters
    ----------
    own : whether forces on single particles have derivatives.
    projected : whether vectors are projected by Q on what contacts leave free, p to u.
    """

    def __init__(self, deriv: Deriv, solver: Implicit, kinds: Sequence[Kind], own: bool, projected: bool) -> None:
        self.deriv, self.solver, self.kinds = deriv, solver, kinds
        self.own, self.projected = own, projected
        self.source = "u" if projected else "p"
        self.rows = [f"{q}_{a}" for q in "rzqxu" for a in "xyz"] + [f"d{k}" for k in range(6)] + ["m"]
        self.rows += [f"h{k}" for k in range(6)] if own else []
        vector = f"np.empty(3 * (M[0] + {2 * LANES}), R)"
        tiles = f"np.empty({len(self.rows) * APART} * (M[0] // {BLOCK} + 1), R)"
        blocks = [name for kind in kinds for name in (*kind.arrays, f"{kind.name}_K", f"{kind.name}_R")]
        blocks += [name for pairs in deriv.pairs for name in pairs.blocks]
        self.matrix = ", ".join(["base", "n", *["slices"] * bool(kinds), *blocks, *["Q"] * projected])
        given = ", ".join([*deriv.binder.arrays, self.matrix])
        self.calls = [
            f"condense({given}, g, U, V)",
            f"gradients({self.matrix}, guess, warm, load, dv, V, way, let, terms, part)",
        ]
        self.scratch = {"V": tiles, "terms": "np.empty(M[0])", "way": vector, "let": vector}

    @property
    def text(self) -> str:
        """The functions."""
        parts = [
            function("folded", "a, lo, count", "**FLAGS", FOLD.splitlines()),
            self._condense(),
            self._image(),
            self._eased(),
            self._turned(),
            self._gradients(),
        ]
        return "".join(parts)

    def _function(self, name: str, arguments: str, lines: Sequence[str]) -> str:
        return function(name, arguments, self.deriv.flags, lines)

    # ------------------------------------------------------------------------------------------------ loops

    def _at(self, row: str) -> str:
        """The number of lane c in a row of the tile."""
        return f"V[c + np.uintp({APART * self.rows.index(row)})]"

    def _blocks(self, lines: Sequence[str], summed: bool = True) -> list[str]:
        """A loop over blocks of particles, and the sum of `terms`."""
        end = ["part[block] = folded(terms, lo, hi - lo)"] if summed else []
        loop = [
            f"for block in {self.deriv.loop}((n + {BLOCK - 1}) // {BLOCK}):",
            f"    lo = {BLOCK} * block",
            f"    hi = min(n, lo + {BLOCK})",
            f"    b = np.uintp({len(self.rows) * APART} * block)",
            *indented([*lines, *end], 1),
        ]
        total = ["total = 0.0", f"for block in range((n + {BLOCK - 1}) // {BLOCK}):", "    total = total + part[block]"]
        return [*loop, *total] if summed else loop

    def _lanes(self, lines: Sequence[str]) -> list[str]:
        """A loop over the particles i of a block, in lanes c."""
        return ["for i in range(lo, hi):", "    c = b + np.uintp(i - lo)", *indented(lines, 1)]

    def _slices(self, lines: Sequence[str]) -> list[str]:
        """A loop over the slices of a block, from particle `begin` and lane `first` on."""
        return [
            f"for piece in range(lo // {LANES}, (hi + {LANES - 1}) // {LANES}):",
            f"    begin = {LANES} * piece",
            f"    width = min(n - begin, {LANES})",
            "    first = b + np.uintp(begin - lo)",
            *indented(lines, 1),
        ]

    def _slice(self, lines: Sequence[str]) -> list[str]:
        """A loop over the particles of a slice, in lanes c."""
        return ["for l in range(width):", "    c = first + np.uintp(l)", *indented(lines, 1)]

    def _runs(self, kind: Kind, before: Sequence[str], lane: Sequence[str]) -> list[str]:
        """A loop over the runs of a slice and their lanes; number k of a lane's block is at e + k LANES."""
        k = kind.name
        return [
            f"for run in range({k}_runs[slices + piece], {k}_runs[slices + piece + 1]):",
            f"    blocks = np.uintp({kind.size * LANES} * (run - {k}_runs[slices]))",
            *indented(before, 1),
            *indented(self._slice(["e = blocks + np.uintp(l)", *lane]), 1),
        ]

    def _rest(self, kind: Kind, lines: Sequence[str]) -> list[str]:
        """A loop over the blocks of particle g_ that are in no run, at e."""
        k = kind.name
        return [
            f"for entry in range({k}_ends[g_], {k}_ends[g_ + 1]):",
            f"    e = np.uintp({kind.size}) * np.uintp({k}_block[np.uintp(entry)])",
            f"    other = {k}_other[np.uintp(entry)]",
            *indented(lines, 1),
        ]

    # ------------------------------------------------------------------------------------------------ the matrix

    def _condense(self) -> str:
        """Fills the runs and what stays in the tiles: m, H, the symmetric part of gamma df/dv + gamma^2 df/dx of the
        particles' own forces, and D, the inverses of the blocks on the diagonal; upper triangles."""
        inverse, outputs = statements(
            expanded(traced_block_inverse().program),
            {f"d{i}{j}": f"d{i}{j}" for i, j in UPPER},
            "inv_",
            self.deriv.binder.dtype,
        )
        diagonal = [self._at(f"d{k}") for k in range(6)]
        fill = self._slice([f"{d} = R(0)" for d in diagonal])
        for kind in self.kinds:
            k = kind.name
            lane = [f"place = {k}_fill[{LANES} * run + l]", f"f = np.uintp({kind.size}) * np.uintp(max(place, 0))"]
            for q in range(kind.size):
                value = f"{k}_K[f + np.uintp({q})] if place >= 0 else R(0)"
                lane.append(f"{k}_R[e + np.uintp({LANES * q})] = {value}")
            adds = [
                f"{d} = {d} + {k}_R[e + np.uintp({LANES * _entry(kind, i, j)})]"
                for d, (i, j) in zip(diagonal, UPPER, strict=True)
            ]
            adds = adds if kind.relative else [f"if {k}_start[run] == begin:", *indented(adds, 1)]
            fill += self._runs(kind, [], [*lane, *adds])
        w, m = (self.deriv.binder.attribute(name, "g_") for name in "wm")
        particle = ["i = begin + l", "g_ = base + i", f"w = {w}", f"m = {m}"]
        particle += [f"e_{i}{j} = {d}" for d, (i, j) in zip(diagonal, UPPER, strict=True)]
        for kind in self.kinds:
            adds = [f"e_{i}{j} = e_{i}{j} + {kind.name}_K[e + np.uintp({_entry(kind, i, j)})]" for i, j in UPPER]
            particle += self._rest(kind, adds if kind.relative else ["if other == i:", *indented(adds, 1)])
        if self.projected:
            particle += [f"e_{j}{i} = e_{i}{j}" for i, j in UPPER if i != j]
            particle += [*read("Q", "i", "s_"), *sandwich("e_")]
        particle += ["b_ = np.uintp(18 * i)"] * self.own
        for at, (i, j) in enumerate(UPPER):
            mass = "m" if i == j else "R(0)"
            if self.own:
                pairs = (
                    f"R(0.5) * (U[b_ + np.uintp({f + 3 * i + j})] + U[b_ + np.uintp({f + 3 * j + i})])" for f in (0, 9)
                )
                a, d = pairs
                particle.append(f"h{i}{j} = g * ({d}) + gg * ({a})")
                particle.append(f"{self._at(f'h{at}')} = h{i}{j}")
                mass = f"{mass} - h{i}{j}"
            particle.append(f"d{i}{j} = {mass} - e_{i}{j}")
        particle += inverse
        particle += [f"{d} = {out} if w != 0 else R(0)" for d, out in zip(diagonal, outputs, strict=True)]
        particle.append(f"{self._at('m')} = m if w != 0 else R(0)")
        lines = [
            *self.deriv.binder.numbers.lines(),
            "gg = g * g",
            *self._blocks(self._slices([*fill, *self._slice(particle)]), summed=False),
            "return 0",
        ]
        return self._function("condense", f"{', '.join(self.deriv.binder.arrays)}, {self.matrix}, g, U, V", lines)

    def _image(self) -> str:
        """q = M p - gamma df/dv p - gamma^2 df/dx p in the tiles, and p . q; u is p where contacts let it go."""
        here = f"o = np.uintp({LANES} + begin + l)"
        lane = [here, *(f"{self._at(f'u_{a}')} = {self.source}[{o}]" for a, o in PLACE.items())]
        lines = self._slice([*lane, *(f"{self._at(f'q_{a}')} = R(0)" for a in "xyz")])
        for kind in self.kinds:
            lane = ["o = column + np.uintp(l)", *self._times(kind, f"{kind.name}_R", LANES, self._at)]
            lines += self._runs(kind, [f"column = np.uintp({LANES} + {kind.name}_start[run])"], lane)
        rest = ["g_ = base + begin + l", *(f"q_{a} = {self._at(f'q_{a}')}" for a in "xyz")]
        rest += [f"u_{a} = {self._at(f'u_{a}')}" for a in "xyz"]
        for kind in self.kinds:
            one = [f"o = np.uintp({LANES} + other)", *self._times(kind, f"{kind.name}_K", 1, str)]
            rest += self._rest(kind, one)
        for pairs in self.deriv.pairs:
            first, other, block = pairs.blocks
            near = [f"o = np.uintp({LANES} + {other}[np.uintp(entry)])", "e = np.uintp(9) * np.uintp(entry)"]
            near += self._times(NEAR, block, 1, str)
            rest += [
                f"for entry in range({first}[2 * g_], {first}[2 * g_] + {first}[2 * g_ + 1]):",
                *indented(near, 1),
            ]
        if self.projected:
            rest += [*read("Q", "(begin + l)", "s_"), *times("s_", ("q_x", "q_y", "q_z"), ("q_x", "q_y", "q_z"))]
        rest = self._slice([*rest, *(f"{self._at(f'q_{a}')} = q_{a}" for a in "xyz")])
        if not self.projected and not self.deriv.pairs:
            left = (f"{k.name}_ends[base + begin] < {k.name}_ends[base + begin + width]" for k in self.kinds)
            rest = [f"if {' or '.join(left)}:", *indented(rest, 1)]
        own = [here, *(f"p_{a} = p[{o}]" for a, o in PLACE.items())]
        for i, a in enumerate("xyz"):
            taken = self._at(f"q_{a}")
            if self.own:
                terms = " + ".join(f"{self._at(f'h{upper(i, j)}')} * p_{c}" for j, c in enumerate("xyz"))
                taken = f"({taken} + ({terms}))"
            own.append(f"q_{a} = {self._at('m')} * p_{a} - {taken}")
        own += [f"{self._at(f'q_{a}')} = q_{a}" for a in "xyz"]
        own.append(f"terms[np.uintp(begin + l)] = {_dot('p', 'q')}")
        body = [*self._apart(), *self._blocks(self._slices([*lines, *rest, *self._slice(own)])), "return total"]
        return self._function("image_of", f"{self.matrix}, p, u, V, terms, part", body)

    def _times(self, kind: Kind, blocks: str, far: int, at: Callable[[str], str]) -> list[str]:
        """Statements that add a block, with its numbers so far from each other, times the vector at its column."""
        lines = []
        for a, o in PLACE.items():
            there = f"{self.source}[{o}]"
            lines.append(f"v_{a} = {at(f'u_{a}')} - {there}" if kind.relative else f"v_{a} = {there}")
        for i, a in enumerate("xyz"):
            row = (f"{blocks}[e + np.uintp({far * _entry(kind, i, j)})] * v_{c}" for j, c in enumerate("xyz"))
            lines.append(f"{at(f'q_{a}')} = {at(f'q_{a}')} + ({' + '.join(row)})")
        return lines

    # ------------------------------------------------------------------------------------------------ the iteration

    def _apart(self) -> list[str]:
        return [f"apart = np.uintp(n + {2 * LANES})", "twice = np.uintp(2) * apart"]

    def _eased(self) -> str:
        """r = r - alpha q, z = D r, and r . z."""
        lines = [f"r_{a} = {self._at(f'r_{a}')} - alpha * {self._at(f'q_{a}')}" for a in "xyz"]
        for i, a in enumerate("xyz"):
            row = (f"{self._at(f'd{upper(i, j)}')} * r_{c}" for j, c in enumerate("xyz"))
            lines.append(f"z_{a} = {' + '.join(row)}")
        lines += [f"{self._at(f'{q}_{a}')} = {q}_{a}" for q in "rz" for a in "xyz"]
        lines.append(f"terms[np.uintp(i)] = {_dot('r', 'z')}")
        return self._function("eased", "n, alpha, V, terms, part", [*self._blocks(self._lanes(lines)), "return total"])

    def _turned(self) -> str:
        """x = x + alpha p, p = z + beta p, and u."""
        lines = [f"o = np.uintp({LANES} + i)"]
        for a, o in PLACE.items():
            lines += [f"p_{a} = p[{o}]", f"{self._at(f'x_{a}')} = {self._at(f'x_{a}')} + alpha * p_{a}"]
            lines.append(f"p[{o}] = {self._at(f'z_{a}')} + beta * p_{a}")
        arguments = "n, alpha, beta, V, p" + ", u, Q" * self.projected
        lines = [*self._apart(), *self._blocks(self._lanes([*lines, *self._project()]), summed=False), "return 0"]
        return self._function("turned", arguments, lines)

    def _project(self) -> list[str]:
        """u = Q p."""
        if not self.projected:
            return []
        vectors = ([f"{v}[{o}]" for o in PLACE.values()] for v in "pu")
        return [*read("Q", "i", "s_"), *times("s_", *vectors)]

    def _gradients(self) -> str:
        """The iteration."""
        float32 = self.deriv.binder.dtype == "float32"
        tolerance = max(self.solver.cg_tolerance, 1e-6 if float32 else 0.0)  # it cannot end below round-off
        begin = [f"o = np.uintp({LANES} + i)"]
        for k, (a, o) in enumerate(PLACE.items()):
            j = f"np.uintp(3 * i + {k})"
            begin += [f"{self._at(f'r_{a}')} = {self._at('m')} * load[{j}]", f"{self._at(f'q_{a}')} = R(0)"]
            begin += [f"p[{o}] = warm[{j}] if guess else R(0)", f"{self._at(f'x_{a}')} = p[{o}]"]
        end = [f"dv[np.uintp(3 * i + {k})] = {self._at(f'x_{a}')}" for k, a in enumerate("xyz")]
        margin = [f"{v}[{o}] = R(0)" for v in "pu"[: 1 + self.projected] for o in PLACE.values()]
        image = f"image_of({self.matrix}, p, u, V, terms, part)"
        turn = "turned(n, {0}, V, p" + ", u, Q)" * self.projected + ")" * (not self.projected)
        lines = [
            *self._apart(),
            f"if n >= {LANES}:",
            f"    for k in range({2 * LANES}):",
            *indented([f"o = np.uintp(k if k < {LANES} else n + k)", *margin], 2),
            *self._blocks(self._lanes([*begin, *self._project()]), summed=False),
            "rho = eased(n, R(0), V, terms, part)",
            f"goal = {tolerance * tolerance!r} * rho",
            "if guess:",
            f"    {image}",
            "    rho = eased(n, R(1), V, terms, part)",
            turn.format("R(0), R(0)"),
            "count, down = 0, False",
            f"while rho > goal and count < min({ConjugateGradients.restarts} * 3 * n, {ConjugateGradients.most}):",
            f"    curvature = {image}",
            "    if not curvature > 0.0:",
            "        if count == 0:",
            f"            {turn.format('R(1), R(0)')}",
            "        down = True",
            "        break",
            "    alpha = R(rho / curvature)",
            "    total = eased(n, alpha, V, terms, part)",
            f"    {turn.format('alpha, R(total / rho)')}",
            "    rho = total",
            "    count += 1",
            *self._blocks(self._lanes(end), summed=False),
            "return -1 - count if down else count",
        ]
        return self._function("gradients", f"{self.matrix}, guess, warm, load, dv, V, p, u, terms, part", lines)


def upper(i: int, j: int) -> int:
    """Where entry (i, j) of a symmetric block is kept."""
    return UPPER.index((min(i, j), max(i, j)))


def _entry(kind: Kind, i: int, j: int) -> int:
    """Where entry (i, j) of a block is kept."""
    return upper(i, j) if kind.relative else 3 * i + j


def _dot(a: str, b: str) -> str:
    """The product of two vectors of locals in float64."""
    return "(" + " + ".join(f"np.float64({a}_{c}) * np.float64({b}_{c})" for c in "xyz") + ")"


def read(array: str, index: str, name: str) -> list[str]:
    """The 3x3 matrix of a particle into locals."""
    return [f"{name}{i}{j} = {array}[np.uintp(9 * {index} + {3 * i + j})]" for i in AXES for j in AXES]


def times(matrix: str, vector: Sequence[str], result: Sequence[str]) -> list[str]:
    """result = matrix vector, of locals."""
    lines = [f"new{i} = " + " + ".join(f"{matrix}{i}{j} * {v}" for j, v in enumerate(vector)) for i in AXES]
    return [*lines, *(f"{r} = new{i}" for i, r in enumerate(result))]


def sandwich(name: str, right: str = "s_") -> list[str]:
    """name = s_ name right, of locals, in the order of `ParticleSystem.jacobian`."""
    lines = [f"t{i}{j} = " + " + ".join(f"s_{i}{k} * {name}{k}{j}" for k in AXES) for i in AXES for j in AXES]
    return [
        *lines,
        *(f"{name}{i}{j} = " + " + ".join(f"t{i}{k} * {right}{k}{j}" for k in AXES) for i in AXES for j in AXES),
    ]
