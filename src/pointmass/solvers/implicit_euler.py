"""Backward Euler."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.implicit import Implicit


@final
class ImplicitEuler(Implicit):
    """y1 = y + h F(t + h, y1): order 1, stable for every h.

    It damps whatever a step does not resolve: the energy of an oscillator w falls by 1/(1 + (w h)^2) with every step.

    Notes
    -----
    Curtiss and Hirschfelder, Proc. Natl. Acad. Sci. 38 (1952), 235; Baraff and Witkin, Large Steps in Cloth
    Simulation, SIGGRAPH 1998 (``newton="one"``, ``linear_solver="cg"``).
    """

    name: ClassVar[str] = "implicit_euler"
    order: ClassVar[int] = 1
