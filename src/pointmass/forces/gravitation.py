"""Gravitation of all particles on each other."""

from __future__ import annotations

from typing import Any

from pointmass.laws.pairs import PairForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Gravitation(PairForce):
    """f_i = -G m_i sum_j m_j d / (d^2 + eps^2)^(3/2), d = x_i - x_j, summed directly over all pairs.

    Energy -G m_i m_j / sqrt(d^2 + eps^2) for each pair.

    Parameters
    ----------
    G : constant of gravitation [m^3/(kg s^2)].
    eps : softening length [m], at least 0; with 0 the law is singular where two particles meet.
    """

    def __init__(self, G: Scalar = 1.0, eps: Scalar = 0.0, *, on: Selection = None, enabled: bool = True) -> None:
        super().__init__(
            [Parameter("G", G, unit="m^3/(kg s^2)"), Parameter("eps", eps, unit="m", at_least=0)], on, enabled
        )

    @staticmethod
    def law(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, eps: Any) -> Any:
        """What particle 2 adds to the field at particle 1, without -G."""
        d = fn.sub(x1, x2)
        inverse = 1.0 / fn.sqrt(eps * eps + d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        return fn.scale(m2 * (inverse * inverse * inverse), d)

    @staticmethod
    def finish(sums: Any, x: Any, v: Any, m: Any, t: Any, G: Any) -> Any:
        """Force on a particle in the field of all others [N]."""
        return fn.scale(-G * m, sums)

    @staticmethod
    def potential(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, G: Any, eps: Any) -> Any:
        """Energy of the pair [J]."""
        d = fn.sub(x1, x2)
        return -G * (m1 * m2) / fn.sqrt(fn.dot(d, d) + eps * eps)
