"""A force from formulas, from a potential, or from a grid."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from pointmass.errors import InvalidInput
from pointmass.forces.grid_files import as_grid
from pointmass.laws.field_source import FieldSource
from pointmass.laws.grid import Grid
from pointmass.laws.parameter import Scalar
from pointmass.laws.unary import UnaryForce
from pointmass.particles import Particles, Selection
from pointmass.tracing.derivative import gradient
from pointmass.tracing.trace import Traced, trace

PLACE = ("x", "y", "z", "m", "t")
MOTION = ("x", "y", "z", "vx", "vy", "vz", "m", "t")


class Field(UnaryForce):
    """A force of one's own, in words that a scene file can hold.

    Give exactly one of `force`, `potential` and `grid`. Names in formulas that are neither state, constants nor
    functions are particle attributes.

    Parameters
    ----------
    force : three formulas of x, y, z [m], vx, vy, vz [m/s], m [kg], t [s], particle attributes and the constants [N].
    potential : or one formula of x, y, z, m, t, ... for the potential energy [J]; the force is minus its gradient.
    grid : or a force given at the points of a grid [N]: a `Grid`, or the path of a file (see `load_grid`).
    constants : values by name for the formulas; each is a parameter that `set` changes.
    scale : factor on a grid; a number or a function of t.

    Raises
    ------
    InvalidInput
        Not exactly one source; something that is not a formula; a name that nobody knows.

    Examples
    --------
    >>> pm.Field(("-k*x", "sin(t)*y", "0"), constants={"k": 2.0})
    >>> pm.Field(potential="0.5*k*(x**2 + y**2) + m*9.81*y", constants={"k": 2.0})
    """

    def __init__(
        self,
        force: Any = None,
        *,
        potential: str | None = None,
        grid: Grid | str | None = None,
        constants: dict[str, Scalar] | None = None,
        scale: Scalar = 1.0,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        if sum(given is not None for given in (force, potential, grid)) != 1:
            raise InvalidInput("Field needs exactly one of force (three formulas), potential (one formula) and grid")
        self.has_potential = potential is not None
        if self.has_potential:
            self.source = FieldSource("potential", potential, None, constants, scale, PLACE, count=1)
        else:
            self.source = FieldSource("force", force, as_grid(grid), constants, scale, MOTION)
        super().__init__(self.source.parameters, on, enabled)

    def law(self, x: Any, v: Any, m: Any, t: Any, *parameters: Any) -> Any:
        """Force [N]."""
        value = self._value(x, v, m, t, *parameters)
        return [-slope for slope in gradient(value[0], x)] if self.has_potential else value

    @cached_property
    def traced_potential(self) -> Traced | None:
        """The potential energy as a program."""
        return trace(self._value, self._signature(), 1, f"{self.name} potential") if self.has_potential else None

    def bind(self, particles: Particles) -> None:
        self.source.check(particles)
        super().bind(particles)

    def _value(self, x: Any, v: Any, m: Any, t: Any, *parameters: Any) -> list[Any]:
        state = {"x": x[0], "y": x[1], "z": x[2], "vx": v[0], "vy": v[1], "vz": v[2], "m": m, "t": t}
        return self.source.value({name: state[name] for name in self.source.variables}, parameters)

    def _arguments_with(self, values: dict[str, Any]) -> dict[str, Any]:
        return self.source.arguments_with(self.arguments, values)
