"""Wind whose strength and direction change from place to place and from moment to moment."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput, shown
from pointmass.laws.parameter import Parameter, Scalar, Vector, seed_parameter
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection
from pointmass.tracing import functions as fn
from pointmass.tracing.noise import single


class Gust(VelocityField):
    """x' = U + intensity |U| (n_1, n_2, n_3), noise that travels with the mean wind U (Taylor 1938: frozen turbulence).

    Each component has the mean of U and the standard deviation intensity |U|, at every moment and place.

    Parameters
    ----------
    velocity : mean wind U [m/s], three numbers that stay the same.
    intensity : of the turbulence, standard deviation of each component relative to |U|, at least 0.
    length : size of a gust [m], above 0.
    lifetime : after which a gust is another one [s], above 0.
    seed : a whole number; others give other gusts.

    Notes
    -----
    Gusts of this size push everybody in them alike, and gather particles here and there; small whirls are `CurlNoise`.

    Examples
    --------
    >>> pm.Wind(pm.Gust((4, 0, 0), intensity=0.4, length=6), k=0.02)
    """

    def __init__(
        self,
        velocity: Vector = (3.0, 0.0, 0.0),
        intensity: Scalar = 0.3,
        length: Scalar = 4.0,
        lifetime: Scalar = 5.0,
        seed: int = 0,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        mean = Parameter("velocity", velocity, vector=True, unit="m/s")
        if not mean.constant:
            raise InvalidInput(
                f"velocity = {shown(velocity)} of a gust is not allowed: the mean wind, with which gusts travel, "
                "must be three numbers"
            )
        parameters = [
            mean,
            Parameter("intensity", intensity, at_least=0),
            Parameter("length", length, unit="m", above=0),
            Parameter("lifetime", lifetime, unit="s", above=0),
            seed_parameter(seed),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(x: Any, t: Any, velocity: Any, intensity: Any, length: Any, lifetime: Any, seed: Any) -> Any:
        """Velocity [m/s]."""
        travelled = fn.sub(x, fn.scale(t, velocity))
        place = [a / length for a in travelled]
        turbulence = [single([*place, t / lifetime], seed, component) for component in range(3)]
        return fn.add(velocity, fn.scale(intensity * fn.length(velocity), tuple(turbulence)))
