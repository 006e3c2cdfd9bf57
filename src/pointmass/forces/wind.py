"""Moving air that drags particles along."""

from __future__ import annotations

from typing import Any

from pointmass.forces.air import Air, Velocity
from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Particles, Selection
from pointmass.tracing import functions as fn


class Wind(UnaryForce):
    """f = k (u(x, t) - v): viscous drag towards the velocity u of the air (lecture, "Viscous drag", in moving air).

    Several winds would drag several times; what blows at the same time is one wind with several velocities.

    Parameters
    ----------
    velocity : u [m/s]: three numbers, formulas or functions of t; or a velocity field such as `Vortex(...)` or
        `Flow(("-y", "x", "0"))`; or a list of both, that add up. Parameters of a field stay its own:
        `wind.flows[0].set(circulation=2.0)`.
    k : drag coefficient [N s/m], at least 0. With k = 6 pi mu r it is Stokes's law for a small ball.

    Attributes
    ----------
    air : the velocity as a law of its own.
    flows : the fields of the velocity.

    Examples
    --------
    >>> pm.Wind([pm.Gust((4, 0, 0)), pm.Flutter((0.3, 0.1, 0.3))], k=1e-4)
    """

    def __init__(
        self,
        velocity: Velocity = (3.0, 0.0, 0.0),
        k: Scalar = 0.1,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.air = Air(velocity, "Wind")
        self.flows = self.air.flows
        super().__init__([Parameter("k", k, unit="N s/m", at_least=0), *self.air.parameters], on, enabled)

    def law(self, x: Any, v: Any, m: Any, t: Any, k: Any, *velocity: Any) -> Any:
        """Force [N]."""
        return fn.scale(k, fn.sub(self.air.law(x, t, velocity), v))

    def bind(self, particles: Particles) -> None:
        self.air.bind(particles)
        super().bind(particles)
