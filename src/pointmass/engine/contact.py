"""Prints what the colliders do to a particle as functions of scalars, for kernels: the same bits as the reference path.

`ContactText(surfaces_of(system), order, lagged, dtype)` holds the text; put it before the text of the kernel. Numbers
of surfaces are data: `table()` gives them, one row each, for the argument P, and behind the rows what is looked up in
meshes. What is compiled are the kinds of surface and the programs of those that move. A particle's contacts, and what
was looked up for it last, are `record` numbers of a flat float64 scratch array C from an offset o on; at first they are
0. All arithmetic is float64, also where the state is float32; positions, velocities and forces are three scalars each.

For one particle, in the order of the reference path (a pinned one is left out, with C[o] = 0):

    near(P, C, o, t, x, radius) -> bool                                       is `find` needed? Else C[o] = 0.
    find(P, C, o, t, x, v, m, a, radius, braking) -> v                    before each trial; a: unfiltered acceleration
    bear(P, C, o, t, x, v, m, f) -> f                                     in deriv_eval, on the sum of all forces
    project(P, C, o, matrix, scratch)                                     of a lagged filter: 9 numbers, with 18 scratch
    drag_of(C, o) -> -df/dv of friction in these directions               of a lagged filter
    settle(P, C, o, t + h, h, x, v, radius) -> x, v                       after each kept step, and what follows too
    bounce(P, C, o, t + h, x, v, radius) -> x, v, hit
    strike(P, C, o, alone, events, x0, v0, x, v, t, h, radius) -> x, v, clock, events, ground
    evict(P, C, o, clock, x, v, radius, x at the start of the whole step, when that was) -> x, v

`strike` hit something where it returns more events than it was given; then and where `bounce` hit, the solver starts
anew. Events and hits from KILLED on are deadly: the particle is to be taken away when the step ends. One that is
`alone` goes on from `clock`. One of a larger island has finished its step; if it has hit something and events <=
MOST_EVENTS, the pull that it did not feel is to be paid (see ReferenceEngine._pay) before `evict`: its jump is v minus
the velocity of the chord, (x1 - x0) / h with the solver's x1, and `ground` that of what it hit.

    clear(P, x0, v0, x1, v1, t, h, radius) -> bool

holds only where all of this would do nothing in a step from x0, v0 to x1, v1. For loops over lanes, whose t and h are
common, `clear_lines` gives its statements.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions import contact, swept
from pointmass.collisions.collider import Collider, Response
from pointmass.collisions.looked_up import LookedUp
from pointmass.engine.lookups import LOOKUPS, body_of
from pointmass.engine.printing import indented, literal, statements
from pointmass.engine.reference import EVICTIONS, KILLED, MOST_EVENTS
from pointmass.laws.parameter import Component, Parameter
from pointmass.tracing.columns import expanded
from pointmass.tracing.trace import Traced, vector_names

TABLE = (  # columns of a surface's row
    *("KIND", "SWEPT", "MOTION", "BULGES", "FLAT", "RESPONSE", "RESTITUTION", "FRICTION"),
    *("NEAR", "ROOM", "LOOKUP", "STEEP", "DATA"),
    *("PLACE", "", "", "SHAPE"),
)
RECORD = {  # of a contact, with the size of each
    **{"ON": 1, "LEVEL": 1, "START": 3, "SLIDE": 3, "SPEED": 1, "LOAD": 1, "GIVEN": 3, "NORMAL": 3},
    **{"PRESSED": 1, "HELD": 1, "STICKS": 1, "CARRIED": 3, "BEND": 1, "DRAG": 1, "DRIFT": 3},
}
REMEMBERED = 8  # numbers: whether there is a point, its place, distance and normal; what a search remembers is behind
RESPONSES = get_args(Response)
TRIAL = ("find", "settle", "strike", "evict")  # what a kernel calls before and after each trial
WIDE = 1.000001  # times a way: more than the roundings of ways
ROUNDING = {"float64": 1e-13, "float32": 1e-6}  # of the places between which `clear` looks, on top of eps
FEW = 3  # surfaces of a kind that are printed one by one
PATH = [f"{p}{end}" for end in "01" for p in ("x", "y", "z", "u", "v", "w")]


class ContactText:
    """The functions for a list of surfaces.

    Parameters
    ----------
    surfaces : in the order in which they act, see `reference.surfaces_of`.
    order : of the system.
    lagged : whether the solver is implicit.
    dtype : of the state, "float64" or "float32": how large its round-off is.
    trial : flags of the functions that follow each trial: a kernel that calls them in one place may inline them.

    Attributes
    ----------
    text : the functions.
    record : how many numbers of scratch a particle takes.
    kills : whether a surface kills.
    discrete : whether there is anything to `bounce` off.
    looks_up : whether the distance of a surface is looked up in data.
    """

    def __init__(
        self, surfaces: Sequence[Collider], order: int, lagged: bool, dtype: str, trial: str = "**APART"
    ) -> None:
        self.surfaces, self._dtype = surfaces, dtype
        self._memory = 1 + sum(RECORD.values()) * len(surfaces)
        self.looks_up = any(s.lookup for s in surfaces)
        self._remembered = max((REMEMBERED + LOOKUPS[s.lookup].memory for s in surfaces if s.lookup), default=0)
        self.record = self._memory + self._remembered * len(surfaces)
        self._kinds = list(dict.fromkeys(s.lookup or s.laws for s in surfaces))
        self._row = TABLE.index("SHAPE") + max((len(s.shape) for s in surfaces), default=0)
        blocks = [s.data if isinstance(s, LookedUp) else np.zeros(0) for s in surfaces]
        self._starts = self._row * len(surfaces) + np.cumsum([0, *(b.size for b in blocks)])[:-1]
        self._table = np.concatenate([np.zeros(self._row * len(surfaces)), *blocks])
        self._motions = list({id(s.motion): s.motion for s in surfaces if s.moves}.values())
        self.kills = any(s.response == "kill" for s in surfaces)
        self.discrete = order == 2 and any(s.contact == "discrete" for s in surfaces)
        printed = [*self._constants(order, lagged), "", *self._laws(), *self._places()]
        body = body_of("contact_text.py")
        for name in TRIAL:
            body = body.replace(f"@njit(**APART)\ndef {name}(", f"@njit({trial})\ndef {name}(")
        self.text = "\n".join([*printed, body, *self._lookups(), *self._clear()])

    def table(self) -> NDArray[np.float64]:
        """The numbers of the surfaces now, one row each, and their data behind. The next call changes this array."""
        rows = self._table[: self._row * len(self.surfaces)].reshape(len(self.surfaces), self._row)
        for k, (row, s) in enumerate(zip(rows, self.surfaces, strict=True)):
            motion = 1 + [id(m) for m in self._motions].index(id(s.motion)) if s.moves else 0
            place = [c.value if isinstance(c.value, float) else 0.0 for c in s.motion.parameters[0].components]
            room = s.eps + ROUNDING[self._dtype] * float(np.abs(place).sum())
            kind = self._kinds.index(s.lookup or s.laws)
            numbers: list[float] = [kind, s.contact == "swept", motion, s.bulges, _flat(s)]
            numbers += [RESPONSES.index(s.response), *s.impact, s.eps, room]
            numbers += [bool(s.lookup), s.steepness, self._starts[k]]
            numbers += [*place, *s.shape]
            row[: len(numbers)] = numbers
        return self._table

    def _constants(self, order: int, lagged: bool) -> list[str]:
        """Names for numbers, and which branches there are: those that no surface takes are not compiled."""
        offsets = np.cumsum([0, *RECORD.values()]).tolist()
        numbers = {name: k for k, name in enumerate(TABLE) if name} | dict(zip(RECORD, offsets, strict=False))
        numbers |= {"RECORD": offsets[-1], "ORDER": order, "LAGGED": lagged, "PASSES": contact.PASSES}
        numbers |= {"SQUARINGS": contact.PASSES.bit_length() - 1, "MOST_CHORDS": float(swept.MOST_CHORDS)}
        numbers |= {"NEWTON_STEPS": swept.NEWTON_STEPS, "ROOT_STEPS": swept.ROOT_STEPS, "BACK_STEPS": swept.BACK_STEPS}
        numbers |= {"RESOLUTION": swept.RESOLUTION}
        numbers |= {"STICK": RESPONSES.index("stick"), "KILL": RESPONSES.index("kill"), "KILLED": KILLED}
        numbers |= {"MOST_EVENTS": MOST_EVENTS, "EVICTIONS": EVICTIONS, "SETTLED": contact.SETTLED}
        rounding = contact.STILL * float(np.finfo(self._dtype).eps)
        numbers |= {"ROUND": rounding, "CREEP": max(contact.CREEP, rounding)}
        numbers |= {"MARGIN": swept.MARGIN, "MOST_LOOKS": swept.MOST_LOOKS, "WIDE": WIDE}
        numbers |= {"SURFACES": len(self.surfaces)}
        numbers |= {"ROW": self._row, "MEMORY": self._memory, "REMEMBERED": self._remembered}
        flat = [_flat(s) for s in self.surfaces]
        numbers |= {"LOOKUPS": self.looks_up}
        numbers |= {"CHORDS": not all(f or s.lookup for f, s in zip(flat, self.surfaces, strict=True))}
        numbers |= {"KILLS": self.kills, "STICKY": any(s.response == "stick" for s in self.surfaces)}
        numbers |= {"FLATS": any(flat), "CURVED": not all(flat), "MOVING": bool(self._motions)}
        numbers |= {"BULGING": any(s.bulges for s, f in zip(self.surfaces, flat, strict=True) if not f)}
        return [f"{name} = {value!r}" for name, value in numbers.items()]

    # ------------------------------------------------------------------------------------------------ laws

    def _laws(self) -> list[str]:
        """`gap_of`, `normal_of` and `bending_of`."""
        x, v = ["x", "y", "z"], ["u", "v", "w"]
        lines = []
        found = {"gap_of": "return C[at]", "normal_of": "return C[at + 1], C[at + 2], C[at + 3]"}
        for name, memory, arguments, law in (
            ("gap_of", "C, o, ", x, "distance"),
            ("normal_of", "C, o, ", x, "normal"),
            ("bending_of", "", [*x, *v], "bending"),
        ):
            names = {**_vector("x", "x", "y", "z"), **_vector("v", "u", "v", "w")}
            cases = []
            for kind in self._kinds:
                if not isinstance(kind, str):
                    program = getattr(kind, law)
                    cases.append(_case(program, names | _shape("k", program)))
                elif name == "bending_of":
                    cases.append(["return 0.0"])
                else:
                    cases.append(["at = remembered(P, C, o, k, x, y, z)", found[name]])
            lines += _dispatched(f"{name}(P, {memory}k, {', '.join(arguments)})", "int(P[k * ROW + KIND])", cases)
        return lines

    def _lookups(self) -> list[str]:
        """The search in data, and `look_of`, which does that of a surface."""
        names = [(j, kind) for j, kind in enumerate(self._kinds) if isinstance(kind, str)]
        texts = [LOOKUPS[kind].text(TABLE.index("SHAPE")) for _, kind in names]
        *several, last = [[f"return {LOOKUPS[kind].call}"] for _, kind in names] or [[]]
        if not last:
            return []
        keyed = ["which = int(P[k * ROW + KIND])"] if several else []
        keyed += [line for (j, _), case in zip(names, several, strict=False) for line in _when(j, case)]
        return [*texts, "@njit(**FLAGS)", "def look_of(P, C, m, k, x, y, z):", *indented([*keyed, *last], 1), "", ""]

    def _places(self) -> list[str]:
        """`place_of`, `ground_of` and `push_of`."""
        lines = []
        for which, name in enumerate(("place_of", "ground_of", "push_of")):
            still = [f"P[k * ROW + PLACE + {j}]" for j in range(3)] if which == 0 else ["0.0"] * 3
            cases = [[f"return {', '.join(still)}"]]
            cases += [_moving(m.parameters[which], f"m{j}_", "t", still) for j, m in enumerate(self._motions)]
            lines += _dispatched(f"{name}(P, k, t)", "int(P[k * ROW + MOTION])", cases)
        return lines

    # ------------------------------------------------------------------------------------------------ clear

    def _clear(self) -> list[str]:
        arguments = f"P, {', '.join(PATH)}, t0, h, radius"
        lines = self.clear_lines("float64", "P", loops=True)
        third = f"third = h * {1 / 3!r}"
        body = [*lines.once, *lines.step, third, *lines.begin, *lines.looks]
        body += [*lines.lane, *lines.end, f"return {lines.result}"]
        return ["@njit(**FLAGS)", f"def clear({arguments}):", *indented(body, 1), "", ""]

    def clear_lines(self, dtype: str, table: str, loops: bool = False) -> ClearLines:
        """The statements of `clear`, in a precision.

        Parameters
        ----------
        table : name of the array of numbers.
        loops : whether many surfaces of a kind may be a loop, which no vector of particles can go through.
        """
        counts = Counter(s.laws for s in self.surfaces if loops and _hull_law(s) is not None)
        looped: set[Any] = set()
        lines = ClearLines()
        rounding = literal(ROUNDING[dtype], dtype)
        lines.begin.append(f"size = radius + {rounding} * ({' + '.join(f'abs({p})' for p in PATH[:3])})")
        lines.end.append(f"size = size + {rounding} * ({' + '.join(f'abs({p})' for p in PATH[6:9])})")
        for k, surface in enumerate(self.surfaces):
            if _flat(surface):
                self._clear_of_plane(k, dtype, table, lines)
                continue
            if surface.lookup:
                self._clear_by_bound(k, surface.lookup, dtype, table, lines)
                continue
            if "safe = True" not in lines.begin:
                lines.begin.append("safe = True")
                lines.lane.append(f"far = radius + {rounding} * ({' + '.join(f'abs({p})' for p in PATH[6:9])})")
                lines.results.append("safe")
            apart = _hull_law(surface)
            if apart is None:
                self._clear_by_distance(k, dtype, table, lines)
            elif counts[surface.laws] <= FEW:
                self._clear_by_hull(k, apart, dtype, table, lines)
            elif surface.laws not in looped:
                looped.add(surface.laws)
                lines.lane += self._clear_by_hulls(self._kinds.index(surface.laws), apart, dtype, table)
        return lines

    def _clear_by_hulls(self, kind: int, apart: Traced, dtype: str, table: str) -> list[str]:
        """`_clear_by_hull` of all surfaces at rest of a kind, in a loop."""
        each = ClearLines()
        self._clear_by_hull("k", apart, dtype, table, each)
        return [
            "for k in range(SURFACES):",
            f"    if {table}[k * ROW + KIND] == {kind} and {table}[k * ROW + MOTION] == 0:",
            *indented([*each.once, *each.lane], 2),
        ]

    def _clear_of_plane(self, k: int, dtype: str, table: str, lines: ClearLines) -> None:
        """The control points of the paths, whose hulls they do not leave, are all on the free side: the ends, and those
        that are a third of a step away from an end at its velocity. Where steps meet, one of the latter is the lowest.
        """
        tag, surface = f"q{k}_", self.surfaces[k]
        laws = surface.laws
        lines.once += [f"{tag}{a} = R({table}[{k} * ROW + PLACE + {j}])" for j, a in enumerate("xyz")]
        lines.once.append(f"{tag}room = R({table}[{k} * ROW + ROOM])")
        numbers = _numbers(lines.once, tag, k, laws.distance, table) | _numbers(lines.once, tag, k, laws.normal, table)
        _, normal = statements(expanded(laws.normal.program), numbers, f"{tag}n_", dtype)
        origin = _vector("x", *(f"(-{tag}{a})" for a in "xyz"))
        more, (gap,) = statements(expanded(laws.distance.program), origin | numbers, f"{tag}0_", dtype)
        lines.once += [*more, f"{tag}gap = {gap}"]
        value = surface.normal(np.zeros((1, 3)), 0.0)[0].tolist()

        def along(*parts: str) -> str:
            """The part of a vector along the normal; a plane with faces along the axes needs no products."""
            terms = [(n, v, p) for n, v, p in zip(normal, value, parts, strict=True) if v != 0]
            return " + ".join({1.0: p, -1.0: f"(-{p})"}.get(v, f"{n} * {p}") for n, v, p in terms)

        def lower(point: str) -> str:
            return f"{tag}low = {tag}low if {tag}low < {point} else {point}"

        lines.begin += [
            f"{tag}low = {along('x0', 'y0', 'z0')}",
            f"{tag}a = {tag}low + third * ({along('u0', 'v0', 'w0')})",
            lower(f"{tag}a"),
        ]
        there = f"{tag}b = {along('x1', 'y1', 'z1')}"
        lines.inner += [there, f"{tag}c = {tag}b - third * abs({along('u1', 'v1', 'w1')})", lower(f"{tag}c")]
        lines.end += [there, f"{tag}c = {tag}b - third * ({along('u1', 'v1', 'w1')})"]
        lines.end += [lower(f"{tag}b"), lower(f"{tag}c")]
        lines.results.append(f"{tag}low + {tag}gap > {tag}room + size")

    def _clear_by_hull(self, k: int | str, apart: Traced, dtype: str, table: str, lines: ClearLines) -> None:
        """The hull of the control points is apart from the surface."""
        tag = f"q{k}_"
        lines.once += [f"{tag}{a} = R({table}[{k} * ROW + PLACE + {j}])" for j, a in enumerate("xyz")]
        lines.once.append(f"{tag}room = R({table}[{k} * ROW + ROOM])")
        inner = [
            f"{c}{a} = {a}{e} {s} third * {b}{e}"
            for c, e, s in ("a0+", "c1-")
            for a, b in zip("xyz", "uvw", strict=True)
        ]
        lines.lane += [line for line in inner if line not in lines.lane]
        controls = [*PATH[:3], "ax", "ay", "az", "cx", "cy", "cz", *PATH[6:9]]
        points = [f"({p} - {tag}{'xyz'[j % 3]})" for j, p in enumerate(controls)]
        names = {n: points[j] for j, n in enumerate(n for b in range(4) for n in vector_names(f"b{b}"))}
        names |= _numbers(lines.once, tag, k, apart, table) | {"room": f"{tag}far"}
        more, (result,) = statements(expanded(apart.program), names, tag, dtype)
        lines.lane += [f"{tag}far = {tag}room + far", *more, f"safe = safe & ({result} != R(0))"]

    def _clear_by_distance(self, k: int, dtype: str, table: str, lines: ClearLines) -> None:
        """The start is farther away than the whole way of particle and surface, and the end is free."""
        tag, law = f"q{k}_", self.surfaces[k].laws.distance
        self._way(k, table, lines)
        numbers = _numbers(lines.once, tag, k, law, table)
        gaps = []
        for j in range(2):
            at = _vector("x", *(f"({a}{j} - {tag}{a}{j})" for a in "xyz"))
            more, (gap,) = statements(expanded(law.program), at | numbers, f"{tag}{j}_", dtype)
            lines.lane += more
            gaps.append(f"({gap} - far)")
        wide = literal(WIDE, dtype)
        away = f"({gaps[0]} > {tag}near + {wide} * (way + {tag}way)) & ({gaps[1]} > {tag}near)"
        lines.lane.append(f"safe = safe & {away}")

    def _clear_by_bound(self, k: int, lookup: str, dtype: str, table: str, lines: ClearLines) -> None:
        """The first start is farther away than the whole way by the bound that the surface's data give at once."""
        tag, wide = f"q{k}_", literal(WIDE, dtype)
        self._way(k, table, lines)
        place = ", ".join(f"np.float64({a}0 - {tag}{a}0)" for a in "xyz")
        apart, bound = (f"R({lookup}_{which}({table}, {k}, {place}))" for which in ("apart", "bound"))
        lines.looked[f"{tag}gap"] = apart, bound
        lines.lane.append(f"{tag}gap = {tag}gap - {wide} * (way + {tag}way)")
        lines.results.append(f"{tag}gap > {tag}near + size")

    def _way(self, k: int, table: str, lines: ClearLines) -> None:
        """Where the surface is at the beginning and the end of a step, and the ways of surface and particle."""
        tag, surface = f"q{k}_", self.surfaces[k]
        for j, time in enumerate(("t0", "t0 + h")):
            lines.step.append(", ".join(f"{tag}{a}{j}d" for a in "xyz") + f" = place_of({table}, {k}, {time})")
            lines.step += [f"{tag}{a}{j} = R({tag}{a}{j}d)" for a in "xyz"]
        lines.once.append(f"{tag}near = R({table}[{k} * ROW + NEAR])")
        if surface.moves:
            moved = ", ".join(f"{tag}{a}1d - {tag}{a}0d" for a in "xyz")
            lines.step.append(f"{tag}way = R(length3({moved}) + swing_of({table}, {k}, t0, h))")
        else:
            lines.once.append(f"{tag}way = R(0)")
        if not any(line.startswith("way =") for line in lines.lane):
            lines.lane.append(f"way = {' + '.join(f'abs({p})' for p in _legs())}")


