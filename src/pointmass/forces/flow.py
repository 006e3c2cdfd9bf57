"""A velocity field that particles follow."""

from __future__ import annotations

from typing import Any

from pointmass.forces.field import FieldSource
from pointmass.laws.grid import Grid
from pointmass.laws.unary import VelocityField
from pointmass.particles import Selection


class Flow(VelocityField):
    """x' = g(x, t): the particle of the lecture's first slides, carried by a vector field.

    Parameters
    ----------
    velocity : three formulas of x, y, z, t and the constants, such as ("-y", "x", "0") [m/s].
    grid : or a field given on a grid of points.
    constants : numbers by name, for the formulas.
    scale : factor on the field; a number or a function of t.
    """

    def __init__(
        self,
        velocity: Any = None,
        *,
        grid: Grid | str | None = None,
        constants: dict[str, float] | None = None,
        scale: Any = 1.0,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        self.source = FieldSource("velocity", velocity, grid, constants, ("x", "y", "z", "t"))
        super().__init__([self.source.scale(scale)], on, enabled)

    def law(self, x: Any, t: Any, scale: Any) -> Any:  # type: ignore[override]
        """Velocity [m/s]."""
        return self.source.value({"x": x[0], "y": x[1], "z": x[2], "t": t}, scale)
