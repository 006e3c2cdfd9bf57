"""Springs that change their lengths: muscles."""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import ArrayLike

from pointmass.forces.springs import Springs
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.tracing import functions as fn


class Muscles(Springs):
    """Damped springs that want the length rest (1 + offset + amplitude sin(2 pi frequency t + phase)).

    A wave of such lengths that runs along a body makes it crawl or swim (Miller, The Motion Dynamics of Snakes and
    Worms, SIGGRAPH 1988). The length is that of the stage's own time, so no solver loses its order. Numbers may be set
    between steps: `muscles.set(offset=...)`, or by a controller.

    Parameters
    ----------
    pairs : ids of the particles at the ends, shape (e, 2).
    k_s, k_d : stiffness [N/m] and damping [N s/m], at least 0; a number, one for each muscle, or a function of t.
    rest : length of the idle muscle [m], likewise; None = the length at the start.
    offset : how much longer, as a part of `rest`, a muscle is in the mean, above -1; likewise.
    amplitude : of the wave, as a part of `rest`; likewise. With offset - |amplitude| <= -1 no length is left.
    frequency : of the wave [1/s], likewise.
    phase : of the wave at t = 0 [rad], likewise.
    family : a name for these muscles in pictures and reports.
    """

    def __init__(
        self,
        pairs: ArrayLike,
        k_s: Scalar = 100.0,
        k_d: Scalar = 0.0,
        rest: Scalar | None = None,
        offset: Scalar = 0.0,
        amplitude: Scalar = 0.0,
        frequency: Scalar = 1.0,
        phase: Scalar = 0.0,
        *,
        family: str = "muscles",
        enabled: bool = True,
    ) -> None:
        super().__init__(pairs, k_s, k_d, rest, family=family, enabled=enabled)
        wave = [
            Parameter("offset", offset, above=-1),
            Parameter("amplitude", amplitude),
            Parameter("frequency", frequency, unit="1/s"),
            Parameter("phase", phase, unit="rad"),
        ]
        self.parameters |= {p.name: p for p in wave}

    @staticmethod
    def resting(t: Any, rest: Any, *own: Any) -> Any:
        """Length without force at time t [m]."""
        offset, amplitude, frequency, phase = own
        return rest * (1.0 + offset + amplitude * fn.sin(2.0 * math.pi * frequency * t + phase))