@dataclass
class ClearLines:
    """The statements of `clear`, for one step or for several in a row.

    They know a third of the longest step by the name of `third`: a longer one makes hulls and ways larger.

    Attributes
    ----------
    once : of the table alone.
    step : of the time t0 and the length h of a step.
    begin : of the start x0, ..., w0 of the first step and the radius.
    looked : of the start, too: locals, and two expressions of their values: that which is above 0 far from all data,
        and one that looks into the data, which no vector can do.
    lane : of a step from x0, ..., w0 to x1, ..., w1.
    inner : after each step but the last.
    end : after the last step.
    results : conditions that all hold if everything was clear.
    """

    once: list[str] = field(default_factory=list)
    step: list[str] = field(default_factory=list)
    begin: list[str] = field(default_factory=list)
    looked: dict[str, tuple[str, str]] = field(default_factory=dict)
    lane: list[str] = field(default_factory=list)
    inner: list[str] = field(default_factory=list)
    end: list[str] = field(default_factory=list)
    results: list[str] = field(default_factory=list)

    @property
    def looks(self) -> list[str]:
        """Statements that give the locals of `looked` their values."""
        return [f"{name} = {bound}" for name, (_, bound) in self.looked.items()]

    @property
    def result(self) -> str:
        """Whether it is clear, as an expression."""
        return " & ".join(f"({r})" for r in self.results) or "True"


