"""The classical Runge-Kutta method."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import ExplicitRungeKutta, Row, row


@final
class RK4(ExplicitRungeKutta):
    """Order 4 with four evaluations.

    An oscillator w is stable for w h < 2 sqrt 2, a decay at rate c for c h < 2.785. Below the limit the energy falls
    by (w h)^6/72 with every step.

    Notes
    -----
    Kutta, Z. Math. Phys. 46 (1901); Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, sec. II.1.
    """

    name: ClassVar[str] = "rk4"
    order: ClassVar[int] = 4
    A: ClassVar[tuple[Row, ...]] = (row(""), row("1/2"), row("0 1/2"), row("0 0 1"))
    b: ClassVar[Row] = row("1/6 1/3 1/3 1/6")
    c: ClassVar[Row] = row("0 1/2 1/2 1")
