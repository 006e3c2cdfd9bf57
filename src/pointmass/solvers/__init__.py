"""Solvers: methods that advance y' = F(t, y), and what runs them. They know neither particles nor forces."""

from __future__ import annotations

from pointmass.errors import unknown
from pointmass.solvers.advance import Stats, advance
from pointmass.solvers.base import Solver, Step, System
from pointmass.solvers.bdf2 import BDF2
from pointmass.solvers.bogacki_shampine import BogackiShampine
from pointmass.solvers.control import PIController
from pointmass.solvers.dormand_prince import DormandPrince
from pointmass.solvers.euler import Euler
from pointmass.solvers.events import Event, first_root
from pointmass.solvers.explicit import EmbeddedRungeKutta, ExplicitRungeKutta
from pointmass.solvers.function_system import FunctionSystem
from pointmass.solvers.heun import Heun
from pointmass.solvers.implicit import Implicit
from pointmass.solvers.implicit_euler import ImplicitEuler
from pointmass.solvers.implicit_midpoint import ImplicitMidpoint
from pointmass.solvers.integrate import Solution, integrate
from pointmass.solvers.leapfrog import Leapfrog
from pointmass.solvers.midpoint import Midpoint
from pointmass.solvers.rk4 import RK4
from pointmass.solvers.splitting import Splitting, Substep
from pointmass.solvers.stability import amplification, largest_safe_step
from pointmass.solvers.symplectic_euler import SymplecticEuler
from pointmass.solvers.yoshida4 import Yoshida4

__all__ = [
    "ALIASES",
    "BDF2",
    "RK4",
    "SOLVERS",
    "BogackiShampine",
    "DormandPrince",
    "EmbeddedRungeKutta",
    "Euler",
    "Event",
    "ExplicitRungeKutta",
    "FunctionSystem",
    "Heun",
    "Implicit",
    "ImplicitEuler",
    "ImplicitMidpoint",
    "Leapfrog",
    "Midpoint",
    "PIController",
    "Solution",
    "Solver",
    "Splitting",
    "Stats",
    "Step",
    "Substep",
    "SymplecticEuler",
    "System",
    "Yoshida4",
    "advance",
    "amplification",
    "find_solver",
    "first_root",
    "integrate",
    "largest_safe_step",
]

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
