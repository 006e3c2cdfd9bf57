"""Prints how one elastic element moves its particles: the operations of `laws.relaxation`, in order.

Locals of node a: its place `x` at the start of the step and how far it comes, `r`, its inverse mass `w`, and where it
is free, `f`, if there are contacts. `had` is what the element has noted, and `more` what is added to that.
"""

from __future__ import annotations

from pointmass.tracing.trace import vector_names

AXES = range(3)


def state(nodes: int) -> dict[str, str]:
    """Expression of each input of a constraint that is no parameter."""
    return {"t": "R(t)"} | {name: f"q{a}{c}" for a in range(nodes) for c, name in enumerate(vector_names(f"x{a + 1}"))}


def places(nodes: int) -> list[str]:
    """Statements that find where the particles are now."""
    return [f"q{a}{c} = x{a}{c} + r{a}{c}" for a in range(nodes) for c in AXES]


def solved(nodes: int, outputs: list[str], projected: bool) -> list[str]:
    """Statements from the constraint and its slopes to how far the particles come."""
    gap, k, d, *slopes = outputs
    lines = [f"k = {k} * h * h", f"d = {d} * h"]
    lines += [f"g{a}{c} = {slopes[3 * a + c]}" for a in range(nodes) for c in AXES]
    for a in range(nodes):
        free = [[f"f{a}{3 * c + m} * g{a}{m}" for m in AXES] for c in AXES]
        lines += [f"y{a}{c} = {' + '.join(free[c]) if projected else f'g{a}{c}'}" for c in AXES]
    lines += ["soft = R(0)", "went = R(0)"]
    for a in range(nodes):
        lines.append(f"soft = soft + w{a} * ({' + '.join(f'g{a}{c} * y{a}{c}' for c in AXES)})")
        lines.append(f"went = went + ({' + '.join(f'g{a}{c} * r{a}{c}' for c in AXES)})")
    lines.append(f"more = -(k * ({gap}) + had + d * went) / (R(1) + (k + d) * soft)")
    return [*lines, *(f"r{a}{c} = r{a}{c} + (w{a} * more) * y{a}{c}" for a in range(nodes) for c in AXES)]
