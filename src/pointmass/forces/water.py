"""Water that closed surfaces push away as they move: what fish swim with."""

from __future__ import annotations

from typing import Any

from pointmass.forces.air import Velocity
from pointmass.forces.exposed import Plates, Triangles
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Water(Plates):
    """F = min(0, -drag A (n . v)) n on each triangle, a third of it on each of its corners.

    A is the area, n the unit normal outwards, and v the mean velocity of the corners relative to the water. Only what
    moves outwards pushes water away, and the force never speeds up what it acts on: F . v = -drag A (n . v)^2 or 0.

    Parameters
    ----------
    triangles : ids of the corners, shape (e, 3), counter-clockwise seen from the water; or the name of a surface.
    drag : force for each area and speed [N s/m^3], at least 0; a number, one for each triangle, or a function of t.
    velocity : of the water at the middle of a triangle [m/s]: three numbers, formulas or functions of t; or a velocity
        field such as `Gust(...)`; or a list of both, that add up.

    Attributes
    ----------
    flows : the fields of the velocity.

    Notes
    -----
    The law is that of Tu & Terzopoulos (Artificial Fishes, SIGGRAPH 1994), linear in the speed as in slow, thick water.
    Real drag grows with the square of the speed, and there is no inertia of the water here.
    """

    def __init__(
        self,
        triangles: Triangles,
        drag: Scalar = 1000.0,
        velocity: Velocity = (0.0, 0.0, 0.0),
        *,
        enabled: bool = True,
    ) -> None:
        super().__init__(triangles, [Parameter("drag", drag, unit="N s/m^3", at_least=0)], velocity, enabled)

    def law(self, *arguments: Any) -> Any:
        """Forces on the three corners [N]."""
        *state, t, drag = arguments[:8]
        normal, moves, water = self.exposed(state, t, arguments[8:])
        outwards = fn.maximum(fn.dot(normal, fn.sub(moves, water)), 0.0)
        third = fn.scale(-drag * outwards * fn.inverse(3.0 * fn.length(normal)), normal)
        return [third, third, third]
