"""The flow around a piece of a straight vortex."""

from __future__ import annotations

import math
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class VortexLine(VelocityField):
    """x' = Gamma / (4 pi) int ds x d / (d^2 + eps^2)^(3/2) along the line from a to b, d from there to x (Biot-Savart).

    In closed form, Gamma / (4 pi) (s_a / r_a - s_b / r_b) e x d / (h^2 + eps^2), with e the direction, h the distance
    from the line, s the way along it from each end and r the softened distance from that end. A line that goes on for
    ever is `Vortex`.

    Parameters
    ----------
    a, b : its ends [m]; functions of t move them. Seen against the way from a to b the air turns counter-clockwise.
    circulation : Gamma [m^2/s].
    eps : radius of the core [m], at least 0; with 0 the speed grows without bound towards the line, and is 0 on it.

    Notes
    -----
    The core is that of Rosenhead and Moore; Saffman, Vortex Dynamics (1992), 2.3 and 11.2.
    """

    def __init__(
        self,
        a: Vector = (0.0, 0.0, 0.0),
        b: Vector = (0.0, 1.0, 0.0),
        circulation: Scalar = 1.0,
        eps: Scalar = 0.05,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("a", a, vector=True, unit="m"),
            Parameter("b", b, vector=True, unit="m"),
            Parameter("circulation", circulation, unit="m^2/s"),
            Parameter("eps", eps, unit="m", at_least=0),
        ]
        if parameters[0].constant and parameters[1].constant and parameters[0].at(0.0) == parameters[1].at(0.0):
            raise InvalidInput(f"a and b of a vortex line are both {a}: they must be different places")
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, a: Any, b: Any, circulation: Any, eps: Any) -> Any:
        """Velocity [m/s]."""
        line = fn.sub(b, a)
        e = fn.scale(fn.inverse(fn.length(line)), line)
        from_a, from_b = fn.sub(x, a), fn.sub(x, b)
        around = fn.cross(e, from_a)  # as long as the distance from the line
        core = fn.dot(around, around) + eps * eps
        ends = [fn.dot(e, d) for d in (from_a, from_b)]
        reach = ends[0] * fn.inverse(fn.sqrt(core + ends[0] * ends[0]))
        reach = reach - ends[1] * fn.inverse(fn.sqrt(core + ends[1] * ends[1]))
        return fn.scale(circulation * reach * fn.inverse(4.0 * math.pi * core), around)
