"""Brownian motion."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, seed_parameter
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn
from pointmass.tracing.noise import draw

AHEAD = 2.0**-10  # of an interval: a time on the grid is not before it because of rounding


class Diffusion(VelocityField):
    """x' = sqrt(2 D / interval) xi: a random velocity that is another one in each interval of time.

    The mean square displacement is 6 D t at the ends of intervals (Einstein 1905).

    Parameters
    ----------
    coefficient : D [m^2/s], at least 0.
    interval : [s], above 0; at least as long as the solver's step, or some velocities are left out and others count
        too much.
    seed : a whole number; others give other motions.

    Notes
    -----
    xi is drawn by (seed, particle, number of the interval). A step of Euler's method that is an interval long is the
    step x <- x + sqrt(2 D h) xi.
    """

    def __init__(
        self,
        coefficient: Scalar = 0.01,
        interval: Scalar = 1.0 / 60.0,
        seed: int = 0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("coefficient", coefficient, unit="m^2/s", at_least=0),
            Parameter("interval", interval, unit="s", above=0),
            seed_parameter(seed),
            Parameter("chance", "chance"),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, coefficient: Any, interval: Any, seed: Any, chance: Any) -> Any:
        """Velocity [m/s]."""
        cell = fn.floor(t / interval + AHEAD)
        speed = fn.sqrt(2.0 * coefficient / interval)
        return [speed * draw(chance, cell, seed, axis) for axis in range(3)]
