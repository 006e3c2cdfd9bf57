"""A magnetic field."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Magnetic(UnaryForce):
    """f = q v x B (Lorentz): bends a path into a circle of radius m v / (q B) and does no work.

    Parameters
    ----------
    B : magnetic field [T].
    q : charge [C]; by default the particle attribute `charge`.
    """

    def __init__(
        self, B: Vector = (0.0, 0.0, 1.0), q: Scalar = "charge", *, on: Selection = None, enabled: bool = True
    ) -> None:
        super().__init__([Parameter("B", B, vector=True, unit="T"), Parameter("q", q, unit="C")], on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, B: Any, q: Any) -> Any:
        """Force [N]."""
        return fn.scale(q, fn.cross(v, B))
