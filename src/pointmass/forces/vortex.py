"""The flow around a straight vortex line."""

from __future__ import annotations

import math
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Vortex(VelocityField):
    """x' = Gamma r / (2 pi (r^2 + eps^2)) around a line, r = distance from it: a whirl with a smooth core.

    Seen against `axis` it turns counter-clockwise; far out a particle goes round in 4 pi^2 r^2 / Gamma.

    Parameters
    ----------
    circulation : Gamma [m^2/s]; a number or a function of t.
    center : a point of the line [m]; may move as a function of t.
    axis : direction of the line; its length does not matter.
    eps : radius of the core [m], at least 0; with 0 the speed grows without bound towards the line, and is 0 on it.
    """

    def __init__(
        self,
        circulation: Scalar = 1.0,
        center: Vector = (0.0, 0.0, 0.0),
        axis: Vector = (0.0, 0.0, 1.0),
        eps: Scalar = 0.05,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("circulation", circulation, unit="m^2/s"),
            Parameter("center", center, vector=True, unit="m"),
            Parameter("axis", axis, vector=True),
            Parameter("eps", eps, unit="m", at_least=0),
        ]
        if parameters[2].constant and not any(parameters[2].at(0.0)):
            raise InvalidInput("axis = (0, 0, 0) is not allowed: it must be a direction, such as (0, 0, 1)")
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, circulation: Any, center: Any, axis: Any, eps: Any) -> Any:
        """Velocity [m/s]."""
        unit = fn.scale(fn.inverse(fn.length(axis)), axis)
        around = fn.cross(unit, fn.sub(x, center))  # as long as the distance from the line
        return fn.scale(circulation * fn.inverse(2.0 * math.pi * (fn.dot(around, around) + eps * eps)), around)
