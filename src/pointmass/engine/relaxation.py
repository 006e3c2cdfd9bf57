"""Prints the step of a solver that relaxes elements one by one: what `laws.relaxation` does, element by element.

The elements of a family lie in the order of their colours. One thread goes through those of an island in this order;
all threads on one island share the elements of a colour, which have no particle in common.
"""

from __future__ import annotations

from pointmass.engine.forces import Deriv, Elements
from pointmass.engine.printing import function, indented
from pointmass.engine.steps import StepText, each
from pointmass.laws.elements import ConstraintForce
from pointmass.solvers.xpbd import XPBD
from pointmass.tracing.trace import vector_names

AXES = range(3)


def relaxation_text(deriv: Deriv, solver: XPBD) -> StepText:
    """The step for a system and a solver."""
    families = [(k, f) for k, f in enumerate(deriv.families) if isinstance(f.force, ConstraintForce)]
    projected = deriv.contact is not None
    scratch = {f"noted{f.number}": f"np.empty(M[{k + 1}], R)" for k, f in families}
    scratch |= {"Q": "np.empty(9 * M[0], R)", "Qw": "np.empty(18 * M[0], R)"} if projected else {}
    free = ", Q" * projected
    w = deriv.binder.attribute("w", "np.uintp(base + i)")
    lines = ["elastic = False", "status |= DERIV(t, x, v, kv)", "elastic = True"]
    if deriv.contact is not None:
        lines += [
            f"for i in {deriv.loop}(n):",
            f"    project(F, K, i * {deriv.contact.record}, Q[9 * i:9 * i + 9], Qw[18 * i:18 * i + 18])",
        ]
    way = "way[q] = hr * (v1[q] if free else R(0))"
    lines += each(deriv.loop, w, ["v1[q] = v[q] + hr * kv[q]", way, "rise[q] = way[q]"])
    for _, f in families:
        lines += [f"for q in {deriv.loop}(e{f.number} - s{f.number}):", f"    noted{f.number}[q] = R(0)"]
    sweep = [f"status |= relax{f.number}({deriv.call}, t + h, hr, x, rise, noted{f.number}{free})" for _, f in families]
    lines += [f"for _ in range({solver.iterations}):", *indented(sweep or ["pass"], 1)]
    lines += each(deriv.loop, w, ["x1[q] = x[q] + rise[q]", "v1[q] = v1[q] + (rise[q] - way[q]) / hr"])
    functions = "".join(_relax(deriv, f, free) for _, f in families)
    return StepText(["kv", "way", "rise"], lines, 1, functions=functions, scratch=scratch)


def _relax(deriv: Deriv, elements: Elements, free: str) -> str:
    """The function that looks at all elements of a family once."""
    force, j = elements.force, elements.number
    assert isinstance(force, ConstraintForce)
    nodes = range(force.nodes)
    state = {"t": "R(t)"}
    for a in nodes:
        state |= {name: f"q{a}{c}" for c, name in enumerate(vector_names(f"x{a + 1}"))}
    text = deriv.binder.law(force.traced_constraint, force, state, "u_", elements.table, f"c{j}")
    body = [f"n{a} = np.uintp(E{j}[{force.nodes} * u_ + {a}])" for a in nodes]
    body += [f"o{a} = np.uintp(3) * n{a}" for a in nodes]
    body += [f"r{a}{c} = rise[o{a} + np.uintp({c})]" for a in nodes for c in AXES]
    body += [f"q{a}{c} = x[o{a} + np.uintp({c})] + r{a}{c}" for a in nodes for c in AXES]
    body += [f"w{a} = {deriv.binder.attribute('w', f'(np.uintp(base) + n{a})')}" for a in nodes]
    body += [*text.lines, f"k = {text.outputs[1]} * h * h", f"d = {text.outputs[2]} * h"]
    body += [f"g{a}{c} = {text.outputs[3 + 3 * a + c]}" for a in nodes for c in AXES]
    for a in nodes:
        entry = [f"Q[np.uintp(9) * n{a} + np.uintp({m})] * g{a}{m % 3}" for m in range(9)]
        body += [f"y{a}{c} = {' + '.join(entry[3 * c : 3 * c + 3]) if free else f'g{a}{c}'}" for c in AXES]
    body += ["soft = R(0)", "went = R(0)"]
    for a in nodes:
        body.append(f"soft = soft + w{a} * ({' + '.join(f'g{a}{c} * y{a}{c}' for c in AXES)})")
        body.append(f"went = went + ({' + '.join(f'g{a}{c} * r{a}{c}' for c in AXES)})")
    body += [
        f"i = np.uintp(u_ - s{j})",
        f"more = -(k * ({text.outputs[0]}) + noted[i] + d * went) / (R(1) + (k + d) * soft)",
        "noted[i] = noted[i] + more",
    ]
    body += [f"rise[o{a} + np.uintp({c})] = r{a}{c} + (w{a} * more) * y{a}{c}" for a in nodes for c in AXES]
    loop = [f"for u_ in range(s{j}, e{j}):", *indented(body, 1)]
    if deriv.parallel:
        one = [f"for u_ in prange(Z{j}[colour], Z{j}[colour + 1]):", *indented(body, 1)]
        loop = [f"for colour in range(len(Z{j}) - 1):", *indented(one, 1)]
    lines = [
        *deriv.binder.numbers.lines(),
        "status = 0",
        *text.at_time,
        f"if {deriv.binder.switch(force)} != 0:",
        *indented(loop, 1),
        "return status",
    ]
    return function(f"relax{j}", f"{deriv.call}, t, h, x, rise, noted{free}", deriv.flags, lines)
