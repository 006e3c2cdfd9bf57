"""Prints one step of a solver from its table, as loops over the numbers of an island.

Each family of solvers is one function here: it reads the table of a method and prints the same operations in the same
order as its class does on NumPy arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pointmass.engine.printing import indented, literal
from pointmass.solvers.base import Solver
from pointmass.solvers.explicit import ExplicitRungeKutta
from pointmass.solvers.splitting import Splitting


@dataclass(frozen=True)
class StepText:
    """One step from (x, v) at t to (x1, v1) at t + h.

    Attributes
    ----------
    work : names of the arrays that it needs, each of length 3n.
    lines : statements; `deriv(...)` is written DERIV(t, x, v, k).
    """

    work: list[str]
    lines: list[str]


def step_text(solver: Solver, order: int, dtype: str, loop: str, velocity_dependent: bool) -> StepText:
    """The step of a solver."""
    if isinstance(solver, ExplicitRungeKutta):
        return _explicit(solver, order, dtype, loop)
    assert isinstance(solver, Splitting)
    return _splitting(solver, dtype, loop, velocity_dependent)


def _weighted(weights: Sequence[float], names: Sequence[str], dtype: str) -> str:
    """w1 k1[q] + w2 k2[q] + ..., without the terms whose weight is 0."""
    return " + ".join(f"{literal(w, dtype)} * {k}[q]" for w, k in zip(weights, names, strict=False) if w)


def _explicit(solver: ExplicitRungeKutta, order: int, dtype: str, loop: str) -> StepText:
    stages = solver._stages
    slopes = [f"ka{i}" for i in range(len(stages))]  # of v (order 1: of x)
    rises = [f"kx{i}" for i in range(len(stages))]  # of x, for order 2
    lines: list[str] = []
    for i, (c, a) in enumerate(stages):
        x, v = ("x", "v") if i == 0 else ("tx", "tv")
        if order == 1:
            v = x
        if i:
            lines.append(f"for q in {loop}(3 * n):")
            lines.append(f"    tx[q] = x[q] + hr * ({_weighted(a, rises if order == 2 else slopes, dtype)})")
            if order == 2:
                lines.append(f"    tv[q] = v[q] + hr * ({_weighted(a, slopes, dtype)})")
        lines.append(f"status |= DERIV(t + {c!r} * h, {x}, {v}, {slopes[i]})")
        if order == 2:
            lines += [
                f"for q in {loop}(3 * n):",
                f"    {rises[i]}[q] = {v}[q] if C[0, base + q // 3] != 0 else R(0)",
            ]
    lines.append(f"for q in {loop}(3 * n):")
    if order == 2:
        lines.append(f"    x1[q] = x[q] + hr * ({_weighted(solver._weights, rises, dtype)})")
        lines.append(f"    v1[q] = v[q] + hr * ({_weighted(solver._weights, slopes, dtype)})")
    else:
        lines.append(f"    x1[q] = x[q] + hr * ({_weighted(solver._weights, slopes, dtype)})")
    work = ["tx", *slopes] if order == 1 else ["tx", "tv", *slopes, *rises]
    return StepText(work, lines)


def _splitting(solver: Splitting, dtype: str, loop: str, velocity_dependent: bool) -> StepText:
    lines = [f"for q in {loop}(3 * n):", "    x1[q] = x[q]", "    v1[q] = v[q]", "status |= DERIV(t, x, v, ka)"]
    fresh = True
    for (opening, drift, closing), (before, after) in zip(solver.substeps, solver._times, strict=True):
        if not fresh:
            lines.append(f"status |= DERIV(t + {before!r} * h, x1, v1, ka)")
        lines += [
            f"kick = {literal(opening, dtype)} * hr",
            f"drift = {literal(drift, dtype)} * hr",
            f"for q in {loop}(3 * n):",
            "    v1[q] = v1[q] + kick * ka[q]",
            "    x1[q] = x1[q] + drift * (v1[q] if C[0, base + q // 3] != 0 else R(0))",
        ]
        fresh = closing != 0.0 and not velocity_dependent
        if closing != 0.0:
            lines += _closing(closing, after, solver.passes if velocity_dependent else 1, dtype, loop)
    return StepText(["ka", "before"], lines)


def _closing(closing: float, after: float, passes: int, dtype: str, loop: str) -> list[str]:
    kick = [
        f"status |= DERIV(t + {after!r} * h, x1, v1, ka)",
        f"for q in {loop}(3 * n):",
        "    v1[q] = before[q] + kick * ka[q]",
    ]
    lines = [f"kick = {literal(closing, dtype)} * hr", f"for q in {loop}(3 * n):", "    before[q] = v1[q]"]
    return [*lines, *(kick if passes == 1 else [f"for _ in range({passes}):", *indented(kick, 1)])]
