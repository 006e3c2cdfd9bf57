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
from pointmass.particles import Particles, Selection
from pointmass.tracing.trace import Traced, trace

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

    @property
    def laws(self) -> Sequence[Traced]:
        return (self.traced,)

    def bind(self, particles: Particles) -> None:
        super().bind(particles)
        for p in self.parameters.values():
            p.check(particles, len(particles), "particles")
        _ = self.traced

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows = slice(None) if self.on is None else particles.select(self.on)
        for axis, part in enumerate(self.traced.columns(*self._inputs(self.traced, particles, t, x, v, rows))):
            f[rows, axis] += part

    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        rows = particles.select(self.on)
        inputs = self._inputs(self._jacobian, particles, t, x, v, rows)
        values = matrix(self._jacobian.columns(*inputs), len(rows), x.dtype).reshape(-1, 3, 2, 3)
        blocks.add_own(rows, values[:, :, 0], values[:, :, 1])

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
        now = clock(t, rows)
        scalars = {"m": particles.m[rows], "t": now}
        return inputs_for(law, {"x": x[rows], "v": v[rows]}, scalars, self.settings(particles, now, rows))


class VelocityField(UnaryForce):
    """A law of a flow: the velocity of the particle at (x, t). The system has order 1."""

    order: ClassVar[int] = 1
    reads: ClassVar[tuple[str, ...]] = ("x", "t")


def unary_force(law: Callable[..., Any]) -> type[UnaryForce]:
    """Make a force from a law of one particle.

    Parameters
    ----------
    law : `law(x, v, m, t, *parameters) -> fx, fy, fz` with vectors x [m] and v [m/s] (x[0], -k * v, x + v), m [kg],
        t [s]. It is called once, on symbols: use `pm.where` for `if`, `pm.sin` for `math.sin`.

    Returns
    -------
    type
        A class of forces; its constructor takes the law's parameters by name (a tuple default makes a vector), and
        `on` and `enabled`.

    Notes
    -----
    Variables of the surrounding program are read once, when the force is first used; what should change later is a
    parameter (`force.set`).

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
    try:
        names = inspect.signature(law).parameters
    except (TypeError, ValueError):
        raise InvalidInput(f"a law must be a function written in Python, not {law!r}") from None
    first, own = list(names)[: len(fixed)], list(names)[len(fixed) :]
    named = all(p.kind in (p.POSITIONAL_OR_KEYWORD, p.POSITIONAL_ONLY) for p in names.values())
    swapped = any(n in fixed and fixed[k] != n for k, n in enumerate(first)) or any(n in fixed for n in own)
    if len(first) < len(fixed) or swapped or not named:
        raise InvalidInput(
            f"law {law_name(law)!r} must take ({', '.join(fixed)}) and then its parameters by name, without * and **, "
            f"not ({', '.join(map(str, names.values()))})"
        )
    for taken in {"on", "by", "enabled", "pairs", "elements", "box"} & set(own):
        raise InvalidInput(f"law {law_name(law)!r} cannot have a parameter {taken!r}: every force has that; rename it")
    return {n: names[n].default for n in own}


def law_name(law: Callable[..., Any]) -> str:
    """Name of a user's law, for messages and for the class that is made of it."""
    return getattr(law, "__name__", type(law).__name__)


def parameters_from(law: Callable[..., Any], own: dict[str, Any], given: dict[str, Any]) -> list[Parameter]:
    """The parameters of a law of the user's own."""
    values = {n: given.pop(n, d) for n, d in own.items()}
    missing = [n for n, v in values.items() if v is inspect.Parameter.empty]
    if missing or given:
        problem = f"needs {', '.join(missing)}" if missing else f"has no parameter {', '.join(given)}"
        raise InvalidInput(f"law {law_name(law)!r} {problem}: its parameters are {', '.join(own) or 'none'}")
    return [Parameter(n, v, vector=_is_vector(n, own[n], v)) for n, v in values.items()]


def _is_vector(name: str, default: Any, value: Any) -> bool:
    """Whether a parameter is a vector: its default says so, and without a default the value does."""
    sample = value if default is inspect.Parameter.empty else default
    if callable(sample):
        return len(trace(sample, {"t": "scalar"}, None, name).program.outputs) > 1
    if isinstance(sample, np.ndarray):
        return sample.ndim == 2 or (sample is default and sample.shape in ((2,), (3,)))
    return isinstance(sample, (tuple, list)) and len(sample) in (2, 3)


def _class_of(law: Callable[..., Any], base: type[Any], fixed: tuple[str, ...]) -> type[Any]:
    own = law_parameters(law, fixed)

    def __init__(self: Any, *, on: Selection = None, enabled: bool = True, **parameters: Any) -> None:
        base.__init__(self, parameters_from(law, own, dict(parameters)), on=on, enabled=enabled)

    return type(law_name(law), (base,), {"__init__": __init__, "law": staticmethod(law), **origin(law)})


def origin(law: Callable[..., Any]) -> dict[str, Any]:
    """What a class keeps of the function that it is made of."""
    return {"__doc__": law.__doc__, "__module__": law.__module__, "name": law_name(law)}
