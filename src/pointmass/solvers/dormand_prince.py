"""The pair of Dormand and Prince."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import EmbeddedRungeKutta, Row, row


@final
class DormandPrince(EmbeddedRungeKutta):
    """Order 5 with an error estimate of order 4, six evaluations and one for the estimate.

    With fixed steps an undamped oscillator w is stable only for w h < 0.997 (it grows by 3e-3 a step at 1.5), a decay
    at rate c for c h < 3.31.

    Notes
    -----
    Dormand and Prince, J. Comput. Appl. Math. 6 (1980), 19. Dense output of order 4, d from Hairer, Norsett and
    Wanner, Solving Ordinary Differential Equations I, sec. II.6.
    """

    name: ClassVar[str] = "dopri5"
    order: ClassVar[int] = 5
    A: ClassVar[tuple[Row, ...]] = (
        row(""),
        row("1/5"),
        row("3/40 9/40"),
        row("44/45 -56/15 32/9"),
        row("19372/6561 -25360/2187 64448/6561 -212/729"),
        row("9017/3168 -355/33 46732/5247 49/176 -5103/18656"),
    )
    b: ClassVar[Row] = row("35/384 0 500/1113 125/192 -2187/6784 11/84")
    c: ClassVar[Row] = row("0 1/5 3/10 4/5 8/9 1")
    b_hat: ClassVar[Row] = row("5179/57600 0 7571/16695 393/640 -92097/339200 187/2100 1/40")
    d: ClassVar[Row | None] = row(
        "-12715105075/11282082432 0 87487479700/32700410799 -10690763975/1880347072"
        " 701980252875/199316789632 -1453857185/822651844 69997945/29380423"
    )
