"""Vortices that carry each other along."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from pointmass.laws.pairs import PairForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class PointVortices(PairForce):
    """x_i' = sum_j Gamma_j / (2 pi (d^2 + eps^2)) (-d_y, d_x, 0), d = x_i - x_j in the x-y plane (Helmholtz 1858).

    Each particle is a straight vortex line along z. Two equal ones a distance d apart turn about each other at
    Gamma / (pi d^2), two opposite ones travel side by side at Gamma / (2 pi d). The centre sum_i Gamma_i x_i stays
    where it is.

    Parameters
    ----------
    circulation : Gamma of each particle [m^2/s]; by default the particle attribute `circulation`.
    eps : radius of the cores [m], at least 0; vortices at the same place do not move each other.
    """

    order: ClassVar[int] = 1
    internal: ClassVar[bool] = False  # sum_i Gamma_i x_i' vanishes, not the sum of velocities
    per_particle: ClassVar[tuple[str, ...]] = ("circulation",)

    def __init__(
        self, circulation: Scalar = "circulation", eps: Scalar = 0.0, *, on: Selection = None, enabled: bool = True
    ) -> None:
        parameters = [
            Parameter("circulation", circulation, unit="m^2/s"),
            Parameter("eps", eps, unit="m", at_least=0),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, circulation: Any, eps: Any) -> Any:
        """Velocity that particle 2 gives to particle 1 [m/s]."""
        dx, dy = x1[0] - x2[0], x1[1] - x2[1]
        rate = circulation[1] * fn.inverse(2.0 * math.pi * (dx * dx + dy * dy + eps * eps))
        return -rate * dy, rate * dx, 0.0
