"""The speed of a flight."""

from __future__ import annotations

from typing import Any

from pointmass.forces.steering import limit_of, limited
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Cruise(UnaryForce):
    """f = m rate (speed - |v|) v/|v|: keeps near a speed, whichever way it goes.

    The speed goes to `speed` as exp(-rate t). Who is at rest has no heading, and stays.

    Parameters
    ----------
    speed : of the cruise [m/s], at least 0.
    rate : at which differences from it end [1/s], at least 0.
    limit : largest acceleration [m/s^2]; None = any.
    """

    def __init__(
        self,
        speed: Scalar = 1.0,
        rate: Scalar = 1.0,
        limit: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("speed", speed, unit="m/s", at_least=0),
            Parameter("rate", rate, unit="1/s", at_least=0),
            *limit_of(limit),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, speed: Any, rate: Any, limit: Any = None) -> Any:
        """Force [N]."""
        now = fn.length(v)
        return fn.scale(m, limited(fn.scale(rate * (speed - now) * fn.inverse(now), v), limit))
