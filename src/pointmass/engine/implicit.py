"""Prints the step of an implicit solver for one island: Newton's method around conjugate gradients without a matrix.

The Jacobian of each element is evaluated once for each iteration of Newton's method into a buffer of 3x3 blocks, from
which `gradients` solves for the correction; again with a smaller share of what pushes, where that does not go downhill.
An island whose elements join near rows only, a chain, is solved by elimination within the band of its matrix, and a
particle alone by the text of `solvers.linear.three`. The operations are those of `solvers.newton` and `solvers.linear`,
in order; where factors of a whole matrix are asked for, an island that is no chain says that it is not solved, and the
reference path takes over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pointmass.engine.binding import Text
from pointmass.engine.blocks import LANES, Kind
from pointmass.engine.forces import FREE, UNARY, Deriv, Elements
from pointmass.engine.gradients import AXES, BLOCK, SQUARE, UPPER, Gradients, read, sandwich, times
from pointmass.engine.printing import function, indented, literal, statements
from pointmass.engine.steps import StepText
from pointmass.laws.elements import ConstraintForce, ElementForce
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.bdf2 import BDF2, LARGEST_RATIO
from pointmass.solvers.implicit import Implicit
from pointmass.solvers.linear import traced_three
from pointmass.solvers.newton import AGAIN, BOLD, GROWTH, HALVINGS, LEAST, LESS, MORE, ROUNDINGS, TURN
from pointmass.tracing.columns import expanded
from pointmass.tracing.program import Program
from pointmass.tracing.trace import Traced, trace, vector_names

NOT_SOLVED = 8  # bit of the status of an island
BAND, LONGEST = 16, 8192  # an island is eliminated up to this distance of rows within an element, and so many rows
ELIMINATE = """for j in range(rows):
    last, end = min(j + m + 1, rows), min(j + 2 * m + 1, rows)
    at = j * (3 * m + 1) + m - j
    best = j
    for i in range(j + 1, last):
        if abs(W[i * (3 * m + 1) + m - i + j]) > abs(W[best * (3 * m + 1) + m - best + j]):
            best = i
    if best != j:
        there = best * (3 * m + 1) + m - best
        for c in range(j, end):
            W[at + c], W[there + c] = W[there + c], W[at + c]
        y[j], y[best] = y[best], y[j]
    for i in range(j + 1, last):
        row = i * (3 * m + 1) + m - i
        factor = W[row + j] / W[at + j]
        if factor != 0:
            for c in range(j + 1, end):
                W[row + c] = W[row + c] - factor * W[at + c]
            y[i] = y[i] - factor * y[j]
for back in range(rows):
    j = rows - 1 - back
    at = j * (3 * m + 1) + m - j
    total = y[j]
    for c in range(j + 1, min(j + 2 * m + 1, rows)):
        total = total - W[at + c] * y[c]
    y[j] = total / W[at + j]
