"""Bending across an edge that two triangles share."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.laws.elements import ConstraintForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Hinges(ConstraintForce):
    """Triangles a-b-c and b-a-d that want the angle `rest` across their edge a-b: E = k_s (theta - rest)^2 / 2.

    theta, from -pi to pi, is 0 where both lie in one plane: theta = atan2((n2 x n1) . e/|e|, n1 . n2) with e = b - a
    and the normals n1 = e x (c - a) and n2 = (d - a) x e. It is above 0 where the hinge is folded towards the side to
    which the normals point; a and b, or c and d, in turn give the other sign. Damping acts on the rate of the angle.

    Parameters
    ----------
    hinges : ids of both ends a, b of the edge and of the opposite corners c, d, shape (e, 4).
    k_s : stiffness [N m/rad], at least 0; a number, one for each hinge, or a function of t.
    k_d : damping [N m s/rad], at least 0, likewise.
    rest : angle without moment [rad], likewise; None = the angle at the start.

    Notes
    -----
    Bridson, Marino and Fedkiw, Simulation of Clothing with Folds and Wrinkles, SCA 2003; Grinspun, Hirani, Desbrun and
    Schröder, Discrete Shells, SCA 2003. A sheet of the bending stiffness B [N m] has k_s = B |e|^2 / (A1 + A2), with
    the areas of both triangles. On cells of right angles that are bent along an edge, this is the energy B k^2 / 2 of
    each unit of area at a curvature k; on equilateral triangles it is the 2 B / sqrt(3) of Seung and Nelson (Phys. Rev.
    A 38 (1988), 1005).
    """

    nodes = 4
    unit = "rad"

    def __init__(
        self,
        hinges: ArrayLike,
        k_s: Scalar = 1e-4,
        k_d: Scalar = 0.0,
        rest: Scalar | None = None,
        *,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("k_s", k_s, unit="N m/rad", at_least=0),
            Parameter("k_d", k_d, unit="N m s/rad", at_least=0),
        ]
        if rest is not None:
            parameters.append(Parameter("rest", rest, unit="rad"))
        super().__init__(hinges, parameters, enabled)

    @staticmethod
    def constraint(*x: Any) -> Any:
        """Angle [rad]."""
        a, b, c, d = x
        e = fn.sub(b, a)
        n1, n2 = fn.cross(e, fn.sub(c, a)), fn.cross(fn.sub(d, a), e)
        return fn.atan2(fn.dot(fn.cross(n2, n1), e) * fn.inverse(fn.length(e)), fn.dot(n1, n2))
