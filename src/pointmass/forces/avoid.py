"""Obstacles that are seen in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pointmass.forces.solids import Solid, Solids
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Avoid(UnaryForce):
    """f = m strength sum max(0, 1 - d/(distance + horizon max(0, -v.n))) n over solids, d away, with the normal n.

    Obstacle avoidance of Reynolds (Not Bumping Into Things, SIGGRAPH 1988; Steering Behaviors for Autonomous
    Characters, GDC 1999) by the signed distance: who comes nearer to a surface reacts the earlier the faster it does;
    who flies along it or away only within `distance`. With a solid that is hollow (`inside`) one stays inside of it.

    Parameters
    ----------
    around : colliders to avoid, such as spheres, boxes and planes; where they move, so does what is avoided. Whether
        they are also met as colliders is another matter.
    strength : acceleration at the surface [m/s^2], at least 0; inside of a solid it is larger.
    distance : at which one reacts in any case [m], above 0.
    horizon : how long ahead one looks [s], at least 0.

    Examples
    --------
    >>> pm.Avoid([pm.Sphere((0, 10, 0), radius=3.0), pm.Plane()], strength=40.0, distance=1.0, horizon=0.7)
    """

    def __init__(
        self,
        around: Sequence[Solid],
        strength: Scalar = 10.0,
        distance: Scalar = 1.0,
        horizon: Scalar = 1.0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.solids = Solids(around, "to avoid")
        parameters = [
            *self.solids.parameters,
            Parameter("strength", strength, unit="m/s^2", at_least=0),
            Parameter("distance", distance, unit="m", above=0),
            Parameter("horizon", horizon, unit="s", at_least=0),
        ]
        super().__init__(parameters, on, enabled)

    def law(self, x: Any, v: Any, m: Any, t: Any, *parameters: Any) -> Any:
        """Force [N]."""
        own = dict(zip(self.parameters, parameters, strict=True))

        def push(distance: Any, normal: Any) -> Any:
            reach = own["distance"] + own["horizon"] * fn.maximum(-fn.dot(v, normal), 0.0)
            return m * own["strength"] * fn.maximum(1.0 - distance / reach, 0.0)

        return self.solids.pushes(x, own, push)
