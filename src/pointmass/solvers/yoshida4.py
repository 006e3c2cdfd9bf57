"""Yoshida's method of order 4."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.errors import whole_number
from pointmass.solvers.splitting import Splitting, Substep

OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
INNER = 1.0 - 2.0 * OUTER


@final
class Yoshida4(Splitting):
    """Three leapfrogs, the middle one backwards in time: order 4, symplectic.

    Parameters
    ----------
    passes : fixed-point passes of a closing kick if a depends on v; two or three give order 3, four give order 4.

    Notes
    -----
    Yoshida, Phys. Lett. A 150 (1990), 262; Forest and Ruth, Physica D 43 (1990), 105. The substep backwards is 1.7 h
    long: it amplifies what drag damps, so stiff drag needs short steps.
    """

    name: ClassVar[str] = "yoshida4"
    order: ClassVar[int] = 4
    substeps: ClassVar[tuple[Substep, ...]] = (
        Substep(OUTER / 2.0, OUTER, OUTER / 2.0),
        Substep(INNER / 2.0, INNER, INNER / 2.0),
        Substep(OUTER / 2.0, OUTER, OUTER / 2.0),
    )

    def __init__(self, passes: int = 4) -> None:
        self.passes = whole_number("passes", passes, at_least=1)
