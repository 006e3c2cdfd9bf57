"""Tetrahedra of a solid, which resist a change of their volume and being turned inside out."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import ArrayLike

from pointmass.forces.volumes import Volumes
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn

FLAT = 0.2  # part of its volume below which a tetrahedron becomes no stiffer


class Bulk(Volumes):
    """A tetrahedron a-b-c-d of a solid, with J = V / rest: E = k_s rest^2 (J - 1/J)^2 / 8, the steeper the flatter.

    Near `rest` that is the energy k_s (V - rest)^2 / 2 of `Volumes`, and k_s and k_d mean the same. But a tetrahedron
    is stiffer by (1 + 3/J^4) / 4: by 12 where it has half of its volume, by 469 at a fifth. There the law goes on as a
    spring as stiff as that, so that it is smooth in every pose: to make a tetrahedron flat takes 18.5 k_s rest^2, 37
    times as much as with `Volumes`. Whoever pays this, or makes a step so long that it leads through, turns it inside
    out; it is then driven back all the more.

    Parameters
    ----------
    tetrahedra : ids of a, b, c, d, shape (e, 4), that wind like a right-handed screw.
    k_s : stiffness near `rest` [N/m^5], at least 0; a number, one for each tetrahedron, or a function of t. A bulk
        modulus K [Pa] is K / rest.
    k_d : damping [N s/m^5], at least 0, likewise; it does not depend on J.
    rest : volume without force [m^3], above 0, likewise.

    Notes
    -----
    The energy is the volumetric term of Schröder and Neff, Invariant formulation of hyperelastic transverse isotropy
    based on polyconvex free energy functions (Int. J. Solids Struct. 40 (2003), 401), J^2 + 1/J^2 - 2: it is convex in
    J, and so polyconvex. Stomakhin, Howes, Schroeder and Teran, Energetically consistent invertible elasticity (SCA
    2012) go on like this below some compression. Explicit steps must suit the stiffness of the flattest tetrahedron:
    `system.stability` tells it for the present pose.
    """

    def __init__(
        self, tetrahedra: ArrayLike, k_s: Scalar = 1.0, k_d: Scalar = 0.0, rest: Scalar = 1.0, *, enabled: bool = True
    ) -> None:
        super().__init__(tetrahedra, k_s, k_d, rest, enabled=enabled)
        self.parameters["rest"] = Parameter("rest", rest, unit="m^3", above=0)

    @staticmethod
    def excess(c: Any, rest: Any) -> Any:
        """rest (J - 1/J^3) / 4 [m^3]; below `FLAT` it is straight."""
        j = c / rest
        held = fn.maximum(j, FLAT)
        return rest * (_rise(held) + steepness(FLAT) * (j - held))

    @staticmethod
    def stored(c: Any, rest: Any) -> Any:
        """rest^2 (J - 1/J)^2 / 8 [m^6]; below `FLAT` it is a parabola."""
        j = c / rest
        held = fn.maximum(j, FLAT)
        further = (_rise(held) + 0.5 * steepness(FLAT) * (j - held)) * (j - held)
        return rest * rest * (0.125 * (held - 1.0 / held) ** 2 + further)


def steepness(j: float) -> float:
    """Stiffness of a tetrahedron that has a part `j` of its volume, relative to k_s."""
    return 0.25 * (1.0 + 3.0 * max(j, FLAT) ** -4)


def squeezed(energy: float) -> float:
    """Part of its volume to which an energy of so many k_s rest^2 brings a tetrahedron, while that is above `FLAT`."""
    both = 8.0 * energy + 2.0  # J^2 + 1/J^2
    return math.sqrt(2.0 / (both + math.sqrt(both * both - 4.0)))


def _rise(j: Any) -> Any:
    return 0.25 * (j - 1.0 / (j * j * j))
