"""The drag of a thin body, link by link: what lets an eel swim and a snake crawl in sand."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.laws.elements import ElementForce
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class SlenderDrag(ElementForce):
    """F = -L (C_T (u . s) s + C_N (u - (u . s) s)) on a link of length L in the direction s, half of it on each end.

    u is the mean velocity of the ends: the resistive force theory of Gray and Hancock (The propulsion of sea-urchin
    spermatozoa, J. Exp. Biol. 32, 1955). With `across` larger than `along`, a wave that runs along the body drives it
    the other way; if they are equal nothing does.

    Parameters
    ----------
    links : ids of the ends, shape (e, 2).
    along, across : C_T and C_N [N s/m^2], at least 0.
    """

    nodes = 2
    internal = False

    def __init__(self, links: ArrayLike, along: Scalar = 0.1, across: Scalar = 0.2, *, enabled: bool = True) -> None:
        coefficients = [
            Parameter("along", along, unit="N s/m^2", at_least=0),
            Parameter("across", across, unit="N s/m^2", at_least=0),
        ]
        super().__init__(links, coefficients, enabled)

    def law(self, x1: Any, v1: Any, x2: Any, v2: Any, t: Any, along: Any, across: Any) -> Any:
        """Forces on both ends [N]."""
        link = fn.sub(x1, x2)
        length = fn.length(link)
        u = fn.scale(0.5, fn.add(v1, v2))
        ahead = fn.scale(fn.dot(u, link) * fn.inverse(length), link)  # L (u . s) s
        half = fn.scale(-0.5, fn.add(fn.scale(across * length, u), fn.scale(along - across, ahead)))
        return [half, half]
