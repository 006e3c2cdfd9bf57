"""Leapfrog as kick, drift, kick: the velocity Verlet method."""

from __future__ import annotations

from typing import ClassVar, final

from pointmass.errors import whole_number
from pointmass.solvers.splitting import Splitting, Substep


@final
class Leapfrog(Splitting):
    """Half a kick, a drift, half a kick: order 2, exact for constant accelerations.

    On an oscillator w it conserves v^2 + w^2 x^2 (1 - (w h)^2/4) exactly and is stable for w h < 2.

    Parameters
    ----------
    passes : fixed-point passes of the second kick if a depends on v. One gives order 1, two give order 2.

    Notes
    -----
    Verlet, Phys. Rev. 159 (1967), 98; Swope et al., J. Chem. Phys. 76 (1982), 637.
    """

    name: ClassVar[str] = "leapfrog"
    order: ClassVar[int] = 2
    substeps: ClassVar[tuple[Substep, ...]] = (Substep(0.5, 1.0, 0.5),)

    def __init__(self, passes: int = 2) -> None:
        self.passes = whole_number("passes", passes, at_least=1)
