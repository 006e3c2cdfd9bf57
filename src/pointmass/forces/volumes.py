"""Springs on the volumes of tetrahedra."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.laws.elements import ConstraintForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Volumes(ConstraintForce):
    """A tetrahedron a-b-c-d that wants the volume `rest`: E = k_s (V - rest)^2 / 2.

    V = (e1 x e2) . e3 / 6 with e1 = b - a, e2 = c - b, e3 = d - c has a sign: it is above 0 where a-b-c-d winds like a
    right-handed screw. So a tetrahedron that is turned inside out is driven back, and a curl keeps its hand. With links
    of length l, bends theta_1 and theta_2 at b and c, and the torsion psi about the link b-c,
    `V = l^3 sin(theta_1) sin(theta_2) sin(psi) / 6`: along a strand it is a spring against torsion. V is a polynomial:
    there is no pose in which the law is not smooth, and on a straight strand, which has no torsion, it gives no force.

    Parameters
    ----------
    tetrahedra : ids of a, b, c, d, shape (e, 4).
    k_s : stiffness [N/m^5], at least 0; a number, one for each tetrahedron, or a function of t.
    k_d : damping [N s/m^5], at least 0, likewise.
    rest : volume without force [m^3], likewise; below 0 for a left-handed one.

    Notes
    -----
    Selle, Lentine, Fedkiw, A mass spring model for hair simulation (SIGGRAPH 2008) hold torsion with springs along the
    altitudes of these tetrahedra; an altitude is 3 V over the area of its base, and needs a rule for which of the seven
    is taken when. Teschner et al., A versatile and robust model for geometrically complex deformable solids (CGI 2004,
    eq. 4) have the energy used here, for solids.
    """

    nodes = 4
    unit = "m^3"

    def __init__(
        self, tetrahedra: ArrayLike, k_s: Scalar = 1.0, k_d: Scalar = 0.0, rest: Scalar = 0.0, *, enabled: bool = True
    ) -> None:
        parameters = [
            Parameter("k_s", k_s, unit="N/m^5", at_least=0),
            Parameter("k_d", k_d, unit="N s/m^5", at_least=0),
            Parameter("rest", rest, unit="m^3"),
        ]
        super().__init__(tetrahedra, parameters, enabled)

    @staticmethod
    def constraint(*x: Any) -> Any:
        """Volume with its sign [m^3]."""
        e1, e2, e3 = (fn.sub(x[k + 1], x[k]) for k in range(3))
        return fn.dot(fn.cross(e1, e2), e3) * (1.0 / 6.0)
