"""A velocity field that particles follow."""

from __future__ import annotations

from typing import Any

from pointmass.errors import InvalidInput
from pointmass.forces.grid_files import as_grid
from pointmass.laws.field_source import FieldSource
from pointmass.laws.grid import Grid
from pointmass.laws.parameter import Scalar
from pointmass.laws.unary import VelocityField
from pointmass.particles import Particles, Selection


class Flow(VelocityField):
    """x' = g(x, t): the particle of the lecture's first slides, carried by a vector field.

    Parameters
    ----------
    velocity : three formulas of x, y, z, t, particle attributes and the constants, such as ("-y", "x", "0") [m/s].
    grid : or a field given at the points of a grid [m/s]: a `Grid`, or the path of a file (see `load_grid`).
    constants : values by name for the formulas; each is a parameter that `set` changes.
    scale : factor on a grid; a number or a function of t.

    Raises
    ------
    InvalidInput
        Neither or both of velocity and grid; something that is not a formula; a name that nobody knows.

    Examples
    --------
    >>> pm.Flow(("-W*y", "W*x", "0"), constants={"W": 2.0})
    """

    def __init__(
        self,
        velocity: Any = None,
        *,
        grid: Grid | str | None = None,
        constants: dict[str, Scalar] | None = None,
        scale: Scalar = 1.0,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        if (velocity is None) == (grid is None):
            raise InvalidInput("Flow needs either velocity, three formulas, or grid")
        self.source = FieldSource("velocity", velocity, as_grid(grid), constants, scale, ("x", "y", "z", "t"))
        super().__init__(self.source.parameters, on, enabled)

    def law(self, x: Any, t: Any, *parameters: Any) -> Any:
        """Velocity [m/s]."""
        return self.source.value({"x": x[0], "y": x[1], "z": x[2], "t": t}, parameters)

    def bind(self, particles: Particles) -> None:
        self.source.check(particles)
        super().bind(particles)

    def _arguments_with(self, values: dict[str, Any]) -> dict[str, Any]:
        return self.source.arguments_with(self.arguments, values)
