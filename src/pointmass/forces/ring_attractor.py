"""A circle that attracts."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput
from pointmass.forces.pull import Pull
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class RingAttractor(Pull):
    """f = -m strength d / (d^2 + eps^2)^((power + 1) / 2), d from the nearest place of a circle, or of a point.

    A negative strength repels. On the axis, where all of the circle is equally near, the pull goes to its centre.

    Parameters
    ----------
    center : [m]; may move as a function of t.
    axis : at right angles to the circle; its length does not matter.
    radius : of the circle [m], at least 0; with 0 it is a point.
    strength : acceleration 1 m from the circle [m/s^2].
    power : how the pull falls off: 0 is the same at all distances, 1 that of a heavy line, 2 that of a point, -1 a
        spring.
    eps : softening length [m], above 0: nearer to the circle the pull goes to 0.
    reach : distance at which the pull has smoothly ended [m], by a factor (1 - d^2/reach^2)^2; None = never.

    Examples
    --------
    >>> pm.RingAttractor((0, 1, 0), radius=0.8, strength=4.0, power=1.0)
    """

    def __init__(
        self,
        center: Vector = (0.0, 0.0, 0.0),
        axis: Vector = (0.0, 1.0, 0.0),
        radius: Scalar = 0.5,
        strength: Scalar = 1.0,
        power: Scalar = 1.0,
        eps: Scalar = 0.05,
        reach: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        shape = [
            Parameter("center", center, vector=True, unit="m"),
            Parameter("axis", axis, vector=True),
            Parameter("radius", radius, unit="m", at_least=0),
        ]
        if shape[1].constant and not any(shape[1].at(0.0)):
            raise InvalidInput("axis = (0, 0, 0) is not allowed: it must be a direction, such as (0, 1, 0)")
        super().__init__(shape, strength, power, eps, reach, on, enabled)

    def ways(self, x: Any, own: dict[str, Any]) -> list[Any]:
        e = fn.scale(fn.inverse(fn.length(own["axis"])), own["axis"])
        d = fn.sub(x, own["center"])
        outward = fn.sub(d, fn.scale(fn.dot(e, d), e))
        return [fn.sub(d, fn.scale(own["radius"] * fn.inverse(fn.length(outward)), outward))]
