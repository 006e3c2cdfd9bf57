"""Prints one step of a solver from its table, as loops over the numbers of an island.

Each family of solvers is one function here: it reads the table of a method and prints the same operations in the same
order as its class does on NumPy arrays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pointmass.engine.blocks import Kind
from pointmass.engine.printing import literal
from pointmass.solvers.base import Solver
from pointmass.solvers.control import control_of
from pointmass.solvers.explicit import EmbeddedRungeKutta, ExplicitRungeKutta
from pointmass.solvers.splitting import Splitting

AT_REST = "v[q] = v[q] if free else R(0)"


@dataclass(frozen=True)
class StepText:
    """One step from (x, v) at t to (x1, v1) at t + h.

    Attributes
    ----------
    work : names of the arrays that it needs, each of length 3n.
    lines : statements; the slopes dy/dt = (kx, kv) are written SLOPE(t, x, v, kx, kv), kv alone DERIV(t, x, v, kv).
    evaluations : of the forces.
    keeps : whether the slope of the end is that of the next beginning, and is used again where `known` says so.
    error : statements that put the error over tolerance into ex and ev, from methods that have one.
    functions : text of those that the lines call.
    scratch : further work arrays -> the expressions that make them; M has the largest numbers of particles and of each
        family's elements of an island.
    memory : arrays of 3 numbers for each particle that the next step reads.
    kinds : of blocks of the matrix, whose layouts the functions read.
    in_place : whether the step ends in x and v themselves, those who are pinned at rest.
    around : statements before the first step of a span and after the last, if x and v are elsewhere meanwhile.
    """

    work: list[str]
    lines: list[str]
    evaluations: int
    keeps: bool = False
    error: list[str] = field(default_factory=list)
    functions: str = ""
    scratch: dict[str, str] = field(default_factory=dict)
    memory: list[str] = field(default_factory=list)
    kinds: list[Kind] = field(default_factory=list)
    in_place: bool = False
    around: tuple[str, ...] = ()

    @property
    def arrays(self) -> list[str]:
        """Names of the parts of the layouts."""
        return [array for kind in self.kinds for array in kind.arrays]


def step_text(
    solver: Solver, order: int, dtype: str, loop: str, w: str, velocity_dependent: bool, steady: bool, contacts: bool
) -> StepText:
    """The step of a solver.

    Parameters
    ----------
    w : inverse mass of particle i, as an expression.
    steady : whether forces are the same at all times.
    contacts : whether somebody may be `standing` on a surface: then accelerations depend on velocities.
    """
    if isinstance(solver, ExplicitRungeKutta):
        return _explicit(solver, order, dtype, loop, w, contacts)
    assert isinstance(solver, Splitting)
    return _splitting(solver, dtype, loop, w, velocity_dependent, steady, contacts)


def each(loop: str, w: str, lines: list[str]) -> list[str]:
    """Statements for each number q of a particle i, which may be `free` or pinned: its inverse mass w is 0."""
    return [
        f"for i in {loop}(n):",
        f"    free = {w} != 0",
        "    for axis in range(3):",
        "        q = np.uintp(3 * i) + np.uintp(axis)",
        *(f"        {line}" for line in lines),
    ]


def _weighted(weights: Sequence[float], slopes: str, dtype: str) -> str:
    """w0 k0[q] + w1 k1[q] + ..., without the terms whose weight is 0."""
    return " + ".join(f"{literal(w, dtype)} * {slopes}{i}[q]" for i, w in enumerate(weights) if w)


def _explicit(solver: ExplicitRungeKutta, order: int, dtype: str, loop: str, w: str, contacts: bool) -> StepText:
    in_place = not contacts and control_of(solver) is None
    parts = [("x", "kx"), ("v", "kv")][:order]
    lines: list[str] = []
    for i, (c, a) in enumerate(solver._stages):
        if i:
            lines.append(f"for q in {loop}(3 * n):")
            lines += [f"    t{y}[q] = {y}[q] + hr * ({_weighted(a, k, dtype)})" for y, k in parts]
        x, v = ("x", "v") if i == 0 else ("tx", "tv")
        lines.append(f"status |= SLOPE(t + {c!r} * h, {x}, {v}, kx{i}, kv{i})")
    ends = [f"{y}{'' if in_place else 1}[q] = {y}[q] + hr * ({_weighted(solver._weights, k, dtype)})" for y, k in parts]
    lines += each(loop, w, [*ends, *[AT_REST] * (in_place and order == 2)])
    stages = len(solver._stages)
    error: list[str] = []
    if control_of(solver) is not None:
        assert isinstance(solver, EmbeddedRungeKutta)
        weights, stages = solver._error_weights, stages + 1
        error = [f"status |= SLOPE(t + h, x1, v1, kx{stages - 1}, kv{stages - 1})", f"for q in {loop}(3 * n):"]
        for y, k in parts:
            size = f"maximum(abs({y}[q]), abs({y}1[q]))"
            error.append(f"    e{y}[q] = (hr * ({_weighted(weights, k, dtype)})) / scale({size})")
    work = [f"{k}{i}" for i in range(stages) for k in ("kx", "kv")] + ["tx", "tv"] + ["ex", "ev"] * bool(error)
    return StepText(work, lines, stages, error=error, in_place=in_place)


def _splitting(
    solver: Splitting, dtype: str, loop: str, w: str, velocity_dependent: bool, steady: bool, contacts: bool
) -> StepText:
    keeps = solver.substeps[-1].closing != 0.0 and steady and not velocity_dependent and not contacts
    start = "status |= DERIV(t, x, v, kv)"
    lines = ["if known[0] == 0:", f"    {start}", "known[0] = 1"] if keeps else [start]
    passes = solver.passes if velocity_dependent else 1
    evaluations, fresh = 1, True
    x1, v1 = ("x1", "v1") if contacts else ("x", "v")
    for k, ((opening, drift, closing), (before, after)) in enumerate(zip(solver.substeps, solver._times, strict=True)):
        x, v = ("x", "v") if k == 0 else (x1, v1)
        rest = [AT_REST] * (not contacts and k == len(solver.substeps) - 1)
        if not fresh or contacts:
            again = f"status |= DERIV(t + {before!r} * h, {x}, {v}, kv)"
            lines += [again] if not fresh else ["if standing > 0:", f"    {again}"]
            evaluations += not fresh
        fresh = closing != 0.0 and not velocity_dependent
        moves = [
            f"{v1}[q] = {v}[q] + kick * kv[q]",
            f"{x1}[q] = {x}[q] + drift * ({v1}[q] if free else R(0))",
            *(rest if closing == 0.0 else [f"before[q] = {v1}[q]"]),
        ]
        kicks = f"kick = {literal(opening, dtype)} * hr"
        lines += [kicks, f"drift = {literal(drift, dtype)} * hr", *each(loop, w, moves)]
        if closing != 0.0:
            count = f"{solver.passes} if standing > 0 else {passes}" if contacts else f"{passes}"
            lines += [
                f"kick = {literal(closing, dtype)} * hr",
                f"for _ in range({count}):",
                f"    status |= DERIV(t + {after!r} * h, {x1}, {v1}, kv)",
                f"    for q in {loop}(3 * n):",
                f"        {v1}[q] = before[q] + kick * kv[q]",
                *(each(loop, w, rest) if rest else []),
            ]
            evaluations += passes
    return StepText(["kv", "before"], lines, evaluations, keeps, in_place=not contacts)
