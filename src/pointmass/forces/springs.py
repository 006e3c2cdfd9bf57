"""Damped springs between pairs of particles."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.errors import InvalidInput, shown
from pointmass.laws.elements import ConstraintForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Springs(ConstraintForce):
    """f1 = -[k_s (L - rest) + k_d (dv . dx)/L] dx/L, f2 = -f1, with dx = x1 - x2, dv = v1 - v2, L = |dx|.

    The slide "Damped spring" prints |dv| where the notes of Witkin (Particle System Dynamics, 1997) have the projection
    dv . dx / L. The projection is what damps: |dv| would never change sign, and would also brake a rotation in which
    the length stays the same. A spring of length 0 pulls nowhere.

    Parameters
    ----------
    pairs : ids of the particles at the ends, shape (e, 2).
    k_s : stiffness [N/m], at least 0; a number, one for each spring, or a function of t.
    k_d : damping [N s/m], at least 0, likewise.
    rest : length without force [m], likewise (a muscle is a function of t); None = the length at the start.
    family : a name for these springs in pictures and reports, such as "shear".
    """

    nodes = 2
    unit = "m"
    convex = True

    def __init__(
        self,
        pairs: ArrayLike,
        k_s: Scalar = 100.0,
        k_d: Scalar = 0.0,
        rest: Scalar | None = None,
        *,
        family: str = "springs",
        enabled: bool = True,
    ) -> None:
        parameters = [Parameter("k_s", k_s, unit="N/m", at_least=0), Parameter("k_d", k_d, unit="N s/m", at_least=0)]
        if rest is not None:
            parameters.append(Parameter("rest", rest, unit="m", at_least=0))
        super().__init__(pairs, parameters, enabled)
        if not isinstance(family, str):
            raise InvalidInput(f"family must be a name, such as 'shear', not {shown(family)}")
        self.family = family

    @staticmethod
    def constraint(*x: Any) -> Any:
        """Length [m]."""
        return fn.length(fn.sub(x[0], x[1]))
