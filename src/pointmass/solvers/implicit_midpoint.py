"""The implicit midpoint rule."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.implicit import Implicit


@final
class ImplicitMidpoint(Implicit):
    """y1 = y + h F(t + h/2, (y + y1)/2): order 2, stable for every h, symplectic.

    The energy of an oscillator is conserved exactly, so modes that a step does not resolve ring on undamped.

    Notes
    -----
    Hairer, Lubich and Wanner, Geometric Numerical Integration, sec. II.1 and IV.2.
    """

    name: ClassVar[str] = "implicit_midpoint"
    order: ClassVar[int] = 2
    c: ClassVar[float] = 0.5
