"""Birds of a feather."""

from __future__ import annotations

from typing import Any, ClassVar

from pointmass.forces.steering import field_of_view as view
from pointmass.forces.steering import limit_of, limited, sees
from pointmass.laws.pairs import PairForce, cut_off
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Flocking(PairForce):
    """f = m (separation sum_j (1 - r_j/s)+ n_j + alignment mean_j(v_j - v) + cohesion mean_j(x_j - x)).

    The boids of Reynolds (SIGGRAPH 1987; Steering Behaviors for Autonomous Characters, GDC 1999): everybody keeps apart
    from those that it sees nearer than s = `separation_radius`, n_j pointing from them to it, flies as those that it
    sees within `cutoff` do on average, and to the middle of them. Who sees nobody feels nothing. A blind angle makes it
    one-sided, and momentum is not conserved.

    Parameters
    ----------
    cutoff : distance within which others count [m], above 0.
    separation_radius : [m], above 0; who is beyond the cut-off does not count here either.
    separation : acceleration away from somebody at the same place [m/s^2].
    alignment : rate at which differences of velocity end [1/s].
    cohesion : acceleration for each metre that the others' middle is away [1/s^2].
    field_of_view : full angle of a cone around the velocity [degrees], at most 360; who is at rest sees all around.
    limit : largest acceleration by all this [m/s^2]; None = any.
    box : sides of a periodic box [m], each at least twice the cut-off.

    Examples
    --------
    >>> pm.Flocking(cutoff=2.5, separation_radius=1.0, separation=8.0, alignment=1.0, cohesion=1.0, on="starlings")
    """

    internal: ClassVar[bool] = False

    def __init__(
        self,
        cutoff: float = 2.5,
        separation_radius: Scalar = 1.0,
        separation: Scalar = 1.5,
        alignment: Scalar = 1.0,
        cohesion: Scalar = 1.0,
        field_of_view: Scalar = 270.0,
        limit: Scalar | None = None,
        box: tuple[float, float, float] | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            cut_off(cutoff),
            Parameter("separation_radius", separation_radius, unit="m", above=0),
            Parameter("separation", separation, unit="m/s^2"),
            Parameter("alignment", alignment, unit="1/s"),
            Parameter("cohesion", cohesion, unit="1/s^2"),
            view(field_of_view),
            *limit_of(limit),
        ]
        super().__init__(parameters, on, enabled, box)

    @staticmethod
    def law(
        x1: Any, v1: Any, m1: Any, x2: Any, v2: Any, m2: Any, t: Any, separation_radius: Any, field_of_view: Any
    ) -> Any:
        """Whether 1 sees 2; how it keeps apart; where 2 is and how it moves, seen from 1."""
        way = fn.sub(x2, x1)
        seen = fn.where(sees(way, v1, field_of_view), 1.0, 0.0)
        distance = fn.length(way)
        apart = -seen * fn.maximum(1.0 - distance / separation_radius, 0.0) * fn.inverse(distance)
        return seen, *fn.scale(apart, way), *fn.scale(seen, way), *fn.scale(seen, fn.sub(v2, v1))

    @staticmethod
    def finish(
        sums: Any, x: Any, v: Any, m: Any, t: Any, separation: Any, alignment: Any, cohesion: Any, limit: Any = None
    ) -> Any:
        """Force [N]."""
        share = 1.0 / fn.maximum(sums[0], 1.0)
        apart, way, drift = sums[1:4], sums[4:7], sums[7:10]
        together = fn.add(fn.scale(cohesion * share, way), fn.scale(alignment * share, drift))
        return fn.scale(m, limited(fn.add(fn.scale(separation, apart), together), limit))
