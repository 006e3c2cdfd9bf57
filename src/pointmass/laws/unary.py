"""Forces on one particle at a time: f(x, v, m, t, parameters)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.laws.force import Array, Blocks, Force, clock, inputs_for, matrix
from pointmass.laws.parameter import Parameter
from pointmass.laws.trace import Traced, trace
from pointmass.particles import Particles, Selection

STATE = ("x_x", "x_y", "x_z", "v_x", "v_y", "v_z")


class UnaryForce(Force):
    """A law of one particle.

    Attributes
    ----------
    law : (x, v, m, t, *parameters) -> the force on the particle, three numbers.
    potential : the potential energy, of the same arguments, where there is one.
    """

    reads: ClassVar[tuple[str, ...]] = ("x", "v", "m", "t")
    law: ClassVar[Callable[..., Any]]
    potential: ClassVar[Callable[..., Any] | None] = None

    @cached_property
    def traced(self) -> Traced:
        """The law as a program."""
        return trace(self.law, self._signature(), 3, self.name)

    @cached_property
    def traced_potential(self) -> Traced | None:
        """The potential energy as a program."""
        return None if self.potential is None else trace(self.potential, self._signature(), 1, f"{self.name} potential")

    @property
    def velocity_dependent(self) -> bool:
        return "v" in self.traced.depends_on

    def bind(self, particles: Particles) -> None:
        particles.select(self.on)
        for p in self.parameters.values():
            p.check(particles, len(particles), "particles")
        _ = self.traced

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows = particles.select(self.on)
        where = slice(None) if self.on is None else rows
        for axis, part in enumerate(self.traced.columns(*self._inputs(self.traced, particles, t, x, v, rows))):
            f[where, axis] += part

    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        rows = particles.select(self.on)
        inputs = self._inputs(self._jacobian, particles, t, x, v, rows)
        values = matrix(self._jacobian.columns(*inputs), len(rows), x.dtype).reshape(-1, 3, 2, 3)
        blocks.add(rows, rows, values[:, :, 0], values[:, :, 1])

    def energy(self, particles: Particles, t: float, x: Array, v: Array) -> float | None:
        if self.traced_potential is None:
            return None
        rows = particles.select(self.on)
        (value,) = self.traced_potential.columns(*self._inputs(self.traced_potential, particles, t, x, v, rows))
        return float(np.sum(np.broadcast_to(value, len(rows)), dtype=np.float64))

    def keep(self, particles: Particles, mask: Any) -> None:
        super().keep(particles, mask)
        for p in self.parameters.values():
            p.keep(mask)

    def grow(self, particles: Particles, count: int) -> None:
        super().grow(particles, count)
        self.bind(particles)

    @cached_property
    def _jacobian(self) -> Traced:
        return self.traced.jacobian(*STATE)

    def _signature(self) -> dict[str, str]:
        kinds = {"x": "vector", "v": "vector", "m": "scalar", "t": "scalar"}
        own = {p.name: "vector" if p.vector else "scalar" for p in self.parameters.values()}
        return {name: kinds[name] for name in self.reads} | own

    def _inputs(self, law: Traced, particles: Particles, t: Any, x: Array, v: Array, rows: Any) -> list[Any]:
        now = clock(t, rows, x.dtype)
        parameters = {p.name: p.of(particles, now, rows) for p in self.parameters.values()}
        return inputs_for(law, {"x": x[rows], "v": v[rows]}, {"m": particles.m[rows], "t": now}, parameters)


class VelocityField(UnaryForce):
    """A law of a flow: the velocity of the particle at (x, t). The system has order 1."""

    order: ClassVar[int] = 1
    reads: ClassVar[tuple[str, ...]] = ("x", "t")


def unary_force(law: Callable[..., Any]) -> type[UnaryForce]:
    """Make a force from a law of one particle.

    Parameters
    ----------
    law : `law(x, v, m, t, *parameters) -> fx, fy, fz` with x [m] and v [m/s] tuples of three numbers, m [kg], t [s].
        It is called once, on symbols: use `pm.where` for `if`, `pm.sin` for `math.sin`.

    Returns
    -------
    type
        A class of forces; its constructor takes the law's parameters by name (a tuple default makes a vector), and
        `on` and `enabled`.

    Examples
    --------
    >>> @pm.unary_force
    ... def swirl(x, v, m, t, strength=1.0):
    ...     return -strength * x[1], strength * x[0], 0.0
    >>> system = pm.ParticleSystem(particles, forces=[swirl(strength=2.0)])
    """
    return _class_of(law, UnaryForce, ("x", "v", "m", "t"))


def velocity_field(law: Callable[..., Any]) -> type[VelocityField]:
    """Make a flow from a law `law(x, t, *parameters) -> vx, vy, vz`, for systems of order 1 (x' = g(x, t))."""
    return _class_of(law, VelocityField, ("x", "t"))


def law_parameters(law: Callable[..., Any], fixed: Sequence[str]) -> dict[str, Any]:
    """Names of a law's own parameters -> their defaults; the first names must be `fixed`."""
    names = inspect.signature(law).parameters
    first = list(names)[: len(fixed)]
    if len(first) < len(fixed):
        raise InvalidInput(
            f"law {law.__name__!r} must take ({', '.join(fixed)}, *parameters), not ({', '.join(names)})"
        )
    return {n: names[n].default for n in list(names)[len(fixed) :]}


def parameters_from(law: Callable[..., Any], own: dict[str, Any], given: dict[str, Any]) -> list[Parameter]:
    """The parameters of a law of the user's own."""
    values = {n: given.pop(n, d) for n, d in own.items()}
    missing = [n for n, v in values.items() if v is inspect.Parameter.empty]
    if missing or given:
        problem = f"needs {', '.join(missing)}" if missing else f"has no parameter {', '.join(given)}"
        raise InvalidInput(f"law {law.__name__!r} {problem}: its parameters are {', '.join(own) or 'none'}")
    return [Parameter(n, v, vector=_is_vector(own[n], v)) for n, v in values.items()]


def _is_vector(default: Any, value: Any) -> bool:
    sample = value if default is inspect.Parameter.empty else default
    return isinstance(sample, tuple) and len(sample) == 3


def _class_of(law: Callable[..., Any], base: type[Any], fixed: tuple[str, ...]) -> type[Any]:
    own = law_parameters(law, fixed)

    def __init__(self: Any, *, on: Selection = None, enabled: bool = True, **parameters: Any) -> None:
        base.__init__(self, parameters_from(law, own, dict(parameters)), on=on, enabled=enabled)

    body = {"__init__": __init__, "law": staticmethod(law), "__doc__": law.__doc__, "__module__": law.__module__}
    return type(law.__name__, (base,), body)
