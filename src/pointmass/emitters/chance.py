"""Numbers that each particle draws for itself: how they are spread, and within which bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pointmass import random
from pointmass.errors import InvalidInput, number, shown

Array = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Spread:
    """mean +- half_range, each value in between equally likely (Reeves 1983).

    Attributes
    ----------
    mean, half_range : in the unit of the parameter; the standard deviation is half_range / sqrt(3).

    Examples
    --------
    >>> pm.Nozzle(speed=pm.Spread(5, 0.5))
    """

    mean: float
    half_range: float


@dataclass(frozen=True)
class Normal:
    """A normal distribution; a value that the parameter does not allow, as a negative mass, is drawn again.

    Attributes
    ----------
    mean, sd : mean and standard deviation, in the unit of the parameter.

    Examples
    --------
    >>> pm.Nozzle(speed=pm.Normal(5, 0.5))
    """

    mean: float
    sd: float


Chance = float | Spread | Normal
KINDS: tuple[type[Spread] | type[Normal], ...] = (Spread, Normal)


class Quantity:
    """A checked number, or distribution, from which every particle draws.

    Parameters
    ----------
    name : of the parameter, for messages; what is drawn for one name does not depend on another.
    value : a number, a `Spread`, a `Normal`, or a table with the fields of one of them.
    forever : whether it may be infinite, if it is a number.
    bounds : `above`, `at_least`, `at_most`, as for `errors.number`.

    Raises
    ------
    InvalidInput
        A value that is not allowed, at the ends of a spread too.
    """

    def __init__(self, name: str, value: Any, *, unit: str = "", forever: bool = False, **bounds: float) -> None:
        self.name, self._bounds = name, bounds
        if isinstance(value, Mapping):
            value = _from_table(name, value)
        self.value: Chance
        if isinstance(value, KINDS):
            label, width = ("half_range", "half-range") if isinstance(value, Spread) else ("sd", "standard deviation")
            wide = number(f"{label} of {name}", getattr(value, label), at_least=0, unit=unit)
            mean = number(f"mean of {name}", value.mean, unit=unit, **bounds)
            self.value = type(value)(mean, wide)
            if isinstance(value, Spread):
                for end in (mean - wide, mean + wide):
                    if not self._allowed(np.asarray(end)):
                        raise InvalidInput(
                            f"{name} = {mean:g} +- {wide:g} is not allowed: with {end:g} it comes to what "
                            f"it must not be, so use a smaller {width}"
                        )
        elif forever and isinstance(value, float) and value == math.inf:
            self.value = value
        else:
            self.value = number(name, value, unit=unit, **bounds)

    def draw(self, seed: int, stream: str, ids: NDArray[Any]) -> Array:
        """A value for each id, shape (k,)."""
        value = self.value
        if isinstance(value, Spread):
            return random.spread(seed, stream, ids, self.name, value.mean, value.half_range)
        if isinstance(value, Normal):
            return self._normal(value, seed, stream, ids)
        return np.full(len(ids), value)

    def whole(self, seed: int, stream: str, ids: NDArray[Any]) -> NDArray[np.int64]:
        """A whole number for each id, shape (k,): what it draws, rounded up or down so that the mean stays."""
        luck = random.uniform(seed, stream, ids, f"{self.name} rounding")[:, 0]
        return np.floor(self.draw(seed, stream, ids) + luck).astype(np.int64)

    def _normal(self, value: Normal, seed: int, stream: str, ids: NDArray[Any]) -> Array:
        result = np.full(len(ids), value.mean)
        rows, again = np.arange(len(ids)), 0
        while len(rows):  # at least half of them are allowed each time, for the mean is
            purpose = self.name if again == 0 else f"{self.name} {again}"
            result[rows] = value.mean + value.sd * random.normal(seed, stream, ids[rows], purpose)[:, 0]
            rows, again = rows[~self._allowed(result[rows])], again + 1
        return result

    def _allowed(self, values: Array) -> NDArray[np.bool_]:
        above, least = self._bounds.get("above", -np.inf), self._bounds.get("at_least", -np.inf)
        return (values > above) & (values >= least) & (values <= self._bounds.get("at_most", np.inf))


def _from_table(name: str, table: Mapping[str, Any]) -> Chance:
    for kind in KINDS:
        if {f.name for f in fields(kind)} == set(table):
            return kind(**table)
    raise InvalidInput(
        f"{name} = {shown(dict(table))} is not allowed: it must be a number, a table with mean and half_range, "
        "or one with mean and sd"
    )
