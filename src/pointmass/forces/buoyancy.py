"""Hot air that rises, and soot that weighs it down."""

from __future__ import annotations

from typing import Any

from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn


class Buoyancy(UnaryForce):
    """f = m (beta (T - ambient) - alpha rho) up: smoke rises as it is hot and sinks as it is dense.

    Against a linear drag k the speed of rise becomes f / k.

    Parameters
    ----------
    temperature : T [K]: a number, the particle attribute "temperature", or a formula of a particle's age, such as
        "293 + 200*exp(-0.5*age)" for smoke that cools down.
    ambient : temperature of the air [K].
    beta : lift for each degree [m/s^2/K], at least 0; for an ideal gas |g| / ambient.
    density : rho of what the air carries [kg/m^3], at least 0.
    alpha : weight of that density [m^4/kg/s^2], at least 0; |g| / (1.2 kg/m^3) for what is carried by air.
    up : direction of the lift; its length does not matter.

    Notes
    -----
    Fedkiw, Stam & Jensen, Visual simulation of smoke (SIGGRAPH 2001), equation 8, as a force on the mass of a particle.
    """

    def __init__(
        self,
        temperature: Scalar = "temperature",
        ambient: Scalar = 293.0,
        beta: Scalar = 9.81 / 293.0,
        density: Scalar = 0.0,
        alpha: Scalar = 9.81 / 1.2,
        up: Vector = (0.0, 1.0, 0.0),
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        parameters = [
            Parameter("temperature", temperature, unit="K"),
            Parameter("ambient", ambient, unit="K"),
            Parameter("beta", beta, unit="m/s^2/K", at_least=0),
            Parameter("density", density, unit="kg/m^3", at_least=0),
            Parameter("alpha", alpha, unit="m^4/kg/s^2", at_least=0),
            Parameter("up", up, vector=True),
        ]
        super().__init__(parameters, on, enabled)

    @staticmethod
    def law(
        x: Any, v: Any, m: Any, t: Any, temperature: Any, ambient: Any, beta: Any, density: Any, alpha: Any, up: Any
    ) -> Any:
        """Force [N]."""
        lift = beta * (temperature - ambient) - alpha * density
        return fn.scale(m * lift * fn.inverse(fn.length(up)), up)
