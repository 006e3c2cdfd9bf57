"""Drag that grows with the square of the speed."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class QuadraticDrag(UnaryForce):
    """f = -c |v| v, with c = rho C_D A / 2 (air 1.2 kg/m^3, drag coefficient, frontal area).

    Parameters
    ----------
    c : drag coefficient [kg/m], at least 0. Falling particles reach the speed sqrt(m g / c).
    """

    def __init__(self, c: Scalar = 0.01, *, on: Selection = None, enabled: bool = True) -> None:
        super().__init__([Parameter("c", c, unit="kg/m", at_least=0)], on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, c: Any) -> Any:
        """Force [N]."""
        return fn.scale(-c * fn.length(v), v)
