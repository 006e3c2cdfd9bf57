"""The velocity of moving air: a vector, a velocity field, or several that add up."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np

from pointmass.errors import InvalidInput, shown
from pointmass.laws.parameter import Parameter, Vector
from pointmass.laws.unary import VelocityField
from pointmass.particles import Particles
from pointmass.tracing import functions as fn
from pointmass.tracing.trace import Traced, trace

VELOCITIES = ("velocity", "current")  # what forces and bodies call theirs
Velocity = Vector | VelocityField | Sequence[Vector | VelocityField]


class Air:
    """What a force takes as its parameter `velocity`.

    Attributes
    ----------
    flows : the fields that it is made of; their parameters stay their own.
    parameters : of the law.
    traced : the law as a program.

    Parameters
    ----------
    velocity : [m/s]: three numbers, formulas or functions of t, a velocity field, or a list of fields and of such
        vectors, whose sum it is.
    owner : what the force is called in messages.

    Raises
    ------
    InvalidInput
        Something else, or a field that acts on a selection of particles.
    """

    def __init__(self, velocity: Any, owner: str) -> None:
        several = isinstance(velocity, (list, tuple, np.ndarray)) and any(_is_field(part) for part in velocity)
        self._parts: list[tuple[VelocityField | None, list[Parameter]]] = []
        for k, part in enumerate(velocity if several else [velocity]):
            name = f"velocity{k}" if several else "velocity"
            if isinstance(part, VelocityField):
                if part.on is not None:
                    raise InvalidInput(f"the velocity field of a wind acts on all: give `on` to {owner} instead")
                self._parts.append((part, [_renamed(p, name) for p in part.parameters.values()]))
            elif _is_field(part):
                raise InvalidInput(
                    f"velocity must be three numbers or a velocity field such as Vortex(), not {shown(part)}"
                )
            else:
                self._parts.append((None, [Parameter(name, part, vector=True, unit="m/s")]))
        self.flows = [flow for flow, _ in self._parts if flow is not None]
        self.parameters = [p for _, own in self._parts for p in own]

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "traced"}  # traced again where needed

    @cached_property
    def traced(self) -> Traced:
        own = {p.name: "vector" if p.vector else "scalar" for p in self.parameters}
        return trace(lambda x, t, *p: self.law(x, t, p), {"x": "vector", "t": "scalar"} | own, 3, "air")

    def law(self, x: Any, t: Any, parameters: Sequence[Any]) -> Any:
        """The velocity at a place and time [m/s], for the values of its parameters."""
        values, result = list(parameters), None
        for flow, own in self._parts:
            mine, values = values[: len(own)], values[len(own) :]
            part = mine[0] if flow is None else flow.law(x, t, *mine)
            result = part if result is None else fn.add(result, part)
        return result

    def same(self, other: Air) -> bool:
        """Whether both are the same velocity, now: the same formulas and numbers."""
        values = [
            [None if isinstance(c.value, Traced) else c.value for p in air.parameters for c in p.components]
            for air in (self, other)
        ]
        same = self.traced.program.text == other.traced.program.text and all(map(np.array_equal, *values))
        return same and all(a.joins(b) for a, b in zip(self.parameters, other.parameters, strict=True))

    def bind(self, particles: Particles) -> None:
        """Check the fields against the particles."""
        for flow in self.flows:
            flow.bind(particles)


def _is_field(part: Any) -> bool:
    """Whether something is a force of any kind, or the class of one."""
    return isinstance(part, type) or hasattr(part, "add_forces")


def _renamed(parameter: Parameter, prefix: str) -> Parameter:
    """A parameter of an inner field under a name of its own here; its numbers stay shared."""
    result = copy(parameter)
    result.name = f"{prefix}_{parameter.name}"
    return result