return 0"""  # with row pivoting, which widens the band above the diagonal


def implicit_text(deriv: Deriv, solver: Implicit) -> StepText:
    """The step for a system and a solver."""
    return _Printer(deriv, solver).text()


class _Printer:
    def __init__(self, deriv: Deriv, solver: Implicit) -> None:
        self.deriv, self.solver = deriv, solver
        self.projected = deriv.contact is not None and deriv.order == 2  # on what contacts leave free, by Q
        self.system, self.second = deriv.system, deriv.order == 2
        self.dtype = deriv.binder.dtype
        share = "share" if solver.newton == "full" else literal(0.0, self.dtype)
        self.families = [_Family(deriv, f, share) for f in deriv.families]
        self.kinds = _kinds(self.families)
        self.linked = bool(self.families or deriv.pairs)
        self.searches = self.second and solver.newton == "full"  # for the place where the potential is least
        # Conjugate gradients see the symmetric part of the matrix alone, and one step of Newton's method shows that.
        self.direct = solver.linear_solver == "direct"
        auto = solver.linear_solver == "auto" and solver.newton == "full"
        self.eliminates = bool(self.families) and not deriv.pairs and (self.direct or auto)
        self.arrays = [array for kind in self.kinds for array in kind.arrays]
        buffers = [f"{kind.name}_{b}" for kind in self.kinds for b in "KR"]
        self.shared = ", ".join(
            [deriv.call, *self.arrays, *["slices"] * bool(self.kinds), *buffers, *["Q", "Qw"] * self.projected]
        )

    def text(self) -> StepText:
        """Everything."""
        scratch: dict[str, str] = {}
        for k, kind in enumerate(self.kinds):
            most = " + ".join(f"{self.families[j].size} * M[{j + 1}]" for j in kind.families)
            scratch[f"{kind.name}_K"] = f"np.empty({most}, R)"
            scratch[f"{kind.name}_R"] = f"np.empty({kind.size * LANES} * M[{len(self.families) + k + 1}], R)"
        scratch |= {"U": "np.empty(18 * M[0], R)", "part": f"np.empty(M[0] // {BLOCK} + 1)"}
        work = ["gap", "load", "dv", "lack", "rate", "xs", "xt", "vs", "vt", "zx", "zv", "xh", "vh"]
        scratch |= FREE if self.projected else {}
        looks = self.deriv.binder.functions
        jacobian, own = self._jacobian()
        gradients = Gradients(self.deriv, self.solver, self.kinds, own, self.projected)
        if self.linked:
            scratch |= gradients.scratch
        if self.eliminates:
            scratch["W"] = f"np.empty({3 * (3 * (3 * BAND + 2) + 1)} * min(M[0], {LONGEST}), R)"
        history = ["x_before", "v_before"][: self.deriv.order] if isinstance(self.solver, BDF2) else []
        memory = ["warm"] * self.linked + history
        state = f"{self.shared}, t, h, x, v, x1, v1, {', '.join([*scratch, *work, *memory])}, h_before, done"
        state = ", ".join(dict.fromkeys(state.split(", ")))  # blocks are among the shared ones already
        parts = [self._largest(), *[self._work()] * self.searches, jacobian]
        if self.eliminates:
            parts += [
                self._distance(),
                self._assemble(),
                function("eliminate", "rows, m, W, y", "**FLAGS", ELIMINATE.splitlines()),
            ]
        if self.linked and not self.direct:
            parts.append(gradients.text)
        parts.append(self._function("implicit", state, self._newton(gradients)))
        parts.append(self._function("divided", state, self._divided(state)))
        more = self.deriv.binder.functions[len(looks) :]  # derivatives look up what laws do not
        lines = [
            f"bad = implicit({state})",
            f"if bad & {NOT_SOLVED}:",
            f"    bad = divided({state})",
            "status |= bad",
        ]
        functions = more + "".join(parts)
        return StepText(work, lines, 0, functions=functions, scratch=scratch, memory=memory, kinds=self.kinds)

    def _function(self, name: str, arguments: str, lines: Sequence[str]) -> str:
        return function(name, arguments, self.deriv.flags, lines)

    def _largest(self) -> str:
        """Largest size of the first 3n numbers of an array, NaN where one is."""
        worst = "{1} = {0} if {0} > {1} or {0} != {0} else {1}"
        lines = [
            f"for block in {self.deriv.loop}((n + {BLOCK - 1}) // {BLOCK}):",
            "    mine = 0.0",
            f"    for q in range({3 * BLOCK} * block, min(3 * n, {3 * BLOCK} * block + {3 * BLOCK})):",
            "        size = np.float64(abs(a[q]))",
            f"        {worst.format('size', 'mine')}",
            "    part[block] = mine",
            "most = 0.0",
            f"for block in range((n + {BLOCK - 1}) // {BLOCK}):",
            f"    {worst.format('part[block]', 'most')}",
            "return most",
        ]
        return self._function("largest", "n, a, part", lines)

    def _work(self) -> str:
        """The sum of m a . b over the movable particles of an island."""
        m, w = (self.deriv.binder.attribute(name, "g_") for name in "mw")
        product = " + ".join(f"np.float64(a[o_{c}]) * np.float64(b[o_{c}])" for c in "xyz")
        lines = [
            *self.deriv.binder.numbers.lines(),
            f"for block in {self.deriv.loop}((n + {BLOCK - 1}) // {BLOCK}):",
            "    mine = 0.0",
            f"    for i in range({BLOCK} * block, min(n, {BLOCK} * block + {BLOCK})):",
            "        g_ = base + i",
            *indented(_offsets(), 2),
            f"        if {w} != 0:",
            f"            mine = mine + np.float64({m}) * ({product})",
            "    part[block] = mine",
            "total = 0.0",
            f"for block in range((n + {BLOCK - 1}) // {BLOCK}):",
            "    total = total + part[block]",
            "return total",
        ]
        return self._function("work_of", f"{self._attributes}, a, b, part", lines)

    @property
    def _attributes(self) -> str:
        return ", ".join(["base", "n", *self.deriv.binder.arrays])

    # ------------------------------------------------------------------------------------------------ the Jacobian

    def _jacobian(self) -> tuple[str, bool]:
        """Blocks of the elements into K, those of particles into U (df/dx, df/dv), and k = w df/dx gap; and whether
        forces on particles have any.

        K is gamma df/dv + gamma^2 df/dx, made symmetric unless it is wanted as a whole.
        """
        at_time: list[str] = []
        elements: list[str] = []
        for family in self.families:
            text = family.law(self.deriv)
            at_time += text.at_time
            elements += family.evaluate(self.deriv, text, "u" if self.projected else "gap")
        first = self.deriv.projections if self.projected else []
        if self.projected and self.linked:
            first += [f"for i in {self.deriv.loop}(n):", *indented(_projected("Q", "gap", "u"), 1)]
        for pairs in self.deriv.pairs:
            elements += [f"# {pairs.force.name}", f"if {self.deriv.acting(pairs)}:"]
            elements += [f"    status |= {pairs.slopes_call('u' if self.projected else 'gap')}", "else:"]
            elements += indented(pairs.off(), 1)
        timed, particle, own = self._own_blocks()
        lines = [
            *self.deriv.binder.numbers.lines(),
            "status = 0",
            *at_time,
            *timed,
            "gg = g * g",
            *first,
            *elements,
            f"for i in {self.deriv.loop}(n):",
            *indented(particle, 1),
            "return status",
        ]
        u = ", u" * (self.linked and self.projected)
        return self._function("jacobian", f"{self.shared}, t, g, whole, share, x, v, gap, U, k{u}", lines), own

    def _own_blocks(self) -> tuple[list[str], list[str], bool]:
        """Statements of the time, those for particle i, and whether any of its blocks is not 0."""
        binder, found = self.deriv.binder, False
        at_time: list[str] = []
        lines = ["g_ = base + i", *_offsets()]
        sums = [f"{q}{i}{j}" for q in "ab" for i in AXES for j in AXES]
        lines += [f"{s} = R(0)" for s in sums]
        for number, force in enumerate(self.system.forces):
            if not isinstance(force, UnaryForce):
                continue
            traced = force._jacobian
            mass = {"m": binder.attribute("m", "g_")} if "m" in traced.depends_on else {}
            text = binder.law(traced, force, {**UNARY, **mass, "t": "R(t)"}, "g_", binder.particle, f"d{number}")
            if all(out == literal(0.0, self.dtype) for out in text.outputs):
                continue
            found = True
            at_time += text.at_time
            acts = binder.selected(force, "g_")
            lines += [f"# {force.name}", *text.lines]
            for (i, q, j), out in zip(((i, q, j) for i in AXES for q in "ab" for j in AXES), text.outputs, strict=True):
                if out != literal(0.0, self.dtype):
                    lines.append(f"{q}{i}{j} = {q}{i}{j} + {out if acts is None else f'({out} if {acts} else R(0))'}")
        for pairs in self.deriv.pairs:
            found = True
            lines.append(f"if {self.deriv.binder.switch(pairs.force)} != 0:")
            lines += [f"    {s} = {s} + {pairs.slope(k)}" for k, s in enumerate(sums)]
        if self.projected and self.deriv.contact is not None:
            lines += [*read("Q", "i", "s_"), *sandwich("a"), *sandwich("b")]
            found = True
            lines += [f"drag = R(drag_of(K, {self.deriv.contact.record} * i))"]
            lines += [f"b{i}{j} = b{i}{j} - drag * s_{i}{j}" for i, j in SQUARE]
        lines += ["b = np.uintp(18 * i)"]
        lines += [f"U[b + np.uintp({k})] = {s}" for k, s in enumerate(sums)]
        if self.second:
            lines += [f"w = {binder.attribute('w', 'g_')}", *(f"f_{a} = R(0)" for a in "xyz")]
            for family in self.families:
                lines += family.gather()
            for pairs in self.deriv.pairs:
                lines.append(f"if {self.deriv.binder.switch(pairs.force)} != 0:")
                lines += [f"    f_{a} = f_{a} + {pairs.slope(18 + k)}" for k, a in enumerate("xyz")]
            if self.projected:
                lines += times("s_", ("f_x", "f_y", "f_z"), ("f_x", "f_y", "f_z"))
            for i, a in enumerate("xyz"):
                own = " + ".join(f"(w * a{i}{j}) * gap[o_{c}]" for j, c in enumerate("xyz"))
                lines.append(f"k[o_{a}] = w * f_{a} + ({own})")
        return at_time, lines, found

    # ------------------------------------------------------------------------------------------------ chains

    def _distance(self) -> str:
        """Largest distance of two rows that an element joins."""
        lines = [*self.deriv.binder.numbers.lines(), "most = 0"]
        for family in self.families:
            lines += family.distance()
        return function("apart", self.shared, "**FLAGS", [*lines, "return most"])

    def _assemble(self) -> str:
        """M - gamma df/dv - gamma^2 df/dx as a band: entry (i, j) is W[i (3m + 1) + j - i + m]; and dv = M load."""
        m, w = (self.deriv.binder.attribute(name, "g_") for name in "mw")
        lines = ["g_ = base + i", "for j in range(3 * i * wide, (3 * i + 3) * wide):", "    W[j] = R(0)"]
        lines.append("b = np.uintp(18 * i)")
        for i, c in SQUARE:
            own = f"g * U[b + np.uintp({9 + 3 * i + c})] + gg * U[b + np.uintp({3 * i + c})]"
            lines.append(f"W[{_place(i, c, 'i')}] = {own}")
        for family in self.families:
            lines += family.assemble()
        if self.projected:  # blocks of the particles' own forces once more, which changes nothing
            block = [f"e_{i}{c} = W[{_place(i, c, 'other')}]" for i, c in SQUARE]
            inner = [*block, *read("Q", "other", "o"), *sandwich("e_", "o")]
            inner += [f"W[{_place(i, c, 'other')}] = e_{i}{c}" for i, c in SQUARE]
            lines += read("Q", "i", "s_")
            lines += ["for other in range(max(0, i - distance), min(n, i + distance + 1)):", *indented(inner, 1)]
        lines += [
            f"mass = {m} if {w} != 0 else R(1)",
            "for j in range(3 * i * wide, (3 * i + 3) * wide):",
            f"    W[j] = -W[j] if {w} != 0 else R(0)",
        ]
        for i in AXES:
            lines.append(f"W[{_place(i, i, 'i')}] = W[{_place(i, i, 'i')}] + mass")
        lines += [f"dv[3 * i + {k}] = mass * load[3 * i + {k}] if {w} != 0 else R(0)" for k in AXES]
        every = ["m = 3 * distance + 2", "wide = 3 * m + 1", "gg = g * g", f"for i in {self.deriv.loop}(n):"]
        lines = [*self.deriv.binder.numbers.lines(), *every, *indented(lines, 1), "return m"]
        return self._function("assemble", f"{self.shared}, distance, g, U, load, dv, W", lines)

    def _elimination(self) -> list[str]:
        if not self.eliminates:
            return []
        return [
            "elif narrow:",
            f"    band = assemble({self.shared}, distance, g, U, load, dv, W)",
            "    eliminate(3 * n, band, W, dv)",
        ]

    # ------------------------------------------------------------------------------------------------ Newton's method

    def _alone(self) -> list[str]:
        """dv of an island of one particle."""
        names = {"g": "g"} | {f"load_{a}": f"load[{i}]" for i, a in enumerate("xyz")}
        lines = [f"w = {self.deriv.binder.attribute('w', 'base')}"]
        for m, (q, offset) in enumerate((("a", 0), ("b", 9))):
            for i in AXES:
                for j, a in enumerate("xyz"):
                    entry = f"w * U[{offset + 3 * i + j}]"
                    if not self.second:
                        entry = "R(0)" if m == 0 else f"U[{3 * i + j}]"  # for order 1, J stands for B
                    lines.append(f"{q}{i}{j} = {entry}")
                    names[f"{q}{i}_{a}"] = f"{q}{i}{j}"
        body, outputs = statements(expanded(traced_three().program), names, "three_", self.dtype)
        gone = "w != 0 and largest(1, load, part) != 0.0"
        return [*lines, *body, *(f"dv[{i}] = {out} if {gone} else R(0)" for i, out in enumerate(outputs))]

    def _newton(self, gradients: Gradients) -> list[str]:
        """One step, see `solvers.newton.Newton` and `solvers.implicit.Implicit.step`."""
        solver, second, loop, dtype = self.solver, self.second, self.deriv.loop, self.dtype
        every = f"for j in {loop}(3 * n):"
        free = "C[0, base + j // 3] != 0"
        gamma = "R(h)" if solver.c == 1.0 else f"{literal(solver.c, dtype)} * R(h)"
        state = [("x", "xs", "xt"), ("v", "vs", "vt")][: 1 + second]
        unknown, u, trial = state[-1]
        z = f"z{unknown}"
        start = [f"g = {gamma}", f"ts = t + {solver.c!r} * h", *self._history()]
        begin = [every, *(f"    {s}[j] = {y}[j]" for y, s, _ in state)]
        begin += [*self._force("s"), every, f"    lack[j] = {u}[j] - {z}[j] - g * rate[j]"]
        if second:
            begin.append(f"    gap[j] = zx[j] + g * vs[j] - xs[j] if {free} else R(0)")
        jacobian_u = ", let" * (self.linked and self.projected)
        extra = "vs" if second else "xs"
        iteration = [
            f"status |= jacobian({self.shared}, ts, g, narrow, share, xs, {extra}, gap, U, rate{jacobian_u})",
            every,
            "    load[j] = g * rate[j] - lack[j] if first else -lack[j]" if second else "    load[j] = -lack[j]",
            "size = largest(n, load, part)",
            "if not size < np.inf:",
            f"    return status | {NOT_SOLVED}",
            "if size > 0.0:",
            "    done[3] += 1",
            *["definite = True"] * self.searches,
        ]
        alone = self._alone()
        if self.linked:
            condense, solve = gradients.calls
            gradual = [
                "    guess = first and largest(n, warm, part) != 0.0",
                f"    {condense}",
                f"    count = {solve}",
                *["    definite = count >= 0"] * self.searches,
                "    done[4] += count if count >= 0 else -1 - count",
            ]
            wide = [f"    return status | {NOT_SOLVED}"]  # factors of a whole matrix: the reference path has them
            iteration += [
                "if n == 1:",
                *indented(alone, 1),
                "elif size == 0.0:",
                f"    {every}",
                "        dv[j] = R(0)",
            ]
            iteration += [
                *self._elimination(),
                "else:",
                *(wide if self.direct else gradual),
            ]
        else:
            iteration += alone
        move = [
            every,
            "    step = part_ * dv[j]",
            f"    {trial}[j] = {u}[j] + step if step != 0 else {u}[j]",
            *(["    xt[j] = zx[j] + g * vt[j] if " + free + " else xs[j]"] if second else []),
        ]
        accept = [every, *(f"    {s}[j] = {t}[j]" for _, s, t in state)]
        once = solver.newton == "one"
        if self.searches:
            iteration += [
                f"steep = work_of({self._attributes}, load, dv, part)",
                "if bold or share == 0 or n == 1 or size == 0.0 or (definite and steep > 0.0):",
                "    break",
                f"share = {literal(LESS, dtype)} * share",
                f"share = R(0) if share < {literal(LEAST, dtype)} else share",
            ]
            iteration = [
                f"if bold and k == {BOLD}:",
                *indented([*begin, "bold, first, share = False, True, R(0)"], 1),
                "while True:",
                *indented(iteration, 1),
            ]
        iteration += [
            "change = largest(n, dv, part)",
            "if not change < np.inf:",
            f"    return status | {NOT_SOLVED}",
        ]
        short = f"now < {GROWTH!r} * size"
        if second:
            turned = f"work_of({self._attributes}, lack, dv, part) <= {TURN!r} * steep"
            short = f"({short} if bold or first or not steep > 0.0 else {turned})"
        search = [
            *move,
            *self._force("t"),
            every,
            f"    gap[j] = {trial}[j] - {z}[j]",
            "    lack[j] = gap[j] - g * rate[j]",
            "now = largest(n, lack, part)",
            f"allowed = {solver.tolerance!r} * (largest(n, {z}, part) + largest(n, gap, part))",
            f"if now <= allowed or quiet or {short}:",
            "    break",
            "part_ = R(0.5) * part_",
        ]
        noise = ROUNDINGS * {"float64": 2.0**-52, "float32": 2.0**-23}[dtype]
        if second:
            quiet = f"G * change <= {noise!r} * (G * largest(n, vs, part) + largest(n, xs, part))"
        else:
            quiet = f"change <= {noise!r} * largest(n, xs, part)"
        iteration += ["part_ = R(1)"]
        if once:
            iteration += [*move, *accept, "solved = True"]
        else:
            iteration += [
                "if size == 0.0:",
                *indented([*move, *accept, "solved = True", "break"], 1),
                "G = np.float64(g)",
                f"quiet = {quiet}",
                f"for _ in range({HALVINGS}):",
                *indented(search, 1),
                *accept,
                "if now <= allowed or quiet:",
                "    solved = True",
                "    break",
                f"share = {literal(MORE, dtype)} * share + {literal(AGAIN, dtype)}",
                "share = R(1) if bold or first else min(share, R(1))",
                "first = False",
            ]
        loops = iteration if once else [f"for k in range({solver.max_iterations}):", *indented(iteration, 1)]
        return [
            "status = 0",
            *start,
            *begin,
            "first = True",
            f"distance = apart({self.shared})" if self.eliminates else "distance = n",
            f"narrow = distance <= {BAND} and n <= {LONGEST}" if self.eliminates else "narrow = False",
            "bold = narrow or n == 1" if self.searches else "bold = False",
            "share = R(1) if bold else R(0)",
            "solved = False",
            *loops,
            "if not solved:",
            f"    return status | {NOT_SOLVED}",
            *self._end(),
            "return status",
        ]

    def _divided(self, state: str) -> list[str]:
        """A step in halves, and those whose equations are not solved again in halves, see `Implicit.step`."""
        columns = "xv"[: 1 + self.second]
        every = f"for j in {self.deriv.loop}(3 * n):"
        call = state.replace(" t, h, x, v,", " t + number * length, length, xh, vh,")
        return [
            every,
            *(f"    {y}h[j] = {y}[j]" for y in columns),
            "number, parts = 0, 2",
            "done[2] += 1",
            "while number < parts:",
            "    length = h / parts",
            f"    bad = implicit({call})",
            f"    if bad & {NOT_SOLVED} and parts < {2**self.solver.divisions}:",
            "        done[2] += 1",
            "        number, parts = 2 * number, 2 * parts",
            "        continue",
            "    if bad != 0:",
            "        return bad",
            f"    {every}",
            *(f"        {y}h[j] = {y}1[j]" for y in columns),
            "    number += 1",
            "    while number % 2 == 0 and number < parts:",
            "        number, parts = number // 2, parts // 2",
            "return 0",
        ]

    def _force(self, where: str) -> list[str]:
        v = f"v{where}" if self.second else f"x{where}"
        return [f"status |= deriv({self.deriv.call}, ts, x{where}, {v}, rate)", "done[1] += 1"]

    def _history(self) -> list[str]:
        """z and gamma."""
        loop = f"for j in {self.deriv.loop}(3 * n):"
        parts = "xv"[: 1 + self.second]
        if not isinstance(self.solver, BDF2):
            return [loop, *(f"    z{y}[j] = {y}[j]" for y in parts)]
        one, two = literal(1.0, self.dtype), literal(2.0, self.dtype)
        return [
            "ratio = R(h) / R(h_before[0])",
            f"ratio = R(0) if ratio > {literal(LARGEST_RATIO, self.dtype)} else ratio",
            f"g = R(h) * ({one} + ratio) / ({one} + {two} * ratio)",
            f"weight = ratio * ratio / ({one} + {two} * ratio)",
            loop,
            *(f"    z{y}[j] = {y}[j] + weight * ({y}[j] - {y}_before[j])" for y in parts),
        ]

    def _end(self) -> list[str]:
        """x1, v1 on the line through the stage, and what the next step remembers."""
        lines = [f"for j in {self.deriv.loop}(3 * n):"]
        for y in "xv"[: 1 + self.second]:
            if self.solver.c == 1.0:
                lines.append(f"    {y}1[j] = {y}s[j]")
            else:
                lines.append(f"    rise = {y}s[j] - {y}[j]")
                lines.append(
                    f"    {y}1[j] = {y}[j] + rise / {literal(self.solver.c, self.dtype)} if rise != 0 else {y}[j]"
                )
            if isinstance(self.solver, BDF2):
                lines.append(f"    {y}_before[j] = {y}[j]")
        if self.linked:
            lines.append("    warm[j] = vs[j] - v[j]")
        return [*lines, "h_before[0] = h"]


class _Family:
    """A family of elements in the matrix.

    A pair whose force depends on the differences of its ends has one block for all four, df1/dx1 = -df1/dx2 = df2/dx2,
    of which the upper triangle is kept; others have nodes x nodes blocks. All families of a kind share a buffer.
    `share` is the local of what is counted of all that may make the matrix indefinite, see `ElementForce.softened`.
    """

    def __init__(self, deriv: Deriv, elements: Elements, share: str) -> None:
        self.share = share
        self.elements, self.force, self.number = elements, elements.force, elements.number
        self.nodes = self.force.nodes
        self.switch = f"if {deriv.binder.switch(self.force)} != 0:"
        self.relative = is_relative(self.force)
        self.size = 9 if self.relative else 9 * self.nodes**2
        self.blocks = f"{_kind(self.relative)}_K"
        self.begin = "0"  # number of the first block in the island

    def law(self, deriv: Deriv) -> Text:
        """df/dx and df/dv: entries [node, axis, of node, x or v, axis]; for a relative pair of the first end alone."""
        traced = self.force.softened
        if self.relative:
            traced = Traced(traced.name, traced.inputs, _first_end(traced.program))
        state = {"t": "R(t)", "share": self.share}
        for a in range(self.nodes):
            for q in "xv":
                state |= {n: f"{q}[n{a} + np.uintp({i})]" for i, n in enumerate(vector_names(f"{q}{a + 1}"))}
        return deriv.binder.law(traced, self.force, state, "u_", self.elements.table, f"j{self.number}")

    def evaluate(self, deriv: Deriv, text: Text, gap: str) -> list[str]:
        """Statements that evaluate the blocks of all elements, and df/dx gap into the buffer of forces."""
        j, k = self.number, self.nodes
        stride = "(9 if whole else 6)" if self.relative else "9"
        own = f"b = np.uintp({stride} * ({self._block(f'(u_ - s{j})')}))"
        body = [f"n{a} = np.uintp(3) * np.uintp(E{j}[{k} * u_ + {a}])" for a in range(k)]
        body += [*text.lines, own, f"c = np.uintp({3 * k} * (u_ - s{j}))"]
        body += self._relative(text) if self.relative else self._full(text)
        lines = [line.replace("GAP", gap) for line in body]
        loop = f"    for u_ in {deriv.loop}(s{j}, e{j}):"
        off = [own, f"for q in range({'9 if whole else 6' if self.relative else self.size}):"]
        off.append(f"    {self.blocks}[b + np.uintp(q)] = R(0)")
        return [f"# {self.force.name}", self.switch, loop, *indented(lines, 2), "else:", loop, *indented(off, 2)]

    def _block(self, element: str) -> str:
        """The number of the first block of an element in the island."""
        return f"{self.begin} + {element if self.relative else f'{self.nodes**2} * {element}'}"

    def _relative(self, text: Text) -> list[str]:
        j = self.number
        entry = {(i, q, c): text.outputs[6 * i + 3 * q + c] for i in AXES for q in (0, 1) for c in AXES}
        lines = [f"d{c} = GAP[n0 + np.uintp({c})] - GAP[n1 + np.uintp({c})]" for c in AXES]
        lines.append("if whole:")
        for i, c in SQUARE:
            lines.append(
                f"    {self.blocks}[b + np.uintp({3 * i + c})] = g * ({entry[i, 1, c]}) + gg * ({entry[i, 0, c]})"
            )
        lines.append("else:")
        for k, (i, c) in enumerate(UPPER):
            value = _symmetric(entry[i, 0, c], entry[c, 0, i], entry[i, 1, c], entry[c, 1, i])
            lines.append(f"    {self.blocks}[b + np.uintp({k})] = {value}")
        for i in AXES:
            lines.append(f"l{i} = " + " + ".join(f"{entry[i, 0, c]} * d{c}" for c in AXES))
            lines += [f"B{j}[c + np.uintp({i})] = l{i}", f"B{j}[c + np.uintp({3 + i})] = -l{i}"]
        return lines

    def _full(self, text: Text) -> list[str]:
        j, k = self.number, self.nodes
        place = [(a, i, b, q, c) for a in range(k) for i in AXES for b in range(k) for q in (0, 1) for c in AXES]
        entry = dict(zip(place, text.outputs, strict=True))
        lines = []
        for a in range(k):
            for b in range(k):
                for i, c in SQUARE:
                    value = _symmetric(*(e for q in (0, 1) for e in (entry[a, i, b, q, c], entry[b, c, a, q, i])))
                    own = f"g * ({entry[a, i, b, 1, c]}) + gg * ({entry[a, i, b, 0, c]})"
                    at = 9 * (k * a + b) + 3 * i + c
                    lines.append(f"{self.blocks}[b + np.uintp({at})] = {own} if whole else {value}")
            for i in AXES:
                terms = " + ".join(
                    f"{entry[a, i, b, 0, c]} * GAP[n{b} + np.uintp({c})]" for b in range(k) for c in AXES
                )
                lines.append(f"B{j}[c + np.uintp({3 * a + i})] = {terms}")
        return lines

    def gather(self) -> list[str]:
        """Statements that add the buffer to f_x, f_y, f_z."""
        j = self.number
        lines = [f"b = np.uintp(3) * np.uintp(I{j}[u_])"]
        lines += [f"f_{a} = f_{a} + B{j}[b + np.uintp({k})]" for k, a in enumerate("xyz")]
        return self._each(lines)

    def distance(self) -> list[str]:
        """Statements that take the distance of rows within an element into account."""
        j, k = self.number, self.nodes
        nodes = ", ".join(f"E{j}[{k} * u_ + {a}]" for a in range(k))
        return [
            self.switch,
            f"    for u_ in range(s{j}, e{j}):",
            f"        most = max(most, np.int64(max({nodes})) - np.int64(min({nodes})))",
        ]

    def assemble(self) -> list[str]:
        """Statements that add the blocks of a row to the band."""
        j, k = self.number, self.nodes
        if self.relative:
            lines = [f"c = I{j}[u_]", f"b = np.uintp(9 * ({self._block('(c >> 1)')}))"]
            lines.append(f"other = np.int64(E{j}[2 * s{j} + (c ^ 1)])")
            for i, c in SQUARE:
                for at, sign in ((_place(i, c, "i"), "+"), (_place(i, c, "other"), "-")):
                    lines.append(f"W[{at}] = W[{at}] {sign} {self.blocks}[b + np.uintp({3 * i + c})]")
            return self._each(lines)
        inner = [f"b = np.uintp(9 * ({self.begin} + {k} * c + node))", f"other = np.int64(E{j}[e + node])"]
        for i, c in SQUARE:
            at = _place(i, c, "other")
            inner.append(f"W[{at}] = W[{at}] + {self.blocks}[b + np.uintp({3 * i + c})]")
        lines = [f"c = I{j}[u_]", f"e = {k} * s{j} + c - c % {k}", f"for node in range({k}):"]
        return self._each([*lines, *indented(inner, 1)])

    def _each(self, lines: list[str]) -> list[str]:
        """Over the entries of particle g_."""
        j = self.number
        return [self.switch, f"    for u_ in range(J{j}[g_], J{j}[g_ + 1]):", *indented(lines, 2)]


def _kind(relative: bool) -> str:
    return "pair" if relative else "full"


def _kinds(families: Sequence[_Family]) -> list[Kind]:
    """The kinds of blocks that there are; says to each family where its blocks begin."""
    found = []
    for relative in (True, False):
        mine = [k for k, f in enumerate(families) if f.relative == relative]
        begin: list[str] = []
        for k in mine:
            family = families[k]
            family.begin = " + ".join(begin) or "0"
            count = f"(e{family.number} - s{family.number})"
            begin.append(count if relative else f"{family.nodes**2} * {count}")
        found += [Kind(_kind(relative), relative, tuple(mine))] if mine else []
    return found


def is_relative(force: ElementForce) -> bool:
    """Whether a force of two particles depends on the differences of their places and velocities alone."""
    if force.nodes != 2:
        return False
    if isinstance(force, ConstraintForce):  # all follows from C(x1, x2)
        law = trace(force.constraint, {"x1": "vector", "x2": "vector"}, 1, force.name)
        return _by_difference(law.program, "x")
    program = force.traced.program
    opposite = all(_negative(program, *program.outputs[i::3]) for i in AXES)
    return opposite and _by_difference(program, "x") and _by_difference(program, "v")


def _by_difference(program: Program, quantity: str) -> bool:
    """Whether a program uses the vectors 1 and 2 of a quantity in differences only."""
    ends = [[program.argument(n) for n in vector_names(f"{quantity}{a}")] for a in (1, 2)]
    pairs = {("sub", *pair[::way]) for pair in zip(*ends, strict=True) for way in (1, -1)}
    mine = {node for end in ends for node in end}
    users = [program.nodes[i] for i in program.live() if program.nodes[i][0] not in ("const", "arg", "call")]
    return not mine & set(program.outputs) and all(u in pairs for u in users if mine & set(u[1:]))


def _negative(program: Program, one: int, other: int) -> bool:
    """Whether two outputs are each other's negative."""
    nodes = program.nodes
    return (
        nodes[one] == ("neg", other) or nodes[other] == ("neg", one) or program.value(one) == program.value(other) == 0
    )


def _first_end(program: Program) -> Program:
    """Of the slopes of a pair, those of the force on the first end by its own place and velocity."""
    return replace(program, outputs=[program.outputs[12 * i + k] for i in AXES for k in range(6)])


def _offsets() -> list[str]:
    return [f"o_{a} = np.uintp(3 * i + {k})" for k, a in enumerate("xyz")]


def _symmetric(a: str, a_turned: str, b: str, b_turned: str) -> str:
    """An entry of gamma df/dv + gamma^2 df/dx, made symmetric."""
    return f"R(0.5) * (g * ({b} + {b_turned}) + gg * ({a} + {a_turned}))"


def _place(i: int, c: int, other: str) -> str:
    """Where the band keeps entry (i, c) of the block of particle i and another one."""
    return f"np.uintp((3 * i + {i}) * wide + 3 * ({other} - i) + m + {c - i})"


def _projected(matrices: str, vector: str, result: str) -> list[str]:
    """result[i] = matrices[i] vector[i]."""
    return [
        *read(matrices, "i", "s_"),
        *times(
            "s_", [f"{vector}[np.uintp(3 * i + {k})]" for k in AXES], [f"{result}[np.uintp(3 * i + {k})]" for k in AXES]
        ),
    ]
