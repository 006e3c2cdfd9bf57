"""Where a collider or an emitter is at which time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from pointmass.errors import InvalidInput
from pointmass.laws.parameter import Parameter, Vector

Array = NDArray[np.floating[Any]]
STILL = np.zeros(3)


@final
class Motion:
    """The path of a point, with its exact velocity and acceleration.

    Parameters
    ----------
    place : [m], three numbers, or formulas or a function of t.
    name : of the place, for messages.

    Attributes
    ----------
    fixed : the place, shape (3,), if it never changes; else None.
    parameters : place, velocity and acceleration.

    Raises
    ------
    InvalidInput
        It depends on something other than t, or is not finite at the start.
    """

    def __init__(self, place: Vector, name: str = "center") -> None:
        self._place = Parameter(name, place, vector=True, unit="m")
        if not self._place.common:
            raise InvalidInput(f"{name} may depend on t and nothing else")
        self._velocity = self._place.rate()
        self._acceleration = self._velocity.rate()
        self.parameters = self._place, self._velocity, self._acceleration
        start = self._place.at(0.0)
        self.fixed: Array | None = np.array(start, np.float64) if self._place.constant else None

    def place(self, t: Any) -> Array:
        """The place [m] at time t, shape (3,), or (k, 3) for t of shape (k,)."""
        return _rows(self._place.at(t)) if self.fixed is None else self.fixed

    def velocity(self, t: Any) -> Array:
        """Its velocity [m/s], shape (3,) or (k, 3)."""
        return _rows(self._velocity.at(t)) if self.fixed is None else STILL

    def acceleration(self, t: Any) -> Array:
        """Its acceleration [m/s^2], shape (3,) or (k, 3)."""
        return _rows(self._acceleration.at(t)) if self.fixed is None else STILL


def _rows(parts: Sequence[Any]) -> Array:
    return np.stack(np.broadcast_arrays(*parts), axis=-1)
