"""What moves through air or water: the part that laws of plates and fins have in common."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from pointmass.errors import unknown
from pointmass.forces.air import Air, Velocity
from pointmass.laws.elements import ElementForce
from pointmass.laws.parameter import Parameter
from pointmass.particles import Particles
from pointmass.tracing import functions as fn

Triangles = str | ArrayLike  # a surface's name, or ids


class Exposed(ElementForce):
    """A force on elements by what flows around them, whose velocity is the last of its parameters.

    Attributes
    ----------
    air : the velocity as a law of its own.
    flows : the fields of the velocity.
    """

    internal = False

    def __init__(self, ids: ArrayLike, parameters: list[Parameter], velocity: Velocity, enabled: bool) -> None:
        self.air = Air(velocity, "the particles")
        self.flows = self.air.flows
        super().__init__(ids, [*parameters, *self.air.parameters], enabled)

    def bind(self, particles: Particles) -> None:
        self.air.bind(particles)
        super().bind(particles)

    def joins(self, other: ElementForce) -> bool:
        return isinstance(other, Exposed) and super().joins(other) and self.air.same(other.air)


class Plates(Exposed):
    """One on triangles, which may be those of a surface, by its name."""

    nodes = 3

    def __init__(self, triangles: Triangles, parameters: list[Parameter], velocity: Velocity, enabled: bool) -> None:
        self._surface = triangles if isinstance(triangles, str) else None
        super().__init__(() if isinstance(triangles, str) else triangles, parameters, velocity, enabled)

    def bind(self, particles: Particles) -> None:
        if self._surface is not None:
            if self._surface not in particles.surfaces:
                raise unknown("surface", self._surface, particles.surfaces)
            self.ids = particles.surfaces[self._surface].triangles
        super().bind(particles)

    def joins(self, other: ElementForce) -> bool:
        return self._surface is None and isinstance(other, Plates) and other._surface is None and super().joins(other)

    def exposed(self, state: Any, t: Any, velocity: Any) -> tuple[Any, Any, Any]:
        """From places and velocities of the corners in turn: the normal, as long as the area; the mean velocity of the
        corners; and that of the air in their middle."""
        x1, v1, x2, v2, x3, v3 = state
        middle, moves = (fn.scale(1.0 / 3.0, fn.add(fn.add(a, b), c)) for a, b, c in ((x1, x2, x3), (v1, v2, v3)))
        normal = fn.scale(0.5, fn.cross(fn.sub(x2, x1), fn.sub(x3, x1)))
        return normal, moves, self.air.law(middle, t, velocity)