def _flat(surface: Collider) -> bool:
    """Whether it is a plane at rest: a path crosses it where a polynomial is 0."""
    return not surface.curved and not surface.moves


def _hull_law(surface: Collider) -> Traced | None:
    """The law that tells whether the hull of some points is apart from a curved surface at rest, if there is one."""
    return None if _flat(surface) or surface.lookup or surface.moves else surface.laws.apart


def _legs() -> list[str]:
    """Coordinates of the legs of the control polygon."""
    return [
        leg
        for a, b in zip("xyz", "uvw", strict=True)
        for leg in (f"third * {b}0", f"third * {b}1", f"({a}1 - {a}0) - third * ({b}0 + {b}1)")
    ]


def _printed(law: Traced, names: Mapping[str, str], prefix: str) -> tuple[list[str], list[str]]:
    return statements(expanded(law.program, inline=True), names, prefix, "float64")


def _vector(name: str, *parts: str) -> dict[str, str]:
    return dict(zip(vector_names(name), parts, strict=True))


def _count(law: Traced) -> int:
    """How many numbers of shape a law takes."""
    return sum(n.startswith("s") for n in law.inputs)


def _shape(k: str, law: Traced) -> dict[str, str]:
    return {f"s{j}": f"P[{k} * ROW + SHAPE + {j}]" for j in range(_count(law))}


