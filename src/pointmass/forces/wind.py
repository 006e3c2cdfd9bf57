"""Moving air that drags particles along."""

from __future__ import annotations

from copy import copy
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter, Scalar, Vector
from pointmass.laws.unary import UnaryForce, VelocityField
from pointmass.particles import Particles, Selection
from pointmass.tracing import functions as fn


class Wind(UnaryForce):
    """f = k (u(x, t) - v): viscous drag towards the velocity u of the air (lecture, "Viscous drag", in moving air).

    Parameters
    ----------
    velocity : u [m/s]: three numbers, formulas or functions of t, or a velocity field such as `Vortex(...)` or
        `Flow(("-y", "x", "0"))`, whose parameters stay its own: `wind.flow.set(circulation=2.0)`.
    k : drag coefficient [N s/m], at least 0. With k = 6 pi mu r it is Stokes's law for a small ball.
    """

    def __init__(
        self,
        velocity: Vector | VelocityField = (3.0, 0.0, 0.0),
        k: Scalar = 0.1,
        *,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.flow = velocity if isinstance(velocity, VelocityField) else None
        own = [Parameter("k", k, unit="N s/m", at_least=0)]
        if isinstance(velocity, VelocityField):
            if velocity.on is not None:
                raise InvalidInput("the velocity field of a wind acts on all: give `on` to Wind instead")
            own += [_renamed(p) for p in velocity.parameters.values()]
        elif isinstance(velocity, type) or hasattr(velocity, "add_forces"):
            raise InvalidInput(f"velocity must be three numbers or a velocity field such as Vortex(), not {velocity!r}")
        else:
            own.append(Parameter("velocity", velocity, vector=True, unit="m/s"))
        super().__init__(own, on, enabled)

    def law(self, x: Any, v: Any, m: Any, t: Any, k: Any, *velocity: Any) -> Any:
        """Force [N]."""
        air = self.flow.law(x, t, *velocity) if self.flow else velocity[0]
        return fn.scale(k, fn.sub(air, v))

    def bind(self, particles: Particles) -> None:
        if self.flow is not None:
            self.flow.bind(particles)
        super().bind(particles)


def _renamed(parameter: Parameter) -> Parameter:
    """A parameter of the inner field under a name of its own here; its numbers stay shared."""
    result = copy(parameter)
    result.name = f"velocity_{parameter.name}"
    return result
