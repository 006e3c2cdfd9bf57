"""What attractors of all shapes have in common: how the pull falls off with the distance."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any

from pointmass.laws.parameter import Parameter, Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Selection
from pointmass.tracing import functions as fn
from pointmass.tracing.trace import Traced, trace

Triple = tuple[Any, ...]


class Pull(UnaryForce):
    """f = -m strength d / (d^2 + eps^2)^((power + 1) / 2), with d the way from the nearest place of a shape.

    A negative strength repels. Without `reach` the energy is m strength (r^(1 - power) - 1) / (1 - power) with
    r^2 = d^2 + eps^2, and with power = 1 its limit, m strength log r. With `reach` the force is multiplied by
    (1 - d^2/reach^2)^2, and is 0 beyond.

    Parameters
    ----------
    shape : parameters of the shape.
    strength : acceleration 1 m from the shape [m/s^2].
    power : how the pull falls off: 0 is the same at all distances, 1 that of a heavy line, 2 that of a point, -1 a
        spring.
    eps : softening length [m], above 0: nearer to the shape the pull goes to 0.
    reach : distance at which the pull has smoothly ended [m], above 0; None = it never does.
    """

    def __init__(
        self,
        shape: Sequence[Parameter],
        strength: Scalar,
        power: Scalar,
        eps: Scalar,
        reach: Scalar | None,
        on: Selection,
        enabled: bool,
    ) -> None:
        parameters = [
            *shape,
            Parameter("strength", strength, unit="m/s^2"),
            Parameter("power", power),
            Parameter("eps", eps, unit="m", above=0),
        ]
        self.ends = reach is not None
        if reach is not None:
            parameters.append(Parameter("reach", reach, unit="m", above=0))
        super().__init__(parameters, on, enabled)

    @abstractmethod
    def ways(self, x: Triple, own: dict[str, Any]) -> list[Triple]:
        """The way from the nearest place of each part of the shape to x [m]; symbols in, symbols out.

        Parameters
        ----------
        own : values of the parameters by name.
        """

    def law(self, x: Any, v: Any, m: Any, t: Any, *parameters: Any) -> Any:
        """Force [N]."""
        own = dict(zip(self.parameters, parameters, strict=True))
        force: Any = (0.0, 0.0, 0.0)
        for d in self.ways(x, own):
            square = fn.dot(d, d)
            pull = fn.pow(square + own["eps"] * own["eps"], -0.5 * (own["power"] + 1.0))
            if self.ends:
                left = 1.0 - fn.minimum(square / (own["reach"] * own["reach"]), 1.0)
                pull = pull * left * left
            force = fn.sub(force, fn.scale(m * own["strength"] * pull, d))
        return force

    @cached_property
    def traced_potential(self) -> Traced | None:
        """The potential energy as a program; None where the pull ends."""
        return None if self.ends else trace(self._energy, self._signature(), 1, f"{self.name} potential")

    def _energy(self, x: Any, v: Any, m: Any, t: Any, *parameters: Any) -> Any:
        own = dict(zip(self.parameters, parameters, strict=True))
        energy: Any = 0.0
        for d in self.ways(x, own):
            half = 0.5 * fn.log(fn.dot(d, d) + own["eps"] * own["eps"])
            z = (1.0 - own["power"]) * half
            small = fn.absolute(z) < 1e-4  # where exp(z) - 1 would lose its digits
            safe = fn.where(small, 1.0, z)
            rise = fn.where(small, 1.0 + z * (0.5 + z / 6.0), (fn.exp(safe) - 1.0) / safe)
            energy = energy + m * own["strength"] * half * rise
        return energy
