"""A bare ordinary differential equation as a system."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from pointmass.errors import InvalidInput, whole_number
from pointmass.solvers.base import Array, Clock
from pointmass.solvers.islands import Islands

STEP = float(np.finfo(np.float64).eps) ** (1.0 / 3.0)  # where truncation and round-off of a central difference meet


@final
class FunctionSystem:
    """dy/dt = function(t, y), for every solver of this library.

    Parameters
    ----------
    function : (t, y) -> dy/dt, shape (dim,). For order 2, y = [x, v] and dy/dt = [v, a].
    dim : how many numbers y has.
    order : 1, or 2 for x'' = a(t, x, v).
    jacobian : (t, y) -> d(dy/dt)/dy, shape (dim, dim), an array or sparse; by central differences if None.
    velocity_dependent : whether a depends on v (order 2).
    islands : island of each entry, shape (dim,), counted from 0; all in one if None. With several islands, t may
        come as an array of shape (dim,).
    inertia : mass of each entry of v, shape (dim // 2,); 1 if None.

    Raises
    ------
    InvalidInput
        An argument has the wrong shape or value.
    """

    def __init__(
        self,
        function: Callable[[Any, Array], ArrayLike],
        dim: int,
        order: int = 1,
        jacobian: Callable[[Any, Array], Any] | None = None,
        velocity_dependent: bool = True,
        islands: ArrayLike | None = None,
        inertia: ArrayLike | None = None,
    ) -> None:
        if order not in (1, 2):
            raise InvalidInput(f"order = {order} is not allowed: it must be 1 or 2")
        self.dim, self.order = whole_number("dim", dim, at_least=order), order
        if order == 2 and dim % 2:
            raise InvalidInput(f"dim = {dim} is not allowed: an order 2 system has as many velocities as positions")
        self.velocity_dependent = velocity_dependent
        self.islands = _islands(islands, dim, order)
        self.inertia: Array = np.array(np.ones(dim // 2) if inertia is None else inertia, np.float64)
        if self.inertia.shape != (dim // 2,):
            raise InvalidInput(f"inertia must have shape ({dim // 2},), not {self.inertia.shape}")
        self._function, self._jacobian = function, jacobian

    def deriv_eval(self, t: Clock, y: Array) -> Array:
        """dy/dt, shape (dim,)."""
        slope: Array = np.array(self._function(t, y), np.float64)
        if slope.shape != (self.dim,):
            raise InvalidInput(f"function must return an array of shape ({self.dim},), not {slope.shape}")
        return slope

    def jacobian(self, t: Clock, y: Array, share: Array | None = None) -> Any:
        """d(dy/dt)/dy, a scipy.sparse CSR array of shape (dim, dim), always as a whole."""
        from scipy import sparse

        return sparse.csr_array(self._differences(t, y) if self._jacobian is None else self._jacobian(t, y))

    def external(self, t: Clock, y: Array) -> Array:
        """dy/dt: a function has no elements that could be relaxed."""
        return self.deriv_eval(t, y)

    def relaxed(self, t: Clock, h: Array, x: Array, rise: Array, sweeps: int) -> Array:
        """`rise`."""
        return rise

    def _differences(self, t: Clock, y: Array) -> Array:
        columns = []
        for i in range(self.dim):
            aside = np.zeros(self.dim)
            aside[i] = STEP * max(1.0, abs(y[i]))
            columns.append((self.deriv_eval(t, y + aside) - self.deriv_eval(t, y - aside)) / (2.0 * aside[i]))
        return np.stack(columns, axis=1)


def _islands(islands: ArrayLike | None, dim: int, order: int) -> Islands:
    """Island of each entry, numbered in the order in which they appear."""
    given = np.zeros(dim, np.intp) if islands is None else np.array(islands)
    if given.shape != (dim,) or not np.issubdtype(given.dtype, np.integer):
        raise InvalidInput(f"islands must be {dim} whole numbers, one for each entry of y")
    if order == 2 and (given[: dim // 2] != given[dim // 2 :]).any():
        raise InvalidInput("islands must be the same for the positions as for the velocities")
    _, first, inverse = np.unique(given, return_index=True, return_inverse=True)
    rank = np.empty(len(first), np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.reshape(-1)]
