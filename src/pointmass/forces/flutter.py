"""Air that shakes each particle in its own way: flakes, leaves, ash."""

from __future__ import annotations

from math import exp, sqrt, tanh
from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, Vector, seed_parameter
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn
from pointmass.tracing.noise import draw

H = 0.25  # length of a cell of time, in decay times
MEMORY = 24  # cells; what was before counts exp(-6)
DECAY = exp(-H)
KICK = sqrt(1.0 - DECAY**2)  # of a cell, for a variance of 1 at its ends
# Between its ends the variance is lower: e^(-2 H s) + KICK^2 ((1 - e^(-H s)) / (1 - DECAY))^2, and this is its mean.
MEAN = (1 - DECAY**2) / (2 * H) + (1 + DECAY) / (1 - DECAY) * (1 - 2 * (1 - DECAY) / H + (1 - DECAY**2) / (2 * H))
SHORTER = 2.0 * MEAN * tanh(0.5 * H) / H  # decay time for which the displacement is that of the limit


class Flutter(VelocityField):
    """x' = u(t), for each particle a random velocity of its own that it forgets in time T (Ornstein & Uhlenbeck 1930).

    The mean of u is 0, its standard deviation `strength`, its correlation in time about e^(-t/T), and after a long time
    the mean square displacement is 2 strength^2 T t along each axis.

    Parameters
    ----------
    strength : standard deviation of u along x, y and z [m/s].
    lifetime : T [s], above 0.
    seed : a whole number; others give other motions.

    Notes
    -----
    The law is a function of the particle and of t, so that solvers may evaluate it at any time, in any order: u answers
    to kicks that are constant within cells of time, a quarter of T each, and drawn by (seed, particle, cell). At the
    ends of cells this is the exact step u <- u e^(-h/T) + s sqrt(1 - e^(-2h/T)) xi; each particle has other cells.

    Examples
    --------
    >>> snow = [pm.Gravity(), pm.Wind(pm.Flutter((0.6, 0.1, 0.6), lifetime=0.4), k=0.01)]
    """

    def __init__(
        self,
        strength: Vector = (0.5, 0.2, 0.5),
        lifetime: Scalar = 0.5,
        seed: int = 0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("strength", strength, vector=True, unit="m/s"),
            Parameter("lifetime", lifetime, unit="s", above=0),
            seed_parameter(seed),
            Parameter("chance", "chance"),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, strength: Any, lifetime: Any, seed: Any, chance: Any) -> Any:
        """Velocity [m/s]."""
        now = t / (H * SHORTER * lifetime) + chance
        cell = fn.floor(now)
        part = now - cell
        left = fn.exp(-H * part)
        weights = [KICK * (1.0 - left) / (1.0 - DECAY), *(KICK * DECAY**k * left for k in range(MEMORY))]
        weights[-1] = weights[-1] * (1.0 - part)  # the oldest kick fades out
        result = []
        for axis in range(3):
            total: Any = 0.0
            for age, weight in enumerate(weights):
                total = total + weight * draw(chance, cell - float(age), seed, axis)
            result.append(strength[axis] * (1.0 / sqrt(MEAN)) * total)
        return result
