"""Solvers: methods that advance y' = F(t, y), and what runs them. They know neither particles nor forces."""

from __future__ import annotations

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
from pointmass.solvers.registry import ALIASES, SOLVERS, as_solver, find_solver
from pointmass.solvers.rk4 import RK4
from pointmass.solvers.splitting import Splitting, Substep
from pointmass.solvers.stability import amplification, largest_safe_step, largest_safe_steps
from pointmass.solvers.symplectic_euler import SymplecticEuler
from pointmass.solvers.xpbd import XPBD
from pointmass.solvers.yoshida4 import Yoshida4

__all__ = [
    "ALIASES",
    "BDF2",
    "RK4",
    "SOLVERS",
    "XPBD",
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
    "as_solver",
    "find_solver",
    "first_root",
    "integrate",
    "largest_safe_step",
    "largest_safe_steps",
]
