"""Which solver suits a system and a step, and why: what `solver="auto"` means."""

from __future__ import annotations

import math

from pointmass.errors import InvalidInput
from pointmass.laws.pairs import PairForce
from pointmass.solvers.base import Solver
from pointmass.solvers.implicit_euler import ImplicitEuler
from pointmass.solvers.rk4 import RK4
from pointmass.solvers.symplectic_euler import SymplecticEuler
from pointmass.solvers.xpbd import XPBD
from pointmass.system import ParticleSystem

AUTO = "auto"
TOLERANCE = 1e-3  # of the equations of implicit_euler: nobody sees more


def chosen(system: ParticleSystem, dt: float) -> tuple[Solver, str]:
    """A solver for a system as it is now, with steps of dt [s], and one sentence that says why.

    A flow gets RK4. Else it is symplectic_euler, which costs least, where the system's fastest motion lets it make such
    steps; and where it does not, implicit_euler, which has no limit. Forces between pairs cost much there: if it is
    springs and the like that are too stiff, and they are not, it is xpbd instead.

    Raises
    ------
    InvalidInput
        A parameter of a force is not allowed now.
    """
    if system.order == 1:
        return RK4(), "rk4, because the system is a flow"
    limit = _limit(system)
    if dt <= limit:
        room = "has no limit here" if limit == math.inf else f"may make steps of {limit:.3g} s here"
        return SymplecticEuler(), f"symplectic_euler, because it costs least and {room}; dt is {dt:.3g} s"
    why = f"symplectic_euler may make steps of {limit:.3g} s here, and dt is {dt:.3g} s"
    if any(isinstance(force, PairForce) and force.enabled for force in system.forces):
        with system.slack():
            rest = _limit(system)
        if dt <= rest:
            return XPBD(), f"xpbd, because {why}; there are forces between pairs, which cost an implicit solver much"
    return ImplicitEuler(tolerance=TOLERANCE), f"implicit_euler, because {why}"


def _limit(system: ParticleSystem) -> float:
    """The largest safe step of symplectic_euler [s]; 0 where it cannot be found."""
    try:
        return system.stability(SymplecticEuler()).largest_safe_dt
    except InvalidInput:
        system.deriv_eval()  # refuses a parameter that is not allowed
        return 0.0
