"""Prints what the colliders do to a particle as functions of scalars, for kernels: the same bits as the reference path.

`ContactText(surfaces_of(system), order, lagged, dtype)` holds the text; put it before the text of the kernel. Numbers
of surfaces are data: `table()` gives them, one row each, for the argument P. What is compiled are the kinds of surface
and the programs of those that move. A particle's contacts are `record` numbers of a flat float64 scratch array C from
an offset o on. All arithmetic is float64, also where the state is float32; positions, velocities and forces are three
scalars each.

For one particle, in the order of the reference path (a pinned one is left out, with C[o] = 0):

    near(P, t, x, radius) -> bool                                         is `find` needed? Else C[o] = 0.
    find(P, C, o, t, x, v, m, a, radius) -> v                             before each trial; a: unfiltered acceleration
    bear(P, C, o, t, x, v, m, f) -> f                                     in deriv_eval, on the sum of all forces
    project(P, C, o, matrix, scratch)                                     of a lagged filter: 9 numbers, with 18 scratch
    settle(P, C, o, t + h, h, x, v, radius) -> x, v                       after each kept step, and what follows too
    bounce(P, t + h, x, v, radius) -> x, v, hit
    strike(P, C, o, alone, events, x0, v0, x, v, t, h, radius) -> x, v, clock, events, ground
    evict(P, clock, x, v, radius, x at the start of the whole step, when that was) -> x, v

`strike` hit something where it returns more events than it was given; then and where `bounce` hit, the solver starts
anew. One that is `alone` goes on from `clock`. One of a larger island has finished its step; if it has hit something
and events <= MOST_EVENTS, the pull that it did not feel is to be paid (see ReferenceEngine._pay) before `evict`: its
jump is v minus the velocity of the chord, (x1 - x0) / h with the solver's x1, and `ground` that of what it hit.

    clear(P, x0, v0, x1, v1, t, h, radius) -> bool

holds only where all of this would do nothing in a step from x0, v0 to x1, v1. For loops over lanes, whose t and h are
common, `clear_lines` gives its statements: those before the loop, those for each lane, and the result.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pointmass.collisions import contact, swept
from pointmass.collisions.collider import Collider
from pointmass.engine.printing import indented, statements
from pointmass.engine.reference import EVICTIONS, MOST_EVENTS
from pointmass.laws.parameter import Component, Parameter
from pointmass.tracing.columns import expanded
from pointmass.tracing.trace import Traced, vector_names

TABLE = ("KIND", "SWEPT", "MOTION", "BULGES", "RESTITUTION", "FRICTION", "NEAR", "ROOM", "PLACE", "", "", "SHAPE")
RECORD = {  # of a contact, with the size of each
    **{"ON": 1, "LEVEL": 1, "START": 3, "SLIDE": 3, "SPEED": 1, "LOAD": 1, "GIVEN": 3, "NORMAL": 3},
    **{"PRESSED": 1, "HELD": 1, "STICKS": 1, "CARRIED": 3, "BEND": 1},
}
MARK = "# ---------------------------------------------------------------------------------------------------------- printed\n"
ROUNDING = 1e-13  # of the places between which `clear` looks, on top of eps
PATH = [f"{p}{end}" for end in "01" for p in ("x", "y", "z", "u", "v", "w")]


class ContactText:
    """The functions for a list of surfaces.

    Parameters
    ----------
    surfaces : in the order in which they act, see `reference.surfaces_of`.
    order : of the system.
    lagged : whether the solver is implicit.
    dtype : of the state, "float64" or "float32": how large its round-off is.

    Attributes
    ----------
    text : the functions.
    record : how many numbers of scratch a particle takes.
    clear_lines : statements before a loop over lanes, statements for a lane, and the expression of the result.
    """

    def __init__(self, surfaces: Sequence[Collider], order: int, lagged: bool, dtype: str) -> None:
        self.surfaces = surfaces
        self.record = 1 + sum(RECORD.values()) * len(surfaces)
        self._kinds = list(dict.fromkeys(s.laws for s in surfaces))
        self._motions = list({id(s.motion): s.motion for s in surfaces if s.moves}.values())
        self.clear_lines = self._clear_lines()
        body = Path(__file__).with_name("contact_text.py").read_text(encoding="utf-8").split(MARK)[1]
        printed = [*_constants(order, lagged, dtype), "", *self._laws(), *self._places()]
        self.text = "\n".join([*printed, body.strip("\n"), "", "", *self._clear()])

    def table(self) -> NDArray[np.float64]:
        """The numbers of the surfaces now, one row each."""
        first = TABLE.index("SHAPE")
        result = np.zeros((len(self.surfaces), first + max((len(s.shape) for s in self.surfaces), default=0)))
        for row, s in zip(result, self.surfaces, strict=True):
            motion = 1 + [id(m) for m in self._motions].index(id(s.motion)) if s.moves else 0
            place = [c.value if isinstance(c.value, float) else 0.0 for c in s.motion.parameters[0].components]
            room = s.eps + ROUNDING * float(np.abs(place).sum())
            numbers = [self._kinds.index(s.laws), s.contact == "swept", motion, s.bulges]
            numbers += [s.restitution, s.friction, s.eps, room, *place, *s.shape]
            row[: len(numbers)] = numbers
        return result

    # ------------------------------------------------------------------------------------------------ laws

    def _laws(self) -> list[str]:
        """`gap_of`, `normal_of` and `bending_of`."""
        x, v = ["x", "y", "z"], ["u", "v", "w"]
        lines = []
        for name, arguments, programs in (
            ("gap_of", x, [k.distance for k in self._kinds]),
            ("normal_of", x, [k.normal for k in self._kinds]),
            ("bending_of", [*x, *v], [k.bending for k in self._kinds]),
        ):
            names = {**_vector("x", "x", "y", "z"), **_vector("v", "u", "v", "w")}
            cases = [_case(p, names | _shape("k", p)) for p in programs]
            lines += _dispatched(f"{name}(P, k, {', '.join(arguments)})", "int(P[k, KIND])", cases)
        return lines

    def _places(self) -> list[str]:
        """`place_of`, `ground_of` and `push_of`."""
        lines = []
        for which, name in enumerate(("place_of", "ground_of", "push_of")):
            still = ["P[k, PLACE]", "P[k, PLACE + 1]", "P[k, PLACE + 2]"] if which == 0 else ["0.0"] * 3
            cases = [[f"return {', '.join(still)}"]]
            cases += [_moving(m.parameters[which], f"m{j}_", "t", still) for j, m in enumerate(self._motions)]
            lines += _dispatched(f"{name}(P, k, t)", "int(P[k, MOTION])", cases)
        return lines

    # ------------------------------------------------------------------------------------------------ clear

    def _clear(self) -> list[str]:
        arguments = f"P, {', '.join(PATH)}, t0, h, radius"
        before, inside, result = self.clear_lines
        body = [*before, *inside, f"return {result}"]
        return ["@njit(**FLAGS)", f"def clear({arguments}):", *indented(body, 1), "", ""]

    def _clear_lines(self) -> tuple[list[str], list[str], str]:
        before = ["third = h * 0.3333333333333333"]
        ends = [
            (f"a{a}", f"{a}0 + third * {r}0", f"c{a}", f"{a}1 - third * {r}1")
            for a, r in zip("xyz", "uvw", strict=True)
        ]
        inside = [line for a, first, c, second in ends for line in (f"{a} = {first}", f"{c} = {second}")]
        controls = [*PATH[:3], "ax", "ay", "az", "cx", "cy", "cz", *PATH[6:9]]
        inside += [
            f"size = radius + {ROUNDING!r} * ({' + '.join(f'abs({p})' for p in controls)})",
            f"way = {' + '.join(f'abs({p})' for p in _legs())}",
        ]
        results = []
        for k, surface in enumerate(self.surfaces):
            tag = f"q{k}_"
            apart = surface.laws.apart
            if apart is not None and not surface.moves:
                before += [f"{tag}{a} = P[{k}, PLACE + {j}]" for j, a in enumerate("xyz")]
                points = [f"({p} - {tag}{'xyz'[j % 3]})" for j, p in enumerate(controls)]
                names = {n: points[j] for j, n in enumerate(n for b in range(4) for n in vector_names(f"b{b}"))}
                before.append(f"{tag}room = P[{k}, ROOM]")
                lines, (result,) = _printed(apart, names | _numbers(before, tag, k, apart) | {"room": f"{tag}far"}, tag)
                inside += [f"{tag}far = {tag}room + size", *lines]
                results.append(f"({result} != 0.0)")
            else:
                results.append(self._clear_by_distance(k, before, inside))
        return before, inside, " & ".join(results) or "True"

    def _clear_by_distance(self, k: int, before: list[str], inside: list[str]) -> str:
        """The start is farther away than the whole way of particle and surface, and the end is free."""
        tag, surface = f"q{k}_", self.surfaces[k]
        law = surface.laws.distance
        for j, time in enumerate(("t0", "t0 + h")):
            before.append(", ".join(f"{tag}{a}{j}" for a in "xyz") + f" = place_of(P, {k}, {time})")
        before += [f"{tag}near = P[{k}, NEAR]", f"{tag}way = 0.0"]
        if surface.moves:
            moved = ", ".join(f"{tag}{a}1 - {tag}{a}0" for a in "xyz")
            before[-1] = f"{tag}way = length3({moved}) + swing_of(P, {k}, t0, h)"
        numbers = _numbers(before, tag, k, law)
        gaps = []
        for j in range(2):
            at = _vector("x", *(f"({a}{j} - {tag}{a}{j})" for a in "xyz"))
            lines, (gap,) = _printed(law, at | numbers, f"{tag}{j}_")
            inside += lines
            gaps.append(f"({gap} - size)")
        return f"({gaps[0]} > {tag}near + 1.000001 * (way + {tag}way)) & ({gaps[1]} > {tag}near)"


def _legs() -> list[str]:
    """Coordinates of the legs of the control polygon."""
    return [leg for a in "xyz" for leg in (f"a{a} - {a}0", f"c{a} - a{a}", f"{a}1 - c{a}")]


def _constants(order: int, lagged: bool, dtype: str) -> list[str]:
    offsets = np.cumsum([0, *RECORD.values()]).tolist()
    numbers = {name: k for k, name in enumerate(TABLE) if name} | dict(zip(RECORD, offsets, strict=False))
    numbers |= {"RECORD": offsets[-1], "ORDER": order, "LAGGED": lagged, "PASSES": contact.PASSES}
    numbers |= {"SQUARINGS": contact.PASSES.bit_length() - 1, "MOST_CHORDS": float(swept.MOST_CHORDS)}
    numbers |= {"NEWTON_STEPS": swept.NEWTON_STEPS, "ROOT_STEPS": swept.ROOT_STEPS, "RESOLUTION": swept.RESOLUTION}
    numbers |= {"MOST_EVENTS": MOST_EVENTS, "EVICTIONS": EVICTIONS, "SETTLED": contact.SETTLED}
    numbers |= {"ROUND": contact.STILL * float(np.finfo(dtype).eps)}
    return [f"{name} = {value!r}" for name, value in numbers.items()]


def _printed(law: Traced, names: Mapping[str, str], prefix: str) -> tuple[list[str], list[str]]:
    return statements(expanded(law.program), names, prefix, "float64")


def _vector(name: str, *parts: str) -> dict[str, str]:
    return dict(zip(vector_names(name), parts, strict=True))


def _count(law: Traced) -> int:
    """How many numbers of shape a law takes."""
    return sum(n.startswith("s") for n in law.inputs)


def _shape(k: str, law: Traced) -> dict[str, str]:
    return {f"s{j}": f"P[{k}, SHAPE + {j}]" for j in range(_count(law))}


def _numbers(before: list[str], tag: str, k: int, law: Traced) -> dict[str, str]:
    """Names of locals for the numbers of a shape, read in `before`."""
    used = [j for j in range(_count(law)) if f"s{j}" in law.program.arguments()]
    before += [f"{tag}s{j} = P[{k}, SHAPE + {j}]" for j in used]
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
    lines = ["@njit(**FLAGS)", f"def {head}:"]
    if several:
        lines.append(f"    which = {key}")
    for number, case in enumerate(several):
        lines += [f"    if which == {number}:", *indented(list(case), 2)]
    return [*lines, *indented(list(last), 1), "", ""]
