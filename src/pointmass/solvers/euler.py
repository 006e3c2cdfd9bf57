"""Euler's method."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.explicit import ExplicitRungeKutta, Row, row


@final
class Euler(ExplicitRungeKutta):
    """y1 = y + h F(t, y): order 1, one evaluation.

    It never conserves: the energy of an oscillator w grows by 1 + (w h)^2 with every step. A decay at rate c needs
    h < 2/c, a damped oscillator h < 2 zeta/w; without damping every step is too long.

    Notes
    -----
    Euler, Institutionum calculi integralis I (1768), sec. 650; Witkin and Baraff, Differential Equation Basics,
    SIGGRAPH course 1997.
    """

    name: ClassVar[str] = "euler"
    order: ClassVar[int] = 1
    A: ClassVar[tuple[Row, ...]] = (row(""),)
    b: ClassVar[Row] = row("1")
    c: ClassVar[Row] = row("0")
