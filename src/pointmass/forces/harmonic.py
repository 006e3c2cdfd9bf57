"""A spring from a fixed point to every particle."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Harmonic(UnaryForce):
    """f = -k_s (x - center) - k_d v: each particle swings about `center` with the period 2 pi sqrt(m/k_s).

    Energy k_s |x - center|^2 / 2.

    Parameters
    ----------
    k_s : stiffness [N/m], at least 0.
    center : [m]; may move as a function of t.
    k_d : damping of the particle's own velocity [N s/m], at least 0.
    """

    def __init__(
        self,
        k_s: Scalar = 1.0,
        center: Vector = (0.0, 0.0, 0.0),
        k_d: Scalar = 0.0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("k_s", k_s, unit="N/m", at_least=0),
            Parameter("center", center, vector=True, unit="m"),
            Parameter("k_d", k_d, unit="N s/m", at_least=0),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, k_s: Any, center: Any, k_d: Any) -> Any:
        """Force [N]."""
        return fn.sub(fn.scale(-k_s, fn.sub(x, center)), fn.scale(k_d, v))

    @staticmethod
    def potential(x: Any, v: Any, m: Any, t: Any, k_s: Any, center: Any, k_d: Any) -> Any:
        """Energy [J]."""
        d = fn.sub(x, center)
        return 0.5 * k_s * fn.dot(d, d)
