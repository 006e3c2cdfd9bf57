"""Wind on triangles: on cloth, leaves, sails."""

from __future__ import annotations

from typing import Any

from pointmass.forces.air import Velocity
from pointmass.forces.exposed import Plates, Triangles
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class PlateWind(Plates):
    """F = rho/2 A |w|^2 cos(b) (drag e + lift (n - cos(b) e)) on a flat plate, a third of it on each of its corners.

    w = |w| e is the wind relative to the mean velocity of the corners, A the area, n the unit normal on the side to
    which the air flows, and cos(b) = n . e. Broadside that is rho A drag |w|^2 / 2; edge-on nothing; the lift, which is
    at right angles to w, is largest at 45 degrees, rho A lift |w|^2 / 4.

    Parameters
    ----------
    triangles : ids of the corners, shape (e, 3), or the name of a surface, such as that of a cloth.
    velocity : of the air at the middle of a triangle [m/s]: three numbers, formulas or functions of t; or a velocity
        field such as `Gust(...)`; or a list of both, that add up.
    density : rho of the air [kg/m^3], at least 0.
    drag, lift : coefficients of the plate, at least 0; a number, one for each triangle, or a function of t.

    Attributes
    ----------
    air : the velocity as a law of its own.
    flows : the fields of the velocity.

    Notes
    -----
    A thin plate across the flow has a drag of about 1.2 (Hoerner, Fluid-Dynamic Drag, 1965). At small angles of attack
    this is a simple law that has the right signs and limits, and no theory of wings.

    Examples
    --------
    >>> pm.PlateWind([(0, 1, 2), (2, 1, 3)], velocity=(4, 0, 0))
    >>> pm.PlateWind("cloth", velocity=pm.Gust((4, 0, 0)))
    """

    def __init__(
        self,
        triangles: Triangles,
        velocity: Velocity = (3.0, 0.0, 0.0),
        density: Scalar = 1.2,
        drag: Scalar = 1.2,
        lift: Scalar = 0.8,
        *,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("density", density, unit="kg/m^3", at_least=0),
            Parameter("drag", drag, at_least=0),
            Parameter("lift", lift, at_least=0),
        ]
        super().__init__(triangles, parameters, velocity, enabled)

    def law(self, *arguments: Any) -> Any:
        """Forces on the three corners [N]."""
        *state, t, density, drag, lift = arguments[:10]
        normal, moves, air = self.exposed(state, t, arguments[10:])
        w = fn.sub(air, moves)
        area, speed, flux = fn.length(normal), fn.length(w), fn.dot(normal, w)
        # |w|^2 A cos(b) n = flux |w| normal / A, and |w|^2 A cos(b)^2 e = flux^2 w / (A |w|)
        push = fn.scale(drag * fn.absolute(flux) - lift * flux * flux * fn.inverse(area * speed), w)
        rise = fn.scale(lift * flux * speed * fn.inverse(area), normal)
        third = fn.scale(density / 6.0, fn.add(push, rise))
        return [third, third, third]
