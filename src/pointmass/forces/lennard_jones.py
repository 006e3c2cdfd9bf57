"""Atoms of a noble gas."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput
from pointmass.laws.pairs import PairForce, cut_off
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Particles, Selection
from pointmass.tracing import functions as fn


class LennardJones(PairForce):
    """f = 24 epsilon (2 (sigma/r)^12 - (sigma/r)^6) d / r^2 within a cut-off, d = x_i - x_j (Lennard-Jones 1931).

    Energy 4 epsilon [(sigma/r)^12 - (sigma/r)^6] for each pair, shifted so that it is 0 at the cut-off; its minimum
    lies at 2^(1/6) sigma. It is singular where two particles meet. A step of 0.005 sigma sqrt(m/epsilon) is usual.

    Parameters
    ----------
    epsilon : depth of the well [J].
    sigma : distance at which the energy is 0 without the shift [m], greater than 0.
    cutoff : [m]; None = 2.5 sigma, which must then be a number.
    box : sides of a periodic box [m], each at least twice the cut-off; every pair is taken at its nearest images.
    """

    def __init__(
        self,
        epsilon: Scalar = 1.0,
        sigma: Scalar = 1.0,
        cutoff: float | None = None,
        box: tuple[float, float, float] | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [Parameter("epsilon", epsilon, unit="J"), Parameter("sigma", sigma, unit="m", above=0)]
        super().__init__([*parameters, *([] if cutoff is None else [cut_off(cutoff)])], on, enabled, box)

    def reach(self, particles: Particles) -> float | None:
        """The cut-off [m]."""
        sigma = self.parameters["sigma"]
        if "cutoff" in self.parameters:
            return super().reach(particles)
        if not sigma.constant:
            raise InvalidInput(f"{self.name} needs a cutoff [m] where sigma is not one number")
        return 2.5 * float(sigma.components[0].value)  # type: ignore[arg-type]

    @staticmethod
    def law(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, epsilon: Any, sigma: Any) -> Any:
        """Force of particle 2 on particle 1 [N]."""
        d = fn.sub(x1, x2)
        inverse = 1.0 / fn.dot(d, d)
        s6 = (sigma * sigma * inverse) ** 3
        return fn.scale(24.0 * epsilon * (2.0 * s6 - 1.0) * s6 * inverse, d)

    @staticmethod
    def potential(
        x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, epsilon: Any, sigma: Any, cutoff: Any = None
    ) -> Any:
        """Energy of the pair [J]."""
        d = fn.sub(x1, x2)
        s6 = (sigma * sigma / fn.dot(d, d)) ** 3
        edge = 2.5**-6 if cutoff is None else (sigma / cutoff) ** 6
        return 4.0 * epsilon * (s6 * s6 - s6 - (edge * edge - edge))
