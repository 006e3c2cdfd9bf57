"""Pectoral fins: how a fish climbs, dives, brakes and keeps upright."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import ArrayLike

from pointmass.forces.air import Velocity
from pointmass.forces.exposed import Exposed
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Fins(Exposed):
    """F = -drag area (v . n) n on a section of a body, with n = cos(angle) ahead + sin(angle) up; and a righting pair.

    v is the velocity of the section relative to the water; `ahead` and `up` are the section's own. With an angle of
    90 degrees the fins lie flat; below they dive, above they climb, and with 180 degrees they brake (Tu & Terzopoulos,
    Artificial Fishes, SIGGRAPH 1994). F . v is never positive. In addition the upper two corners are pulled up and the
    lower two down, by `upright` each: a couple, that keeps the fish from rolling over.

    Parameters
    ----------
    sections : ids of four corners each, upper left, upper right, lower right, lower left, shape (e, 4).
    angle : of the fins [rad], from pi/4 to pi; a number, one for each section, or a function of t.
    area : of the fins of a section [m^2], at least 0; likewise.
    drag : force for each area and speed [N s/m^3], at least 0; likewise.
    upright : [N], at least 0; likewise.
    velocity : of the water, as for `Water`.

    Attributes
    ----------
    flows : the fields of the velocity.
    """

    nodes = 4

    def __init__(
        self,
        sections: ArrayLike,
        angle: Scalar = math.pi / 2,
        area: Scalar = 0.01,
        drag: Scalar = 1000.0,
        upright: Scalar = 0.0,
        velocity: Velocity = (0.0, 0.0, 0.0),
        *,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("angle", angle, unit="rad", at_least=math.pi / 4, at_most=math.pi),
            Parameter("area", area, unit="m^2", at_least=0),
            Parameter("drag", drag, unit="N s/m^3", at_least=0),
            Parameter("upright", upright, unit="N", at_least=0),
        ]
        super().__init__(sections, parameters, velocity, enabled)

    def law(self, *arguments: Any) -> Any:
        """Forces on the four corners [N]."""
        state, (t, angle, area, drag, upright, *velocity) = arguments[:8], arguments[8:]
        left_up, right_up, right_down, left_down = state[0::2]
        top, bottom = fn.add(left_up, right_up), fn.add(left_down, right_down)
        rise = fn.sub(top, bottom)
        aside = fn.sub(fn.add(right_up, right_down), fn.add(left_up, left_down))
        up = fn.scale(fn.inverse(fn.length(rise)), rise)
        ahead = fn.cross(up, aside)
        ahead = fn.scale(fn.inverse(fn.length(ahead)), ahead)
        normal = fn.add(fn.scale(fn.cos(angle), ahead), fn.scale(fn.sin(angle), up))
        moves = fn.scale(0.25, fn.add(fn.add(state[1], state[3]), fn.add(state[5], state[7])))
        v = fn.sub(moves, self.air.law(fn.scale(0.25, fn.add(top, bottom)), t, velocity))
        quarter = fn.scale(-0.25 * drag * area * fn.dot(v, normal), normal)
        pull = (0.0, upright, 0.0)
        upper, lower = fn.add(quarter, pull), fn.sub(quarter, pull)
        return [upper, upper, lower, lower]
