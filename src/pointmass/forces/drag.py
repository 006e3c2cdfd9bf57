"""Viscous drag."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Drag(UnaryForce):
    """f = -k v (lecture, "Viscous drag"): a particle slows down with the time constant m/k.

    Parameters
    ----------
    k : drag coefficient [N s/m], at least 0.
    """

    def __init__(self, k: Scalar = 0.1, *, on: Selection = None, enabled: bool = True) -> None:
        super().__init__([Parameter("k", k, unit="N s/m", at_least=0)], on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, k: Any) -> Any:
        """Force [N]."""
        return fn.scale(-k, v)
