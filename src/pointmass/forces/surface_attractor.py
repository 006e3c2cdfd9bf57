"""Surfaces of solids that attract."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pointmass.forces.pull import Pull
from pointmass.forces.solids import Solid, Solids
from pointmass.laws.parameter import Scalar
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class SurfaceAttractor(Pull):
    """f = -m strength d / (d^2 + eps^2)^((power + 1) / 2), d from the nearest place of a surface; on both of its sides.

    A negative strength repels. The shapes are those of colliders, such as planes, spheres and boxes, which particles go
    through unless they are colliders of the system, too. The pulls of several add up.

    Parameters
    ----------
    around : colliders whose surfaces attract; where they move, so do the surfaces.
    strength : acceleration 1 m from a surface [m/s^2].
    power : how the pull falls off: 0 is the same at all distances, as that of a heavy plane, 2 that of a point, -1 a
        spring.
    eps : softening length [m], above 0: nearer to the surface the pull goes to 0.
    reach : distance at which the pull has smoothly ended [m], by a factor (1 - d^2/reach^2)^2; None = never.

    Examples
    --------
    >>> pm.SurfaceAttractor([pm.Sphere((0, 1, 0), radius=0.8)], strength=5.0, power=0.0, reach=2.0)
    """

    def __init__(
        self,
        around: Sequence[Solid],
        strength: Scalar = 1.0,
        power: Scalar = 0.0,
        eps: Scalar = 0.05,
        reach: Scalar | None = None,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.solids = Solids(around, "whose surfaces attract")
        super().__init__(self.solids.parameters, strength, power, eps, reach, on, enabled)

    def ways(self, x: Any, own: dict[str, Any]) -> list[Any]:
        return [fn.scale(distance, normal) for distance, normal in self.solids.met(x, own)]
