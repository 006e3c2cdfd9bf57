"""Prints what the colliders do to an island before and after each piece of a step: the hooks of `ReferenceEngine`.

`prepare` finds who stands on what, and `collide` lets everybody settle, bounce, strike and be put out again. What they
do to one particle is printed by `contact`.
"""

from __future__ import annotations

from pointmass.engine.contact import ContactText
from pointmass.engine.printing import function, indented
from pointmass.engine.reference import KILLED, MOST_EVENTS

WORK = ("x0", "v0", "bx", "px", "pv", "ground", "a1", "a2")  # arrays of an island, each of length 3n
XYZ = ("x", "y", "z")


class ImpactText:
    """The two functions for a system.

    Parameters
    ----------
    call : the arguments of `deriv` that an island has.
    w, m, radius : of row g, as expressions.
    braking : see `Solver.braking`.
    """

    def __init__(
        self,
        contact: ContactText,
        order: int,
        loop: str,
        flags: str,
        call: str,
        w: str,
        m: str,
        radius: str,
        braking: float,
    ) -> None:
        self.contact, self.order, self.loop, self.flags, self.call = contact, order, loop, flags, call
        self.row = ["g = base + i", f"o = {contact.record} * i", "j = 3 * i", f"radius = np.float64({radius})"]
        self.w, self.m, self.braking = w, m, braking
        self.text = self._prepare() + self._collide()

    def _state(self, x: str, v: str) -> str:
        """Six numbers of row i, those of v 0 in a flow."""
        place = [f"np.float64({x}[j + {k}])" for k in range(3)]
        return ", ".join(place + ([f"np.float64({v}[j + {k}])" for k in range(3)] if self.order == 2 else ["0.0"] * 3))

    def _prepare(self) -> str:
        state = self._state("x", "v")
        close = f"near(F, K, o, t, {', '.join(state.split(', ')[:3])}, radius)"
        slope = ", ".join(f"np.float64(av[j + {k}])" for k in range(3))
        keep = [f"v[j + {k}] = R(v{a})" for k, a in enumerate(XYZ)] if self.order == 2 else []
        lines = [
            f"braking = {self.braking!r} * h if n > 1 else 0.0",
            "count = 0",
            f"for i in {self.loop}(n):",
            *indented(self.row, 1),
            "    K[o] = 0.0",
            f"    if {self.w} != 0 and {close}:",
            "        count += 1",
            "if count == 0:",
            "    return 0, 0",
            f"status = deriv({self.call}, t, x, v, av)",
            "standing = 0",
            f"for i in {self.loop}(n):",
            *indented(self.row, 1),
            f"    if {self.w} != 0 and {close}:",
            f"        vx, vy, vz = find(F, K, o, t, {state}, np.float64({self.m}), {slope}, radius, braking)",
            *indented(keep, 2),
            "        if K[o] > 0:",
            "            standing += 1",
            "return standing, status",
        ]
        doc = '"""Find who stands on what, and stop their motion into it; how many do, and a status."""'
        return function("prepare", f"{self.call}, t, h, x, v, av", self.flags, [doc, *lines])

    def _collide(self) -> str:
        second = self.order == 2
        now = "sx, sy, sz, vx, vy, vz"
        kept = [f"{q}[j + {k}] = R({p})" for q, p, k in _places("x", "v")][: 6 if second else 3]
        planned = [f"p{q}[j + {k}] = R({p})" for q, p, k in _places("x", "v")][: 6 if second else 3]
        each = [
            *self.row,
            f"if {self.w} != 0:",
            f"    {now} = settle(F, K, o, end, h, {self._state('x', 'v')}, radius)",
            *[f"    {now}, struck = bounce(F, K, o, end, {now}, radius)"] * self.contact.discrete,
            *indented(planned, 1),
            f"    {now}, clock, e, gx, gy, gz = strike(",
            f"        F, K, o, alone, events[i], {self._state('x0', 'v0')}, {now}, t, h, radius",
            "    )",
            "    if e > events[i]:",
            "        hits += 1",
            f"        paid[i] = 1 if not alone and e <= {MOST_EVENTS} else 0",
            "        events[i] = e",
            *indented(self._bounced(), 1),
            "    if alone:",
            "        when[0] = clock",
            *indented([f"ground[j + {k}] = g{a}" for k, a in enumerate(XYZ)], 1),
            *indented(kept, 1),
            "else:",
            *indented([f"p{q}[j + {k}] = {q}[j + {k}]" for q in "xv"[: self.order] for k in range(3)], 1),
        ]
        out = [
            *self.row,
            f"if {self.w} != 0:",
            f"    {now} = evict(F, K, o, now, {self._state('x', 'v')}, radius, "
            + ", ".join(f"np.float64(bx[j + {k}])" for k in range(3))
            + ", began)",
            *indented(kept, 1),
        ]
        lines = [
            "end = t + h",
            "hits = 0",
            "when[0] = end",
            f"for i in {self.loop}(n):",
            "    paid[i] = 0",
            *indented(each, 1),
            *(self._pay() if second else []),
            "now = when[0]",
            f"for i in {self.loop}(n):",
            *indented(out, 1),
            "return now, hits",
        ]
        arguments = "alone, t, h, x, v, events, paid, when, began, " + ", ".join(WORK)
        doc = '"""Let everybody respond to what is in the way; the clock to go on from, and how many hit."""'
        return function("collide", f"{self.call}, {arguments}", self.flags, [doc, *lines])

    def _bounced(self) -> list[str]:
        """What follows of the test at the end of a step."""
        if not self.contact.discrete:
            return []
        death = [f"    events[i] += {KILLED} if struck == {KILLED} and not clock < end else 0"]
        return ["if struck > 0:", "    hits += 1", *death * self.contact.kills]

    def _pay(self) -> list[str]:
        """ReferenceEngine._pay: what linked particles gained of the others' pull is taken off their rebound."""
        chord = [f"u{a} = (px[j + {k}] - x0[j + {k}]) / h" for k, a in enumerate(XYZ)]
        closing = [f"c{a} = pv[j + {k}] - u{a}" for k, a in enumerate(XYZ)]
        jump = [f"j{a} = v[j + {k}] - c{a} - u{a}" for k, a in enumerate(XYZ)]
        mean = [f"0.5 * (a1[j + {k}] + a2[j + {k}])" for k in range(3)]
        way = [f"(x[j + {k}] - px[j + {k}])" for k in range(3)]
        return [
            "pays = 0",
            f"for i in {self.loop}(n):",
            "    if paid[i] != 0:",
            "        pays += 1",
            "        j = 3 * i",
            *indented([*chord, *closing, *(f"v[j + {k}] += R(c{a})" for k, a in enumerate(XYZ))], 2),
            "if pays > 0:",
            f"    deriv({self.call}, end, px, pv, a1)",
            f"    deriv({self.call}, end, x, v, a2)",
            f"    for i in {self.loop}(n):",
            "        if paid[i] != 0:",
            "            j = 3 * i",
            *indented([*chord, *closing, *jump], 3),
            f"            pull = {' + '.join(f'{m} * {d}' for m, d in zip(mean, way, strict=True))}",
            "            gain = max(cx * jx + cy * jy + cz * jz - pull, 0.0)",
            "            size = np.sqrt(jx * jx + jy * jy + jz * jz)",
            "            if size > 0:",
            *indented([f"j{a} = j{a} / size" for a in XYZ], 4),
            "                speed = "
            + " + ".join(f"(v[j + {k}] - ground[j + {k}]) * j{a}" for k, a in enumerate(XYZ)),
            "                left = np.sqrt(max(speed * speed - 2 * gain, 0.0)) if speed > 0 else speed",
            *indented([f"v[j + {k}] -= R((speed - left) * j{a})" for k, a in enumerate(XYZ)], 4),
        ]


def _places(x: str, v: str) -> list[tuple[str, str, int]]:
    """(array, local, component) of the six numbers of a state."""
    return [(x, f"s{a}", k) for k, a in enumerate(XYZ)] + [(v, f"v{a}", k) for k, a in enumerate(XYZ)]
