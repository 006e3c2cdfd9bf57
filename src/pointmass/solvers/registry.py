"""The solvers by name."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput, unknown
from pointmass.solvers.base import Solver
from pointmass.solvers.bdf2 import BDF2
from pointmass.solvers.bogacki_shampine import BogackiShampine
from pointmass.solvers.dormand_prince import DormandPrince
from pointmass.solvers.euler import Euler
from pointmass.solvers.heun import Heun
from pointmass.solvers.implicit_euler import ImplicitEuler
from pointmass.solvers.implicit_midpoint import ImplicitMidpoint
from pointmass.solvers.leapfrog import Leapfrog
from pointmass.solvers.midpoint import Midpoint
from pointmass.solvers.rk4 import RK4
from pointmass.solvers.symplectic_euler import SymplecticEuler
from pointmass.solvers.xpbd import XPBD
from pointmass.solvers.yoshida4 import Yoshida4

SOLVERS: dict[str, type[Solver]] = {
    solver.name: solver
    for solver in (
        Euler,
        SymplecticEuler,
        Midpoint,
        Heun,
        RK4,
        Leapfrog,
        Yoshida4,
        BogackiShampine,
        DormandPrince,
        ImplicitEuler,
        ImplicitMidpoint,
        BDF2,
        XPBD,
    )
}

ALIASES: dict[str, str] = {
    "backward_euler": "implicit_euler",
    "bogacki_shampine": "bs32",
    "dormand_prince": "dopri5",
    "explicit_euler": "euler",
    "explicit_midpoint": "midpoint",
    "forward_euler": "euler",
    "semi_implicit_euler": "symplectic_euler",
    "velocity_verlet": "leapfrog",
    "verlet": "leapfrog",
}


def find_solver(name: str) -> type[Solver]:
    """The solver of a name or an alias; case does not matter, and "-" is "_".

    Raises
    ------
    InvalidInput
        No solver has this name.
    """
    key = str(name).lower().replace("-", "_")
    key = ALIASES.get(key, key)
    if key not in SOLVERS:
        raise unknown("solver", name, (*SOLVERS, *ALIASES))
    return SOLVERS[key]


def as_solver(solver: Any) -> Solver:
    """A solver, or one by its name with its usual settings.

    Raises
    ------
    InvalidInput
        Something else.
    """
    if isinstance(solver, str):
        return find_solver(solver)()
    if isinstance(solver, type) and issubclass(solver, Solver):
        raise InvalidInput(f"solver must be made first: {solver.__name__}(), with brackets")
    if not isinstance(solver, Solver):
        raise InvalidInput(f'solver must be a solver such as pm.RK4(), or a name such as "rk4", not {solver!r:.60}')
    return solver
