"""Somewhere to go."""

from __future__ import annotations

from typing import Any

from pointmass.forces.steering import limit_of, limited
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Seek(UnaryForce):
    """f = m rate (speed min(1, |d|/arrival) d/|d| - v), d = target - x: towards a goal, at a speed, slower near it.

    Seek and arrival of Reynolds (Steering Behaviors for Autonomous Characters, GDC 1999): the velocity that one would
    like to have, less that which one has.

    Parameters
    ----------
    target : the goal [m]; may move as a function of t.
    speed : at which to go there [m/s], at least 0.
    rate : at which the velocity becomes that one [1/s], at least 0.
    arrival : distance from the goal at which one begins to slow down [m], above 0.
    limit : largest acceleration [m/s^2]; None = any.

    Examples
    --------
    >>> pm.Seek(target=("8*t", 20, 0), speed=9.0, rate=0.3, on="geese")
    """

    def __init__(
        self,
        target: Vector = (0.0, 0.0, 0.0),
        speed: Scalar = 1.0,
        rate: Scalar = 1.0,
        arrival: Scalar = 1.0,
        limit: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("target", target, vector=True, unit="m"),
            Parameter("speed", speed, unit="m/s", at_least=0),
            Parameter("rate", rate, unit="1/s", at_least=0),
            Parameter("arrival", arrival, unit="m", above=0),
            *limit_of(limit),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, v: Any, m: Any, t: Any, target: Any, speed: Any, rate: Any, arrival: Any, limit: Any = None) -> Any:
        """Force [N]."""
        way = fn.sub(target, x)
        wanted = fn.scale(speed / fn.maximum(fn.length(way), arrival), way)
        return fn.scale(m, limited(fn.scale(rate, fn.sub(wanted, v)), limit))
