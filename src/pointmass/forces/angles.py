"""Angular springs at joints."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.laws.elements import ConstraintForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Angles(ConstraintForce):
    """A joint a-b-c that wants the angle `rest` between a->b and b->c: E = k_s (theta - rest)^2 / 2.

    theta = atan2(|e1 x e2|, e1 . e2) with e1 = b - a, e2 = c - b is 0 for a straight joint. Damping acts on the rate of
    the angle. At exactly 0 and pi the direction of bending is not defined and the joint gives no force.

    Parameters
    ----------
    joints : ids of a, b, c, shape (e, 3).
    k_s : stiffness [N m/rad], at least 0; a number, one for each joint, or a function of t.
    k_d : damping [N m s/rad], at least 0, likewise.
    rest : angle without moment [rad], likewise.
    """

    nodes = 3
    unit = "rad"

    def __init__(
        self, joints: ArrayLike, k_s: Scalar = 1.0, k_d: Scalar = 0.0, rest: Scalar = 0.0, *, enabled: bool = True
    ) -> None:
        parameters = [
            Parameter("k_s", k_s, unit="N m/rad", at_least=0),
            Parameter("k_d", k_d, unit="N m s/rad", at_least=0),
            Parameter("rest", rest, unit="rad"),
        ]
        super().__init__(joints, parameters, enabled)

    @staticmethod
    def constraint(*x: Any) -> Any:
        """Angle [rad]."""
        e1, e2 = fn.sub(x[1], x[0]), fn.sub(x[2], x[1])
        return fn.atan2(fn.length(fn.cross(e1, e2)), fn.dot(e1, e2))
