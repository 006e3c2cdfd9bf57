"""Forces that are NumPy functions of whole arrays: for what a law of scalars cannot say. Reference path only."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, overload

import numpy as np

from pointmass.errors import InvalidInput
from pointmass.laws.force import Array, Blocks, Force
from pointmass.particles import Particles, Selection

Function = Callable[..., Any]


class ArrayForce(Force):
    """Any function of the whole state.

    Parameters
    ----------
    function : `function(x, v, m, t, **constants) -> f`: x, v, f of shape (n, 3), m of shape (n,); f may be one vector
        for all. It must be pure. Each particle's force may depend on that particle only (`coupled=False`) or on all of
        them (`coupled=True`). Where particles have clocks of their own, t has shape (n,).
    constants : passed to the function by name.
    coupled : whether particles act on each other.
    on, enabled : as for every force; the function sees the selected rows.

    Notes
    -----
    It is not compiled, and implicit solvers see its Jacobian by finite differences (uncoupled ones only).
    """

    def __init__(
        self,
        function: Function,
        *,
        constants: dict[str, Any] | None = None,
        coupled: bool = False,
        on: Selection = None,
        enabled: bool = True,
    ) -> None:
        super().__init__((), on, enabled)
        self.function = function
        self.constants = dict(constants or {})
        self.coupled = coupled

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", "array_force")

    @property
    def velocity_dependent(self) -> bool:
        return True

    def add_forces(self, particles: Particles, t: Any, x: Array, v: Array, f: Array) -> None:
        rows = particles.select(self.on)
        if len(rows):  # a mean of nobody is not a number
            f[rows] += self._evaluate(particles, t, x, v, rows)

    def add_jacobian(self, particles: Particles, t: Any, x: Array, v: Array, blocks: Blocks) -> None:
        if self.coupled:
            raise InvalidInput(
                f"{self.called} couples particles in NumPy, and implicit solvers need a law: "
                "use pm.spring_force or an explicit solver"
            )
        rows = particles.select(self.on)
        result = np.empty((2, len(rows), 3, 3), x.dtype)
        step = np.cbrt(np.finfo(x.dtype).eps)
        for which, q in enumerate((x, v)):
            for axis in range(3):
                h = step * np.maximum(1.0, np.abs(q[:, axis]))
                high, low = q.copy(), q.copy()
                high[:, axis] += h
                low[:, axis] -= h
                states = ((high, v), (low, v)) if which == 0 else ((x, high), (x, low))
                up, down = (self._evaluate(particles, t, a, b, rows) for a, b in states)
                result[which, :, :, axis] = (up - down) / (2 * h[rows, None])
        blocks.add_own(rows, result[0], result[1])

    def links(self, particles: Particles) -> Any:
        rows = particles.select(self.on)
        return np.stack([rows[:-1], rows[1:]], axis=1) if self.coupled else super().links(particles)

    def _evaluate(self, particles: Particles, t: Any, x: Array, v: Array, rows: Any) -> Array:
        now = t[rows] if isinstance(t, np.ndarray) else t
        try:
            result = np.asarray(self.function(x[rows], v[rows], particles.m[rows], now, **self.constants), x.dtype)
        except Exception as error:
            raise InvalidInput(f"{self.called}: the function failed: {type(error).__name__}: {error}") from error
        if result.shape not in ((len(rows), 3), (3,)):
            raise InvalidInput(
                f"{self.called}: the function must return an array of shape ({len(rows)}, 3), not {result.shape}"
            )
        return np.broadcast_to(result, (len(rows), 3))


@overload
def array_force(function: Function, /) -> ArrayForce: ...
@overload
def array_force(**options: Any) -> Callable[[Function], ArrayForce]: ...
def array_force(function: Function | None = None, /, **options: Any) -> Any:
    """Make a force from a NumPy function of whole arrays: see `ArrayForce`, which lists the options.

    Examples
    --------
    >>> @pm.array_force
    ... def swirl(x, v, m, t):
    ...     return np.cross([0, 1, 0], x)
    >>> @pm.array_force(coupled=True)
    ... def gather(x, v, m, t):
    ...     return x.mean(axis=0) - x
    """
    return partial(ArrayForce, **options) if function is None else ArrayForce(function, **options)
