"""Balls that push each other away."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.laws.pairs import PairForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Particles, Selection
from pointmass.tracing import functions as fn


class SoftSphere(PairForce):
    """f = [k_s s - k_d (v_i - v_j) . n] n where two balls overlap by s = r_i + r_j - |d|, n = d/|d|, d = x_i - x_j.

    A linear spring and dashpot (Cundall & Strack 1979). With z = k_d / (2 sqrt(k_s mu)), mu their reduced mass, two
    balls part with exp(-pi z / sqrt(1 - z^2)) of the speed with which they met, after pi sqrt(mu / (k_s (1 - z^2))); a
    step should be some twentieth of that. Balls whose centres coincide do not push.

    Parameters
    ----------
    k_s : stiffness [N/m], at least 0.
    k_d : damping [N s/m], at least 0.
    radius : of each ball [m]; by default the particle attribute `radius`.
    onset : overlap over which the damping sets in [m], 0 = all of it at the first touch. The force then jumps there,
        and the equations of an implicit step may have no solution: such solvers need an onset of some hundredths of a
        radius.
    box : sides of a periodic box [m], each at least four times the largest radius.
    """

    per_particle: ClassVar[tuple[str, ...]] = ("radius",)

    def __init__(
        self,
        k_s: Scalar = 1000.0,
        k_d: Scalar = 0.0,
        radius: Scalar = "radius",
        box: tuple[float, float, float] | None = None,
        *,
        onset: Scalar = 0.0,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("k_s", k_s, unit="N/m", at_least=0),
            Parameter("k_d", k_d, unit="N s/m", at_least=0),
            Parameter("radius", radius, unit="m", at_least=0),
            Parameter("onset", onset, unit="m", at_least=0),
        ]
        super().__init__(parameters, on, enabled, box)

    def reach(self, particles: Particles) -> float:
        """Twice the largest radius [m]."""
        radius = self.parameters["radius"]
        if not radius.steady:
            raise InvalidInput(f"radius of {self.name} must not depend on t")
        (values,) = radius.of(particles, 0.0, particles.select(self.on))
        return 2 * float(np.max(values, initial=0.0))

    @staticmethod
    def law(
        x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, k_s: Any, k_d: Any, radius: Any, onset: Any
    ) -> Any:
        """Force of particle 2 on particle 1 [N]."""
        d = fn.sub(x1, x2)
        distance = fn.length(d)
        inverse = fn.inverse(distance)
        overlap = radius[0] + radius[1] - distance
        damping = k_d * fn.where(overlap < onset, overlap * fn.inverse(onset), 1.0)
        push = k_s * overlap - damping * inverse * fn.dot(fn.sub(v1, v2), d)
        return fn.scale(fn.where(overlap > 0.0, push * inverse, 0.0), d)

    @staticmethod
    def potential(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, k_s: Any, radius: Any) -> Any:
        """Energy of the pair [J]."""
        overlap = fn.maximum(radius[0] + radius[1] - fn.length(fn.sub(x1, x2)), 0.0)
        return 0.5 * k_s * overlap * overlap
