"""Heun's method, the explicit trapezoidal rule."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import ExplicitRungeKutta, Row, row


@final
class Heun(ExplicitRungeKutta):
    """The mean of the slopes at both ends of an Euler step: order 2, two evaluations.

    On linear systems it is the midpoint rule: the energy of an oscillator w grows by 1 + (w h)^4/4 with every step.

    Notes
    -----
    Heun, Z. Math. Phys. 45 (1900); Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sec. II.1.
    """

    name: ClassVar[str] = "heun"
    order: ClassVar[int] = 2
    A: ClassVar[tuple[Row, ...]] = (row(""), row("1"))
    b: ClassVar[Row] = row("1/2 1/2")
    c: ClassVar[Row] = row("0 1")
