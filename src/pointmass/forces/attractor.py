"""A point that attracts."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Attractor(UnaryForce):
    """f = -mu m d / (d^2 + eps^2)^(3/2), d = x - center: gravity of a softened point (Plummer 1911).

    Energy -mu m / sqrt(d^2 + eps^2). A negative mu repels.

    Parameters
    ----------
    mu : strength G M [m^3/s^2].
    center : [m]; may move as a function of t.
    eps : softening length [m], at least 0; with 0 the law is singular at the centre.
    """

    def __init__(
        self,
        mu: Scalar = 1.0,
        center: Vector = (0.0, 0.0, 0.0),
        eps: Scalar = 0.0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("mu", mu, unit="m^3/s^2"),
            Parameter("center", center, vector=True, unit="m"),
            Parameter("eps", eps, unit="m", at_least=0),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, mu: Any, center: Any, eps: Any) -> Any:
        """Force [N]."""
        d = fn.sub(x, center)
        r2 = fn.dot(d, d) + eps * eps
        return fn.scale(-mu * m / (r2 * fn.sqrt(r2)), d)

    @staticmethod
    def potential(x: Any, v: Any, m: Any, t: Any, mu: Any, center: Any, eps: Any) -> Any:
        """Energy [J]."""
        d = fn.sub(x, center)
        return -mu * m / fn.sqrt(fn.dot(d, d) + eps * eps)
