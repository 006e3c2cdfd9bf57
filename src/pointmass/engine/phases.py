"""A step of a solver as phases: each evaluates the accelerations, and then changes the state entry by entry.

The fast paths keep the state where the laws read it, so nothing is copied between two evaluations. Every phase does the
operations of `steps.py` in the same order, so that the bits are the same.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from pointmass.engine.printing import literal
from pointmass.laws.elements import ElementForce
from pointmass.laws.unary import UnaryForce
from pointmass.solvers.base import Solver
from pointmass.solvers.explicit import EmbeddedRungeKutta, ExplicitRungeKutta
from pointmass.solvers.splitting import Splitting
from pointmass.system import ParticleSystem

REACHED = '''BITS = np.int32 if R is np.float32 else np.int64
SIZE = BITS(np.iinfo(BITS).max)  # all bits but the sign


@njit(**FLAGS)
def reached(s, begin, end, runs=1, apart=0):
    """Largest size of some numbers, or of several runs of them, with whole numbers, so that the loop is one of vectors:
    the bits of sizes are in their order, and NaN is above all."""
    bits = s.view(BITS)
    most = BITS(0)
    for run in range(runs):
        o = np.uintp(run * apart)
        for i in range(begin, end):
            most = max(most, bits[o + np.uintp(i)] & SIZE)
    return BITS(most).view(R)


'''
STATE = ("X", "V")  # where the laws read position and velocity; before and after a step, the state itself


@dataclass(frozen=True)
class Phase:
    """An evaluation of the accelerations at X and V, and what follows from it.

    Attributes
    ----------
    time : of the evaluation, an expression of t and h (float64).
    lines : statements for one axis of one particle. They know the acceleration `a`, whether the particle is `free`, the
        step `hr` in the precision of the kernel, and entries of the scratch as {X}, {V}, {name}.
    """

    time: str
    lines: list[str] = field(default_factory=list)


def phases(solver: Solver, dtype: str, velocity_dependent: bool) -> list[Phase]:
    """The phases of one step of a system of order 2."""
    if isinstance(solver, ExplicitRungeKutta):
        return _explicit(solver, dtype)
    assert isinstance(solver, Splitting)
    return _splitting(solver, dtype, velocity_dependent)


def regions(steps: Iterable[Phase]) -> list[str]:
    """The parts of the scratch, a number for each axis of each particle, that the phases name."""
    return list(dict.fromkeys([*STATE, *(name for phase in steps for line in phase.lines for name in _names(line))]))


def entries(lines: Iterable[str], places: Mapping[str, str]) -> list[str]:
    """Statements of a phase for one axis, each entry of the scratch read once and written once.

    Parameters
    ----------
    places : where the entry of each region is.
    """
    result, known, written = [], set(), {}
    for line in lines:
        target, value = line.split(" = ", 1)
        for name in _names(value):
            if name not in known:
                result.append(f"{name} = {places[name]}")
                known.add(name)
        result.append(line.replace("{", "").replace("}", ""))
        for name in _names(target):
            known.add(name)
            written[name] = f"{places[name]} = {name}"
    return [*result, *written.values()]


def simple(system: ParticleSystem, solver: Solver) -> bool:
    """Whether a system moves undisturbed, by fixed steps and by laws of one particle and of elements."""
    fixed = isinstance(solver, Splitting) or (
        isinstance(solver, ExplicitRungeKutta) and not (isinstance(solver, EmbeddedRungeKutta) and solver.adaptive)
    )
    known = all(isinstance(f, (UnaryForce, ElementForce)) for f in system.forces)
    return fixed and known and system.order == 2 and not system.colliders


def _names(text: str) -> list[str]:
    return re.findall(r"{(\w+)}", text)


def _weighted(weights: Sequence[float], names: Sequence[str], dtype: str) -> str:
    return " + ".join(f"{literal(w, dtype)} * {k}" for w, k in zip(weights, names, strict=False) if w)


def _explicit(solver: ExplicitRungeKutta, dtype: str) -> list[Phase]:
    stages = solver._stages
    later = [*(a for _, a in stages[1:]), solver._weights]  # what is formed after each evaluation
    base = [f"{{{q}0}}" if len(stages) > 1 else f"{{{q}}}" for q in STATE]
    result = []
    for i, (c, _) in enumerate(stages):
        phase = Phase(f"t + {c!r} * h", ["r = select(free, {V}, R(0))"])
        rises = [*(f"{{r{j}}}" for j in range(i)), "r"]
        slopes = [*(f"{{a{j}}}" for j in range(i)), "a"]
        if any(i < len(weights) and weights[i] for weights in later[i + 1 :]):
            phase.lines.extend([f"{{r{i}}} = r", f"{{a{i}}} = a"])
        phase.lines.append(f"{{X}} = {base[0]} + hr * ({_weighted(later[i], rises, dtype)})")
        phase.lines.append(f"{{V}} = {base[1]} + hr * ({_weighted(later[i], slopes, dtype)})")
        result.append(phase)
    result[-1].lines.append("{V} = select(free, {V}, R(0))")
    if len(stages) > 1:
        result[-1].lines.extend(f"{{{q}0}} = {{{q}}}" for q in STATE)
    return result


def _splitting(solver: Splitting, dtype: str, velocity_dependent: bool) -> list[Phase]:
    result = [Phase("t")]
    fresh = True
    for (opening, drift, closing), (before, after) in zip(solver.substeps, solver._times, strict=True):
        if not fresh:
            result.append(Phase(f"t + {before!r} * h"))
        kick = f"{literal(opening, dtype)} * hr"
        result[-1].lines.append(f"{{V}} = {{V}} + {kick} * a")
        result[-1].lines.append(f"{{X}} = {{X}} + {literal(drift, dtype)} * hr * select(free, {{V}}, R(0))")
        fresh = closing != 0.0 and not velocity_dependent
        if closing != 0.0:
            result[-1].lines.append("{B} = {V}")
            for _ in range(solver.passes if velocity_dependent else 1):
                result.append(Phase(f"t + {after!r} * h", [f"{{V}} = {{B}} + {literal(closing, dtype)} * hr * a"]))
    result[-1].lines.append("{V} = select(free, {V}, R(0))")
    return result
