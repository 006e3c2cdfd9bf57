"""The pair of Bogacki and Shampine."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import EmbeddedRungeKutta, Row, row


@final
class BogackiShampine(EmbeddedRungeKutta):
    """Order 3 with an error estimate of order 2, three evaluations and one for the estimate.

    With fixed steps an oscillator w is stable for w h < sqrt 3, a decay at rate c for c h < 2.51.

    Notes
    -----
    Bogacki and Shampine, Appl. Math. Lett. 2 (1989), 321. Dense output is the cubic of Hermite.
    """

    name: ClassVar[str] = "bs32"
    order: ClassVar[int] = 3
    A: ClassVar[tuple[Row, ...]] = (row(""), row("1/2"), row("0 3/4"))
    b: ClassVar[Row] = row("2/9 1/3 4/9")
    c: ClassVar[Row] = row("0 1/2 3/4")
    b_hat: ClassVar[Row] = row("7/24 1/4 1/3 1/8")
