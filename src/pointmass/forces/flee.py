"""Predators and prey."""

from __future__ import annotations

from typing import Any, ClassVar

from pointmass.forces.steering import field_of_view as view
from pointmass.forces.steering import sees
from pointmass.laws.pairs import PairForce, cut_off
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Flee(PairForce):
    """f = m strength sum_j w_j n_j / max(1, sum_j w_j) with w_j = 1 - r_j/cutoff and n_j from j to the particle.

    Flee and pursuit of Reynolds (Steering Behaviors for Autonomous Characters, GDC 1999), from or for all that one
    sees, the nearer the more: away from the particles of `by`, or with a negative strength after them. No acceleration
    is above |strength|.

    Parameters
    ----------
    by : from whom one flees, a group or rows; None = those of `on`, from each other.
    strength : acceleration right beside somebody [m/s^2]; negative: one hunts them.
    cutoff : distance within which they are noticed [m], above 0.
    field_of_view : full angle of a cone around the velocity [degrees], at most 360; who is at rest sees all around.

    Examples
    --------
    >>> fear = pm.Flee(by="falcon", on="starlings", strength=60.0, cutoff=12.0)
    >>> hunt = pm.Flee(by="starlings", on="falcon", strength=-20.0, cutoff=25.0, field_of_view=200.0)
    """

    internal: ClassVar[bool] = False

    def __init__(
        self,
        by: Selection = None,
        strength: Scalar = 10.0,
        cutoff: float = 5.0,
        field_of_view: Scalar = 360.0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [Parameter("strength", strength, unit="m/s^2"), cut_off(cutoff), view(field_of_view)]
        super().__init__(parameters, on, enabled, by=by)

    @staticmethod
    def law(x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, cutoff: Any, field_of_view: Any) -> Any:
        """Weight of 2, and its direction away from 2, weighted."""
        way = fn.sub(x2, x1)
        distance = fn.length(way)
        weight = fn.where(sees(way, v1, field_of_view), fn.maximum(1.0 - distance / cutoff, 0.0), 0.0)
        return weight, *fn.scale(-weight * fn.inverse(distance), way)

    @staticmethod
    def finish(sums: Any, x: Any, v: Any, m: Any, t: Any, strength: Any) -> Any:
        """Force [N]."""
        return fn.scale(m * strength / fn.maximum(sums[0], 1.0), sums[1:4])
