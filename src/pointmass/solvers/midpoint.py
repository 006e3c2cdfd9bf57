"""The explicit midpoint rule."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import ExplicitRungeKutta, Row, row


@final
class Midpoint(ExplicitRungeKutta):
    """Half an Euler step, and from the start a whole one with the slope found there: order 2, two evaluations.

    The energy of an oscillator w grows by 1 + (w h)^4/4 with every step: slowly, but for every h.

    Notes
    -----
    Runge, Math. Ann. 46 (1895); Witkin and Baraff, Differential Equation Basics, SIGGRAPH course 1997.
    """

    name: ClassVar[str] = "midpoint"
    order: ClassVar[int] = 2
    A: ClassVar[tuple[Row, ...]] = (row(""), row("1/2"))
    b: ClassVar[Row] = row("0 1")
    c: ClassVar[Row] = row("0 1/2")
