"""The flow through and around a vortex ring, such as a smoke ring."""

from __future__ import annotations

import math
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn

HALVINGS = 6  # of the arithmetic-geometric mean: the error is squared by each, and small to start with


class VortexRing(VelocityField):
    """x' = Gamma / (4 pi) int ds x d / (d^2 + eps^2)^(3/2) around a circle, d from there to x (Biot-Savart).

    In closed form, with complete elliptic integrals. On the axis, at a height z over the centre, the speed is
    Gamma R^2 / (2 (R^2 + z^2 + eps^2)^(3/2)). The ring stays where it is: real ones travel along their axis, which
    `center` can follow, as (0, "0.5*t", 0).

    Parameters
    ----------
    center : [m]; may move as a function of t.
    axis : direction of the flow through the ring; its length does not matter.
    radius : R of the circle [m], above 0.
    circulation : Gamma [m^2/s].
    eps : radius of the core [m], at least 0; with 0 the speed grows without bound towards the circle.

    Notes
    -----
    The core is that of Rosenhead and Moore; Saffman, Vortex Dynamics (1992), 10.1. The integrals come from the
    arithmetic-geometric mean (Abramowitz & Stegun 17.6), which is exact to rounding for eps > 1e-3 R.
    """

    def __init__(
        self,
        center: Vector = (0.0, 0.0, 0.0),
        axis: Vector = (0.0, 1.0, 0.0),
        radius: Scalar = 0.5,
        circulation: Scalar = 1.0,
        eps: Scalar = 0.05,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("center", center, vector=True, unit="m"),
            Parameter("axis", axis, vector=True),
            Parameter("radius", radius, unit="m", above=0),
            Parameter("circulation", circulation, unit="m^2/s"),
            Parameter("eps", eps, unit="m", at_least=0),
        ]
        if parameters[1].constant and not any(parameters[1].at(0.0)):
            raise InvalidInput("axis = (0, 0, 0) is not allowed: it must be a direction, such as (0, 1, 0)")
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, center: Any, axis: Any, radius: Any, circulation: Any, eps: Any) -> Any:
        """Velocity [m/s]."""
        e = fn.scale(fn.inverse(fn.length(axis)), axis)
        d = fn.sub(x, center)
        z = fn.dot(e, d)
        outward = fn.sub(d, fn.scale(z, e))  # as long as the distance rho from the axis
        rho2 = fn.dot(outward, outward)
        rho = fn.sqrt(rho2)
        far = (rho + radius) * (rho + radius) + z * z + eps * eps  # D = far - m far cos^2(theta / 2)
        m = 4.0 * rho * radius / far
        near = ((rho - radius) * (rho - radius) + z * z + eps * eps) / far  # 1 - m
        quarter, bend = _elliptic(m, near)
        # int dtheta / D^(3/2), and int cos(theta) dtheta / D^(3/2) divided by 2 rho R, which is finite on the axis
        scale = fn.inverse(far * fn.sqrt(far) * near)
        whole = 4.0 * quarter * (1.0 - 0.5 * m - m * m * bend) * scale
        waved = 16.0 * quarter * (0.25 - bend * (1.0 - 0.5 * m)) * scale / far
        factor = circulation * radius / (4.0 * math.pi)
        along = factor * (radius * whole - 2.0 * radius * rho2 * waved)
        return fn.add(fn.scale(along, e), fn.scale(factor * 2.0 * radius * z * waved, outward))


def _elliptic(m: Any, rest: Any) -> tuple[Any, Any]:
    """K(m), and b with E(m) = K (1 - m/2 - m^2 b), from the means of 1 and the root of `rest` = 1 - m."""
    a, g = 1.0, fn.sqrt(rest)
    c = 0.5 / (1.0 + g)  # half the difference of the means, divided by m
    bend, weight = c * c, 1.0
    a, g = 0.5 * (a + g), fn.sqrt(g)
    for _ in range(HALVINGS):
        mean = 0.5 * (a + g)
        c = m * c * c / (4.0 * mean)
        weight *= 2.0
        bend = bend + weight * c * c
        a, g = mean, fn.sqrt(a * g)
    return 0.5 * math.pi / a, bend