def _numbers(before: list[str], tag: str, k: int | str, law: Traced, table: str) -> dict[str, str]:
    """Names of locals for the numbers of a shape, read in `before`."""
    used = [j for j in range(_count(law)) if f"s{j}" in law.program.arguments()]
    before += [f"{tag}s{j} = R({table}[{k} * ROW + SHAPE + {j}])" for j in used]
    return {f"s{j}": f"{tag}s{j}" for j in used}


def _case(law: Traced, names: Mapping[str, str]) -> list[str]:
    lines, outputs = _printed(law, names, "r")
    return [*lines, f"return {', '.join(outputs)}"]


def _moving(parameter: Parameter, prefix: str, t: str, still: Sequence[str]) -> list[str]:
    """The three numbers of a motion at a time; those that never change are taken from `still`."""
    lines: list[str] = []
    outputs = [_component(c, f"{prefix}{j}_", t, still[j], lines) for j, c in enumerate(parameter.components)]
    return [*lines, f"return {', '.join(outputs)}"]


def _component(component: Component, prefix: str, t: str, still: str, lines: list[str]) -> str:
    if not isinstance(component.value, Traced):
        return still
    more, (output,) = _printed(component.value, {"t": t}, prefix)
    lines += more
    return output


def _dispatched(head: str, key: str, cases: Iterable[Sequence[str]]) -> list[str]:
    """A function that does one of several things, by a number of the surface."""
    *several, last = cases
    lines = [f"which = {key}"] if several else []
    for number, case in enumerate(several):
        lines += _when(number, case)
    return ["@njit(**FLAGS)", f"def {head}:", *indented([*lines, *last], 1), "", ""]


def _when(number: int, case: Sequence[str]) -> list[str]:
    """Statements of the surfaces of a kind, or with a motion."""
    return [f"if which == {number}:", *indented(list(case), 1)]
