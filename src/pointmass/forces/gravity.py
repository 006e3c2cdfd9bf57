"""Uniform gravity."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Gravity(UnaryForce):
    """f = m G (lecture, "Gravity"); energy -m G . x.

    Parameters
    ----------
    g : acceleration G [m/s^2].
    """

    def __init__(self, g: Vector = (0.0, -9.81, 0.0), *, on: Selection = None, enabled: bool = True) -> None:
        super().__init__([Parameter("g", g, vector=True, unit="m/s^2")], on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, g: Any) -> Any:
        """Force [N]."""
        return fn.scale(m, g)

    @staticmethod
    def potential(x: Any, v: Any, m: Any, t: Any, g: Any) -> Any:
        """Energy [J]."""
        return -m * fn.dot(g, x)
