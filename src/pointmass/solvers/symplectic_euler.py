"""Semi-implicit Euler."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.solvers.splitting import Splitting, Substep


@final
class SymplecticEuler(Splitting):
    """v1 = v + h a(t, x, v), then x1 = x + h v1: order 1, one evaluation.

    On an oscillator w it conserves v^2 + w^2 x^2 - w^2 h x v exactly and is stable for w h < 2; with drag, for
    w h < 2 (sqrt(1 + zeta^2) - zeta).

    Notes
    -----
    Hairer, Lubich and Wanner, Geometric Numerical Integration, sec. I.1.2.
    """

    name: ClassVar[str] = "symplectic_euler"
    order: ClassVar[int] = 1
    substeps: ClassVar[tuple[Substep, ...]] = (Substep(1.0, 1.0, 0.0),)
